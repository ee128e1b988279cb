"""The noise of peaks that somebody else has measured: what a smooth course does not explain."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.robust import normal_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.identification.peaks import Peaks

__all__ = ["scatter", "with_scatter"]

FEWEST: Final = 16
"""Values from which a scatter is told: eight differences, to about a third."""

_DIFFERENCE: Final = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
"""Fourth difference, which a cubic leaves 0."""


def scatter(values: NDArray[np.float64]) -> float:
    """Return the standard deviation of the noise of values in a row; 0 where there are few.

    Fourth differences of every second value, since a zero error moves odd and even peaks apart;
    of white noise they have 70 times its variance. Robust: the median counts.

    Parameters
    ----------
    values : ndarray of float, shape (P,)
        Of a course that a cubic through nine of them follows.
    """
    if values.size < FEWEST:
        return 0.0
    size = values.size - 8
    differences: NDArray[np.float64] = sum(
        weight * values[2 * k : 2 * k + size] for k, weight in enumerate(_DIFFERENCE)
    )
    return normal_scale(np.asarray(differences)) / float(np.sqrt(np.sum(_DIFFERENCE**2)))


def with_scatter(peaks: Peaks) -> Peaks:
    """Return peaks without standard errors with those that their own scatter shows."""
    if peaks.known:
        return peaks
    size = peaks.time.shape
    return dataclasses.replace(
        peaks,
        stderr_time=np.full(size, scatter(peaks.time)),
        stderr_amplitude=np.full(size, scatter(np.abs(peaks.amplitude))),
    )
