"""Rules of the angle: read, integrated from a gyroscope, or computed from pixels."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.polynomial.legendre import legvander

from pendmap.formatting import counted
from pendmap.records.experiment import Gyroscope
from pendmap.signal.half_cycles import swings
from pendmap.signal.robust import normal_scale

if TYPE_CHECKING:
    from pendmap.records.work import Work
    from pendmap.signal import Floats, Mask
    from pendmap.tables.findings import Finding

WRAPPED_SPAN: Final = 1.01  # Greatest span of wrapped readings, turns: one turn and some noise
WRAP_JUMP: Final = 0.5  # Jump between neighbours above which the nearer angle is a turn away, turns
LARGEST_ANGLE: Final = 1e5  # Greatest plausible angle, rad: about 16,000 turns
MOST_HUGE: Final = 0.5  # Share of implausible angles above which the column is refused
DRIFT_DEGREE: Final = 8  # Degree of the polynomials of time along which a camera drifts
OFF_CIRCLE: Final = 0.3  # Greatest distance of places from a circle, over their spread, rms
BLOCKS: Final = 30  # Blocks of a record that give the error of a radius
MOST_RADIUS_ERROR: Final = 0.5  # Relative standard error of the radius above which it is unknown
RADIUS_DOUBT: Final = 0.02  # Relative standard error of the radius above which it is reported


def turning_points(work: Work) -> Finding | None:
    """Take declared turning points for the readings; report those of one sign."""
    if "peaks" not in work.extra or "angle" in work.columns:
        return None
    work.theta = work.extra.pop("peaks")
    work.peaks_only = True
    peaks = work.theta[np.isfinite(work.theta)]
    if not peaks.size or (np.any(peaks < 0) and np.any(peaks > 0)):
        return None
    return work.finding("peaks-one-sign")


def source_missing(work: Work) -> Finding | None:
    """Remove rows without a number for the channel from which the angle is computed."""
    if "angle" in work.columns or work.peaks_only:
        return None
    if "pixel_x" in work.extra:
        return _finite(work, "position", work.extra["pixel_x"], work.extra["pixel_y"])
    return _finite(work, "velocity", work.extra["velocity"])


def _finite(work: Work, what: str, *values: Floats) -> Finding | None:
    """Remove rows in which a required channel has no number."""
    good = np.all([np.isfinite(v) for v in values], axis=0)
    if good.size and not good.any():
        work.refuse(f"the {what} must be numbers, no row has a number for it", **work.other())
    finding = work.leave_out(~good, "angle-missing", "row", channel=what)
    work.refuse_short()
    return finding


def derived(work: Work) -> Finding | None:
    """Compute the angle from pixels or else a velocity."""
    if "acceleration" in work.extra:
        work.note("acceleration-unused")
    if "angle" in work.columns or work.peaks_only:
        return None
    if "pixel_x" in work.extra:
        return _circle_angle(work, work.extra.pop("pixel_x"), work.extra.pop("pixel_y"))
    rate = work.extra["velocity"]
    work.theta = angle_of_rate(work.time, rate, np.abs(rate) < LARGEST_ANGLE)
    work.integrated = True
    return work.finding("angle-integrated")


def _circle_angle(work: Work, x: Floats, y: Floats) -> Finding:
    """Compute the angle of points on a fitted circle; down is along y, where the bob is fastest."""
    middle = np.array([np.median(x), np.median(y)])
    size = float(np.hypot(np.ptp(x), np.ptp(y)))
    if not size or not math.isfinite(size):
        work.refuse("pixel_x and pixel_y must show a swing, they do not move", **work.other())
    u, v = (x - middle[0]) / size, (y - middle[1]) / size
    scaled = 2 * (work.time - work.time[0]) / max(float(np.ptp(work.time)), 1e-12) - 1
    still, moved = (_circle(u, v, legvander(scaled, degree)) for degree in (0, DRIFT_DEGREE))
    drifts = u.size * math.log(still[3] / moved[3]) > DRIFT_DEGREE * math.log(u.size)
    (radius, a), b, error, rms = moved if drifts else still
    spread = math.sqrt(float(np.var(u) + np.var(v)))
    if not error < MOST_RADIUS_ERROR * radius or rms > OFF_CIRCLE * spread:
        work.refuse(
            "pixel_x and pixel_y must be positions of a bob on a circle, they lie on none; small"
            " swings .4 from the pivot",
            angle=work.columns["pixel_x"],
            angle_scale=2.5,
        )
    speed = np.hypot(np.gradient(u, work.time), np.gradient(v, work.time))
    quick = speed >= np.quantile(speed, 0.8)
    down = 1.0 if np.median((v - b)[quick]) > 0 else -1.0
    work.theta = np.unwrap(np.arctan2(u - a, down * (v - b)))
    if error > RADIUS_DOUBT * radius:
        work.note("circle-uncertain", percent=100 * error / radius)
    if drifts:
        work.note("frame-drifts", way=size * float(np.ptp(b)))
    x0, y0 = middle + size * np.array([a, np.mean(b)])
    sizes = {"radius": radius * size, "error": error * size, "rms": rms * size}
    return work.finding("angle-from-pixels", x=x0, y=y0, way="down" if down > 0 else "up", **sizes)


def _circle(u: Floats, v: Floats, basis: Floats) -> tuple[Floats, Floats, float, float]:
    """Return the circle nearest to points, whose centre moves along v as functions of the time.

    They are the radius and u of the centre, its v, the standard error of the radius, and the
    residual. A motion along u is a drift of the zero, which does not change the radius.
    """
    from scipy.optimize import least_squares

    # Initial circle: the algebraic fit, by least squares of u^2 + v^2.
    algebraic = np.linalg.lstsq(np.column_stack([u, v, basis]), u**2 + v**2, rcond=None)[0]
    a, b = float(algebraic[0]) / 2, float(algebraic[1]) / 2
    radius = math.sqrt(max(float(algebraic[2]) + a * a + b * b, 1e-12))
    circle = np.array([radius, a, b, *np.zeros(basis.shape[1] - 1)])
    near = np.ones(u.size, bool)

    def away(circle: Floats, used: Mask) -> Floats:
        return np.asarray(np.hypot(u - circle[1], v - basis @ circle[2:]) - circle[0])[used]

    for _ in range(2):
        inside = near
        fit = least_squares(away, circle, args=(inside,), method="lm", xtol=1e-14, ftol=1e-14)
        circle, every = fit.x, np.abs(away(fit.x, np.ones(u.size, bool)))
        near = every <= 6 * max(normal_scale(every), 1e-9)
    # Sums over blocks of the record: neighbouring residuals need not be independent.
    blocks = np.linspace(0, fit.fun.size, min(BLOCKS, fit.fun.size) + 1).astype(int)[:-1]
    score = np.add.reduceat(fit.jac * fit.fun[:, None], blocks, axis=0)
    free = blocks.size / max(blocks.size - circle.size, 1)
    error = math.sqrt(free) * float(np.linalg.norm(score @ np.linalg.pinv(fit.jac.T @ fit.jac)[0]))
    rms = math.sqrt(2 * fit.cost / max(np.count_nonzero(inside), 1)) or 1e-12
    return circle[:2], basis @ circle[2:], error, rms


def missing(work: Work) -> Finding | None:
    """Remove rows without a possible angle; InputError if most are too large."""
    huge = np.abs(work.theta) > LARGEST_ANGLE
    if np.mean(huge) > MOST_HUGE:
        largest = float(np.nanmax(np.abs(work.theta)))
        text = f"angles must be up to {LARGEST_ANGLE:g} rad, got {largest:.3g} rad, too large for a"
        text += " pendulum, as counts of 4096 a turn would be"
        work.refuse(text, angle_scale=math.tau / 4096)
    return _finite(work, "angle", np.where(huge, math.nan, work.theta))


def wrapped(work: Work) -> Finding | None:
    """Unwrap the readings of a sensor that reads the angle modulo one turn."""
    steps = np.diff(work.theta)
    jumps = np.flatnonzero(np.abs(steps) > WRAP_JUMP * math.tau)
    span = float(np.ptp(work.theta))
    if not jumps.size or span > WRAPPED_SPAN * math.tau or span < 0.9 * math.tau:
        return None
    work.theta = np.unwrap(work.theta)
    return work.finding("angle-wrapped", at=jumps + 1, jumps=counted(jumps.size, "jump"))


OVER_THE_TOP: Final = 4 * math.pi  # Range of angles above which a record contains rotations, rad
FEWEST_PEAKS: Final = 4  # Fewest turning points from which a drift or a period is estimated


def angle_of_rate(time: Floats, rate: Floats, good: Mask | None = None) -> Floats:
    """Return the integral of a rate about the middle of the swing, less the drift by the bias."""
    from scipy.interpolate import CubicSpline

    if good is None or np.count_nonzero(good) < 2:
        good = np.ones(time.size, bool)
    inside = np.clip(time, time[good][0], time[good][-1])
    theta = CubicSpline(time[good], rate[good]).antiderivative()(inside)
    if np.ptp(theta - np.median(theta)) > OVER_THE_TOP:
        return np.asarray(theta - theta[-1])
    # Turning points about the straight line through all angles give the middles of the swings.
    trend = np.polyval(np.polyfit(time, theta, 1), time)
    half = swings(time, theta - trend)
    if half.peak_time.size < FEWEST_PEAKS:
        return np.asarray(theta - np.median(theta))
    peaks = half.peak + np.interp(half.peak_time, time, trend)
    middle = dataclasses.replace(half, peak=peaks).middle
    line = np.polyfit(half.peak_time[1:-1], middle, 1)
    return np.asarray(theta - np.polyval(line, time))


def gyroscope_of(time: Floats, theta: Floats, rate: Floats) -> Gyroscope:
    """Return the gyroscope with ``w0`` estimated from a rate and its integral."""
    half = swings(time, theta)
    # The removed line has the slope of the bias; the median is robust to outliers.
    bias = float(np.median((rate[1:] + rate[:-1]) / 2 - np.diff(theta) / np.diff(time)))
    speed, size = np.abs(rate - bias), np.abs(half.peak)
    swung = (size[:-1] < math.pi) & (size[1:] < math.pi)
    if not np.any(swung):
        # A pendulum rotates if its greatest speed exceeds 2 w0.
        return Gyroscope(float(np.max(speed)) / 2 or 1.0)
    # The energy of a swing gives th' = 2 w0 sin(A/2) in the middle.
    middle = (size[:-1] + size[1:]) / 2
    passing = np.interp(half.crossing[1:-1], time, speed)[swung]
    w0 = float(np.sum(passing) / np.sum(2 * np.sin(middle[swung] / 2)))
    return Gyroscope(w0)
