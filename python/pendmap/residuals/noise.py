"""Noise of residuals: its spectrum, models of its correlation, and the excess above it.

Errors of a pendulum's model appear at the frequency of the swing, at its lowest harmonics and
below. At higher frequencies the spectrum contains noise alone. The noise model fitted there is
extrapolated to low frequencies, where noise correlated from sample to sample is stronger. Spectra
are cosine transforms of each window, which need no period, summed in narrow bins of frequency.

Correlated noise is a first-order autoregressive process, AR(1), with correlation ``rho``, plus
white noise such as that of rounding. The spectral density at the frequency ``w``, rad/sample, is

``S(w) = scale (c (1 - rho^2) / (1 + rho^2 - 2 rho cos w) + 1 - c)``,

with the coloured share ``c`` of the variance ``scale``. The ratio of the white part to the least
density of the coloured part is

``phi = (1 - c) / c (1 + |rho|) / (1 - |rho|)``.

By Whittle's likelihood a squared amplitude ``P`` adds ``log S + P / S`` to the deviance. High
frequencies determine ``rho`` and ``phi`` only jointly, so results are averaged over a grid of
models, called laws here, weighted by posterior probability. The prior is uniform in ``log phi`` and
in ``arctanh rho``, a quarter of the logarithm of the ratio of the coloured densities at the lowest
and the highest frequency. Rounding to counts of ``q`` has the variance ``q^2 / 12``, a lower bound
on the white noise; laws with exactly that have a higher prior, since other white noise is rare.

References
----------
Whittle (1953), Arkiv foer Matematik 2, 423.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy import stats
from scipy.fft import dct
from scipy.special import fdtr, fdtrc

from pendmap.signal.local_polynomial import POINTS, even_weights

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun
    from pendmap.signal import Floats


CERTAIN: Final = 1e9  # Number of amplitudes that represents an exactly known noise level
ARITHMETIC: Final = 1e-4
"""Mean squared residual, in standard errors squared, below which residuals are rounding errors."""
BINS: Final = 256  # Bins of frequency from 0 to half the sampling rate
PHASES: Final = np.pi * (np.arange(BINS) + 0.5) / BINS
"""Frequency at the middle of each bin, rad/sample."""
HARMONICS: Final = 4.0
"""Upper edge of the slow band, where model errors appear, over the swing or rotation frequency."""
GAP: Final = 1.5
"""Lower edge of the quick band, where only noise appears, over the upper edge of the slow band."""
WIDEST: Final = 0.4  # Greatest upper edge of the slow band, over the Nyquist frequency
STATES: Final = 2  # Initial conditions fitted in each window: angle and velocity
LEAST: Final = 8  # Fewest samples of a window for which a spectrum is computed
COLOURS: Final = np.tanh(np.linspace(-1.5, 2.0, 101))  # Correlations ``rho`` of the laws
FLOORS: Final = np.concatenate([[0.0], np.geomspace(0.03, 50.0, 35)])  # Ratios ``phi`` of the laws
RARE: Final = 0.0025  # Prior odds of all coloured laws together against white noise
FAINT: Final = 1e-6
"""Probability of a law, relative to the most probable one, below which it is discarded."""
COUNTED: Final = 10.0  # Prior odds of white noise from rounding alone against any other level
OWN: Final = 50  # Fewest amplitudes from which a run's own noise level is estimated


@dataclasses.dataclass(frozen=True)
class ResidualNoise:
    """Noise of residuals and the excess above it, in units of the readings' standard errors."""

    level: float  # Spectral density of noise at the motion's frequencies; 1 for stated white noise
    colour: float  # Correlation from sample to sample, mean over all laws
    # Excess of the slow part: sum of squares over the noise's density, less its expectation, in
    # standard errors from the noise and its unknown law; of all runs and of each.
    z: float
    by_run: tuple[float, ...]
    # Probability that noise alone gives the slow part of all runs or of any one: F-test of the
    # slow part against the quick part, with Bonferroni's factor, mean over all laws.
    chance: float
    laws: Floats = dataclasses.field(repr=False)  # Level and probability of each law, (2, laws)
    amplitudes: float = dataclasses.field(repr=False)  # Independent amplitudes of a level
    # Effective number of readings ``3 (sum P)^2 / sum P^2``, with squared amplitudes ``P``: all for
    # white noise, a few for residuals that oscillate.
    independent: float
    # Variance over that which local fits to readings of this colour show; 1 for white noise.
    swell: float = 1.0

    def chance_of(self, gain: float, count: int, least: float = 0.0) -> float:
        """Return the probability of at least this gain from noise with ``count`` parameters.

        F-test, mean over all laws; levels are at least ``least``; 1 without parameters. The gain is
        the decrease of the sum of squares, in standard errors squared.
        """
        if count == 0:
            return 1.0
        levels, weights = np.maximum(self.laws[0], least), self.laws[1]
        return float(weights @ fdtrc(count, self.amplitudes, max(gain, 0.0) / count / levels))


