"""Standard deviations that some false samples do not change."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Places = NDArray[np.intp]
    from numpy.typing import ArrayLike, NDArray


def normal_scale(values: Floats) -> float:
    """Return the standard deviation of normal values from the median of their sizes, robust."""
    return 1.4826 * float(np.median(np.abs(values))) if values.size else 0.0


def broad_scale(sizes: Floats) -> float:
    """Return a standard deviation from sizes, robust, that knows of long tails.

    The larger of those that the median and the 80 % quantile show: where noise changes with speed,
    or has long tails, the median alone is half of it. A tenth of false samples changes neither.
    """
    if not sizes.size:
        return 0.0
    half, most = np.quantile(sizes, [0.5, 0.8])
    return float(max(1.4826 * half, most / 1.2816))


# Stretches of an array.


def true_runs(mask: NDArray[np.bool_]) -> tuple[Places, Places]:
    """Return where stretches of True begin and end (the place after the last)."""
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)


def equal_runs(values: NDArray[np.float64], least: int) -> tuple[Places, Places]:
    """Return where stretches of at least ``least`` equal values begin and end."""
    low, high = true_runs(np.diff(values) == 0)
    long = high - low + 1 >= least
    return low[long], high[long] + 1


# Times counted from a record's first sample: time stamps leave no digits for what happens.


def from_first(time: ArrayLike) -> tuple[NDArray[np.float64], float]:
    """Return times from the first one on, and the first one, s."""
    t = np.ascontiguousarray(time, dtype=np.float64)
    if t.ndim != 1 or t.size == 0 or not np.isfinite(t[0]):
        return t, 0.0
    return t - t[0], float(t[0])


def span(time: NDArray[np.float64]) -> str:
    """Return which part of its own clock a record covers, in words."""
    first, last = (f"{round(float(t), 4):.15g}" for t in (time[0], time[-1]))
    return f"{first} to {last} s"


# The intervals of a clock: its tick, and where samples are missing from it.


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
