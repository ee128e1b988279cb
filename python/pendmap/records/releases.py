"""Releases of a free record: where a motion begins and ends that nobody touches."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.hand import touched, without_hand
from pendmap.records.swings import after_turns, swings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Places = tuple[int, int]

__all__ = ["enough", "grown", "held_short", "releases"]

RISE: Final = 0.1
"""Share of the largest swing by which a free swing grows only if somebody helps."""

HELD: Final = 1.5
"""Times longer than a release from rest takes to be seen, from where it was held before."""

UPRIGHT: Final = 2.7
"""Angle in rad beyond which a pendulum leaves so slowly that a hold cannot be told."""

FEWEST_HELD: Final = 10
"""Samples of a hold that show whether it is quiet."""

FEWEST: Final = 5
"""Half cycles of a release that is worth a run: three swings from a hand have five between its
first and last passage of the middle."""


def releases(  # noqa: PLR0913, PLR0917 (a record and what is known of its motion)
    work: Work,
    parts: list[Places],
    middle: float,
    limit: float,
    period: float,
    noise: float,
) -> list[Places]:
    """Divide motions into stretches that nobody touches, in order.

    Parameters
    ----------
    work : Work
        A free record.
    parts : list of (int, int)
        Where it moves: first place and the one after the last.
    middle : float
        What it swings about, rad.
    limit : float
        Within what nothing moves, rad.
    period : float
        Of small swings, s.
    noise : float
        Of a reading, rad.
    """
    hand = touched(work, period)
    free = [
        (_let_go(work, part, hand, period, noise), part[1])
        for part in without_hand(work.time, parts, hand, period)
    ]
    return [piece for part in free for piece in grown(work, part, middle, limit)]


def _let_go(work: Work, part: Places, hand: NDArray[np.bool_], period: float, noise: float) -> int:
    """Return where a motion begins after a quiet hold, closer than a hand is known to let go."""
    low, high = part
    before, sure = (
        int(np.searchsorted(work.time, work.time[low] - share * period)) for share in (0.5, 0.2)
    )
    hold = work.theta[before:sure]
    if hold.size < FEWEST_HELD or not hand[before:low].all():
        return low
    # A hand that trembles drifts more than noise does.
    early, late = np.array_split(hold, 2)
    drift = abs(float(np.mean(early) - np.mean(late)))
    span = max(6 * noise, 2 * work.count)
    if np.ptp(hold) > span or drift > max(4 * noise / math.sqrt(hold.size), work.count / 4):
        return low
    found = held_short(work, (before, high), period, noise)
    return low if found is None else min(low, found)


def enough(work: Work, part: Places, middle: float, limit: float) -> bool:
    """Whether a release has the swings to be worth a run."""
    good = np.flatnonzero(work.trusted[slice(*part)]) + part[0]
    if not good.size:
        return False
    theta = work.theta[good] - middle
    theta -= 2 * math.pi * round(float(np.median(theta)) / (2 * math.pi))  # carried round once
    start = after_turns(theta)
    return swings(work.time[good][start:], theta[start:], least=limit).peak.size >= FEWEST


def grown(work: Work, part: Places, middle: float, limit: float) -> list[Places]:
    """Divide a motion where the swing grows: somebody took the pendulum and let it go again."""
    low, high = part
    good = np.flatnonzero(work.trusted[low:high]) + low
    if good.size < 5:
        return []
    good = good[after_turns(work.theta[good] - middle) :]
    half = swings(work.time[good], work.theta[good] - middle, least=limit)
    size = np.abs(half.peak)
    if size.size < 4:
        return [part]
    # Neighbours together: an offset makes every other half cycle larger.
    pairs = np.maximum(size[:-1], size[1:])
    rise = max(RISE * float(size.max()), 2 * limit)
    cuts: list[Places] = []
    least, at = pairs[0], 0
    k = 1
    while k < pairs.size:
        if pairs[k] < least:
            least, at = pairs[k], k
        elif pairs[k] > least + rise:
            top = k
            while top + 1 < pairs.size and pairs[top + 1] > pairs[top] * 1.001:
                top += 1
            peak = top + int(size[top + 1] > size[top]) if top + 1 < size.size else top
            stop = int(np.searchsorted(work.time, half.peak_time[min(at + 1, size.size - 1)]))
            go = int(np.searchsorted(work.time, half.peak_time[peak]))
            cuts.append((stop, go))
            least, at, k = pairs[top], top, top
        k += 1
    edges = [low, *(place for cut in cuts for place in cut), high]
    pieces = zip(edges[::2], edges[1::2], strict=True)
    return [(a, b) for a, b in pieces if b - a > 5]


def held_short(work: Work, part: Places, period: float, noise: float) -> int | None:
    """Return where a motion begins that was held for less than a period before."""
    low = part[0]
    if not work.trusted[low : low + 5].all():
        return None
    theta, time = work.theta[low : part[1]], work.time[low : part[1]]
    start = float(np.median(theta[:5]))
    seen = max(6 * noise, 1.5 * work.count, 1e-4)
    left = np.flatnonzero(np.abs(theta - start) > seen)
    w0 = 2 * math.pi / period
    if not left.size or abs(start) > UPRIGHT or abs(math.sin(start)) < 0.05:
        return None
    usual = math.sqrt(2 * seen / (w0**2 * abs(math.sin(start))))
    interval = float(np.median(np.diff(work.time)))
    still = float(time[left[0]] - time[0])
    if still <= HELD * usual + 4 * interval:
        return None
    return low + max(int(np.searchsorted(time, time[left[0]] - usual)), 0)