def estimate_noise(
    fit: TrajectoryFit, runs: Sequence[FitRun], adapted: int, floors: Sequence[float]
) -> ResidualNoise:
    """Return the noise of a fit's residuals.

    ``adapted`` is the number of the fit's parameters; ``floors`` the share of rounding in the
    variance of each run's noise.
    """
    spectra = residual_spectra(fit, runs)
    size = spectra.slow_sizes.sum() + spectra.quick_sizes.sum()
    power = spectra.slow.sum() + spectra.quick.sum()
    if not spectra.quick_sizes.any() or power < ARITHMETIC * size:
        none, known = (0.0,) * len(runs), np.ones((2, 1))
        return ResidualNoise(1.0, 0.0, 0.0, none, 1.0, known, CERTAIN, spectra.independent)
    laws = noise_laws(spectra.quick, spectra.quick_sizes, np.asarray(floors, np.float64))
    sizes = spectra.slow_sizes.sum(axis=1)
    degrees = sizes - spectra.states - adapted * sizes / sizes.sum()
    # Sum of squares of the slow part over the noise's density, shape (laws, runs).
    left = ((1 / laws.shapes) @ spectra.slow.T) / laws.scales
    laws = _posterior(laws, left, degrees, sizes)
    parts = [slice(None), *(slice(k, k + 1) for k in range(len(runs)))]
    excesses = [
        _excess(left[:, part], degrees[part], sizes[part], laws.weights, laws.sizes[part])
        for part in parts
    ]
    (z, *by_run), chances = zip(*excesses, strict=True)
    # The noise's density, weighted by the spectrum of the motion.
    levels = np.sum((laws.shapes @ spectra.motion.T) * laws.scales, axis=1) / spectra.motion.sum()
    return ResidualNoise(
        float(laws.weights @ levels),
        float(laws.weights @ laws.correlations),
        z,
        tuple(by_run),
        min(min(chances) * len(excesses), 1.0),
        np.stack([levels, laws.weights]),
        float(spectra.quick_sizes.sum()),
        spectra.independent,
        float(laws.weights @ (1 / (laws.shapes @ _local_shares()))),
    )


def _posterior(laws: Laws, left: Floats, degrees: Floats, sizes: Floats) -> Laws:
    """Return the laws weighted with the likelihood of the slow part.

    Errors of a model only add to noise. The likelihood is the sum of two cases of equal prior odds:
    the noise gives less than the slow part (the model is wrong) or exactly that (it is right).
    """
    free = float(degrees.sum())
    if laws.weights.size == 1 or free <= 0:
        return laws
    mean = left.sum(axis=1) / free
    others = _denominator_degrees(sizes, laws.sizes)
    weights = laws.weights * (fdtr(free, others, mean) + mean * stats.f.pdf(mean, free, others))
    # If parameters were fitted to noise, all laws exceed the slow part: use the quick part alone.
    if not weights.sum() > 0:
        return laws
    return dataclasses.replace(laws, weights=weights / weights.sum())


