"""The angle, from whichever channel tells it: read, integrated, or seen in a picture."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.formatting import counted
from pendmap.records.from_acceleration import angle_from
from pendmap.records.rod_sensors import LIKE, angle_of_rate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]


TURN: Final = 2 * math.pi

BAND: Final = 1.01
"""Turns that wrapped readings span at most, a count or some noise beyond one."""

JUMP: Final = 0.75
"""Turns between neighbours that are a wrap: a true half turn from one sample to the next could
not be told from it anyway."""

LARGEST: Final = 1e5
"""Radians beyond which a number is no pendulum's angle: ten thousand turns."""

MOST: Final = 0.5
"""Share of such numbers from which the column is no angle, or in another unit."""


def make(work: Work) -> None:
    """Make the angle from the channels that there are; leave out rows without one.

    Raises
    ------
    InputError
        If none of them tells it.
    """
    if "peaks" in work.extra and "no angle" in work.extra:
        work.theta = work.extra.pop("peaks")
        work.peaks_only = True
        _one_sign(work)
    elif "no angle" in work.extra:
        _derived(work)
    work.extra.pop("no angle", None)
    _finite(work, "angle", work.theta)
    _sane(work)
    if not work.peaks_only:
        _unwrap(work)


def _one_sign(work: Work) -> None:
    """Say how turning points without signs are taken: those of one side would halve ``w0``."""
    peaks = work.theta[np.isfinite(work.theta)]
    if peaks.size and (np.all(peaks >= 0) or np.all(peaks <= 0)):
        text = (
            "the turning points have one sign: taken for those of both sides, one each half swing;"
            " with those of one side alone w0 comes out half as large"
        )
        work.say("peaks-one-sign", text)


def _finite(work: Work, what: str, *values: Floats) -> None:
    """Leave out rows where a channel that is needed has no number."""
    good = np.all([np.isfinite(v) for v in values], axis=0)
    missing = np.flatnonzero(~good)
    if missing.size and missing.size == good.size:
        raise InputError(f"{work.where}: the {what} must be numbers, no row has a number for it")
    if missing.size:
        text = f"{counted(missing.size, 'row')} without a number for the {what} left out"
        work.say("angle-missing", text, mended=True, at=missing)
        work.keep(good)
    work.refuse_short()


def _sane(work: Work) -> None:
    """Leave out numbers that no angle has."""
    huge = np.abs(work.theta) > LARGEST
    if np.mean(huge) > MOST:
        largest = float(np.max(np.abs(work.theta)))
        raise InputError(
            f"{work.where}: angles must be up to {LARGEST:g} rad, got {largest:.3g} rad, too large"
            " for a pendulum; a scale may stand in [columns] of experiment.toml"
        )
    if huge.any():
        text = f"{counted(int(huge.sum()), 'number')} beyond {LARGEST:g} rad left out"
        work.say("angle-huge", text, mended=True, at=np.flatnonzero(huge))
        work.keep(~huge)
        work.refuse_short()


def _derived(work: Work) -> None:
    if "pixel_x" in work.extra:
        x, y = work.extra["pixel_x"], work.extra["pixel_y"]
        _finite(work, "position", x, y)
        x, y = work.extra.pop("pixel_x"), work.extra.pop("pixel_y")
        found = circle_angle(work.time, x, y, work.where)
        work.theta = found.theta
        work.say("angle-from-pixels", found.text, mended=True)
        if found.doubt:
            work.say("circle-uncertain", found.doubt)
        return
    if "velocity" in work.extra:
        _finite(work, "velocity", work.extra["velocity"])
        rate = work.extra["velocity"]
        work.theta = angle_of_rate(work.time, rate, np.abs(rate) < LARGEST)
        work.integrated = True
        text = (
            "the angle is the velocity integrated; its zero is the middle of the swing: for"
            " pictures and the methods of peaks; the trajectory method fits the velocity itself"
        )
        work.say("angle-integrated", text, mended=True)
        return
    _accelerated(work)


def _accelerated(work: Work) -> None:
    """Make the angle of an acceleration alone, whose place must be known."""
    beside = "an angle, a velocity (gyroscope) or pixel_x and pixel_y beside it"
    sensor = work.accelerometer
    if sensor is None:
        raise InputError(
            f"{work.where}: an acceleration alone tells no angle, where the sensor sits is not"
            f" known: {work.place_missing} missing in [columns] of experiment.toml: it must be like"
            f" {LIKE}, or {beside}"
        )
    if sensor.direction == "radial":
        raise InputError(
            f"{work.where}: a radial acceleration alone cannot tell left from right: it must be"
            f" the tangential one, or {beside}"
        )
    if work.plan.kind == "forced":
        raise InputError(
            f"{work.where}: an acceleration alone on a forced run holds the pivot's own: it must be"
            f" a free decay, or {beside}"
        )
    _finite(work, "acceleration", work.extra["acceleration"])
    found = angle_from(work.time, work.extra["acceleration"], sensor, work.where)
    work.theta, work.accelerometer = found.theta, found.accelerometer
    removed = ", gravity removed" if not sensor.gravity else f", g = {sensor.gravity:g} m/s^2"
    place = (
        "an angular acceleration"
        if sensor.direction == "angular"
        else f"a tangential acceleration {sensor.distance_m:g} m from the pivot{removed}"
    )
    text = (
        f"the angle is made of {place}, without the damping's part in it: roughly right, for"
        " pictures and the methods of peaks; the trajectory method fits the acceleration itself"
    )
    work.say("angle-from-acceleration", text, mended=True)
    if found.doubt:
        work.say("acceleration-weak", found.doubt)


