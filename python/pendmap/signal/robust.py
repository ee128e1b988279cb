"""Robust estimates of scale, runs in arrays, and sampling intervals of a record."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.ndimage import maximum_filter1d

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from pendmap.signal import Floats, Indices, Mask, Stretch

Z95: Final = 1.959963984540054  # 97.5 % point of the standard normal distribution
NORMAL_MAD: Final = 0.674489750196  # Median of the absolute value of a standard normal variable
LONG_INTERVAL: Final = 1.6  # Interval, in median intervals, above which samples are missing
SCATTERED_STAMPS: Final = 0.1  # Scatter, in median intervals, above which stamps are averaged
STAMPS_BESIDE: Final = 8  # Stamps on each side of a gap whose means are compared
CERTAIN_GAP: Final = 4.0  # Step of these means above which it is a gap, standard deviations


def rms(values: Floats) -> float:
    """Return the root mean square of the finite values; nan if there are none."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else np.nan


def normal_scale(values: Floats) -> float:
    """Return the standard deviation of normal values from their median absolute value."""
    return 1.4826 * float(np.median(np.abs(values))) if values.size else 0.0


def broad_scale(sizes: Floats) -> float:
    """Return the greater robust standard deviation by the median and by the 80 % quantile."""
    if not sizes.size:
        return 0.0
    half, most = np.quantile(sizes, [0.5, 0.8])
    return float(max(1.4826 * half, most / 1.2816))


def true_runs(mask: Mask) -> tuple[Indices, Indices]:
    """Return the first and last (exclusive) indices of the runs of True."""
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)


def stretches(mask: Mask) -> list[Stretch]:
    """Return the runs of True as pairs of first and last (exclusive) index."""
    low, high = true_runs(mask)
    return list(zip(low.tolist(), high.tolist(), strict=True))


def widened(mask: Mask, reach: int) -> Mask:
    """Return the mask of indices within ``reach`` of a marked one."""
    return np.asarray(maximum_filter1d(mask.view(np.uint8), 2 * reach + 1, mode="constant") > 0)


def between(stretches: list[Stretch], low: int, high: int) -> list[Stretch]:
    """Return the index ranges from ``low`` to ``high`` between sorted stretches."""
    edges = [low, *(place for stretch in stretches for place in stretch), high]
    return list(zip(edges[::2], edges[1::2], strict=True))


def equal_runs(values: Floats, least: int) -> tuple[Indices, Indices]:
    """Return first and last (exclusive) indices of runs of at least ``least`` equal values."""
    low, high = true_runs(np.diff(values) == 0)
    long = high - low + 1 >= least
    return low[long], high[long] + 1


def from_first(time: ArrayLike) -> tuple[Floats, float]:
    """Return times relative to the first, which keeps their digits, and the first time, s."""
    t = np.asarray(time, dtype=np.float64)
    if t.ndim != 1 or t.size == 0 or not np.isfinite(t[0]):
        return t, 0.0
    return t - t[0], float(t[0])


def span(time: Floats) -> str:
    """Return the time span of a record as text."""
    first, last = (f"{round(float(t), 4):.15g}" for t in (time[0], time[-1]))
    return f"{first} to {last} s"


@dataclasses.dataclass(frozen=True)
class Intervals:
    """Sampling interval and gaps of a record."""

    tick: float  # mean interval without gaps, s
    gaps: Indices  # indices of intervals that are too long
    missing: int  # samples missing in the gaps


def intervals_of(time: Floats) -> Intervals:
    """Return the sampling interval and the gaps of a record with increasing times in s.

    If the stamps scatter, an interval is a gap only if the stamps after it are late on average.
    """
    steps = np.diff(time)
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > LONG_INTERVAL * usual)
    late = steps - usual
    if normal_scale(late) > SCATTERED_STAMPS * usual and time.size > 4 * STAMPS_BESIDE:
        tick = float(np.median(_ahead(time))) / STAMPS_BESIDE
        # Stamps near an end have no stamps to compare with.
        late = np.zeros(steps.size)
        late[STAMPS_BESIDE - 1 : steps.size - STAMPS_BESIDE + 1] = (
            _ahead(time) - STAMPS_BESIDE * tick
        )
        gaps = gaps[late[gaps] > max(0.5 * tick, CERTAIN_GAP * normal_scale(late))]
        # Means near a gap contain a part of it: only the largest one marks the gap.
        highest = [np.max(late[gaps[np.abs(gaps - k) < STAMPS_BESIDE]]) for k in gaps]
        gaps = np.asarray(gaps[late[gaps] >= highest], np.intp)
        usual = tick
    whole = np.delete(steps, gaps)
    tick = float(np.mean(whole)) if gaps.size <= steps.size / 4 else usual
    return Intervals(tick, gaps, int(np.sum(np.maximum(np.round(late[gaps] / usual), 1))))


def _ahead(time: Floats) -> Floats:
    """Return the mean of the next stamps less the mean of the stamps before, s."""
    sums = np.concatenate(([0.0], np.cumsum(time - time[0])))
    means = (sums[STAMPS_BESIDE:] - sums[:-STAMPS_BESIDE]) / STAMPS_BESIDE
    return np.asarray(means[STAMPS_BESIDE:] - means[:-STAMPS_BESIDE])
