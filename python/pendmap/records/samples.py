"""Samples that lie: readings that clip or freeze; the step they come in."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records import false_samples
from pendmap.records.runs_of import equal_runs
from pendmap.words import counted

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]

__all__ = ["check", "say_steps", "step_of"]

SAME: Final = 5
"""Equal readings in a row that may be a clipped or frozen sensor."""

LATTICE: Final = 0.12
"""Root mean square distance from multiples of a step, in steps, that shows it; 0.29 is chance."""

FINEST: Final = 3e-5
"""A step under this, in rad, says nothing: it is how many digits were written."""


def check(work: Work) -> None:
    """Mark what is not for fitting, mend missed counts that are certain, and say so."""
    work.seen = step_of(work.theta)
    work.count = _count(work)
    _clipped(work)
    _frozen(work)
    false_samples.find(work)


def _count(work: Work) -> float:
    """Return the step of the readings: as it is known, or as it can be seen."""
    counts = work.known.get("encoder_counts")
    if counts is None:
        return work.seen
    count = 2 * math.pi / float(counts)
    return work.seen if work.seen > 1.5 * count and work.theta.size > 200 else count


def say_steps(work: Work) -> None:
    """Say what steps the readings come in, once their unit is certain."""
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


def step_of(theta: Floats) -> float:
    """Return the step that readings come in, rad; 0 where there is none to be seen.

    The least distance between different readings is tried, then refined by all of them; a step is
    believed where the readings repeat and lie on its multiples.
    """
    values = np.unique(np.round(theta, 12))
    if values.size < 3 or values.size > 0.7 * theta.size:
        return 0.0
    apart = np.diff(values)
    # Written digits round multiples of a step: neighbours differ by it, give or take a digit.
    least = float(np.quantile(apart, 0.02))
    near = apart[(apart >= 0.5 * least) & (apart < 1.5 * least)]
    step = float(np.median(near)) if near.size else least
    multiples = np.round(apart / step)
    small = multiples < 50
    if step <= 0 or not np.any(multiples[small] > 0):
        return 0.0
    step = float(np.sum(apart[small]) / max(np.sum(multiples[small]), 1.0))
    away = (values - values[0]) / step
    away = away - np.round(away)
    phase = np.angle(np.mean(np.exp(2j * np.pi * away))) / (2 * np.pi)
    away = away - phase
    away -= np.round(away)
    return step if float(np.sqrt(np.mean(away**2))) < LATTICE else 0.0


def _clipped(work: Work) -> None:
    """Mark plateaus at the ends of the range that the motion runs into at speed."""
    marked = np.zeros(work.theta.size, bool)
    for end in (float(work.theta.max()), float(work.theta.min())):
        low, high = equal_runs(work.theta, SAME)
        at_end = np.abs(work.theta[low] - end) <= 1e-9 * max(abs(end), 1.0)
        hits = [
            (a, b)
            for a, b in zip(low[at_end], high[at_end], strict=True)
            if _abrupt(work, a, b) and a > 0 and b < work.theta.size
        ]
        if len(hits) > 1 or (hits and hits[0][1] - hits[0][0] > 4 * SAME):
            for a, b in hits:
                marked[a:b] = True
    if marked.any():
        at = np.flatnonzero(marked)
        work.trusted[at] = False
        text = (
            f"the sensor ends at {work.theta[at].min():.4g} or {work.theta[at].max():.4g} rad:"
            f" {counted(at.size, 'clipped sample')} not for fitting"
        )
        work.say("clipped", text, at=at)


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
    before = slice(max(low - 4, 0), low)
    after = slice(high, high + 4)
    slopes = [
        float(np.ptp(work.theta[part]) / np.ptp(work.time[part]))
        for part in (before, after)
        if work.theta[part].size > 1
    ]
    if not slopes:
        return False
    half = (work.time[high - 1] - work.time[low]) / 2
    noise = float(np.median(np.abs(np.diff(work.theta, 2)))) if work.theta.size > 2 else 0.0
    return bool(min(slopes) * half / 2 > 2 * work.count + 3 * min(noise, 0.01))
