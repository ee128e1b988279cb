"""A gyroscope alone: the angle that its rate integrates to, and what is not known of the sensor.

It reads th' and a bias. White noise of the rate becomes a random walk of the integrated angle,
which no independent errors describe: a fit compares the rate, and the angle made here is where it
begins and what pictures show.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.swings import Swings, swings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["Gyroscope", "angle_of_rate", "gyroscope_of"]

OVER: Final = 4 * math.pi
"""Radians from the middle from which a record turns over the top."""

FEWEST: Final = 4
"""Turning points that a drift is taken from."""


@dataclasses.dataclass(frozen=True)
class Gyroscope:
    """A gyroscope of whose readings alone the angle was made.

    Parameters
    ----------
    w0 : float
        Natural frequency, rad/s, as speeds in the middle of swings show it beside their angles: it
        makes angles of readings.
    bias : float
        What it reads of nothing, rad/s, as the integrated angle drifts; not a number where no drift
        was told from the motion. The fit has a bias of its own.
    """

    w0: float
    bias: float = math.nan

    @property
    def gain(self) -> float:
        """Reading of a small free swing over its angle, ``w0``; rad/s."""
        return self.w0

    @property
    def unit(self) -> str:
        """Of the readings."""
        return "rad/s"


def angle_of_rate(time: Floats, rate: Floats, good: NDArray[np.bool_] | None = None) -> Floats:
    """Return the integral of a rate, rad, shape (N,): its zero is the middle of the swing.

    A straight line that the sensor's bias adds is taken out. Of a record that turns over the top
    neither is seen: there the last angle is 0.

    Parameters
    ----------
    time, rate : ndarray, shape (N,)
        s, increasing; rad/s.
    good : ndarray of bool, shape (N,), optional
        Which readings are not false; a spline passes the others over.
    """
    theta = _integral(time, rate, good)
    if np.ptp(theta - np.median(theta)) > OVER:
        return np.asarray(theta - theta[-1])
    middle = _middles(time, theta)
    if middle is None:
        return np.asarray(theta - np.median(theta))
    line = np.polyfit(*middle, 1)
    return np.asarray(theta - np.polyval(line, time))


def gyroscope_of(time: Floats, theta: Floats, rate: Floats) -> Gyroscope:
    """Return what a rate and the angle of :func:`angle_of_rate` say of the sensor."""
    found = swings(time, theta)
    bias = math.nan
    if np.ptp(theta - np.median(theta)) <= OVER and found.peak_time.size >= FEWEST:
        # A line was taken out: by its slope readings are above the angle's own, but for false ones.
        bias = float(np.median((rate[1:] + rate[:-1]) / 2 - np.diff(theta) / np.diff(time)))
    return Gyroscope(_frequency(found, time, np.abs(rate - np.nan_to_num(bias))), bias)


def _integral(time: Floats, rate: Floats, good: NDArray[np.bool_] | None) -> Floats:
    from scipy.interpolate import CubicSpline

    if good is not None and np.count_nonzero(good) > 1:
        spline = CubicSpline(time[good], rate[good])
        inside = np.clip(time, time[good][0], time[good][-1])
        return np.asarray(spline.antiderivative()(inside))
    return np.asarray(CubicSpline(time, rate).antiderivative()(time))


def _middles(time: Floats, theta: Floats) -> tuple[Floats, Floats] | None:
    """Return times and values halfway between turning points of either side."""
    trend = np.polyval(np.polyfit(time, theta, 1), time)
    found = swings(time, theta - trend)
    if found.peak_time.size < FEWEST:
        return None
    peaks = found.peak + np.interp(found.peak_time, time, trend)
    # Halves of (1, 2, 1): what the decay does to a plain mean of two turns cancels.
    value = (peaks[:-2] + 2 * peaks[1:-1] + peaks[2:]) / 4
    return found.peak_time[1:-1], value


def _frequency(found: Swings, time: Floats, speed: Floats) -> float:
    """Return ``w0`` from the energy of swings: th' = 2 w0 sin(A/2) where they pass the middle."""
    size = np.abs(found.peak)
    middle = (size[:-1] + size[1:]) / 2
    swung = (size[:-1] < math.pi) & (size[1:] < math.pi)
    if np.any(swung):
        passing = np.interp(found.crossing[1:-1], time, speed)[swung]
        return float(np.sum(passing) / np.sum(2 * np.sin(middle[swung] / 2)))
    fastest = float(np.max(speed))  # it turns over the top from 2 w0 on
    return fastest / 2 if fastest > 0 else 1.0
