"""The noise of a record, without a model of the pendulum.

A polynomial through nine neighbouring samples follows the motion; what remains, over the filter's
gain, is noise. Three things spoil that, and each has its remedy here:

- Sampling that is slow against the motion leaves some of the motion in the residual: polynomials
  of higher degree are taken until a higher one no longer gives less.
- Counts coarser than the noise, read so quickly that neighbours share a count: neighbouring errors
  are then alike and the residual does not see them. Samples further apart are taken, where the
  pendulum passes at least a count from one to the next; slower than that nothing can be said but
  that an even error within a count has the standard deviation count/sqrt(12), and that is the
  least that is reported. Where nothing moves, how often each count is shown says more
  (:mod:`pendmap.records.still`).
- Outliers: what is beyond eight standard deviations (robust, from quantiles, among samples of
  similar speed) is left out with all windows that it is part of, then a plain root mean square is
  taken. The median alone would be wrong by a tenth for the even errors of a counter.

Noise that is not white is read too small: ``colour`` says by how much the reading depends on the
filter.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.jitter import SpeedLaw, law_of, speed_of
from pendmap.records.local_fit import LocalFit, local_fit
from pendmap.records.robust import broad_scale
from pendmap.records.steps import step_of
from pendmap.records.still import still_noise

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.experiment import Run

    Floats = NDArray[np.float64]

__all__ = [
    "NoiseFloor",
    "SpeedRange",
    "fastest",
    "noise_floor",
    "noise_of",
]

DEGREES: Final = ((4, 9), (6, 11), (8, 13), (10, 15))
"""Degree and samples of the polynomials that are tried in turn."""

EVERY: Final = 0.06
"""Radians of its own phase that a motion may pass between samples and be followed by a quartic:
the next term, x^6/720 over nine samples, is then under 1e-8 of the amplitude."""

LAG: Final = 0.25
"""Radians of phase over which a way is measured, where that is more than an interval."""

FARTHEST: Final = 0.25
"""Radians of phase between samples that are taken further apart because of coarse counts."""

FURTHER: Final = 4
"""Strides beyond the shortest that are read too. From sample to sample a steady motion may pass
almost whole counts: errors are then alike for long, but not at all strides."""

STIFF: Final = 2.0
"""So many times as far apart may samples be through which the highest degree goes."""

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

KINDS: Final = 16
"""Kinds of speed, with equally many samples, that have outliers of their own."""

FEW: Final = 0.3
"""Radians of its own phase between samples beyond which polynomials leave some of the motion: about
20 samples a period. It is largest where the motion is quick, which looks like a clock's fault."""

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
    law : SpeedLaw or None
        How the noise grows with speed, where the record shows that it does.
    bound : bool
        Whether ``sigma`` is an upper bound: of so few samples a period some motion is left in it.
    """

    sigma: float
    stderr: float
    by_speed: tuple[SpeedRange, ...] = ()
    limited_by_count: bool = False
    colour: float = 1.0
    samples: int = 0
    law: SpeedLaw | None = None
    bound: bool = False


def noise_floor(run: Run) -> NoiseFloor:
    """Return the noise of a run, from the samples that are trusted; see :func:`noise_of`.

    Of a gyroscope alone it is that of the rate, in rad/s, by its change in rad/s^2.
    Where no sample is trusted, since nothing moves, all show it.
    """
    if run.peaks_only:
        return NoiseFloor(math.nan, math.nan)
    trusted = run.trusted if run.trusted.any() else None
    if run.gyroscope is not None:
        found = noise_of(run.time, run.read, trusted=trusted, count=step_of(run.read))
        law = found.law and dataclasses.replace(found.law, grows_with="acceleration")
        return dataclasses.replace(found, law=law)
    return noise_of(run.time, run.theta, trusted=trusted, count=run.count_rad)


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
    if time.size < FEWEST:
        return None
    interval = float(np.median(np.diff(time)))
    swing, phase = fastest(time, theta, count)
    speed = speed_of(time, theta, phase)
    first = _clean(local_fit(time, theta), bad, speed)
    if first.middle.size < FEWEST:
        return None
    fit = first
    if swing * interval > EVERY:
        fit = _followed(time, theta, bad, speed, first)
    next_fit = _clean(local_fit(time, theta, degree=6, points=11), bad, speed)
    colour = _rms(first) / max(_rms(next_fit), 1e-300) if next_fit.middle.size >= FEWEST else 1.0
    least = count / math.sqrt(12)
    slowest = 0.0
    if count and _rms(fit) < DITHERED * count:
        nearest = fit if swing * interval > EVERY else None
        apart = _apart(time, theta, bad, speed, count, interval, swing, nearest)
        if apart is None:
            still = still_noise(theta if bad.all() else theta[~bad], count)
            if still is not None:
                return NoiseFloor(*still, colour=colour, samples=int(theta.size))
            return NoiseFloor(max(least, _rms(fit)), least / 10, (), True, colour)  # noqa: FBT003
        fit, slowest = apart
        law = None
    else:
        # A residual holds the noise of all its window, each with its own speed.
        square = np.convolve(speed**2, fit.shares, "same")[fit.middle]
        law = law_of(
            fit.residual, square, worth=fit.sum_of_squares, fastest=phase, count=count,
            interval=interval,
        )  # fmt: skip
    few = phase * interval > FEW
    sigma, error = _rms(fit), _stderr(fit)
    limited = sigma < least
    sigma = max(sigma, least)
    ranges = tuple(_ranges(fit, least, slowest))
    law = None if few else law
    return NoiseFloor(sigma, error, ranges, limited, colour, fit.middle.size, law, few)


def fastest(time: Floats, theta: Floats, count: float) -> tuple[float, float]:
    """Return the fastest phase of the motion, rad/s: that of the swing, or of the rotation.

    First with large swings counted for rotations, whose bends are as sharp; then without.
    """
    interval = float(np.median(np.diff(time)))
    lag = 1
    while True:
        way = float(np.quantile(np.abs(theta[lag:] - theta[:-lag]), 0.98))
        if way >= CLEAR * count or 8 * lag > theta.size:
            break
        lag *= 2
    reach = max(float(np.quantile(np.abs(theta - np.median(theta)), 0.99)), 1e-300)
    # A rotation's phase is its angle.
    length = min(reach, 1.0) if float(np.ptp(theta)) > math.pi else reach
    slowest = 1.0 / float(time[-1] - time[0])
    phase = max(way / (lag * interval * length), slowest)
    # What noise makes of neighbours looks like speed: over longer ways it is less.
    while lag < (longer := min(int(LAG / (phase * interval)), theta.size // 8)):
        lag = longer
        way = float(np.quantile(np.abs(theta[lag:] - theta[:-lag]), 0.98))
        phase = max(way / (lag * interval * length), slowest)
    swing = phase if float(np.ptp(theta)) > math.tau else phase * length / reach
    return min(phase, math.pi / interval), min(max(swing, slowest), math.pi / interval)


def _followed(
    time: Floats, theta: Floats, bad: NDArray[np.bool_], speed: Floats, first: LocalFit
) -> LocalFit:
    """Return the fit of the lowest degree above which no degree leaves less."""
    chosen = first
    for degree, points in DEGREES[1:]:
        higher = _clean(local_fit(time, theta, degree=degree, points=points), bad, speed)
        if higher.middle.size < FEWEST:
            break
        if not _less(higher, chosen):
            break
        chosen = higher
    return chosen


def _less(fit: LocalFit, other: LocalFit) -> bool:
    """Return whether a fit leaves less than another beyond its error: it follows the motion."""
    enough = LESS + 2 * _stderr(fit) / max(_rms(fit), 1e-300)
    return fit.middle.size >= FEWEST and _rms(other) > enough * _rms(fit)


def _apart(  # noqa: PLR0913, PLR0917 (what is known of the record)
    time: Floats,
    theta: Floats,
    bad: NDArray[np.bool_],
    speed: Floats,
    count: float,
    interval: float,
    swing: float,
    nearest: LocalFit | None,
) -> tuple[LocalFit, float] | None:
    """Return a fit of samples at least a count apart, and the slowest speed where they are.

    Where sampling is slow against the motion, ``nearest`` is the fit of neighbours that follows it.
    """
    most = max(int(FARTHEST / (swing * interval)), 1)
    stride = 1
    while True:
        # Even slower motion keeps neighbours within a count, whose errors are alike.
        slowest = count / (stride * interval)
        fit = _clean(local_fit(time, theta, degree=6, points=11, stride=stride), bad, speed)
        if stride == 1 and nearest is not None and _less(nearest, fit):
            fit = nearest
        quick = np.abs(fit.slope) >= slowest
        if np.count_nonzero(quick) >= max(FEWEST, quick.size // 3) or stride >= most:
            break
        stride = min(2 * stride, most)
    if np.count_nonzero(quick) < FEWEST:
        return None
    found = [_only(fit, quick)]
    farthest = max(int(STIFF * FARTHEST / (swing * interval)), 1)
    for longer in range(stride + 1, min(stride + FURTHER, farthest) + 1):
        degree, points = DEGREES[1] if fit is not nearest and longer <= most else DEGREES[-1]
        more = local_fit(time, theta, degree=degree, points=points, stride=longer)
        more = _clean(more, bad, speed)
        found.append(_only(more, np.abs(more.slope) >= slowest))
    return _pooled(found), slowest


def _pooled(fits: list[LocalFit]) -> LocalFit:
    """Return all residuals of several fits to the same samples, worth no more than those of one."""
    middle, residual, slope = (
        np.concatenate([getattr(fit, name) for fit in fits])
        for name in ("middle", "residual", "slope")
    )
    worth = fits[0].sum_of_squares * middle.size / fits[0].middle.size
    return dataclasses.replace(
        fits[0], middle=middle, residual=residual, slope=slope, sum_of_squares=worth
    )


def _clean(fit: LocalFit, bad: NDArray[np.bool_], speed: Floats) -> LocalFit:
    """Leave out windows with samples that are not trusted, then those with outliers."""
    fit = _only(fit, ~_near(bad, fit.neighbours)[fit.middle])
    return _only(fit, ~_outlying(fit, speed)[fit.middle])


def _outlying(fit: LocalFit, speed: Floats) -> NDArray[np.bool_]:
    """Return which samples share a window with an outlier among residuals of similar speed."""
    false = np.zeros(speed.size, bool)
    sizes = np.abs(fit.residual)
    whole = broad_scale(sizes)
    order = np.argsort(speed[fit.middle], kind="stable")
    for part in np.array_split(order, max(min(KINDS, order.size // (5 * FEWEST)), 1)):
        # Noise that grows with speed is many times stronger at the quickest.
        scale = max(whole, broad_scale(sizes[part]))
        false[fit.middle[part[sizes[part] > FALSE * scale]]] = scale > 0
    return _near(false, fit.neighbours)


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