@functools.cache
def _local_shares() -> Floats:
    """Return the share of each bin in the variance of white noise that a local fit shows."""
    weights, _ = even_weights(4, POINTS)
    lags = np.arange(POINTS) - POINTS // 2
    response = (np.cos(np.outer(PHASES, lags)) @ weights) ** 2
    return np.asarray(response / response.sum(), np.float64)


def _denominator_degrees(sizes: Floats, quick: Floats) -> float:
    """Return the degrees of freedom of the noise level of slow parts (Satterthwaite)."""
    return float(sizes.sum() ** 2 / np.sum(sizes**2 / quick))


def _excess(
    left: Floats, degrees: Floats, sizes: Floats, weights: Floats, quick: Floats
) -> tuple[float, float]:
    """Return the excess of runs over noise, in standard errors, and its p-value.

    ``sizes`` and ``quick`` are the numbers of slow and of quick amplitudes, by run.
    """
    number, free = float(sizes.sum()), float(degrees.sum())
    if number == 0 or free <= 0:
        return 0.0, 1.0
    total = left.sum(axis=1)
    mean = float(weights @ total)
    scatter = 2 * number + 2 * float(np.sum(sizes**2 / quick))
    stderr = math.sqrt(scatter + float(weights @ (total - mean) ** 2))
    chances = fdtrc(free, _denominator_degrees(sizes, quick), total / free)
    return (mean - free) / stderr, float(weights @ chances)


@dataclasses.dataclass(frozen=True)
class Spectra:
    """Squared amplitudes of residuals by run and bin, in standard errors squared."""

    slow: Floats  # Sum in each bin of the band of model errors, shape (runs, BINS)
    quick: Floats  # Sum in each bin of the band of noise alone, shape (runs, BINS)
    slow_sizes: Floats  # Number of slow amplitudes, shape (runs, BINS)
    quick_sizes: Floats  # Number of quick amplitudes, shape (runs, BINS)
    # Share of each bin in the slow part of the velocity, times samples, shape (runs, BINS).
    motion: Floats
    states: Floats  # Number of fitted initial states, shape (runs,)
    independent: float  # Effective number of readings, as in ResidualNoise


def residual_spectra(fit: TrajectoryFit, runs: Sequence[FitRun]) -> Spectra:
    """Return the spectra of a fit's residuals."""
    slow, quick, slow_sizes, quick_sizes, motion = np.zeros((5, len(runs), BINS))
    states = np.zeros(len(runs))
    total, fourth = 0.0, 0.0
    for run, first, last, *_ in fit.windows:
        record = runs[run]
        residual = fit.white[run][first:last]
        good = np.isfinite(residual) & record.counted[first:last]
        if np.count_nonzero(good) < LEAST:
            continue
        time = record.time[first:last][good]
        velocity = fit.curves[run][1][first:last][good]
        # The velocity: the angle of a rotation is a ramp, which has no line spectrum.
        rows = np.stack([residual[good], velocity - velocity.mean()])
        power, moved = np.asarray(dct(rows, type=2, norm="ortho"), np.float64) ** 2
        total, fourth = total + float(power.sum()), fourth + float(power @ power)
        swing = max(
            fit["w0"] if "w0" in fit.estimates else fit.model.w0,
            float(np.quantile(np.abs(velocity), 0.9)),
        )
        edge = min(HARMONICS * swing * float(np.median(np.diff(time))), WIDEST * np.pi)
        phase = np.pi * np.arange(time.size) / time.size
        place = np.minimum((phase / np.pi * BINS).astype(int), BINS - 1)
        below, above = phase <= edge, phase >= GAP * edge
        for chosen, sums, sizes in ((below, slow, slow_sizes), (above, quick, quick_sizes)):
            sums[run] += np.bincount(place[chosen], power[chosen], BINS)
            sizes[run] += np.bincount(place[chosen], minlength=BINS)
        moved = moved[below] if moved[below].any() else np.ones(np.count_nonzero(below))
        motion[run] += np.bincount(place[below], time.size * moved / moved.sum(), BINS)
        states[run] += STATES
    independent = 3 * total**2 / fourth if fourth > 0 else 1.0
    return Spectra(slow, quick, slow_sizes, quick_sizes, motion, states, independent)


