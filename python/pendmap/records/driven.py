"""Motions that are not free: a start that is driven, an end that is braked, a push.

A free motion loses no more from a smaller swing than from a larger one before it, but for a gradual
rise: where the loss of a swing rises at an instant to ``SHARPER`` times what it was, a drive ended
there if the swings before did not fall, or else a brake began.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.signal.half_cycles import after_turns, swings
from pendmap.signal.robust import widened

if TYPE_CHECKING:
    from pendmap.records.work import Work
    from pendmap.signal import Floats, Mask, Stretch

SHARPER: Final = 4.0  # Rise of the loss at an instant, and not gradually, that no free motion has
CERTAIN: Final = 6.0  # Standard errors of such a rise
FEWEST: Final = 4  # Fewest half cycles before and after it
MOST_PLACES: Final = 300  # Most instants that are tried
LEAST_ERROR: Final = 1e-3  # Least error of an amplitude, over the largest
SUDDEN: Final = 0.1  # Least change of an amplitude by a push, over the amplitude
GAP: Final = 4.0  # Intervals without a reading that make an amplitude uncertain
TWICE: Final = 2.0  # Loss by a push over that of the swing before


@dataclasses.dataclass(frozen=True)
class Course:
    """Amplitudes of the half cycles of a motion."""

    time: Floats  # s, of the turning points, shape (M,)
    size: Floats  # amplitude, rad, shape (M,)
    error: float  # standard error of an amplitude, rad
    gap: Mask  # whether readings are missing in a half cycle, shape (M,)


def course(work: Work, part: Stretch) -> Course:
    """Return the amplitudes of half sines fitted to the half cycles of a motion."""
    good = np.flatnonzero(work.trusted[slice(*part)]) + part[0]
    good = good[after_turns(work.theta[good] - work.middle) :]
    time, theta = work.time[good], work.theta[good] - work.middle
    half = swings(time, theta, least=work.limit)
    count = half.peak.size
    at = np.searchsorted(half.crossing, time, side="right") - 1
    inside = (at >= 0) & (at < count)
    at, time, theta = at[inside], time[inside], theta[inside]
    sine = np.sin(np.pi * (time - half.crossing[at]) / np.diff(half.crossing)[at])
    square = np.maximum(np.bincount(at, sine**2, count), 1e-9)
    size = np.abs(np.bincount(at, sine * theta, count)) / square
    error = max(work.noise, work.count / 4) * math.sqrt(2 * count / max(time.size, 1))
    error = max(error, LEAST_ERROR * float(size.max(initial=0.0)))
    steps, gap = np.diff(time), np.zeros(count, bool)
    for k in (
        np.flatnonzero(steps > GAP * np.median(steps)) if steps.size and not work.edges else ()
    ):
        gap[at[k] : at[k + 1] + 1] = True
    return Course(half.peak_time, size, error, gap)


def pushes(work: Work, part: Stretch) -> list[Stretch]:
    """Return the parts of a motion between pushes, by which its amplitude changes in one swing."""
    swing = course(work, part)
    pair = (swing.size[:-1] + swing.size[1:]) / 2  # without an offset of the middle
    loss = np.append(pair[:-2] - pair[2:], 0.0)
    usual = np.maximum(loss[:-3], 0.0)
    much = SUDDEN * pair[2:-2] + CERTAIN * swing.error
    size = np.abs(loss)
    high = (loss[2:-1] > TWICE * usual + much) | (-loss[2:-1] > much)
    top = (size[2:-1] >= size[1:-2]) & (size[2:-1] > size[3:])
    after = np.flatnonzero(high & top) + 4
    after = after[~widened(swing.gap, 3)[after]]
    edges = np.searchsorted(work.time, np.stack((swing.time[after - 1], swing.time[after])))
    ends = [part[0], *edges.T.ravel().tolist(), part[1]]
    return list(zip(ends[::2], ends[1::2], strict=True))


def free_part(work: Work, part: Stretch) -> Stretch:
    """Return a motion without a driven start or a braked end; by from_s and to_s all is free."""
    low, high = part
    swing = course(work, part)
    knee = _knee(swing) if swing.size.size > 2 * FEWEST else None
    if knee is None:
        return part
    at, falls = knee
    edge = int(np.searchsorted(work.time, np.interp(at, np.arange(swing.size.size), swing.time)))
    if np.isfinite(work.plan.to_s if falls else work.plan.from_s):
        return part
    work.cut.append((edge, high) if falls else (low, edge))
    return (low, edge) if falls else (edge, high)


def _knee(swing: Course) -> tuple[float, bool] | None:
    """Return the half cycle at which the loss rises, and whether the swings fell before."""
    stride = -(-swing.size.size // MOST_PLACES)
    whole = swing.size.size - swing.size.size % stride
    size = swing.size[:whole].reshape(-1, stride).mean(axis=1)
    time = swing.time[:whole].reshape(-1, stride).mean(axis=1)
    time = time / np.median(np.diff(time))
    best, answer = CERTAIN, None
    for m in range(FEWEST - 1, size.size - FEWEST):
        end = min(size.size, 2 * m + 5)
        k = time[:end] - time[m]
        after = np.maximum(k, 0)
        columns = [np.ones(end), k, after, k > 0, (-1.0) ** np.arange(end), after**2]
        rows = np.column_stack(columns[: 6 if end - m > 2 * FEWEST else 5])
        answers, _, rank, _ = np.linalg.lstsq(rows, size[:end], rcond=None)
        if rank < rows.shape[1]:
            continue
        left = size[:end] - rows @ answers
        scale = max(float(left @ left) / max(end - rank, 1), swing.error**2)
        spread = np.sqrt(scale * np.diag(np.linalg.inv(rows.T @ rows)))
        before, rise = -answers[1], -answers[2]
        excess = (before + rise) / SHARPER - before
        certain = float(rise / spread[2])
        if certain > best and excess > CERTAIN / 2 * math.hypot(spread[1], spread[2] / SHARPER):
            best, answer = certain, ((m + 0.5) * stride, bool(before > CERTAIN * spread[1]))
    return answer
