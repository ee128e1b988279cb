"""Rules of samples that are no independent readings: interpolated, clipped, frozen, in steps.

Between two readings an interpolated record is a polynomial of low degree: differences of the next
order vanish, at the same samples of every interval, but not across a reading.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.formatting import counted
from pendmap.records.noise import fastest
from pendmap.records.resolution import step_of
from pendmap.signal.robust import equal_runs

if TYPE_CHECKING:
    from pendmap.records.work import Work
    from pendmap.signal import Floats, Indices
    from pendmap.tables.findings import Finding

EQUAL_READINGS: Final = 5  # Fewest consecutive equal readings that may be clipped or frozen
FINEST: Final = 3e-5  # Step below which it is the last written digit, rad
# Order of the differences that vanish between readings, by kind of interpolation
VANISHING_ORDER: Final = {"held": 1, "straight lines": 2, "cubics": 4}
VANISHED: Final = 0.1  # Differences between readings, over the largest, below which they vanish
FEWEST_SAMPLES: Final = 200  # Fewest samples in which interpolation is searched for
INTERVALS: Final = 60  # Number of intervals between readings that are examined
READINGS_A_PERIOD: Final = 5.0  # Fewest readings per period of an interpolated record
_EVEN: Final = 1e-3  # Greatest relative deviation of an interval in an evenly sampled record


def step(work: Work) -> None:
    """Set the step of the readings, rad, from the description or the readings."""
    if not work.edges:
        work.estimated_step = step_of(work.theta)
    counts, seen = work.known.get("encoder_counts"), work.estimated_step
    count = 2 * math.pi / float(counts) if counts else seen
    work.count = seen if seen > 1.5 * count and work.theta.size > 200 else count


def named_step(work: Work) -> Finding | None:
    """Report the step of the readings, or that they are edges; called once the unit is certain."""
    if work.integrated:
        return None  # an integral has no steps
    turn = f"{2 * math.pi / (work.estimated_step or math.inf):.5g}"
    if work.edges:
        return work.finding("edges-logged", turn=turn, edges=counted(work.theta.size, "edge"))
    counts, seen = work.known.get("encoder_counts"), work.estimated_step
    if counts is None and seen > FINEST:
        return work.finding("counts-seen", step=seen, turn=turn)
    if counts is not None and work.count == seen > 3 * math.pi / float(counts):
        return work.finding("counts-differ", step=seen, turn=turn, counts=counts)
    return None


def clipped(work: Work) -> Finding | None:
    """Mark plateaus at the ends of the range that the motion reaches at speed."""
    unit = "rad"
    if work.integrated:
        rate, unit = work.extra["velocity"], "rad/s"
        work = dataclasses.replace(work, theta=rate, count=step_of(rate))
    marked = np.zeros(work.theta.size, bool)
    ends = []
    low, high = equal_runs(work.theta, EQUAL_READINGS)
    for end in (float(work.theta.min()), float(work.theta.max())):
        ended = np.abs(work.theta - end) <= 1e-9 * max(abs(end), 1.0)
        hits = [
            (a, b)
            for a, b in zip(low[ended[low]], high[ended[low]], strict=True)
            if a > 0 and b < work.theta.size and _abrupt(work, a, b)
        ]
        if len(hits) > 1 or (hits and hits[0][1] - hits[0][0] > 4 * EQUAL_READINGS):
            ends.append(f"{end:.4g}")
            marked |= ended  # including shorter plateaus
    at = np.flatnonzero(marked)
    return work.distrust(at, "clipped", "clipped sample", ends=" and ".join(ends), unit=unit)


def frozen(work: Work) -> Finding | None:
    """Mark constant readings in the middle of a motion."""
    marked = np.zeros(work.theta.size, bool)
    change = np.diff(work.theta)
    for a, b in zip(*equal_runs(work.theta, EQUAL_READINGS), strict=True):
        if a < 3 or b > work.theta.size - 3 or not work.trusted[a]:
            continue
        before, jump = change[a - 1], change[b - 1]
        quick = abs(jump) > 3 * max(abs(before), work.count)
        if jump * before > 0 and quick and _abrupt(work, a, b):
            marked[a:b] = True
    return work.distrust(np.flatnonzero(marked), "frozen", "sample")


def _abrupt(work: Work, low: int, high: int) -> bool:
    """Return whether a plateau is flatter than a turning point, within v tau/2 of its extreme."""
    reach = max(high - low, 4)
    slope = math.inf
    for side in (slice(max(low - reach, 0), low), slice(high, high + reach)):
        if work.theta[side].size > 1:
            slope = min(slope, float(np.ptp(work.theta[side]) / np.ptp(work.time[side])))
    missed = slope * float(work.time[high - 1] - work.time[low]) / 4
    noise = float(np.median(np.abs(np.diff(work.theta, 2)))) if work.theta.size > 2 else 0.0
    # The extreme of a parabola is half of this above its ends: a count, and more by friction.
    return math.inf > missed > 4 * work.count + 3 * min(noise, 0.01)


def measured(time: Floats, theta: Floats) -> tuple[str, int, Indices] | None:
    """Return kind and ratio of interpolation, and indices of the readings; None if all are."""
    if theta.size < FEWEST_SAMPLES or np.ptp(theta) == 0:
        return None
    steps = np.diff(time)
    interval = float(np.median(steps))
    if np.max(np.abs(steps / interval - 1)) > _EVEN:
        return None
    quickest = fastest(time, theta, 0.005 * float(np.ptp(theta)))[0]
    most = int(min(math.tau / (READINGS_A_PERIOD * quickest * interval), theta.size / 20))
    begin = int(np.argmax(np.abs(theta - theta[0]) > 0.05 * np.ptp(theta)))
    for made, order in VANISHING_ORDER.items():
        # Divisors of the ratio are detected as well: the largest is used.
        for ratio in range(most, order, -1):
            if _share(theta[begin:], ratio, order)[0] < VANISHED:
                share, first = _share(theta, ratio, order, blocks=theta.size)
                if share < VANISHED:
                    return made, ratio, np.arange(first, theta.size, ratio)
    return None


def _share(theta: Floats, ratio: int, order: int, blocks: int = INTERVALS) -> tuple[float, int]:
    """Return the difference within an interval over the largest, and the reading's index."""
    stride = ratio // (order + 1)
    change = theta[: blocks * ratio + order * stride]
    for _ in range(order):
        change = change[stride:] - change[:-stride]
    count = change.size // ratio
    if count < 10:
        return 1.0, 0
    sizes = np.abs(change[: count * ratio]).reshape(count, ratio).mean(axis=0)
    # The last sample of a held reading differs from the next.
    alike = ratio - order * stride + (0 if order == 1 else 1)
    around = np.concatenate((sizes, sizes[: alike - 1]))
    within = np.lib.stride_tricks.sliding_window_view(around, alike).max(axis=1)
    first, largest = int(np.argmin(within)), float(sizes.max())
    return (float(within[first]) / largest if largest > 0 else 1.0), first


def interpolated(work: Work) -> Finding | None:
    """Keep only the readings of an interpolated record."""
    readings = measured(work.time, work.theta)
    if readings is None:
        return None
    made, ratio, places = readings
    samples = work.time.size
    rate = (samples - 1) / float(work.time[-1] - work.time[0])
    values: dict[str, Any] = {
        "from_hz": f"{rate / ratio:.6g} Hz",
        "to_hz": f"{rate:.6g} Hz",
        "how": "each held" if made == "held" else f"{made} between",
    }
    if work.pivot:
        # The pivot may have been read at every sample.
        return work.finding("interpolated.pivot", **values)
    work.keep(places)
    number = counted(places.size, "reading")
    return work.finding("interpolated", readings=number, samples=samples, **values)
