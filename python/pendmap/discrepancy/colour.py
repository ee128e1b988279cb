"""The colour of noise: which laws a spectrum allows, each with its probability.

Noise that is correlated from sample to sample is taken for a process of first order (AR(1)) of the
correlation ``rho``, and beside it a white floor, as the rounding to counts makes it. The spectral
density at the phase ``w`` from sample to sample is

``S(w) = scale (c (1 - rho^2) / (1 + rho^2 - 2 rho cos w) + 1 - c)``,

``c`` the coloured share of the variance and ``scale`` all of it. A process of first order without
the floor would be drawn to it at high frequencies, and fall short at low ones.

By Whittle's likelihood squared amplitudes ``P`` are worth ``sum log S + P / S``. Where all are
quick, ``rho`` and ``c`` are known only together, and what they say of slow ones is no better known
than that: so no law is chosen, each keeps its share of the likelihood, evenly laid out in ``c`` and
in ``arctanh rho``, half the logarithm of the coloured part at the lowest frequencies over that at
the highest. Rounding to counts of ``q`` has a variance of its own, ``q^2 / 12``: no law has less
of white noise, and those with just as much are the likelier ones, other white noise in a reading
being rare.

References
----------
Whittle (1953), Arkiv foer Matematik 2, 423.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.discrepancy.spectrum import PHASES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["Laws", "laws_of"]

COLOURS: Final = np.tanh(np.linspace(-1.5, 2.0, 141))
"""Correlations from sample to sample that are tried."""

SHARES: Final = np.linspace(0.05, 1.0, 20)
"""Coloured shares of the variance that are tried."""

CERTAIN: Final = 12.0
"""Gain in twice the logarithm of Whittle's likelihood from which noise is said to be coloured."""

FAINT: Final = 1e-6
"""Laws with less than this part of the greatest likelihood are left out."""

COUNTED: Final = 10.0
"""How much likelier than any other a floor is that rounding alone makes."""

OWN: Final = 50
"""Amplitudes from which a run's noise is read from itself: without a model it is not known better
than to a few per cent, and coloured noise worse."""


@dataclasses.dataclass(frozen=True)
class Laws:
    """Laws of noise that a spectrum allows.

    Parameters
    ----------
    weights : ndarray of float, shape (laws,)
        Probability of each.
    colours, shares : ndarray of float, shape (laws,)
        ``rho`` and ``c``; 0 of white noise.
    shapes : ndarray of float, shape (laws, bins)
        Spectral density over the variance.
    scales : ndarray of float, shape (laws, runs)
        Variance in each run, in units of the readings' standard errors squared.
    sizes : ndarray of float, shape (runs,)
        From how many amplitudes each scale was read.
    """

    weights: Floats
    colours: Floats
    shares: Floats
    shapes: Floats
    scales: Floats
    sizes: Floats

    @property
    def correlation(self) -> float:
        """Correlation of the noise from sample to sample, white part included."""
        return float(self.weights @ (self.colours * self.shares))


def laws_of(power: Floats, sizes: Floats, floors: Floats) -> Laws:
    """Return the laws that spectra of noise allow: white noise alone where no colour is certain.

    Parameters
    ----------
    power : ndarray of float, shape (runs, bins)
        Squared amplitudes added up in each bin; bins as of
        :data:`pendmap.discrepancy.spectrum.PHASES`.
    sizes : ndarray of float, shape (runs, bins)
        How many there are; one or more in all.
    floors : ndarray of float, shape (runs,)
        Variance of rounding in each run, in units of the readings' standard errors squared.
    """
    colours, shares, shapes = _tried()
    total, number = sizes.sum(), sizes.sum(axis=1)
    own = number >= OWN
    sums = (1 / shapes) @ power.T
    together = sums.sum(axis=1) / total
    scales = np.where(own, sums / np.where(own, number, 1.0), together[:, None])
    scales = np.maximum(scales, np.finfo(float).tiny)
    deviance = np.log(shapes) @ sizes.sum(axis=0) + np.log(scales) @ number
    deviance += (sums / scales).sum(axis=1)
    # By how many steps of the shares a law's floor exceeds that of rounding.
    rounded = 1 - (floors @ number) / (scales @ number)
    above = (np.clip(rounded, SHARES[0], 1.0) - shares) / (SHARES[1] - SHARES[0])
    prior = np.where(above > -1, 1 + COUNTED * SHARES.size * np.maximum(1 - np.abs(above), 0), 0.0)
    allowed = prior > 0
    allowed[0] = True
    best = deviance[allowed].min()
    keep = allowed & (deviance < best - 2 * np.log(FAINT))
    if deviance[0] - best <= CERTAIN:
        keep = np.arange(deviance.size) == 0
    weights = np.where(shares[keep] > 0, prior[keep], 1.0) * np.exp(-0.5 * (deviance[keep] - best))
    return Laws(
        weights / weights.sum(),
        colours[keep],
        shares[keep],
        shapes[keep],
        scales[keep],
        np.where(own, number, total),
    )


@functools.cache
def _tried() -> tuple[Floats, Floats, Floats]:
    """Return colours, shares and shapes of all laws that are tried, white noise first."""
    rho, share = (v.ravel() for v in np.meshgrid(COLOURS, SHARES, indexing="ij"))
    rho, share = np.concatenate([[0.0], rho]), np.concatenate([[0.0], share])
    r, c = rho[:, None], share[:, None]
    coloured = (1 - r**2) / (1 + r**2 - 2 * r * np.cos(PHASES))
    return rho, share, c * coloured + 1 - c
