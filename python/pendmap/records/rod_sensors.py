"""The angle that the readings of a gyroscope on the rod give.

A gyroscope reads th' plus a bias; the angle serves as initial guess of a fit and for figures.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.signal.half_cycles import swings

if TYPE_CHECKING:
    from pendmap.signal import Floats, Mask

OVER_THE_TOP: Final = 4 * math.pi  # Range of angles above which a record contains rotations, rad
FEWEST_PEAKS: Final = 4  # Fewest turning points from which a drift or a period is estimated


@dataclasses.dataclass(frozen=True)
class Gyroscope:
    """Gyroscope from whose readings alone the angle was computed."""

    w0: float  # rad/s, from speeds in the middle of swings: its reading over a small angle


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
