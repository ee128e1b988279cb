"""Residuals of local fits without outliers, and how great they are."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.robust import broad_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.local_fit import LocalFit

    Floats = NDArray[np.float64]

__all__ = ["FEWEST", "clean", "less", "only", "rms", "stderr"]

FALSE: Final = 8.0
"""Standard deviations beyond which a residual is an outlier. White noise stays below 6; that of
real encoders has longer tails, which are part of it."""

FEWEST: Final = 40
"""Residuals that a standard deviation is taken from; half a dozen would be wrong by a third."""

KINDS: Final = 16
"""Kinds of speed, with equally many samples, that have outliers of their own."""

LESS: Final = 1.02
"""Ratio of two readings of the noise that counts as less: they aim at a few per cent."""


def clean(fit: LocalFit, bad: NDArray[np.bool_], speed: Floats) -> LocalFit:
    """Leave out windows with samples that are not trusted, then those with outliers."""
    fit = only(fit, ~_near(bad, fit.neighbours)[fit.middle])
    return only(fit, ~_outlying(fit, speed)[fit.middle])


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


def less(fit: LocalFit, other: LocalFit) -> bool:
    """Return whether a fit leaves less than another beyond its error: it follows the motion."""
    enough = LESS + 2 * stderr(fit) / max(rms(fit), 1e-300)
    return fit.middle.size >= FEWEST and rms(other) > enough * rms(fit)


def only(fit: LocalFit, which: NDArray[np.bool_]) -> LocalFit:
    """Return a fit with some of its residuals only."""
    return dataclasses.replace(
        fit, middle=fit.middle[which], residual=fit.residual[which], slope=fit.slope[which]
    )


def rms(fit: LocalFit) -> float:
    """Return the root mean square of the residuals, rad."""
    return float(np.sqrt(np.mean(fit.residual**2)))


def stderr(fit: LocalFit) -> float:
    """Return the standard error of the root mean square of residuals that share samples."""
    return rms(fit) * math.sqrt(fit.sum_of_squares / (2 * fit.middle.size))
