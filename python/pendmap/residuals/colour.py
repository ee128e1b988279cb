"""The colour of noise: which laws a spectrum allows, each with its probability.

Noise that is correlated from sample to sample is taken for a process of first order (AR(1)) of the
correlation ``rho``, and beside it a white floor, as the rounding to counts makes it. The spectral
density at the phase ``w`` from sample to sample is

``S(w) = scale (c (1 - rho^2) / (1 + rho^2 - 2 rho cos w) + 1 - c)``,

``c`` the coloured share of the variance and ``scale`` all of it. A process of first order without
the floor would be drawn to it at high frequencies, and fall short at low ones. There it is the
floor over the least density of the coloured part that counts,

``phi = (1 - c) / c (1 + |rho|) / (1 - |rho|)``.

By Whittle's likelihood squared amplitudes ``P`` are worth ``sum log S + P / S``. Where all are
quick, ``rho`` and ``phi`` are known only together, and what they say of slow ones is no better
known than that: so no law is chosen, each keeps its share of the likelihood, evenly laid out in
``log phi`` and in ``arctanh rho``, a quarter of the logarithm of the coloured part at the lowest
frequencies over that at the highest. Rounding to counts of ``q`` has a variance of its own,
``q^2 / 12``: no law has less of white noise, and those with just as much are the likelier ones,
other white noise in a reading being rare.

References
----------
Whittle (1953), Arkiv foer Matematik 2, 423.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.residuals.spectrum import PHASES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

COLOURS: Final = np.tanh(np.linspace(-1.5, 2.0, 101))
"""Correlations from sample to sample that are tried."""

FLOORS: Final = np.concatenate([[0.0], np.geomspace(0.03, 50.0, 35)])
"""White floors over the least density of the coloured part, ``phi``, that are tried."""

RARE: Final = 0.0025
"""How likely coloured noise is beforehand, all its laws together, over white noise: a colour must
be plain to be believed, but one that may be there has its say."""

FAINT: Final = 1e-6
"""Laws with less than this part of the greatest probability are left out."""

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
        ``rho`` and ``c``; 0 and 1 of white noise.
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
    """Return the laws that spectra of noise allow.

    Parameters
    ----------
    power : ndarray of float, shape (runs, bins)
        Squared amplitudes added up in each bin; bins as of
        :data:`pendmap.residuals.spectrum.PHASES`.
    sizes : ndarray of float, shape (runs, bins)
        How many there are; one or more in all.
    floors : ndarray of float, shape (runs,)
        Variance of rounding in each run, in units of the readings' standard errors squared.
    """
    tried = _tried()
    total, number = sizes.sum(), sizes.sum(axis=1)
    own = number >= OWN
    sums = tried.inverse @ power.T
    together = sums.sum(axis=1) / total
    scales = np.where(own, sums / np.where(own, number, 1.0), together[:, None])
    scales = np.maximum(scales, np.finfo(float).tiny)
    deviance = tried.logarithms @ sizes.sum(axis=0) + np.log(scales) @ number
    deviance += (sums / scales).sum(axis=1)
    prior = _prior(tried, float(floors @ number) / (scales @ number))
    deviance[prior == 0] = np.inf
    weights = prior * np.exp(-0.5 * (deviance - deviance.min()))
    weights /= weights.sum()
    keep = weights > FAINT * weights.max()
    return Laws(
        weights[keep],
        tried.colours[keep],
        tried.shares[keep],
        tried.shapes[keep],
        scales[keep],
        np.where(own, number, total),
    )


@dataclasses.dataclass(frozen=True)
class _Tried:
    """All laws, white noise first: shapes over the variance, one over them, their logarithms."""

    colours: Floats
    floors: Floats
    shares: Floats
    shapes: Floats
    inverse: Floats
    logarithms: Floats


@functools.cache
def _tried() -> _Tried:
    rho, floor = (v.ravel() for v in np.meshgrid(COLOURS, FLOORS, indexing="ij"))
    share = 1 / (1 + floor * _least(rho))
    rho, floor, share = (
        np.concatenate([[white], values])
        for white, values in ((0.0, rho), (0.0, floor), (1.0, share))
    )
    r, c = rho[:, None], share[:, None]
    shapes = c * (1 - r**2) / (1 + r**2 - 2 * r * np.cos(PHASES)) + 1 - c
    return _Tried(rho, floor, share, shapes, 1 / shapes, np.log(shapes))


def _least(rho: Floats) -> Floats:
    """Return the least density of a process of first order over its variance."""
    return np.asarray((1 - np.abs(rho)) / (1 + np.abs(rho)), np.float64)


def _prior(tried: _Tried, rounding: Floats) -> Floats:
    """Return how likely laws are beforehand; ``rounding`` has this share in each variance."""
    ratio = rounding / (tried.shares * _least(tried.colours))
    # Where among the floors that of rounding is, and how many steps the law's is above it.
    steps = np.arange(FLOORS.size)
    place = np.interp(np.log(np.maximum(ratio, FLOORS[1])), np.log(FLOORS[1:]), steps[1:])
    place = np.minimum(place, ratio / FLOORS[1])
    above = np.searchsorted(FLOORS, tried.floors) - place
    rounded = COUNTED * FLOORS.size * np.maximum(1 - np.abs(above), 0)
    prior = np.where(above > -1, 1 + rounded, 0.0)
    prior[1:] *= RARE / prior[1:].sum()
    prior[0] = 1.0
    return np.asarray(prior, np.float64)
