"""What a reading is worth: its noise as seen without a model, and the sensor's counts."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Reading", "reading_of"]

WINDOW, DEGREE = 9, 4
"""Points and degree of the local fit."""
DITHERED: Final = 0.45
"""Noise below this part of a count no longer makes the errors of successive readings different."""
MAD: Final = 1.482602218505602
"""The standard deviation of a normal distribution over its median absolute deviation."""


@dataclasses.dataclass(frozen=True)
class Reading:
    """Standard errors of readings.

    Parameters
    ----------
    sigma : float
        Of one reading, rad.
    count : float
        The step of the sensor, rad; 0 where none is seen.
    each : ndarray of float, shape (n,)
        For a fit: readings that stay on one count, undisturbed by noise, all have the same error,
        so that together they say what one of them says.
    doubt : float
        Relative standard error of ``sigma``.
    coarse : bool
        Whether the count is coarser than the noise.
    """

    sigma: float
    count: float
    each: NDArray[np.float64]
    doubt: float
    coarse: bool


def reading_of(theta: NDArray[np.float64], sigma: float | None = None) -> Reading:
    """Return the standard errors of equally spaced readings.

    The noise is the scatter about a quartic through 9 neighbours, by the median absolute
    deviation; it is at least that of the count, ``count / sqrt(12)``.

    Parameters
    ----------
    theta : ndarray of float, shape (n,)
        The readings, rad.
    sigma : float, optional
        Their noise, where it is known, rad.
    """
    count = _count(theta)
    doubt = 0.0
    if sigma is None:
        sigma, doubt = _noise(theta)
    sigma = max(sigma, count / math.sqrt(12), 1e-15)
    coarse = sigma < DITHERED * count
    each = np.full(theta.shape, sigma)
    if coarse:
        change = np.flatnonzero(np.diff(theta) != 0) + 1
        lengths = np.diff(np.concatenate([[0], change, [len(theta)]]))
        each = sigma * np.sqrt(np.repeat(lengths, lengths))
    return Reading(sigma, count, each, doubt, coarse)


def _noise(theta: NDArray[np.float64]) -> tuple[float, float]:
    """Return the noise and its relative standard error."""
    if len(theta) < 4 * WINDOW:
        return 0.0, 1.0
    powers = np.vander(np.arange(WINDOW) - WINDOW // 2, DEGREE + 1, increasing=True)
    weights = -np.linalg.pinv(powers)[0]
    weights[WINDOW // 2] += 1
    rest = np.convolve(theta, weights[::-1], mode="valid")
    # Where the reading does not move the count hides the noise.
    steps = np.convolve(np.diff(theta) != 0, np.ones(WINDOW - 1), mode="valid") > 0
    moving = rest[steps] if np.count_nonzero(steps) >= 4 * WINDOW else rest
    size = MAD * float(np.median(np.abs(moving - np.median(moving))))
    return size / float(np.linalg.norm(weights)), 1.2 / math.sqrt(len(moving))


def _count(theta: NDArray[np.float64]) -> float:
    """Return the step of a sensor with counts; 0 where readings are too many to be counts."""
    values = np.unique(theta)
    if len(values) < 2 or len(values) > 0.5 * len(theta):  # noqa: PLR2004 (two make a step)
        return 0.0
    steps = np.diff(values)
    # Text files round: the smallest step that stands for many.
    real = steps[steps > 1e-9 * max(1.0, float(np.abs(values).max()))]
    return float(np.quantile(real, 0.1)) if len(real) else 0.0
