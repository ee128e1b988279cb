"""Releases of a free record: motions between holds by hand, and those that a trigger marks."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted, listed
from pendmap.records.driven import GAP, free_part, half_cycles, pushes, untouched
from pendmap.signal.robust import stretches

if TYPE_CHECKING:
    from pendmap.records.work import Work
    from pendmap.signal import Floats, Indices, Stretch
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
