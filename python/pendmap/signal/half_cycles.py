"""Half cycles of a record, without standard errors, for checks.

The identification methods compute other peaks and crossings, with standard errors.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from pendmap.signal import Floats


DEAD_BAND: Final = 0.05  # Half width of the dead band about 0, in median absolute angles


@dataclasses.dataclass(frozen=True)
class Swings:
    """Half cycles of a record about 0."""

    crossing: Floats  # s, linear between samples, shape (M + 1,)
    peak_time: Floats  # s, of the farthest sample between two crossings, shape (M,)
    peak: Floats  # rad from the middle, shape (M,)

    @property
    def middle(self) -> Floats:
        """Midpoint of the oscillation at each peak but the first and last, rad, shape (M - 2,).

        Weights (1, 2, 1) cancel the bias of the mean of two turning points due to decay.
        """
        return (self.peak[:-2] + 2 * self.peak[1:-1] + self.peak[2:]) / 4

    @property
    def period(self) -> Floats:
        """Period about each peak but the first and last, s, shape (M - 2,)."""
        halves = np.diff(self.crossing)
        return np.asarray((halves[:-2] + 2 * halves[1:-1] + halves[2:]) / 2)


def after_turns(theta: Floats) -> int:
    """Return the index at which a record about 0 begins to oscillate, after rotations."""
    if not theta.size or abs(float(theta[0])) <= math.pi:
        return 0
    passed = np.flatnonzero(theta * theta[0] <= 0)
    return int(passed[0]) if passed.size else 0


def swings(time: Floats, theta: Floats, *, least: float = 0.0) -> Swings:
    """Return the half cycles of a record about 0 that exceed ``least``."""
    # Sign of the angle outside the dead band, 0 inside.
    band = max(least, DEAD_BAND * float(np.quantile(np.abs(theta), 0.5)) if theta.size else 0.0)
    state = np.where(theta > band, 1, np.where(theta < -band, -1, 0))
    seen = np.flatnonzero(state)
    signs = state[seen]
    turns = np.flatnonzero(signs[1:] != signs[:-1])
    before, after = seen[turns], seen[turns + 1]
    # Crossings by linear interpolation between the samples on both sides of the band.
    rise = theta[after] - theta[before]
    share = -theta[before] / np.where(rise == 0, 1.0, rise)
    crossing = time[before] + share * (time[after] - time[before])
    count = max(crossing.size - 1, 0)
    peak_time, peak = np.empty(count), np.empty(count)
    for k in range(count):
        low, high = after[k], before[k + 1]
        at = low + int(np.argmax(np.abs(theta[low : high + 1])))
        peak_time[k], peak[k] = time[at], theta[at]
    return Swings(crossing, peak_time, peak)
