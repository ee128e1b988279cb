"""Outliers with neighbours on one side only: at the ends of a record and beside its gaps.

No window has such a sample in its middle, so each is predicted from those further in. How far a
prediction may miss is seen in the record itself, a little further in, where outliers are known.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.local_fit import POINTS
from pendmap.records.robust import normal_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["false_ends"]

REACH: Final = 10
"""Samples of each end that are judged: of the first few no window is the middle, and behind them
are too few to tell an outlier from a jump."""

GAP: Final = POINTS // 2
"""Intervals without a sample beyond which no window goes."""

TRIED: Final = 40
"""Predictions further in that show how far they miss."""

DEGREES: Final = (2, 3)
"""Of the polynomials: higher ones carry noise too far beyond their last sample."""


def false_ends(
    time: Floats, theta: Floats, trusted: NDArray[np.bool_], limit: float, count: float
) -> NDArray[np.bool_]:
    """Return which readings at the ends of a record and of its gaps are outliers, shape (N,).

    Parameters
    ----------
    time, theta : ndarray, shape (N,)
        s, increasing; rad, without the outliers that are known.
    trusted : ndarray of bool, shape (N,)
        What is known to be false is neither judged nor believed.
    limit : float
        Times the usual miss of a prediction that make an outlier.
    count : float
        Step of the readings, rad; 0 if they have none.
    """
    false = np.zeros(theta.size, bool)
    good = np.flatnonzero(trusted)
    if good.size < 2:
        return false
    interval = float(np.median(np.diff(time[good])))
    cuts = np.flatnonzero(np.diff(time[good]) > GAP * interval) + 1
    near = REACH + TRIED + POINTS
    for piece in np.split(good, cuts):
        if piece.size < near:
            continue
        for end in (piece[:near], piece[:-near:-1]):
            lag = (time[end] - time[end[0]]) / interval
            false[end[:REACH]] |= _missed(lag, theta[end].copy(), limit, count)
    return false


def _missed(lag: Floats, theta: Floats, limit: float, count: float) -> NDArray[np.bool_]:
    """Judge the first readings, the inner ones first; of outliers the prediction is believed."""
    tried = {degree: _usual(lag, theta, degree) for degree in DEGREES}
    degree = min(tried, key=tried.__getitem__)
    missed = np.zeros(REACH, bool)
    for k in range(REACH - 1, -1, -1):
        there = float(_before(lag, theta, np.array([k]), degree)[0])
        if abs(theta[k] - there) > limit * tried[degree] + 2 * count:
            missed[k] = True
            theta[k] = there
    return missed


def _usual(lag: Floats, theta: Floats, degree: int) -> float:
    """Return by how much predictions miss further in, as a standard deviation."""
    places = np.arange(REACH, lag.size - POINTS)
    return normal_scale(theta[places] - _before(lag, theta, places, degree))


def _before(lag: Floats, theta: Floats, places: NDArray[np.intp], degree: int) -> Floats:
    """Return what polynomials through the nine samples behind each place are there."""
    behind = places[:, None] + np.arange(1, POINTS + 1)
    x = lag[behind] - lag[places, None]
    powers = (x / x[:, -1:])[:, :, None] ** np.arange(degree + 1)
    return np.asarray(np.einsum("mp,mp->m", np.linalg.pinv(powers)[:, 0, :], theta[behind]))
