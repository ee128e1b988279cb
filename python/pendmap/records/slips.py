"""Clock slips: readings that are lost while the stamps continue.

The reading jumps by the velocity times the lost time. The slip ``d`` is estimated with a local
polynomial plus a term ``d v`` from a sample on.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.noise import fastest
from pendmap.signal.local_polynomial import even_weights
from pendmap.signal.robust import normal_scale

if TYPE_CHECKING:
    from pendmap.signal import Floats, Indices

SLIP_DEGREE: Final = 7  # Degree of the polynomials with which slips are detected
SLIP_PHASE: Final = 2.0  # Half-width of the polynomials, rad of phase; their error is below 6e-3
SHORTEST_SIDE: Final = 8  # Fewest samples on either side of a slip, for both velocities
LONGEST_SIDE: Final = 150  # Most samples on either side of a slip
FEWEST_SLIPS: Final = 3  # Fewest slips by whole intervals for which the clock is corrected
CERTAIN_SLIP: Final = (7.0, 7.0, 6.0, 6.0, 6.0)  # Least slip in each pass, standard errors
MOST_INTERVALS: Final = 4  # Longest slip, intervals
SLOW_POWER: Final = 1e-3  # Power over its median below which motion is too slow to detect a slip
OFF_INTERVAL: Final = 0.25  # Relative tolerance for slips by whole intervals
MOST_OTHER_JUMPS: Final = 0.2  # Greatest share of jumps that are not slips
_BLOCK: Final = 4000  # Windows that are solved at a time


@dataclasses.dataclass(frozen=True)
class Slips:
    """Slips of a clock: corrected times, positions, and mean slip per interval."""

    time: Floats  # corrected, s
    places: Indices  # first sample after each slip
    slip: float  # mean size per interval, s
    stderr: float  # standard error of the mean size, s


def slips_of(time: Floats, theta: Floats, fewest: int = FEWEST_SLIPS) -> Slips | None:
    """Return the slips of a clock by whole intervals; None if the readings show none."""
    from scipy.interpolate import CubicSpline

    if not np.all(np.isfinite(theta)):
        return None
    interval = float(np.median(np.diff(time)))
    reach = min(int(SLIP_PHASE / (fastest(time, theta, 0.0)[0] * interval)), LONGEST_SIDE)
    if reach < SHORTEST_SIDE or time.size < 20 * reach:
        return None
    # Apparent sizes of slips of 1, 2, ... intervals, biased since a jump perturbs the velocity.
    place = np.arange(-3 * reach, 3 * reach + 1)
    tried = [_tried(place + k * (place >= 0.0), reach) for k in range(1, MOST_INTERVALS + 1)]
    shown = np.array([gain[3 * reach] / power[3 * reach] for gain, power in tried])
    mended, places = time.copy(), list[int]()
    slip = stderr = 0.0
    for limit in CERTAIN_SLIP:
        grid = np.arange(mended[0], mended[-1] + interval / 2, interval)
        at, lag = _found(CubicSpline(mended, theta)(grid), reach, limit)
        number = 1 + np.argmin(np.abs(lag[:, None] - shown), axis=1)
        size = lag / shown[number - 1]
        good = np.abs(size - 1) < OFF_INTERVAL
        if not places:
            if np.count_nonzero(good) < fewest or np.mean(~good) > MOST_OTHER_JUMPS:
                return None
            slip = interval * float(np.mean(size[good]))
            stderr = interval * float(np.std(size[good])) / math.sqrt(np.count_nonzero(good))
        if not good.any():
            break
        starts = np.searchsorted(mended, grid[at[good]] - interval / 2).tolist()
        for k, count in zip(starts, number[good].tolist(), strict=True):
            mended[k:] += count * interval
        places += starts
    return Slips(mended, np.unique(places), slip, stderr)


def _found(values: Floats, reach: int, limit: float) -> tuple[Indices, Floats]:
    """Return the first samples after slips, and the apparent sizes in intervals."""
    from scipy.ndimage import maximum_filter1d

    gain, power = _tried(values, reach)
    inside = slice(2 * reach, -2 * reach)
    resolved = power > SLOW_POWER * float(np.median(power[inside]))
    resolved[: 2 * reach] = resolved[-2 * reach :] = False
    score = np.where(resolved, np.abs(gain) / np.sqrt(np.maximum(power, 1e-300)), 0.0)
    noise = normal_scale(gain[resolved] / np.sqrt(power[resolved]))
    highest = maximum_filter1d(score, 2 * reach + 1, mode="nearest")
    at = np.flatnonzero((score > limit * noise) & (score >= highest) & resolved)
    return at, gain[at] / power[at]


def _tried(values: Floats, reach: int) -> tuple[Floats, Floats]:
    """Return numerator and denominator of the least-squares slip before each sample."""
    _, weights = even_weights(SLIP_DEGREE, 2 * reach + 1)
    speed = np.zeros(values.size)
    speed[reach:-reach] = np.correlate(values, weights, "valid")
    gain, power = np.zeros(values.size), np.ones(values.size)
    offset = np.arange(-reach, reach + 1)
    basis = np.linalg.qr(np.vander(offset / reach, SLIP_DEGREE + 1))[0]
    for low in range(2 * reach, values.size - 2 * reach, _BLOCK):
        rows = np.arange(low, min(low + _BLOCK, values.size - 2 * reach))
        around = rows[:, None] + offset
        late = speed[around] * (offset >= 0)
        late -= (late @ basis) @ basis.T
        gain[rows] = np.einsum("kj,kj->k", late, values[around] - values[rows, None])
        power[rows] = np.einsum("kj,kj->k", late, late)
    return gain, power
