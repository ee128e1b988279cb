"""The noise of a record, without a model of the pendulum.

A polynomial through nine neighbouring samples follows the motion; what remains, over the filter's
gain, is noise. Three things spoil that, and each has its remedy here:

- Sampling that is slow against the motion leaves some of the motion in the residual: polynomials
  of higher degree are taken until a higher one no longer gives less.
- Counts coarser than the noise, read so quickly that neighbours share a count: neighbouring errors
  are then alike and the residual does not see them. Samples further apart are taken, where the
  pendulum passes at least a count from one to the next; slower than that nothing can be said but
  that an even error within a count has the standard deviation count/sqrt(12), and that is the
  least that is reported.
- Outliers: what is beyond eight standard deviations (robust, from quantiles) is left out with all
  windows that it is part of, then a plain root mean square is taken. The median alone would be
  wrong by a tenth for the even errors of a counter.

Noise that is not white is read too small: ``colour`` says by how much the reading depends on the
filter.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.local_fit import LocalFit, local_fit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.experiment import Run

    Floats = NDArray[np.float64]

__all__ = [
    "NoiseFloor",
    "SpeedRange",
    "broad_scale",
    "fastest",
    "noise_floor",
    "noise_of",
    "normal_scale",
    "outlying",
]

DEGREES: Final = ((4, 9), (6, 11), (8, 13), (10, 15))
"""Degree and samples of the polynomials that are tried in turn."""

EVERY: Final = 0.06
"""Radians of its own phase that a motion may pass between samples and be followed by a quartic:
the next term, x^6/720 over nine samples, is then under 1e-8 of the amplitude."""

FARTHEST: Final = 0.25
"""Radians of phase between samples that are taken further apart because of coarse counts."""

DITHERED: Final = 0.55
"""Noise over count above which neighbouring readings err independently: sqrt(1/4 + 1/12) less
some room, from where the error of a rounded sum is that of its parts to a percent."""

CLEAR: Final = 4
"""Counts of way from which a speed is taken: rounding then changes it by a quarter at most."""

FALSE: Final = 8.0
"""Standard deviations beyond which a residual is an outlier. White noise stays below 6; that of
real encoders has longer tails, which are part of it."""

FEWEST: Final = 40
"""Residuals that a standard deviation is taken from; half a dozen would be wrong by a third."""

RANGES: Final = 4
"""Ranges of speed, with equally many samples."""

LESS: Final = 1.02
"""Ratio of two readings of the noise that counts as less: they aim at a few per cent."""


@dataclasses.dataclass(frozen=True)
class SpeedRange:
    """The noise among samples of similar speed.

    Parameters
    ----------
    speed_from, speed_to : float
        rad/s.
    sigma, stderr : float
        rad.
    samples : int
        How many residuals it comes from.
    """

    speed_from: float
    speed_to: float
    sigma: float
    stderr: float
    samples: int


@dataclasses.dataclass(frozen=True)
class NoiseFloor:
    """The standard deviation of the readings about the motion.

    Parameters
    ----------
    sigma, stderr : float
        rad, the rounding to counts included; ``nan`` where there are too few samples.
    by_speed : tuple of SpeedRange
        From slow to fast.
    limited_by_count : bool
        Whether ``sigma`` is count/sqrt(12) because the record cannot show more.
    colour : float
        Reading of the quartic over that of the next degree: 1 for white noise, more where noise
        is correlated from sample to sample or the motion is not followed.
    samples : int
        How many residuals it comes from.
    """

    sigma: float
    stderr: float
    by_speed: tuple[SpeedRange, ...] = ()
    limited_by_count: bool = False
    colour: float = 1.0
    samples: int = 0


def noise_floor(run: Run) -> NoiseFloor:
    """Return the noise of a run, from the samples that are trusted; see :func:`noise_of`."""
    if run.peaks_only:
        return NoiseFloor(math.nan, math.nan)
    return noise_of(run.time, run.theta, trusted=run.trusted, count=run.count_rad)


def noise_of(
    time: Floats,
    theta: Floats,
    *,
    trusted: NDArray[np.bool_] | None = None,
    count: float = 0.0,
) -> NoiseFloor:
    """Return the noise of readings of any smooth motion.

    Parameters
    ----------
    time, theta : ndarray, shape (N,)
        s, increasing; rad.
    trusted : ndarray of bool, shape (N,), optional
        Windows that hold a sample that is not trusted are left out; where too few remain all
        samples count.
    count : float
        Step of the readings, rad, 0 if there is none.
    """
    bad = np.zeros(time.size, bool) if trusted is None else ~trusted
    found = _noise(time, theta, bad, count)
    if found is None and bad.any():
        found = _noise(time, theta, np.zeros(time.size, bool), count)
    return found or NoiseFloor(math.nan, math.nan)


def _noise(time: Floats, theta: Floats, bad: NDArray[np.bool_], count: float) -> NoiseFloor | None:
    first = _clean(local_fit(time, theta), bad)
    if first.middle.size < FEWEST:
        return None
    interval = float(np.median(np.diff(time)))
    swing = fastest(time, theta, count)
    fit = first
    if swing * interval > EVERY:
        fit = _followed(time, theta, bad, first)
    next_fit = _clean(local_fit(time, theta, degree=6, points=11), bad)
    colour = _rms(first) / max(_rms(next_fit), 1e-300) if next_fit.middle.size >= FEWEST else 1.0
    least = count / math.sqrt(12)
    slowest = 0.0
    if count and _rms(fit) < DITHERED * count:
        apart = _apart(time, theta, bad, count, interval, swing)
        if apart is None:
            return NoiseFloor(max(least, _rms(fit)), least / 10, (), True, colour)  # noqa: FBT003
        fit, slowest = apart
    sigma, error = _rms(fit), _stderr(fit)
    limited = sigma < least
    sigma = max(sigma, least)
    ranges = tuple(_ranges(fit, least, slowest))
    return NoiseFloor(sigma, error, ranges, limited, colour, fit.middle.size)


def fastest(time: Floats, theta: Floats, count: float) -> float:
    """Return the fastest phase of the motion, rad/s: that of the swing, or of the rotation."""
    interval = float(np.median(np.diff(time)))
    lag = 1
    while True:
        way = float(np.quantile(np.abs(theta[lag:] - theta[:-lag]), 0.98))
        if way >= CLEAR * count or 8 * lag > theta.size:
            break
        lag *= 2
    fast = way / (lag * interval)
    reach = float(np.quantile(np.abs(theta - np.median(theta)), 0.99))
    swing = fast / max(reach, 1e-300)
    turning = fast if float(np.ptp(theta)) > math.pi else 0.0
    slowest = 1.0 / (time[-1] - time[0])
    return float(np.clip(max(swing, turning), slowest, math.pi / interval))


def _followed(time: Floats, theta: Floats, bad: NDArray[np.bool_], first: LocalFit) -> LocalFit:
    """Return the fit of the lowest degree above which no degree leaves less."""
    chosen = first
    for degree, points in DEGREES[1:]:
        higher = _clean(local_fit(time, theta, degree=degree, points=points), bad)
        if higher.middle.size < FEWEST:
            break
        enough = LESS + 2 * _stderr(higher) / max(_rms(higher), 1e-300)
        if _rms(chosen) <= enough * _rms(higher):
            break
        chosen = higher
    return chosen


def _apart(  # noqa: PLR0913, PLR0917 (what is known of the record)
    time: Floats,
    theta: Floats,
    bad: NDArray[np.bool_],
    count: float,
    interval: float,
    swing: float,
) -> tuple[LocalFit, float] | None:
    """Return a fit of samples at least a count apart, and the slowest speed where they are."""
    most = max(int(FARTHEST / (swing * interval)), 1)
    stride = 1
    while True:
        # Even slower motion keeps neighbours within a count, whose errors are alike.
        slowest = count / (stride * interval)
        fit = _clean(local_fit(time, theta, degree=6, points=11, stride=stride), bad)
        quick = np.abs(fit.slope) >= slowest
        if np.count_nonzero(quick) >= max(FEWEST, quick.size // 3) or stride >= most:
            break
        stride = min(2 * stride, most)
    if np.count_nonzero(quick) < FEWEST:
        return None
    return _only(fit, quick), slowest


def _clean(fit: LocalFit, bad: NDArray[np.bool_]) -> LocalFit:
    """Leave out windows with samples that are not trusted, then those with outliers."""
    fit = _only(fit, ~_near(bad, fit.neighbours)[fit.middle])
    return _only(fit, ~outlying(fit, bad.size)[fit.middle])


def outlying(fit: LocalFit, size: int) -> NDArray[np.bool_]:
    """Return which of ``size`` samples share a window with an outlier."""
    false = np.zeros(size, bool)
    scale = broad_scale(np.abs(fit.residual))
    false[fit.middle[np.abs(fit.residual) > FALSE * scale]] = scale > 0
    return _near(false, fit.neighbours)


def normal_scale(values: Floats) -> float:
    """Return the standard deviation of normal values from the median of their sizes, robust."""
    return 1.4826 * float(np.median(np.abs(values))) if values.size else 0.0


def broad_scale(sizes: Floats) -> float:
    """Return a standard deviation from sizes, robust, that knows of long tails.

    The larger of those that the median and the 80 % quantile show: where noise changes with speed,
    or has long tails, the median alone is half of it. A tenth of false samples changes neither.
    """
    if not sizes.size:
        return 0.0
    half, most = np.quantile(sizes, [0.5, 0.8])
    return float(max(1.4826 * half, most / 1.2816))


def _near(marked: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Return what is at most ``reach`` places from something marked."""
    sums = np.concatenate([[0], np.cumsum(marked)])
    place = np.arange(marked.size)
    low, high = np.maximum(place - reach, 0), np.minimum(place + reach + 1, marked.size)
    near: NDArray[np.bool_] = sums[high] > sums[low]
    return near


