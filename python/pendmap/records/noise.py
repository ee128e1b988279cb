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
  (:mod:`pendmap.records.resolution`).
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
from pendmap.records.local_fits import FEWEST, apart, clean, followed, only, rms, stderr
from pendmap.records.resolution import step_of, still_noise
from pendmap.signal.local_polynomial import LocalFit, local_fit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.experiment import Run

    Floats = NDArray[np.float64]
    from pendmap.records.work import Work
    from pendmap.signal.local_polynomial import LocalFit


EVERY: Final = 0.06
"""Radians of its own phase that a motion may pass between samples and be followed by a quartic:
the next term, x^6/720 over nine samples, is then under 1e-8 of the amplitude."""

LAG: Final = 0.25
"""Radians of phase over which a way is measured, where that is more than an interval."""

DITHERED: Final = 0.55
"""Noise over count above which neighbouring readings err independently: sqrt(1/4 + 1/12) less
some room, from where the error of a rounded sum is that of its parts to a percent."""

CLEAR: Final = 4
"""Counts of way from which a speed is taken: rounding then changes it by a quarter at most."""

FEW: Final = 0.3
"""Radians of its own phase between samples beyond which polynomials leave some of the motion: about
20 samples a period. It is largest where the motion is quick, which looks like a clock's fault."""

RANGES: Final = 4
"""Ranges of speed, with equally many samples."""


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
    first = clean(local_fit(time, theta), bad, speed)
    if first.middle.size < FEWEST:
        return None
    fit = first
    if swing * interval > EVERY:
        fit = followed(time, theta, bad, speed, first)
    next_fit = clean(local_fit(time, theta, degree=6, points=11), bad, speed)
    colour = rms(first) / max(rms(next_fit), 1e-300) if next_fit.middle.size >= FEWEST else 1.0
    least = count / math.sqrt(12)
    slowest = 0.0
    if count and rms(fit) < DITHERED * count:
        nearest = fit if swing * interval > EVERY else None
        far = apart(time, theta, bad, speed, count, interval, swing, nearest)
        if far is None:
            still = still_noise(theta if bad.all() else theta[~bad], count)
            if still is not None:
                return NoiseFloor(*still, colour=colour, samples=int(theta.size))
            return NoiseFloor(max(least, rms(fit)), least / 10, (), True, colour)  # noqa: FBT003
        fit, slowest = far
        law = None
    else:
        # A residual holds the noise of all its window, each with its own speed.
        square = np.convolve(speed**2, fit.shares, "same")[fit.middle]
        law = law_of(
            fit.residual, square, worth=fit.sum_of_squares, fastest=phase, count=count,
            interval=interval,
        )  # fmt: skip
    few = phase * interval > FEW
    sigma, error = rms(fit), stderr(fit)
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
        part = only(fit, (speed >= low) & (speed <= high))
        if part.middle.size:
            sigma = max(rms(part), least)
            found.append(SpeedRange(float(low), float(high), sigma, stderr(part), part.middle.size))
    return found


# What the noise itself tells: a clock that is not what its stamps say.


def check(work: Work) -> None:
    """Say so where noise grows with speed."""
    if work.integrated:
        return  # a late reading of a rate errs with the acceleration
    floor = noise_of(
        work.time, work.theta, trusted=work.trusted, count=0.0 if work.edges else work.count
    )
    if floor.law is not None:
        interval = float(np.median(np.diff(work.time)))
        part = f"{100 * floor.law.tau / interval:.0f} % of the interval"
        work.say("noise-grows-with-speed", f"{floor.law} ({part})")
