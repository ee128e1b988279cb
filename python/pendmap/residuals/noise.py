"""The noise of residuals, with its colour, and what is in them besides.

A pendulum's model errs slowly: what it lacks shows at the frequencies of the swing, of its few
lowest harmonics and below. Noise stands above them too, so that the spectrum there says how strong
it is where errors of the model cannot be told from it: as strong if it is white, stronger where it
is correlated from sample to sample. The laws that the upper part of the spectrum allows
(:mod:`pendmap.residuals.colour`) are continued downward, each with its probability.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.residuals.colour import Laws, laws_of
from pendmap.residuals.spectrum import spectra_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun

    Floats = NDArray[np.float64]

FOR_SURE: Final = 1e9
"""So many amplitudes tell a level for sure."""

ARITHMETIC: Final = 1e-4
"""Mean square of residuals, over the readings' standard errors, below which they are not looked
into: of records without noise fits leave less, and it has a shape."""


@dataclasses.dataclass(frozen=True)
class Remainder:
    """What residuals hold, in units of the readings' standard errors.

    Parameters
    ----------
    level : float
        Spectral density of the noise where the motion is; 1 for white noise of the stated size.
        Sums of squares that a slow effect gains count as so much less.
    colour : float
        Correlation of the noise from sample to sample, the mean over all laws that it may have.
    excess : float
        What is left in the slow part beyond noise: the sum of squares, over the noise's density,
        that a model without error would gain.
    stderr : float
        Its standard error from the noise alone, and from what is not known of its law.
    by_run : tuple of float
        The same for each run, over its own standard error.
    chance : float
        That noise alone leaves so much, in all runs together or in any of them: Fisher's F of the
        slow part over the rest, times how often was looked (Bonferroni); the mean over all laws of
        the noise.
    laws : ndarray of float, shape (2, laws)
        Levels of the laws that the noise may have, and the probability of each.
    amplitudes : float
        How many independent amplitudes a level was read from.
    independent : float
        Independent readings among the residuals: of squared amplitudes ``P`` of their spectrum
        ``3 (sum P)^2 / sum P^2``, their number for white noise, a few for residuals that oscillate.
    """

    level: float
    colour: float
    excess: float
    stderr: float
    by_run: tuple[float, ...]
    chance: float
    laws: Floats = dataclasses.field(repr=False)
    amplitudes: float = dataclasses.field(repr=False)
    independent: float

    def chance_of(self, gain: float, count: int, least: float = 0.0) -> float:
        """Return the chance that noise alone makes a sum of squares fall by so much.

        Parameters
        ----------
        gain : float
            By how much, in units of the readings' standard errors squared.
        count : int
            How many numbers were adapted for it.
        least : float
            Levels below it count as this one.

        Returns
        -------
        float
            By Fisher's F, the mean over all laws of the noise; 1 where nothing was adapted.
        """
        from scipy.special import fdtrc  # noqa: PLC0415 (where it is needed)

        if count == 0:
            return 1.0
        levels, weights = np.maximum(self.laws[0], least), self.laws[1]
        return float(weights @ fdtrc(count, self.amplitudes, max(gain, 0.0) / count / levels))

    @property
    def z(self) -> float:
        """The excess over its standard error."""
        return self.excess / self.stderr if self.stderr > 0 else 0.0


def remainder_of(
    fit: TrajectoryFit, runs: Sequence[FitRun], adapted: int, floors: Sequence[float]
) -> Remainder:
    """Return what a fit leaves."""
    spectra = spectra_of(fit, runs)
    if not spectra.quick_sizes.any() or spectra.mean < ARITHMETIC:
        return Remainder(
            1.0,
            0.0,
            0.0,
            0.0,
            (0.0,) * len(runs),
            1.0,
            np.ones((2, 1)),
            FOR_SURE,
            spectra.independent,
        )
    laws = laws_of(spectra.quick, spectra.quick_sizes, np.asarray(floors, np.float64))
    sizes = spectra.slow_sizes.sum(axis=1)
    degrees = sizes - spectra.states - adapted * sizes / sizes.sum()
    # Of each law and run: the slow part over what is expected of noise.
    left = ((1 / laws.shapes) @ spectra.slow.T) / laws.scales
    laws = _tenable(laws, left, degrees, sizes)
    excess, stderr, chance = _beyond(left, degrees, sizes, laws)
    by_run, chances = [], [chance]
    for k in range(len(runs)):
        own = slice(k, k + 1)
        above, error, chance = _beyond(
            left[:, own], degrees[own], sizes[own], dataclasses.replace(laws, sizes=laws.sizes[own])
        )
        by_run.append(above / error if error > 0 else 0.0)
        chances.append(chance)
    chance = min(min(chances) * len(chances), 1.0)
    # The noise's density where the motion is.
    levels = np.sum((laws.shapes @ spectra.motion.T) * laws.scales, axis=1) / spectra.motion.sum()
    return Remainder(
        float(laws.weights @ levels),
        laws.correlation,
        excess,
        stderr,
        tuple(by_run),
        chance,
        np.stack([levels, laws.weights]),
        float(spectra.quick_sizes.sum()),
        spectra.independent,
    )


def _tenable(laws: Laws, left: Floats, degrees: Floats, sizes: Floats) -> Laws:
    """Return the laws with what the slow part says of them.

    What a model lacks only adds to noise. So a law is as much less likely as it is improbable that
    noise leaves so little, the likelihood where any sum may have been added; or as it is that noise
    leaves just as much, where the model lacks nothing. Both are equally likely beforehand.
    """
    from scipy.special import fdtr  # noqa: PLC0415 (where it is needed)
    from scipy.stats import f  # noqa: PLC0415

    free = float(degrees.sum())
    if laws.weights.size == 1 or free <= 0:
        return laws
    mean = left.sum(axis=1) / free
    others = _others(laws, sizes)
    weights = laws.weights * (fdtr(free, others, mean) + mean * f.pdf(mean, free, others))
    # All are too great where parameters took up noise: the quick part alone has the say then.
    if not weights.sum() > 0:
        return laws
    return dataclasses.replace(laws, weights=weights / weights.sum())


def _others(laws: Laws, sizes: Floats) -> float:
    """Return the degrees of freedom of what slow parts are divided by (Satterthwaite's)."""
    return float(sizes.sum() ** 2 / np.sum(sizes**2 / laws.sizes))


def _beyond(left: Floats, degrees: Floats, sizes: Floats, laws: Laws) -> tuple[float, float, float]:
    """Return what runs leave beyond noise, its standard error, and the chance of so much."""
    from scipy.special import fdtrc  # noqa: PLC0415 (where it is needed)

    number, free = float(sizes.sum()), float(degrees.sum())
    if number == 0 or free <= 0:
        return 0.0, 0.0, 1.0
    total = left.sum(axis=1)
    mean = float(laws.weights @ total)
    scatter = 2 * number + 2 * float(np.sum(sizes**2 / laws.sizes))
    stderr = math.sqrt(scatter + float(laws.weights @ (total - mean) ** 2))
    chances = fdtrc(free, _others(laws, sizes), total / free)
    return mean - free, stderr, float(laws.weights @ chances)
