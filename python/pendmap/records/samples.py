"""Samples that lie: readings that clip or freeze; the step they come in."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted
from pendmap.records import outliers
from pendmap.records.noise import noise_of
from pendmap.records.outliers import find_spikes
from pendmap.records.resolution import step_of
from pendmap.records.rod_sensors import angle_of_rate
from pendmap.records.swinging import swinging
from pendmap.signal.robust import equal_runs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]


SAME: Final = 5
"""Equal readings in a row that may be a clipped or frozen sensor."""

FINEST: Final = 3e-5
"""A step under this, in rad, says nothing: it is how many digits were written."""

FIT: Final = 3.0
"""What is left over by a parabola, times which a motion must go beyond a plateau."""

PLAIN: Final = 0.05
"""Share of the whole way that no step of readings hides: what goes beyond is cut off."""


def check(work: Work) -> None:
    """Mark what is not for fitting, mend missed counts that are certain, and say so."""
    if work.made_of is not None:
        # What may be false is the acceleration: the angle made of it has corners of its own.
        readings = work.extra["acceleration"]
        moves = swinging(work.time, readings, noise_of(work.time, readings).sigma)
        find_spikes(work, readings, work.made_of.unit, moves.free)
        return
    if work.integrated:
        rate = work.extra["velocity"]
        read = dataclasses.replace(work, theta=rate, count=step_of(rate))
        _clipped(read, "rad/s")
        find_spikes(work, rate, "rad/s", [(0, rate.size)])
        work.theta = angle_of_rate(work.time, rate, work.trusted)
        return
    work.seen = work.seen if work.edges else step_of(work.theta)
    work.count = _count(work)
    _clipped(work, "rad")
    _frozen(work)
    outliers.find(work)


def _count(work: Work) -> float:
    """Return the step of the readings: as it is known, or as it can be seen."""
    counts = work.known.get("encoder_counts")
    if counts is None:
        return work.seen
    count = 2 * math.pi / float(counts)
    return work.seen if work.seen > 1.5 * count and work.theta.size > 200 else count


def say_steps(work: Work) -> None:
    """Say what steps the readings come in, once their unit is certain."""
    if work.integrated or work.edges:
        return  # an integral has none; of edges they are said already
    counts, seen = work.known.get("encoder_counts"), work.seen
    work.count = _count(work)
    if counts is None:
        if seen > FINEST:
            turn = 2 * math.pi / seen
            text = f"the readings come in steps of {seen:.4g} rad ({turn:.5g} a turn)"
            work.say("counts-seen", text)
    elif work.count == seen > 0 and seen > 3 * math.pi / float(counts):
        text = (
            f"the readings come in steps of {seen:.4g} rad, {2 * math.pi / seen:.5g} a turn:"
            f" encoder_counts says {counts}"
        )
        work.say("counts-differ", text)


def _clipped(work: Work, unit: str) -> None:
    """Mark plateaus at the ends of the range that the motion runs into at speed."""
    marked = np.zeros(work.theta.size, bool)
    ends = []
    for end in (float(work.theta.max()), float(work.theta.min())):
        low, high = equal_runs(work.theta, SAME)
        ended = np.abs(work.theta - end) <= 1e-9 * max(abs(end), 1.0)
        hits = [
            (a, b)
            for a, b in zip(low[ended[low]], high[ended[low]], strict=True)
            if a > 0 and b < work.theta.size and b - a > SAME - 0.5
            if _abrupt(work, a, b) and _cut_off(work, a, b)
        ]
        if len(hits) > 1 or (hits and hits[0][1] - hits[0][0] > 4 * SAME):
            ends.append(f"{end:.4g}")
            marked |= ended  # the shorter ones, too
    if marked.any():
        at = np.flatnonzero(marked)
        work.trusted[at] = False
        text = (
            f"the sensor ends at {' and '.join(ends[::-1])} {unit}:"
            f" {counted(at.size, 'clipped sample')} not for fitting"
        )
        work.say("clipped", text, at=at)


def _cut_off(work: Work, low: int, high: int) -> bool:
    """Whether the motion on both sides goes on beyond a plateau, by a parabola through them."""
    if low < 3 or work.theta.size - high < 3:
        return False
    if _missed(work, low, high) > PLAIN * float(np.ptp(work.theta)):
        return True
    begin, end = equal_runs(work.theta, SAME)
    reach = max(high - low, 4)
    first = max(low - reach, int(np.max(end[end < low], initial=0)))
    last = min(high + reach, int(np.min(begin[begin > high], initial=work.theta.size)))
    places = np.r_[min(first, max(low - 4, 0)) : low, high : max(last, high + 4)]
    places = places[places < work.theta.size]
    level = float(work.theta[low])
    time = work.time[places] - (work.time[low] + work.time[high - 1]) / 2
    away = work.theta[places] - level
    answer = np.polyfit(time, away, 2)
    noise = float(np.sqrt(np.mean((away - np.polyval(answer, time)) ** 2)))
    beyond = float(answer[2]) * -math.copysign(1, float(np.median(away)))
    return beyond > 2 * work.count + FIT * noise


def _frozen(work: Work) -> None:
    """Mark stretches without change in the middle of a motion."""
    low, high = equal_runs(work.theta, SAME)
    marked = np.zeros(work.theta.size, bool)
    for a, b in zip(low, high, strict=True):
        if a < 3 or b > work.theta.size - 3 or not work.trusted[a]:
            continue
        jump = abs(work.theta[b] - work.theta[b - 1])
        before = abs(work.theta[a] - work.theta[a - 1])
        passing = (work.theta[b] - work.theta[b - 1]) * (work.theta[a] - work.theta[a - 1]) > 0
        if passing and jump > 3 * max(before, work.count) and _abrupt(work, a, b):
            marked[a:b] = True
    if marked.any():
        at = np.flatnonzero(marked)
        work.trusted[at] = False
        text = f"the reading stands still while the pendulum moves: {counted(at.size, 'sample')}"
        work.say("frozen", f"{text} not for fitting", at=at)


def _abrupt(work: Work, low: int, high: int) -> bool:
    """Whether a plateau is flatter than a turn can be.

    Before a turn with velocity v and after a time tau the angle is within v tau/2 of its extreme:
    a sensor with steps shows a plateau where that is a step or so.
    """
    noise = float(np.median(np.abs(np.diff(work.theta, 2)))) if work.theta.size > 2 else 0.0
    return _missed(work, low, high) > 2 * work.count + 3 * min(noise, 0.01)


def _missed(work: Work, low: int, high: int) -> float:
    """Return how far a motion goes during a plateau, by its speed beside it, rad."""
    before = slice(max(low - 4, 0), low)
    after = slice(high, high + 4)
    slopes = [
        float(np.ptp(work.theta[part]) / np.ptp(work.time[part]))
        for part in (before, after)
        if work.theta[part].size > 1
    ]
    if not slopes:
        return -1.0
    half = float(work.time[high - 1] - work.time[low]) / 2
    return min(slopes) * half / 2
