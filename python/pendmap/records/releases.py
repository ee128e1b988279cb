"""Releases of a free record: motions between holds, drives, brakes, pushes, or by a trigger.

A free motion loses no more from a smaller swing than from a larger one before it, but for a gradual
rise: where the loss of a swing rises at an instant to ``SHARPER`` times what it was, a drive ended
there if the swings before did not fall, or else a brake began.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted, listed
from pendmap.signal.half_cycles import after_turns, swings
from pendmap.signal.local_polynomial import local_fit
from pendmap.signal.robust import normal_scale, stretches, widened

if TYPE_CHECKING:
    from pendmap.records.work import Work
    from pendmap.signal import Floats, Indices, Mask, Stretch
    from pendmap.signal.half_cycles import Swings
    from pendmap.tables.findings import Finding

RELEASE_RISE: Final = 0.1  # Relative growth of a swing that only a hand causes
LONG_HALF: Final = 1.4  # Duration of a half cycle, over the usual one, that only a hand causes
HELD_LONGER: Final = 1.5  # Delay, over that of a release from rest, above which there is a hold
LEFT: Final = 0.2  # Angle, rad, or a quarter of it, by which a motion has left a hold
NEAR_UPRIGHT: Final = 0.05  # Sine of an angle below which a release is too slow to detect
BETWEEN_LEVELS: Final = 0.02  # Greatest share of samples between the two levels of a trigger
DEAD_BAND: Final = 0.2  # Half-width of the hysteresis band, over the distance of the levels
RELEASES_APART: Final = 3.0  # Least time between releases, periods of small swings


def releases(work: Work, parts: list[Stretch]) -> list[Stretch]:
    """Return the stretches of motions ``parts`` that begin with a release, in order."""
    pieces = parts
    if not (math.isfinite(work.plan.from_s) and math.isfinite(work.plan.to_s)):  # not by hand
        pieces = [free_part(work, piece) for part in parts for piece in grown(work, part)]
        pieces = [untouched(work, part) for piece in pieces for part in pushes(work, piece)]
        pieces = [part for part in pieces if part[1] - part[0] > 5]
    begin = held_short(work, pieces[0]) if pieces else None
    return pieces if begin is None else [(begin, pieces[0][1]), *pieces[1:]]


def _let_go(work: Work, good: Indices, until: int) -> int:
    """Return the index at which a motion has left a hold; ``until`` it first passes the middle."""
    fall = good[(work.time[good] > work.time[until] - 0.3 * work.period) & (good < until)]
    away = np.abs(work.theta[fall] - work.middle)
    held = fall[away > max(0.75 * away.max(initial=0.0), away.max(initial=0.0) - LEFT)]
    return int(held[-1]) + 1 if held.size else until


def grown(work: Work, part: Stretch) -> list[Stretch]:
    """Divide a motion where a hand took the pendulum: swings that grow or last too long."""
    from scipy.ndimage import median_filter

    low, high = part
    good, theta, half = half_cycles(work, part)
    time = work.time[good]
    if half.peak.size < 4:
        return [part]
    # The readings after the last crossing may be those of a hand.
    late = np.max(np.abs(theta[time > half.crossing[-1]]), initial=0.0)
    size, crossing = np.append(np.abs(half.peak), late), np.append(half.crossing, time[-1])
    places = np.searchsorted(work.time, crossing).tolist()
    lasts, steps = np.diff(half.crossing), np.diff(time)
    long = lasts > LONG_HALF * median_filter(lasts, 5, mode="nearest")
    for k in np.flatnonzero(steps > GAP * np.median(steps)).tolist():
        long &= (half.crossing[1:] < time[k]) | (half.crossing[:-1] > time[k + 1])
    # The half cycle before may be that of the hand, too.
    hands = [
        (places[max(k - 1, 0)], _let_go(work, good, places[k + 1]))
        for k in np.flatnonzero(long).tolist()
    ]
    if work.trusted[high:].any() and abs(theta[-1]) > RELEASE_RISE * size.max():
        hands.append((places[-2], high))  # a hold follows
    before = np.abs(theta[time < crossing[0]])
    if np.argmax(before) and (1 + RELEASE_RISE) * before.max() + 2 * work.limit < size[1]:
        hands.append((low, places[int(np.argmax(size)) + 1]))  # pushed from rest
    # Pairs of neighbours: an offset makes every other half cycle larger.
    pairs = np.maximum(size[:-1], size[1:])
    # A single outlier raises two pairs.
    lasting = np.minimum(pairs, np.append(pairs[2:], np.full(2, pairs[-1])))
    least, at = pairs[0], 0
    k = 1
    while k < pairs.size:
        if pairs[k] < least:
            least, at = pairs[k], k
        elif lasting[k] > (1 + RELEASE_RISE) * least + 2 * work.limit:
            top = k
            while top + 1 < pairs.size and pairs[top + 1] > pairs[top] * 1.001:
                top += 1
            top += int(np.argmax(size[top : top + 2]))
            hands.append((places[at + 1], _let_go(work, good, places[top + 1])))
            top = min(top, pairs.size - 1)
            least, at, k = pairs[top], top, top
        k += 1
    free = np.ones(high - low, bool)
    for begin, end in hands:
        free[begin - low : end - low] = False
    return [(low + a, low + b) for a, b in stretches(free) if b - a > 5]


def held_short(work: Work, part: Stretch) -> int | None:
    """Return the index at which a motion leaves a hold of less than a period.

    Returns None if it leaves its first level as early as after a release from rest.
    """
    low, high = part
    good = np.flatnonzero(work.trusted[low:high]) + low
    level = float(np.median(work.theta[low : low + 5]))
    seen = max(6 * work.noise, 1.5 * work.count, 1e-4)
    moved = np.abs(work.theta[good] - level)
    away = np.flatnonzero(np.minimum(moved[:-2], np.minimum(moved[1:-1], moved[2:])) > seen)
    pull = abs(math.sin(level - work.middle))
    if not away.size or pull < NEAR_UPRIGHT or not work.trusted[low : low + 5].all():
        return None
    far = max(min(LEFT, abs(level - work.middle) / 4), 2 * seen)
    left, fallen = int(good[away[0]]), int(good[int(np.argmax(moved > far))])
    usual = np.sqrt(2 * np.array((seen, far)) / pull) * work.period / math.tau
    longest = HELD_LONGER * usual + 4 * float(np.median(np.diff(work.time)))
    held, trembles = np.diff(work.time[[low, left, fallen]]) > longest
    return fallen if trembles else left if held else None


def edges_of(values: Floats, edge: str | None = None) -> tuple[Indices, str]:
    """Return the first samples after each edge, by default rising ones, and their direction."""
    seen = values[np.isfinite(values)]
    low, high = float(np.min(seen, initial=np.inf)), float(np.max(seen, initial=-np.inf))
    middle, band = (low + high) / 2, DEAD_BAND * (high - low)
    if not low < high or np.mean(np.abs(seen - middle) < band) > BETWEEN_LEVELS:
        return np.empty(0, np.intp), "of two levels"
    places = np.flatnonzero(np.abs(values - middle) > band)
    above = (values[places] > middle).astype(np.int8)
    turns = np.diff(above, prepend=above[0])
    rising, falling = places[turns > 0], places[turns < 0]
    edge = edge or ("rising" if rising.size or not falling.size else "falling")
    return (rising if edge == "rising" else falling), edge


def marked(work: Work) -> Finding | None:
    """Keep the motion after each edge of a trigger that marks releases."""
    if not work.parts or "trigger" not in work.extra:
        return None
    places, edge = edges_of(work.extra["trigger"], work.edge)
    edges: list[int] = []  # without bounces
    for k in places.tolist():
        if not edges or work.time[k] - work.time[edges[-1]] > work.period:
            edges.append(k)
    apart = np.diff(work.time[edges])
    often = apart.size and np.median(apart) < RELEASES_APART * work.period
    motions = []
    for low, high in itertools.pairwise([] if often else [*edges, work.time.size]):
        after = [(max(a, low), min(b, high)) for a, b in work.parts if a < high and b > low]
        if after:
            a, b = max(after, key=lambda part: part[1] - part[0])
            # The trigger locates the release to a sample, the angle to a fraction of a swing.
            motions.append((low if work.time[a] - work.time[low] < work.period else a, b))
    if not motions:
        return work.finding("trigger-unlike", edge=edge)
    work.parts = motions
    times = listed([f"{work.time[k]:.6g}" for k in edges], 6)
    number = counted(len(edges), "release")
    return work.finding("trigger-release", edge=edge, releases=number, times=times)


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
    if work.edges or time[-1] - time[0] < LAST * work.period:
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
