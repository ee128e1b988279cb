"""An acceleration beside an angle: whether both show one motion, and where the sensor sits.

Where an angle was measured the fit keeps to it, and the acceleration is a check of signs, units and
the place. A swing alone does not tell the distance of a tangential sensor from the sense of its
axis: it reads ``(g - r w0**2) sin(th)``.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.model.quantities import GRAVITY
from pendmap.records.rod_sensors import Accelerometer

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]

SHARE: Final = 0.12
"""Periods that derivatives are taken over: shorter ones drown in noise, longer ones lose the
shape."""

ALIKE: Final = 0.8
"""Correlation from which two channels show the same motion."""

GAIN: Final = 0.1
"""Share by which a reading may miss what the angle says."""

UNUSED: Final = "a check, not fitted: the angle is"
"""Why it is not used."""


@dataclasses.dataclass(frozen=True)
class _Motion:
    """Angle, velocity and acceleration of the samples where they are known, smoothed."""

    theta: Floats
    velocity: Floats
    acceleration: Floats
    measured: Floats
    w0: float


def check(work: Work) -> None:
    """Compare an acceleration with the angle beside it; turn it where its sign is the other."""
    if work.made_of is not None:
        return
    if work.plan.kind == "forced":
        text = "the acceleration is not used: on a forced run it holds the pivot's own"
        work.say("acceleration-unused", text)
        return
    motion = _motion(work)
    if motion is None:
        text = "the acceleration is not used: too few samples beside the angle to compare it"
        work.say("acceleration-unused", text)
    elif work.accelerometer is None:
        _found(work, motion)
    else:
        _compared(work, motion, work.accelerometer)


def _motion(work: Work) -> _Motion | None:
    """Return what the angle says, by polynomials through a part of a period."""
    from scipy.signal import savgol_filter

    measured = work.extra["acceleration"]
    interval = float(np.median(np.diff(work.time)))
    good = work.trusted & np.isfinite(measured)
    count = math.floor((work.time[-1] - work.time[0]) / interval) + 1
    if np.count_nonzero(good) < 100 or count > 10 * work.time.size:
        return None
    even = work.time[0] + interval * np.arange(count)
    theta = np.interp(even, work.time[good], work.theta[good])
    seen = np.interp(even, work.time[good], measured[good])
    inside = np.interp(even, work.time, good.astype(float)) > 0.99
    crossings = np.count_nonzero(np.diff(np.sign(theta[inside] - np.median(theta[inside]))))
    if crossings < 4:
        return None
    # Noise crosses the middle too, so that this is at most the period.
    period = 2 * float(np.count_nonzero(inside)) * interval / crossings
    window = max(round(SHARE * period / interval), 5) | 1
    if window > count // 4:
        return None
    zeroth, first, second = (
        np.asarray(savgol_filter(theta, window, 4, deriv=k, delta=interval)) for k in range(3)
    )
    smoothed = np.asarray(savgol_filter(seen, window, 4))
    inside[: window // 2] = inside[count - window // 2 :] = False
    sine = np.sin(zeroth[inside])
    slope = _slope(sine, second[inside])
    if slope >= 0:
        return None
    w0 = math.sqrt(-slope)
    return _Motion(zeroth[inside], first[inside], second[inside], smoothed[inside], w0)


def _slope(x: Floats, y: Floats) -> float:
    """The slope of the line through points, by least squares."""
    x = x - np.mean(x)
    power = float(np.dot(x, x))
    return float(np.dot(x, y - np.mean(y))) / power if power else 0.0


def _alike(one: Floats, other: Floats) -> float:
    if float(np.std(one)) == 0 or float(np.std(other)) == 0:
        return 0.0
    return float(np.corrcoef(one, other)[0, 1])


def _expected(motion: _Motion, sensor: Accelerometer) -> Floats:
    """What the sensor would read of the angle's motion."""
    r, g = sensor.distance_m, sensor.gravity
    if sensor.direction == "radial":
        return np.asarray(r * motion.velocity**2 + g * np.cos(motion.theta))
    return np.asarray(r * motion.acceleration + g * np.sin(motion.theta))


