"""Permanent jumps of a reading: counts that an encoder missed, turns that it slipped.

A push changes the velocity of a pendulum, never its angle at once: a jump of the angle that stays
is the sensor's.
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.noise import normal_scale
from pendmap.words import counted

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]

__all__ = ["find_steps"]

SIDE: Final = 8
"""Samples on each side that a jump is seen against."""

DEGREE: Final = 5
"""Of the polynomial that the motion is taken for, with the jump, over 16 samples."""

CLEAR: Final = 9.0
"""Standard deviations that make a jump: there are many places and noise is not always normal."""

WHOLE: Final = 0.2
"""Counts by which a jump may miss a whole number of them and be mended by that number."""

MOST: Final = 20
"""Jumps beyond which it is not counts that are missed."""


def find_steps(work: Work) -> None:
    """Mend jumps by a whole number of counts; of others keep the longest part, and say so."""
    if work.time.size < 6 * SIDE:
        return
    theta = work.theta.copy()
    bad = ~work.trusted
    if bad.any() and not bad.all():
        theta[bad] = np.interp(work.time[bad], work.time[~bad], theta[~bad])
    jumps = _jumps(work.time, theta, work.count)
    if not 0 < len(jumps) <= MOST:
        return
    sizes = [size for _, size, _ in jumps]
    places = np.asarray([at for at, _, _ in jumps], np.intp)
    whole = [_whole(size, error, work.count) for _, size, error in jumps]
    if all(whole):
        for at, count in zip(places, whole, strict=True):
            work.theta[at:] -= count * work.count
        said = ", ".join(f"{count:+d}" for count in whole[:4])
        text = f"{counted(len(jumps), 'jump')} of the reading by {said} counts, taken back"
        work.say("missed-counts", text, mended=True, at=places)
        return
    edges = [0, *places.tolist(), work.time.size]
    longest = int(np.argmax(np.diff(edges)))
    keep = np.zeros(work.time.size, bool)
    keep[edges[longest] : edges[longest + 1]] = True
    work.trusted &= keep
    said = ", ".join(f"{size:+.3g}" for size in sizes[:4])
    text = (
        f"{counted(len(jumps), 'jump')} of the reading ({said} rad) that stay: the zero is not the"
        f" same before and after; {work.time[edges[longest]]:.6g} to"
        f" {work.time[edges[longest + 1] - 1]:.6g} s is for fitting"
    )
    work.say("missed-counts", text, at=places)


def _whole(size: float, error: float, count: float) -> int:
    """Return the counts of a jump, 0 where they are not certain."""
    if not count or error > WHOLE * count:
        return 0
    number = round(size / count)
    return number if abs(size / count - number) < WHOLE + 2 * error / count else 0


@functools.cache
def _filters(degree: int, side: int) -> tuple[Floats, Floats]:
    """Return the weights of a jump in the middle, and those of what is left without one."""
    x = (np.arange(-side, side) + 0.5) / side
    powers = np.vander(x, degree + 1, increasing=True)
    with_jump = np.column_stack([powers, x > 0])
    return np.linalg.pinv(with_jump)[-1], powers


def _jumps(time: Floats, theta: Floats, count: float) -> list[tuple[int, float, float]]:
    """Return place, size and standard error of each jump that stays."""
    weights, _ = _filters(DEGREE, SIDE)
    gain = math.sqrt(float(np.sum(weights**2)))
    # Place k: the jump between samples k - 1 and k.
    size = np.correlate(theta - theta[0], weights, "valid")
    place = np.arange(size.size) + SIDE
    usual = float(np.median(np.diff(time)))
    worst = np.max(np.lib.stride_tricks.sliding_window_view(np.diff(time), 2 * SIDE - 1), axis=1)
    even = worst < 1.3 * usual
    scale = max(normal_scale(size[even]), 1e-9) if even.any() else math.inf
    limit = CLEAR * scale + 2 * count
    found: list[tuple[int, float, float]] = []
    left = np.where(even, np.abs(size), 0.0)
    while left.size and len(found) <= MOST:
        k = int(np.argmax(left))
        if left[k] <= limit:
            break
        at = int(place[k])
        if _stays(theta, at, size[k], scale):
            found.append((at, float(size[k]), max(scale, gain * count / math.sqrt(12))))
        left[max(k - 2 * SIDE, 0) : k + 2 * SIDE] = 0.0
    return sorted(found)


def _stays(theta: Floats, at: int, size: float, scale: float) -> bool:
    """Whether the record is smooth on either side and jumps between: a kink or a spike is not."""
    after, before = theta[at : at + SIDE], theta[at - SIDE : at]
    if min(after.size, before.size) < SIDE:
        return False
    x = np.arange(SIDE) + 0.5
    right = np.polyfit(x, after, 3)
    left = np.polyfit(-x[::-1], before, 3)
    rough = max(
        float(np.std(after - np.polyval(right, x))),
        float(np.std(before - np.polyval(left, -x[::-1]))),
    )
    jump = float(np.polyval(right, 0.0) - np.polyval(left, 0.0))
    return bool(abs(jump) > max(6 * rough, abs(size) / 2) and abs(jump - size) < abs(size) + scale)