def _only(fit: LocalFit, which: NDArray[np.bool_]) -> LocalFit:
    return dataclasses.replace(
        fit, middle=fit.middle[which], residual=fit.residual[which], slope=fit.slope[which]
    )


def _rms(fit: LocalFit) -> float:
    return float(np.sqrt(np.mean(fit.residual**2)))


def _stderr(fit: LocalFit) -> float:
    """Standard error of the root mean square of residuals that share samples."""
    return _rms(fit) * math.sqrt(fit.sum_of_squares / (2 * fit.middle.size))


def _ranges(fit: LocalFit, least: float, slowest: float) -> list[SpeedRange]:
    """Return the noise in ranges of speed; below ``slowest`` the count is all that is known."""
    speed = np.abs(fit.slope)
    number = max(min(RANGES, fit.middle.size // FEWEST), 1)
    edges = np.quantile(speed, np.linspace(0, 1, number + 1))
    found = []
    if slowest > 0:
        found.append(SpeedRange(0.0, slowest, least, least / 10, 0))
        edges[0] = slowest
    for low, high in itertools.pairwise(edges):
        part = _only(fit, (speed >= low) & (speed <= high))
        if part.middle.size:
            sigma = max(_rms(part), least)
            found.append(
                SpeedRange(float(low), float(high), sigma, _stderr(part), part.middle.size)
            )
    return found
