"""Motions that are not free: a start that is driven, an end that is braked, a push.

A free motion loses no more from a smaller swing than from a larger one before it, but for a gradual
rise: where the loss of a swing rises at an instant to ``SHARPER`` times what it was, a drive ended
there if the swings before did not fall, or else a brake began.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.signal.half_cycles import after_turns, swings
from pendmap.signal.local_polynomial import local_fit
from pendmap.signal.robust import normal_scale, widened

if TYPE_CHECKING:
    from pendmap.records.work import Work
    from pendmap.signal import Floats, Indices, Mask, Stretch
    from pendmap.signal.half_cycles import Swings

SHARPER: Final = 4.0  # Rise of the loss at an instant, and not gradually, that no free motion has
CERTAIN: Final = 6.0  # Standard errors of such a rise
FEWEST: Final = 4  # Fewest half cycles before and after it
MOST_PLACES: Final = 300  # Most instants that are tried
LEAST_ERROR: Final = 1e-3  # Least error of an amplitude, over the largest
SUDDEN: Final = 0.1  # Least change of an amplitude by a push, over the amplitude
GAP: Final = 4.0  # Intervals without a reading that make a half cycle uncertain
TWICE: Final = 2.0  # Loss by a push over that of the swing before
LAST: Final = 4.0  # Swings at each end of a motion in which a hand may have it


def half_cycles(work: Work, part: Stretch) -> tuple[Indices, Floats, Swings]:
    """Return indices and angles of a motion about its middle, after turns, and its half cycles."""
    good = np.flatnonzero(work.trusted[slice(*part)]) + part[0]
    good = good[after_turns(work.theta[good] - work.middle) :]
    theta = work.theta[good] - work.middle
    return good, theta, swings(work.time[good], theta, least=work.limit)


def course(work: Work, part: Stretch) -> tuple[Floats, Floats, float, Mask]:
    """Return times, amplitudes by fitted half sines, their error, and gaps of half cycles."""
    good, theta, half = half_cycles(work, part)
    time = work.time[good]
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
    if steps.size and not work.edges:
        for k in np.flatnonzero(steps > GAP * np.median(steps)):
            gap[at[k] : at[k + 1] + 1] = True
    return half.peak_time, size, error, gap


def pushes(work: Work, part: Stretch) -> list[Stretch]:
    """Return the parts of a motion between pushes, by which its amplitude changes in one swing."""
    time, size, error, gap = course(work, part)
    pair = (size[:-1] + size[1:]) / 2  # without an offset of the middle
    loss = np.append(pair[:-2] - pair[2:], 0.0)
    usual = np.maximum(loss[:-3], 0.0)
    much = SUDDEN * pair[2:-2] + CERTAIN * error
    step = np.abs(loss)
    high = (loss[2:-1] > TWICE * usual + much) | (-loss[2:-1] > much)
    top = (step[2:-1] >= step[1:-2]) & (step[2:-1] > step[3:])
    after = np.flatnonzero(high & top) + 4
    after = after[~widened(gap, 3)[after]]
    edges = np.searchsorted(work.time, np.stack((time[after - 1], time[after])))
    ends = [part[0], *edges.T.ravel().tolist(), part[1]]
    return list(zip(ends[::2], ends[1::2], strict=True))


def untouched(work: Work, part: Stretch) -> Stretch:
    """Return a motion from half a swing after, and to half a swing before, a hand has it."""
    half = work.period / 2
    wide = work.time[part[0]] - half, work.time[part[1] - 1] + half
    good, theta, _ = half_cycles(work, tuple(np.searchsorted(work.time, wide).tolist()))
    time = work.time[good]
    if work.edges or work.angle_source or time[-1] - time[0] < LAST * work.period:
        return part
    inner = np.quantile(theta[theta.size // 4 : -theta.size // 4], (0.02, 0.98))
    stride = max(round(half / 20 / float(np.median(np.diff(time)))), 1)  # 40 a swing
    fit = local_fit(time, theta, stride=stride)
    bend = 2 * np.sin((theta[fit.middle] - inner.mean()) / 2)
    at, size = time[fit.middle][::stride], np.hypot(fit.slope * half / math.pi, bend)[::stride]
    end, begin = _taken(at, size, half, work.limit), _taken(-at[::-1], size[::-1], half, work.limit)
    first, last = np.searchsorted(work.time, (-begin, end)).tolist()
    return max(part[0], first), min(part[1], last)


def _taken(time: Floats, size: Floats, half: float, limit: float) -> float:
    """Return the time half a swing before the energy changes as by a push in the last swings."""
    before = np.interp(time - 2 * half, time, size)  # an offset of the middle is the same
    loss = before - size
    for k in np.flatnonzero((time > time[-1] - 2 * LAST * half) & (before > 4 * limit)).tolist():
        usual = loss[(time < time[k] - half) & (time > time[k] - 5 * half)]
        middle = float(np.median(usual)) if usual.size else math.inf
        much = SUDDEN * before[k] + CERTAIN * normal_scale(usual - middle)
        if abs(loss[k]) > TWICE * abs(middle) + much:
            return float(time[k]) - half
    return math.inf


def free_part(work: Work, part: Stretch) -> Stretch:
    """Return a motion without a driven start or a braked end; by from_s and to_s all is free."""
    low, high = part
    time, size, error, _ = course(work, part)
    knee = _knee(time, size, error) if size.size > 2 * FEWEST else None
    if knee is None:
        return part
    at, falls = knee
    edge = int(np.searchsorted(work.time, np.interp(at, np.arange(size.size), time)))
    if np.isfinite(work.plan.to_s if falls else work.plan.from_s):
        return part
    work.cut.append((edge, high) if falls else (low, edge))
    return (low, edge) if falls else (edge, high)


def _knee(time: Floats, size: Floats, error: float) -> tuple[float, bool] | None:
    """Return the half cycle at which the loss rises, and whether the swings fell before."""
    time = time / np.median(np.diff(time))
    best, answer = CERTAIN, None
    for m in range(FEWEST - 1, size.size - FEWEST, size.size // MOST_PLACES + 1):
        end = min(size.size, 2 * m + 5)
        k = time[:end] - time[m]
        after = np.maximum(k, 0)
        columns = [np.ones(end), k, after, k > 0, (-1.0) ** np.arange(end), after**2]
        rows = np.column_stack(columns[: 6 if end - m > 2 * FEWEST else 5])
        answers, _, rank, _ = np.linalg.lstsq(rows, size[:end], rcond=None)
        if rank < rows.shape[1]:
            continue
        left = size[:end] - rows @ answers
        scale = max(float(left @ left) / max(end - rank, 1), error**2)
        spread = np.sqrt(scale * np.diag(np.linalg.inv(rows.T @ rows)))
        before, rise = -answers[1], -answers[2]
        excess = (before + rise) / SHARPER - before
        certain = float(rise / spread[2])
        if certain > best and excess > CERTAIN / 2 * math.hypot(spread[1], spread[2] / SHARPER):
            best, answer = certain, (m + 0.5, bool(before > CERTAIN * spread[1]))
    return answer
