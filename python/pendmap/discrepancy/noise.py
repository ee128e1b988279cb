"""The noise of residuals, with its colour, and what is in them besides.

A pendulum's model errs slowly: what it lacks shows at the frequencies of the swing, of its few
lowest harmonics and below. Noise stands above them too, so that the spectrum there says how strong
it is where errors of the model cannot be told from it: as strong if it is white, stronger where it
is correlated from sample to sample. A process of first order (AR(1)) is adapted to the upper part
of the spectrum by Whittle's likelihood, and continued downward.

References
----------
Whittle (1953), Arkiv foer Matematik 2, 423.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.identification.fitting import TrajectoryFit
    from pendmap.identification.runs import FitRun

    Floats = NDArray[np.float64]

__all__ = ["Remainder", "remainder_of"]

HARMONICS: Final = 4.0
"""What a model lacks shows up to so many times the frequency of swing or rotation."""

GAP: Final = 1.5
"""Noise is read from so many times that frequency on."""

COLOURS: Final = np.linspace(-0.9, 0.95, 75)
"""Correlations from sample to sample that are tried."""

CERTAIN: Final = 12.0
"""Gain in twice the logarithm of Whittle's likelihood from which noise is said to be coloured."""

LEAST: Final = 8
"""Samples of a window that a spectrum is taken of."""


@dataclasses.dataclass(frozen=True)
class Remainder:
    """What residuals hold, in units of the readings' standard errors.

    Parameters
    ----------
    level : float
        Spectral density of the noise at low frequencies; 1 for white noise of the stated size. Sums
        of squares that a slow effect gains count as so much less.
    colour : float
        Correlation of the noise from sample to sample; 0 where none is certain.
    excess : float
        What is left in the slow part beyond noise: the sum of squares, over ``level``, that a model
        without error would gain.
    stderr : float
        Its standard error from the noise alone.
    by_run : tuple of float
        The same for each run, over its own standard error.
    chance : float
        That noise alone leaves so much, in all runs together or in any of them: Fisher's F of the
        slow part over the rest, times how often was looked (Bonferroni).
    """

    level: float
    colour: float
    excess: float
    stderr: float
    by_run: tuple[float, ...]
    chance: float

    @property
    def z(self) -> float:
        """The excess over its standard error."""
        return self.excess / self.stderr if self.stderr > 0 else 0.0


@dataclasses.dataclass(frozen=True)
class _Spectrum:
    run: int
    slow: Floats
    states: int
    quick: Floats
    cosines: Floats
    slow_cosines: Floats


def remainder_of(fit: TrajectoryFit, runs: Sequence[FitRun], adapted: int) -> Remainder:
    """Return what a fit leaves.

    Parameters
    ----------
    fit : TrajectoryFit
        With its windows.
    runs : sequence of FitRun
        Its records.
    adapted : int
        How many parameters were adapted to them.
    """
    from scipy.stats import f  # noqa: PLC0415 (where it is needed)

    spectra = [s for s in (_spectrum(fit, runs, w) for w in fit.windows) if s is not None]
    if not spectra:
        return Remainder(1.0, 0.0, 0.0, 0.0, (0.0,) * len(runs), 1.0)
    quick = np.concatenate([s.quick for s in spectra])
    cosines = np.concatenate([s.cosines for s in spectra])
    colour = _colour(quick, cosines)
    innovation = float(np.mean(quick * _shape(colour, cosines)))
    slow = np.concatenate([s.slow for s in spectra])
    at_slow = innovation / _shape(colour, np.concatenate([s.slow_cosines for s in spectra]))
    level = float(np.mean(at_slow))
    degrees = slow.size - sum(s.states for s in spectra) - adapted
    excess = float(np.sum(slow / at_slow)) - degrees
    stderr = math.sqrt(2 * slow.size + 2 * slow.size**2 / max(quick.size, 1))
    by_run = []
    chances = [_beyond(excess + degrees, degrees, quick.size, f)]
    for k in range(len(runs)):
        own = [s for s in spectra if s.run == k]
        size = sum(s.slow.size for s in own)
        total = sum(
            float(np.sum(s.slow * _shape(colour, s.slow_cosines))) / innovation for s in own
        )
        share = adapted * size / max(slow.size, 1)
        free = size - sum(s.states for s in own) - share
        by_run.append((total - free) / math.sqrt(2 * max(size, 1)))
        # By its own noise: a run's standard error is not known better than to a few per cent.
        rest = np.concatenate([s.quick * _shape(colour, s.cosines) for s in own] or [quick])
        chances.append(_beyond(total * innovation / float(np.mean(rest)), free, rest.size, f))
    chance = min(min(chances) * len(chances), 1.0)
    return Remainder(level, colour, excess, stderr, tuple(by_run), chance)


def _beyond(total: float, degrees: float, others: int, law: Any) -> float:  # noqa: ANN401 (scipy's)
    """Return the chance of so great a sum of squares, over the mean square of the rest."""
    return float(law.sf(total / degrees, degrees, others)) if degrees > 0 else 1.0


def _shape(colour: float, cosines: Floats) -> Floats:
    """One over the spectral density of an AR(1) process with innovations of unit variance."""
    return 1.0 + colour**2 - 2.0 * colour * cosines


def _colour(quick: Floats, cosines: Floats) -> float:
    def deviance(colour: float) -> float:
        shape = _shape(colour, cosines)
        innovation = float(np.mean(quick * shape))
        return quick.size * math.log(max(innovation, 1e-300)) - float(np.sum(np.log(shape)))

    all_deviances = [deviance(float(c)) for c in COLOURS]
    best = int(np.argmin(all_deviances))
    return float(COLOURS[best]) if deviance(0.0) - all_deviances[best] > CERTAIN else 0.0


def _spectrum(
    fit: TrajectoryFit, runs: Sequence[FitRun], window: tuple[int, int, int, float, float]
) -> _Spectrum | None:
    from scipy.fft import dct  # noqa: PLC0415 (where it is needed)

    run, first, last = window[:3]
    record = runs[run]
    residual = fit.white[run][first:last]
    good = np.isfinite(residual)
    if record.trusted is not None:
        good &= record.trusted[first:last]
    if np.count_nonzero(good) < LEAST:
        return None
    residual, time = residual[good], record.time[first:last][good]
    power = np.asarray(dct(residual, type=2, norm="ortho"), np.float64) ** 2
    interval = float(np.median(np.diff(time)))
    speed = np.abs(fit.curves[run][1][first:last][good])
    swing = max(
        fit["w0"] if "w0" in fit.estimates else fit.model.w0, float(np.quantile(speed, 0.9))
    )
    # Phase that the motion passes from sample to sample; the spectrum ends at pi.
    angle = np.pi * np.arange(residual.size) / residual.size
    edge = min(HARMONICS * swing * interval, 0.4 * np.pi)
    slow, quick = angle <= edge, angle >= GAP * edge
    return _Spectrum(run, power[slow], 2, power[quick], np.cos(angle[quick]), np.cos(angle[slow]))
