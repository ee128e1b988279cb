"""Half cycles, roughly: where a record passes its middle and how far it goes between.

This serves the checks of a record. The methods of identification have peaks and crossings of their
own, with standard errors.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


DEAD: Final = 0.05
"""Share of the amplitude nearby within which noise may cross the middle without being counted."""


@dataclasses.dataclass(frozen=True)
class Swings:
    """Half cycles of a record.

    Parameters
    ----------
    crossing : ndarray, shape (M + 1,)
        Times at which the record passes its middle, s, by straight lines between samples.
    peak_time, peak : ndarray, shape (M,)
        The farthest sample between two of them, s and rad from the middle.
    """

    crossing: Floats
    peak_time: Floats
    peak: Floats

    @property
    def period(self) -> Floats:
        """Whole periods around the peaks but the first and last, s, shape (M - 2,)."""
        halves = np.diff(self.crossing)
        return np.asarray((halves[:-2] + 2 * halves[1:-1] + halves[2:]) / 2)


def after_turns(theta: Floats) -> int:
    """Return where a record about 0 begins to swing: it may go over the top before."""
    if not theta.size or abs(float(theta[0])) <= math.pi:
        return 0
    passed = np.flatnonzero(theta * theta[0] <= 0)
    return int(passed[0]) if passed.size else 0


def swings(time: Floats, theta: Floats, *, least: float = 0.0) -> Swings:
    """Return the half cycles of a record about 0 that go farther than ``least``."""
    none = np.empty(0)
    # The sign last seen outside a dead band; the band is narrow where the swing is.
    band = max(least, DEAD * float(np.quantile(np.abs(theta), 0.5)) if theta.size else 0.0)
    state = np.where(theta > band, 1, np.where(theta < -band, -1, 0))
    seen = np.flatnonzero(state)
    if seen.size == 0:
        return Swings(none, none, none)
    signs = state[seen]
    turns = np.flatnonzero(signs[1:] != signs[:-1])
    before, after = seen[turns], seen[turns + 1]
    crossing = _crossings(time, theta, before, after)
    count = max(crossing.size - 1, 0)
    peak_time, peak = np.empty(count), np.empty(count)
    for k in range(count):
        low, high = after[k], before[k + 1]
        at = low + int(np.argmax(np.abs(theta[low : high + 1])))
        peak_time[k], peak[k] = time[at], theta[at]
    return Swings(crossing, peak_time, peak)


def _crossings(
    time: Floats, theta: Floats, before: NDArray[np.intp], after: NDArray[np.intp]
) -> Floats:
    """Where straight lines through the samples around the band pass 0."""
    rise = theta[after] - theta[before]
    share = -theta[before] / np.where(rise == 0, 1.0, rise)
    return np.asarray(time[before] + share * (time[after] - time[before]))
