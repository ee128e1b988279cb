"""The two ends of a decay: the release, and the last half cycle that stops."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.optimize import minimize_scalar

from pendmap.identification.window_fit import fit_around

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.identification.turning import Outline

    Floats = NDArray[np.float64]

__all__ = ["End", "release", "stop"]

_SURE: Final = 4.0
_LATENESS: Final = 5 / 32
"""What a quartic makes of ``s abs(s)``: half the slope that it has at 0, over the window."""
_DOUBT: Final = 0.2
_STILL: Final = 1e-3
"""A velocity below this, over amplitude and w0, is none: the even form itself is off by as much."""


@dataclasses.dataclass(frozen=True)
class End:
    """The end of a half cycle: when, where (rad), how surely, of which kind; the window, s."""

    time: float
    angle: float
    stderr_time: float
    stderr_angle: float
    kind: str
    window: float = 0.0

    def late(self, theta_r: float) -> End:
        """Return the turn as it is without the lateness that friction gives a quartic's turn.

        ``5/32 h theta_r / sin A`` for a window of half width ``h``; what is not known of it (the
        law of friction, the next order) is in the error.
        """
        size = abs(self.angle)
        bend = math.sin(min(max(size, 2 * theta_r + 1e-9), 3.0))
        shift = _LATENESS * self.window * theta_r / bend
        # The next order is larger by theta_r / A: near the end it is all that is known.
        unsure = shift * min(_DOUBT + theta_r / max(size, 1e-9), 1.0)
        error = math.hypot(self.stderr_time, unsure)
        return dataclasses.replace(self, time=self.time - shift, stderr_time=error)


def release(
    time: Floats, theta: Floats, sigma: float, scale: tuple[float, float], course: Outline
) -> End | None:
    """Return the release from rest at which the record begins, if it does.

    Either the first sample is the release (then the angle is even about it), or the pendulum was
    held for a while (then a level part joins a falling one without a step of the velocity).

    Parameters
    ----------
    time, theta : array, shape (N,)
        s and rad.
    sigma : float
        Noise, rad.
    scale : (float, float)
        Rough natural frequency, rad/s, and half width of a window, s.
    course : Outline
        The rough course of the record.
    """
    if course.left == 0:
        return None
    w0, half = scale
    step = float(np.median(np.diff(time)))
    level, leaves = float(np.median(theta[: max(course.left // 2, 3)])), float(time[course.left])
    bend = w0**2 * max(math.sin(min(abs(level), math.pi)), 0.02)
    quick = math.sqrt(2 * (6 * sigma + 1e-9) / bend)
    half = max(half, 5.5 * step)
    if leaves - time[0] > 2 * quick + 4 * step:
        return _joined(time, theta, sigma, (float(time[0]), leaves, half), "release")
    even = fit_around(time, theta, float(time[0]), half, (0, 2, 4), sigma=sigma)
    moving = fit_around(time, theta, float(time[0]), half, (0, 1, 2, 4), sigma=sigma)
    if even is None or moving is None:
        return None
    # A velocity, or a bend away from the middle, is a record that begins in motion.
    (angle, gain), (bend, _) = even.at(float(time[0])), even.at(float(time[0]), 2)
    speed, speed_gain = moving.at(float(time[0]), 1)
    slack = _STILL * abs(angle) * w0
    if bend * angle >= 0 or abs(speed) > _SURE * speed_gain * sigma + slack:
        return None
    return End(float(time[0]), angle, step / 10, gain * sigma, "release")


def stop(
    time: Floats, theta: Floats, sigma: float, course: Outline, before: list[End]
) -> End | None:
    """Return where the pendulum came to rest in the half cycle after the last turn, if it is seen.

    Parameters
    ----------
    time, theta : array, shape (N,)
        s and rad.
    sigma : float
        Noise, rad.
    course : Outline
        The rough course of the record.
    before : list of End
        The peaks before it.
    """
    if course.rest is None or not before:
        return None
    last, rests = before[-1], float(time[course.rest])
    if not 0.1 < (rests - last.time) / course.period < 0.9:  # noqa: PLR2004 (a half, roughly)
        return None
    half = 0.25 * course.period
    found = _joined(time[::-1] * -1.0, theta[::-1], sigma, (-time[-1], -rests, half), "stop")
    if found is None or abs(found.angle - last.angle) < _SURE * last.stderr_angle:
        return None
    return dataclasses.replace(found, time=-found.time)


def _joined(
    time: Floats, theta: Floats, sigma: float, where: tuple[float, float, float], kind: str
) -> End | None:
    """Fit a level that goes over into ``level + b s^2 + d s^4``, s the time since it left.

    ``where`` holds the begin of the level, about when it is left, and how far to look on.
    """
    begin, leaves, half = where
    use = (time >= begin) & (time <= leaves + half)
    t, x = time[use], theta[use]
    if t.size < 6:  # noqa: PLR2004 (parameters and two more)
        return None

    def solved(instant: float) -> tuple[float, Floats, Floats]:
        s = np.maximum(t - instant, 0.0) / half
        rows = np.column_stack((np.ones_like(s), s**2, s**4))
        inverse = np.asarray(np.linalg.pinv(rows.T @ rows, hermitian=True), np.float64)
        coefficients = inverse @ (rows.T @ x)
        residual = x - rows @ coefficients
        return float(residual @ residual), coefficients, inverse

    # The sum of squares is flat where the level takes all and has ripples: first a scan.
    scan = np.linspace(max(leaves - half, begin), leaves + half / 2, 61)
    nearest = int(np.argmin([solved(float(at))[0] for at in scan]))
    low, high = float(scan[max(nearest - 1, 0)]), float(scan[min(nearest + 1, 60)])
    best = minimize_scalar(lambda at: solved(at)[0], bounds=(low, high), method="bounded")
    at = float(best.x)
    least, coefficients, inverse = solved(at)
    # The curvature of the sum of squares gives the error of the instant.
    shift = max((high - low) / 10, 1e-9)
    curvature = (solved(at + shift)[0] - 2 * least + solved(at - shift)[0]) / shift**2
    error = sigma * math.sqrt(2 / curvature) if curvature > 0 else half
    level_error = sigma * math.sqrt(max(float(inverse[0, 0]), 0.0))
    return End(at, float(coefficients[0]), min(error, half), level_error, kind)
