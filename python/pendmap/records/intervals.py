"""The intervals of a clock: its tick, and where samples are missing from it."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.robust import normal_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["Intervals", "intervals_of"]

GAP: Final = 1.6
"""Intervals in units of the tick from which samples are missing: one lost sample makes 2."""

SCATTERED: Final = 0.1
"""Robust scatter of the intervals, in ticks, from which a long one alone says nothing."""

BESIDE: Final = 8
"""Stamps on each side whose means tell a lost sample from a stamp that is off: they know a step of
the clock by half the scatter of one stamp."""

CERTAIN: Final = 4.0
"""Standard deviations beyond which such a step is none of the clock's own."""


@dataclasses.dataclass(frozen=True)
class Intervals:
    """What the intervals of a clock show.

    Parameters
    ----------
    tick : float
        Mean interval without gaps, s: with none, the whole over the number of intervals.
    gaps : ndarray of int
        Which intervals are too long for their clock.
    missing : int
        Samples that are missing in them.
    """

    tick: float
    gaps: NDArray[np.intp]
    missing: int


def intervals_of(time: Floats) -> Intervals:
    """Return the tick of a clock and its gaps.

    Where the stamps scatter, an interval is a gap only if the stamps after it, together, are late:
    a stamp that is off makes a long interval and a short one, and nothing is missing.

    Parameters
    ----------
    time : ndarray, shape (N,)
        s, increasing; two and more.
    """
    steps = np.diff(time)
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP * usual)
    late = steps - usual
    if normal_scale(late) > SCATTERED * usual and time.size > 4 * BESIDE:
        tick = float(np.median(_ahead(time))) / BESIDE
        # Next to an end there are no stamps to compare with.
        late = np.zeros(steps.size)
        late[BESIDE - 1 : steps.size - BESIDE + 1] = _ahead(time) - BESIDE * tick
        gaps = gaps[late[gaps] > max(0.5 * tick, CERTAIN * normal_scale(late))]
        # Beside a gap the means show part of it.
        gaps = np.asarray([k for k in gaps if late[k] >= _highest(late, gaps, int(k))], np.intp)
        usual = tick
    whole = np.delete(steps, gaps)
    tick = float(np.mean(whole)) if gaps.size <= steps.size / 4 else usual
    return Intervals(tick, gaps, int(np.sum(np.maximum(np.round(late[gaps] / usual), 1))))


def _ahead(time: Floats) -> Floats:
    """Return by how much the mean of the next stamps is after the mean of as many before, s."""
    sums = np.concatenate(([0.0], np.cumsum(time - time[0])))
    means = (sums[BESIDE:] - sums[:-BESIDE]) / BESIDE
    return np.asarray(means[BESIDE:] - means[:-BESIDE])


def _highest(late: Floats, gaps: NDArray[np.intp], k: int) -> float:
    near = gaps[np.abs(gaps - k) < BESIDE]
    return float(np.max(late[near]))