@dataclasses.dataclass(frozen=True)
class Laws:
    """Noise models compatible with a spectrum, with their probabilities."""

    weights: Floats  # Probability of each law, shape (laws,)
    correlations: Floats  # From sample to sample, ``c rho``, shape (laws,)
    shapes: Floats  # Spectral density over the variance, shape (laws, BINS)
    scales: Floats  # Variance in each run, in standard errors squared, shape (laws, runs)
    sizes: Floats  # Number of amplitudes of each scale, shape (runs,)


def noise_laws(power: Floats, sizes: Floats, floors: Floats) -> Laws:
    """Return the noise models compatible with spectra of noise.

    ``power`` and ``sizes``, shape (runs, BINS), are the sum and the number of squared amplitudes in
    each bin; ``floors``, shape (runs,), the variance of rounding in standard errors squared.
    """
    grid = _law_grid()
    total, number = sizes.sum(), sizes.sum(axis=1)
    separate = number >= OWN
    sums = grid.inverse @ power.T
    together = sums.sum(axis=1) / total
    scales = np.where(separate, sums / np.where(separate, number, 1.0), together[:, None])
    scales = np.maximum(scales, np.finfo(float).tiny)
    deviance = grid.logarithms @ sizes.sum(axis=0) + np.log(scales) @ number
    deviance += (sums / scales).sum(axis=1)
    prior = _prior(grid, float(floors @ number) / (scales @ number))
    deviance[prior == 0] = np.inf
    weights = prior * np.exp(-0.5 * (deviance - deviance.min()))
    weights /= weights.sum()
    keep = weights > FAINT * weights.max()
    correlations = (grid.colours * grid.shares)[keep]
    sizes = np.where(separate, number, total)
    return Laws(weights[keep], correlations, grid.shapes[keep], scales[keep], sizes)


@dataclasses.dataclass(frozen=True)
class _LawGrid:
    """Grid of all noise models, white noise first."""

    colours: Floats
    floors: Floats
    shares: Floats
    shapes: Floats  # Spectral density over the variance
    inverse: Floats  # One over the shapes
    logarithms: Floats  # Of the shapes


@functools.cache
def _law_grid() -> _LawGrid:
    rho, floor = (v.ravel() for v in np.meshgrid(COLOURS, FLOORS, indexing="ij"))
    share = 1 / (1 + floor * _least_density(rho))
    rho, floor, share = (
        np.concatenate([[white], values])
        for white, values in ((0.0, rho), (0.0, floor), (1.0, share))
    )
    r, c = rho[:, None], share[:, None]
    shapes = c * (1 - r**2) / (1 + r**2 - 2 * r * np.cos(PHASES)) + 1 - c
    return _LawGrid(rho, floor, share, shapes, 1 / shapes, np.log(shapes))


def _least_density(rho: Floats) -> Floats:
    """Return the least spectral density of an AR(1) process over its variance."""
    return np.asarray((1 - np.abs(rho)) / (1 + np.abs(rho)), np.float64)


def _prior(grid: _LawGrid, rounding: Floats) -> Floats:
    """Return the prior probability of laws, given the share of rounding in each variance."""
    ratio = rounding / (grid.shares * _least_density(grid.colours))
    # Grid steps from the floor of rounding to that of the law.
    steps = np.arange(FLOORS.size)
    place = np.interp(np.log(np.maximum(ratio, FLOORS[1])), np.log(FLOORS[1:]), steps[1:])
    place = np.minimum(place, ratio / FLOORS[1])
    above = np.searchsorted(FLOORS, grid.floors) - place
    rounded = COUNTED * FLOORS.size * np.maximum(1 - np.abs(above), 0)
    prior = np.where(above > -1, 1 + rounded, 0.0)
    prior[1:] *= RARE / prior[1:].sum()
    prior[0] = 1.0
    return np.asarray(prior, np.float64)
