"""Slips of time: readings that are lost while the stamps go on as if nothing were missing.

A controller that misses a reading now and then and counts the stamps itself writes, from there on,
what the pendulum does an interval later. The reading jumps by the velocity times the interval. An
encoder that misses counts jumps by their size, however quick the motion is.

Around each sample a polynomial is fitted to the readings, with ``d v`` added to all that follow.
That shows ``d`` also near a turning point, where the reading does not jump but the velocity does.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.local_fit import even_weights
from pendmap.records.noise import fastest
from pendmap.records.robust import normal_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["Slips", "slips_of"]

DEGREE: Final = 7

PHASE: Final = 2.0
"""Radians of phase to either side that such a polynomial follows: the next term is 6e-3 of the
swing at its quickest."""

SHORTEST: Final = 8
"""Samples to either side at least: fewer do not tell the velocity on both sides."""

LONGEST: Final = 150

FEWEST: Final = 3
"""Slips with one constant that make it the clock's."""

CERTAIN: Final = (7.0, 7.0, 6.0, 6.0, 6.0)
"""Standard errors of a slip, time after time that slips are looked for: beside a large one a small
one does not show. White noise reaches 6 once in 5e8 samples."""

MOST: Final = 4
"""Intervals of the longest slip."""

SLOW: Final = 1e-3
"""Power over its median below which nothing moves, and no slip is seen."""

WHOLE: Final = 0.25
"""Share by which a slip may miss a whole number of intervals."""

ODD: Final = 0.2
"""Share of the jumps that may be no slips."""

_BLOCK: Final = 4000


@dataclasses.dataclass(frozen=True)
class Slips:
    """Where a clock slipped.

    Parameters
    ----------
    time : ndarray, shape (N,)
        Mended times, s.
    places : ndarray of int
        First sample after each slip.
    slip, stderr : float
        Mean of the slips of one interval, s, as the readings show it.
    """

    time: Floats
    places: NDArray[np.intp]
    slip: float
    stderr: float


def slips_of(time: Floats, theta: Floats) -> Slips | None:
    """Return the slips of a clock by whole intervals; None where the readings show none.

    Parameters
    ----------
    time, theta : ndarray, shape (N,)
        s, increasing; readings, rad.
    """
    from scipy.interpolate import CubicSpline

    interval = float(np.median(np.diff(time)))
    reach = min(int(PHASE / (fastest(time, theta, 0.0)[0] * interval)), LONGEST)
    if reach < SHORTEST or time.size < 20 * reach:
        return None
    shown = _shown(reach)
    mended, places = time.copy(), list[int]()
    slip = stderr = 0.0
    for limit in CERTAIN:
        grid = np.arange(mended[0], mended[-1] + interval / 2, interval)
        at, lag = _found(CubicSpline(mended, theta)(grid), reach, limit)
        number = 1 + np.argmin(np.abs(lag[:, None] - shown), axis=1)
        each = lag / shown[number - 1]
        good = np.abs(each - 1) < WHOLE
        if not places:
            if np.count_nonzero(good) < FEWEST or np.mean(~good) > ODD:
                return None
            slip = interval * float(np.mean(each[good]))
            stderr = interval * float(np.std(each[good])) / math.sqrt(np.count_nonzero(good))
        if not good.any():
            break
        starts = np.searchsorted(mended, grid[at[good]] - interval / 2)
        for k, count in zip(starts.tolist(), number[good].tolist(), strict=True):
            mended[k:] += count * interval
            places.append(int(k))
    return Slips(mended, np.unique(places), slip, stderr)


def _shown(reach: int) -> Floats:
    """Return what slips of 1, 2, ... intervals look like: the jump spoils the velocity near it."""
    place = np.arange(-3 * reach, 3 * reach + 1)
    lines = [place + number * (place >= 0.0) for number in range(1, MOST + 1)]
    lags = [gain / power for gain, power in (_tried(line, reach) for line in lines)]
    return np.array([lag[3 * reach] for lag in lags])


def _found(values: Floats, reach: int, limit: float) -> tuple[NDArray[np.intp], Floats]:
    """Return the first samples after slips, and what each looks like, in intervals."""
    from scipy.ndimage import maximum_filter1d

    gain, power = _tried(values, reach)
    inside = slice(2 * reach, -2 * reach)
    told = power > SLOW * float(np.median(power[inside]))
    told[: 2 * reach] = told[-2 * reach :] = False
    score = np.where(told, np.abs(gain) / np.sqrt(np.maximum(power, 1e-300)), 0.0)
    noise = normal_scale(gain[told] / np.sqrt(power[told]))
    highest = maximum_filter1d(score, 2 * reach + 1, mode="nearest")
    at = np.flatnonzero((score > limit * noise) & (score >= highest) & told)
    return at, gain[at] / power[at]


def _tried(values: Floats, reach: int) -> tuple[Floats, Floats]:
    """Return gain and power of a slip before each sample: least squares give their ratio."""
    _, weights = even_weights(DEGREE, 2 * reach + 1)
    speed = np.zeros(values.size)
    speed[reach:-reach] = np.correlate(values, weights, "valid")
    gain, power = np.zeros(values.size), np.ones(values.size)
    offset = np.arange(-reach, reach + 1)
    basis = np.linalg.qr(np.vander(offset / reach, DEGREE + 1))[0]
    for low in range(2 * reach, values.size - 2 * reach, _BLOCK):
        rows = np.arange(low, min(low + _BLOCK, values.size - 2 * reach))
        around = rows[:, None] + offset
        late = speed[around] * (offset >= 0)
        late -= (late @ basis) @ basis.T
        gain[rows] = np.einsum("kj,kj->k", late, values[around] - values[rows, None])
        power[rows] = np.einsum("kj,kj->k", late, late)
    return gain, power