def _unwrap(work: Work) -> None:
    """Undo the jumps of a sensor that shows an angle within one turn."""
    steps = np.diff(work.theta)
    jumps = np.flatnonzero(np.abs(steps) > JUMP * TURN)
    span = float(np.ptp(work.theta))
    if not jumps.size or span > BAND * TURN or span < 0.9 * TURN:
        return
    work.theta = np.unwrap(work.theta)
    text = f"the sensor wraps: {counted(jumps.size, 'jump')} of one turn undone"
    work.say("angle-wrapped", text, mended=True, at=jumps + 1)
    fastest = float(np.quantile(np.abs(np.diff(work.theta)), 0.999))
    if fastest > math.pi / 2:
        text = f"up to {fastest:.2g} rad from sample to sample: turns may be miscounted"
        work.say("unwrapping-uncertain", text)


# From a picture's coordinates to an angle: a circle through the places of the bob.


ROUNDS: Final = 50
"""Steps of Gauss and Newton; from the algebraic circle five do."""

DOUBT: Final = 0.02
"""Relative standard error of the radius that is worth saying: every angle errs by as much."""


@dataclasses.dataclass(frozen=True)
class CircleAngle:
    """An angle and how it came about."""

    theta: Floats
    text: str
    doubt: str


def circle_angle(time: Floats, x: Floats, y: Floats, where: str) -> CircleAngle:
    """Return the angle of points on a circle, from downward, turning toward positive x.

    Down is along y, on the side where the bob is quickest: pictures count y from the top, other
    tools from the bottom.

    Raises
    ------
    InputError
        If the points lie on no circle.
    """
    middle = np.array([np.median(x), np.median(y)])
    size = float(np.hypot(np.ptp(x), np.ptp(y)))
    if not size or not math.isfinite(size):
        raise InputError(f"{where}: pixel_x and pixel_y must show a swing, they do not move")
    u, v = (x - middle[0]) / size, (y - middle[1]) / size
    a, b, radius = _algebraic(u, v)
    kept = np.ones(u.size, bool)
    for _ in range(2):
        a, b, radius, error, rms = _geometric(u[kept], v[kept], a, b, radius)
        away = np.abs(np.hypot(u - a, v - b) - radius)
        limit = 6 * max(1.4826 * float(np.median(away)), 1e-9)
        kept = away <= limit
    if not (math.isfinite(radius) and 0 < radius < 1e3):
        raise InputError(
            f"{where}: pixel_x and pixel_y must be places of a bob, they lie on no circle"
        )
    speed = np.hypot(np.gradient(u, time), np.gradient(v, time))
    quick = speed >= np.quantile(speed, 0.8)
    down = 1.0 if np.median((v - b)[quick]) > 0 else -1.0
    theta = np.unwrap(np.arctan2(u - a, down * (v - b)))
    centre = middle + size * np.array([a, b])
    text = (
        f"the angle is that on a circle around ({centre[0]:.5g}, {centre[1]:.5g}) of radius"
        f" {radius * size:.5g}, y counted {'down' if down > 0 else 'up'}ward; the places are"
        f" {rms * size:.2g} from it, rms"
    )
    doubt = ""
    if error > DOUBT * radius:
        doubt = (
            f"the radius is uncertain by {100 * error / radius:.0f} %, and so is every angle: the"
            " arc is short"
        )
    return CircleAngle(theta, text, doubt)


def _algebraic(u: Floats, v: Floats) -> tuple[float, float, float]:
    """Return centre and radius of Kasa's circle: least squares of u^2 + v^2."""
    columns = np.column_stack([u, v, np.ones(u.size)])
    solution = np.linalg.lstsq(columns, u**2 + v**2, rcond=None)[0]
    a, b = solution[0] / 2, solution[1] / 2
    return float(a), float(b), math.sqrt(max(float(solution[2]) + a * a + b * b, 1e-12))


def _geometric(
    u: Floats, v: Floats, a: float, b: float, radius: float
) -> tuple[float, float, float, float, float]:
    """Return the circle of least distances, the standard error of its radius, and the rms."""
    for _ in range(ROUNDS):
        distance = np.maximum(np.hypot(u - a, v - b), 1e-12)
        slope = np.column_stack([-(u - a) / distance, -(v - b) / distance, -np.ones(u.size)])
        step = np.linalg.lstsq(slope, -(distance - radius), rcond=None)[0]
        a, b, radius = a + float(step[0]), b + float(step[1]), radius + float(step[2])
        if not math.isfinite(radius) or np.max(np.abs(step)) < 1e-12:
            break
    distance = np.hypot(u - a, v - b) - radius
    rms = float(np.sqrt(np.mean(distance**2)))
    inverse = np.linalg.pinv(slope.T @ slope)
    error = rms * math.sqrt(max(float(inverse[2, 2]), 0.0))
    return a, b, radius, error, rms