def _compared(work: Work, motion: _Motion, sensor: Accelerometer) -> None:
    """Say how a reading compares with what its place makes of the angle."""
    expected = _expected(motion, sensor)
    alike, gain = _alike(expected, motion.measured), _slope(expected, motion.measured)
    where = (
        "" if sensor.direction == "angular" else f", {sensor.direction} at {sensor.distance_m:g} m"
    )
    if abs(alike) < ALIKE:
        text = (
            f"the acceleration is not used: it does not follow the angle (correlation {alike:.2f}"
            f"{where}): direction or column is another, or its noise hides the swing"
        )
        work.say("acceleration-unlike", text)
        return
    if gain < 0:
        work.extra["acceleration"] = -work.extra["acceleration"]
        text = "the acceleration has the other sign than the angle: turned round, the angle counts"
        work.say("sign-turned", text, mended=True)
    gain = abs(gain)
    if abs(gain - 1) > GAIN:
        text = (
            f"the acceleration is {gain:.3g} times what the angle says{where}:"
            f" {_other(motion, sensor)}; not used"
        )
        work.say("acceleration-scale", text)
        return
    text = f"the acceleration is {gain:.3g} times what the angle says{where}: {UNUSED}"
    work.say("acceleration-agrees", text)


def _other(motion: _Motion, sensor: Accelerometer) -> str:
    """What else would explain the readings."""
    if sensor.direction == "angular":
        return "its unit, or a distance"
    measured = motion.measured * math.copysign(
        1.0, _alike(_expected(motion, sensor), motion.measured)
    )
    distance = _distance(dataclasses.replace(motion, measured=measured), sensor)
    found = f"distance_m would be {distance:.3g}, or unit" if distance > 0 else "unit, distance_m"
    return f"{found} or gravity_removed is wrong"


def _distance(motion: _Motion, sensor: Accelerometer) -> float:
    """The distance that the readings show, m; its gravity and sense taken as they are said."""
    if sensor.direction == "radial":
        rest = motion.measured - sensor.gravity * np.cos(motion.theta)
        return _slope(motion.velocity**2, rest)
    gain = _slope(np.sin(motion.theta), motion.measured)
    return (sensor.gravity - gain) / motion.w0**2


def _found(work: Work, motion: _Motion) -> None:
    """Say where an accelerometer sits whose place nobody gave."""
    gravity = float(work.known.get("gravity", GRAVITY))
    sine = _alike(np.sin(motion.theta), motion.measured)
    radial = _alike(motion.velocity**2, motion.measured)
    if max(abs(sine), abs(radial)) < ALIKE:
        text = "the acceleration is not used: it follows neither the angle nor the velocity squared"
        work.say("acceleration-unlike", text)
        return
    if abs(radial) > abs(sine):
        turned = dataclasses.replace(motion, measured=math.copysign(1.0, radial) * motion.measured)
        distance = _distance(turned, Accelerometer("radial", 1.0, gravity))
        without = _distance(turned, Accelerometer("radial", 1.0, 0.0))
        said = f'"radial", with distance_m {distance:.3g}, or {without:.3g} if gravity is removed'
    else:
        gain = abs(_slope(np.sin(motion.theta), motion.measured))
        near, far = (abs(gravity - s * gain) / motion.w0**2 for s in (1, -1))
        without = gain / motion.w0**2
        near_too = f"{near:.3g} or " if gain < gravity else ""
        said = (
            f'"tangential", with distance_m {near_too}{far:.3g} by the sense of its axis, or'
            f" {without:.3g} if gravity is removed"
        )
    text = (
        f"the acceleration looks {said}; {work.place_missing} in [columns] would make it {UNUSED}"
    )
    work.say("acceleration-unused", text)
