"""Clock errors: missing, repeated, decreasing, coarse or jittering time stamps."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.formatting import Estimate, counted, estimate_text, listed, moment
from pendmap.records.by_hand import by_hand
from pendmap.records.noise import OUTLIER, raise_degree
from pendmap.records.resolution import FEWEST_EDGES, logs_edges, spread_stamps
from pendmap.records.work import FEWEST_SAMPLES
from pendmap.signal.local_polynomial import POINTS, local_fit
from pendmap.signal.robust import broad_scale, intervals_of, widened

if TYPE_CHECKING:
    from pendmap.records.work import Work
    from pendmap.signal import Floats, Indices, Mask, Stretch
    from pendmap.signal.local_polynomial import LocalFit
    from pendmap.tables.findings import Finding

RESTART: Final = 10  # Least decrease at a clock's restart, intervals; fewest samples of each part
REPORTED_JITTER: Final = 0.02  # Relative spread of the intervals above which jitter is reported
MOST_UNORDERED: Final = 0.3  # Share of unordered stamps above which the record is refused
STOPPED_READINGS: Final = 50  # Most readings with one stamp (or ten times the usual number)
COARSE_STAMPS: Final = 0.2  # Least share of repeated stamps of a coarse clock
SPACING: Final = frozenset(("time-gap", "time-jitter", "time-uneven"))  # Findings about intervals
AROUND: Final = 101  # Readings around one whose second differences are usual there
SMOOTHER: Final = 16.0  # Decrease of chi squared of a motion that is clearly smoother
CERTAIN_SHARE: Final = 3.0  # Standard errors by which a motion follows even times or its stamps
BLOCKS: Final = 20  # Blocks of stamps whose means are independent
STAMPS: Final = 16  # Stamps on each side of an interval whose means show a lost reading
PLACINGS: Final = 8  # Searches for lost readings; each may reveal one next to another
LATE: Final = 0.6  # Intervals by which stamps that follow a lost reading are late on average


def missing(work: Work) -> Finding | None:
    """Remove rows without a time; InputError if no row has one."""
    bad = ~np.isfinite(work.time)
    if bad.all():
        raise InputError(
            f"{work.where}: the times must be numbers, got no row with a time:"
            f" {by_hand(work.where, rate_hz=100)}"
        )
    finding = work.leave_out(bad, "time-missing", "row")
    if work.time.size < 2:
        work.refuse_short()
    return finding


def stopped(work: Work) -> Finding | None:
    """Remove readings that continue while the clock is stopped."""
    edges = np.flatnonzero(np.diff(work.time, prepend=np.nan, append=np.nan) != 0)
    number = np.diff(edges)
    usual = int(np.median(number))
    stops = np.flatnonzero(number > max(STOPPED_READINGS, RESTART * usual))
    if not stops.size or stops.size == number.size:
        return None
    # After a decrease even the first of the equal stamps is wrong.
    right = work.time[edges[stops]] >= work.time[np.maximum(edges[stops] - 1, 0)]
    begin, end = edges[stops] + usual * right, edges[stops + 1]
    out = np.concatenate([np.arange(a, b) for a, b in zip(begin, end, strict=True)])
    times = listed([moment(work.time[k]) for k in begin], 3)
    readings = counted(out.size, "reading")
    finding = work.finding("time-stops", at=begin, times=times, readings=readings)
    work.keep(np.delete(np.arange(work.time.size), out))
    return finding


def restarted(work: Work) -> Finding | None:
    """Keep the longest part of a record whose clock restarts."""
    steps = np.diff(work.time)
    usual = float(np.median(steps[steps > 0])) if np.any(steps > 0) else math.inf
    falls = (np.flatnonzero(steps < -RESTART * usual) + 1).tolist()
    # A single wrong stamp is no restart: the stamps after it continue those before.
    edges = [0]
    for low, high in itertools.pairwise([*falls, work.time.size]):
        part, before = work.time[low:high], work.time[edges[-1] : low]
        again = part.size > RESTART and np.median(part[:RESTART]) < np.median(before[-RESTART:])
        if again and before.size > RESTART:
            edges.append(low)
    if len(edges) == 1:
        return None
    starts = np.array(edges[1:])
    low, high = longest_between(edges, work.time.size)
    finding = work.finding(
        "time-restarts",
        at=starts,
        starts=counted(starts.size, "time"),
        parts=starts.size + 1,
        first=work.rows[low],
        last=work.rows[high - 1],
    )
    work.keep(np.arange(low, high))
    return finding


def longest_between(edges: list[int], size: int) -> Stretch:
    """Return the longest of the parts that begin at some indices, the first of which is 0."""
    ends = [*edges[1:], size]
    return max(zip(edges, ends, strict=True), key=lambda part: part[1] - part[0])


def coarse(work: Work) -> Finding | None:
    """Space readings evenly if the motion follows even times; else spread equal stamps."""
    steps = np.diff(work.time)
    if not np.all(steps >= 0) or not np.any(steps > 0):
        return None
    same, spread = float(np.mean(steps == 0)), spread_stamps(work.time)
    if logs_edges(work.theta):
        work.time = spread
        return work.finding("time-coarse.edges", percent=100 * same) if same else None
    channels = np.stack([work.theta, *work.extra.values(), *work.pivot.values()])
    again = np.all(np.diff(channels, axis=1)[:, steps == 0] == 0, axis=0)  # samples and stamps
    if work.time.size < FEWEST_EDGES or (same and np.mean(again) > 0.9):
        return None
    in_ticks = same >= COARSE_STAMPS
    place = np.arange(work.time.size)
    places = _with_lost(spread, place)
    near = widened(np.diff(places, prepend=-1) != 1, POINTS // 2)
    lines = [_line(spread, some) for some in (places, place)]
    tries = [_followed(line, work.time, channels, near) for line in lines]
    # Late stamps show lost readings, unless the motion is clearly smoother without them.
    which = int(tries[1].near < tries[0].near - SMOOTHER)
    even, share = lines[which], tries[which]
    wander = np.ptp(np.convolve(spread - even.times, np.ones(STAMPS) / STAMPS, "valid"))
    steady = wander < LATE * even.interval * (2 if in_ticks or which else 1)
    margin = CERTAIN_SHARE * share.error
    if share.share + (-margin if in_ticks else margin) > 0.5:
        return None
    width = float(np.ptp(work.time - even.times))
    if not steady or width < REPORTED_JITTER * even.interval:
        if in_ticks:
            work.time = spread
        return work.finding("time-coarse.tick", percent=100 * same) if in_ticks else None
    lost = 0 if which else int(places[-1] - place[-1])
    work.time, work.clock_stderr = even.times, even.stderr / even.interval
    rate = estimate_text(Estimate(1 / even.interval, work.clock_stderr / even.interval))
    missing = f", {counted(lost, 'reading')} lost" if lost else ""
    return work.finding("time-coarse", width=width, lost=missing, rate=rate)


@dataclasses.dataclass(frozen=True)
class _Line:
    """Even times nearest to stamps."""

    interval: float  # s
    stderr: float  # standard error of the interval, s
    times: Floats  # s


def _line(time: Floats, place: Indices) -> _Line:
    """Return the even times nearest to stamps of readings at some places."""
    far = place - place.mean()
    interval = float(far @ time) / float(far @ far)
    times = time.mean() + interval * far
    # Stamps of one tick are alike: the error is that of independent means of blocks.
    block = time.size // BLOCKS
    means = (time - times)[: block * BLOCKS].reshape(BLOCKS, block).mean(axis=1)
    spread = max(float(np.std(time - times)), math.sqrt(block) * float(np.std(means)))
    return _Line(interval, spread / math.sqrt(float(far @ far)), times)


def _with_lost(time: Floats, place: Indices) -> Indices:
    """Return the places of readings, of which some are lost where all later stamps are late."""
    from scipy.ndimage import maximum_filter1d

    places, beside = place.copy(), min(STAMPS, time.size // 8)
    edge = np.arange(3, time.size - 2)
    low, high = np.maximum(edge - beside, 0), np.minimum(edge + beside, time.size)

    def steps(values: Floats | Indices) -> Floats:
        """Return the means after each interval less the means before."""
        sums = np.concatenate(([0.0], np.cumsum(values - values[0])))
        before = (sums[edge] - sums[low]) / (edge - low)
        return np.asarray((sums[high] - sums[edge]) / (high - edge) - before)

    usual = float(np.median(time[4 * beside :] - time[: -4 * beside])) / (4 * beside)
    for _ in range(PLACINGS):
        step, lag = steps(time), steps(places)
        sound = np.abs(step / usual - lag) < 0.5
        usual = float(np.sum(step[sound]) / np.sum(lag[sound])) if sound.any() else usual
        late = step / usual - lag
        size = np.abs(late)
        at = np.flatnonzero((size > LATE) & (size >= maximum_filter1d(size, 2 * beside + 1)))
        for k, lost in zip(edge[at], late[at], strict=True):
            places[k:] += round(lost)
    return places if np.all(np.diff(places) > 0) else place


@dataclasses.dataclass(frozen=True)
class _Share:
    """Share of the scatter of stamps about even times that a motion follows."""

    share: float  # 1: stamps are the instants of the readings; 0: the even times are
    error: float  # standard error of the share
    near: float  # chi squared of the readings near lost ones


def _followed(even: _Line, stamps: Floats, channels: Floats, near: Mask) -> _Share:
    """Return the share of the channel that determines it best."""
    return min((_share(even, stamps, v, near) for v in channels), key=lambda share: share.error)


def _share(even: _Line, stamps: Floats, values: Floats, near: Mask) -> _Share:
    """Return the share of the scatter that a channel follows: ``s(t) + share v (stamp - t)``."""

    def fitted(degree: int = 4, points: int = 9) -> LocalFit:
        fit = local_fit(even.times, values, degree=degree, points=points)
        size = np.abs(fit.residual)
        return fit.only((size <= OUTLIER * broad_scale(size)) | near[fit.middle])

    fit = raise_degree(fitted, fitted())
    if fit.middle.size < FEWEST_EDGES:
        return _Share(1.0, math.inf, math.inf)
    rough = fit.residual[near[fit.middle]] / max(broad_scale(np.abs(fit.residual)), 1e-300)
    moved = np.interp(np.arange(stamps.size), fit.middle, fit.slope) * (stamps - even.times)
    points = 2 * fit.neighbours + 1
    other = local_fit(even.times, moved, degree=points - 5, points=points)
    follows = np.interp(fit.middle, other.middle, other.residual)
    power = max(float(follows @ follows), 1e-300)
    share = float(follows @ fit.residual) / power
    left = float(np.mean((fit.residual - share * follows) ** 2))
    return _Share(share, math.sqrt(left * fit.sum_of_squares / power), float(rough @ rough))


def repeated(work: Work) -> Finding | None:
    """Remove rows with the time of the row before."""
    again = np.append(False, np.abs(np.diff(work.time)) <= _rounding(work.time))
    alike = np.sum(np.diff(work.theta, prepend=np.nan)[again] == 0)
    return work.leave_out(again, "time-duplicate", "time stamp", alike=alike)


def unordered(work: Work) -> Finding | None:
    """Sort rows out of order, if the angle is then smooth, or remove them."""
    if np.all(np.diff(work.time) > 0):
        return None
    from scipy.ndimage import median_filter

    around = median_filter(work.time, 5, mode="nearest")
    false = np.abs(work.time - around) > 5 * np.median(np.abs(np.diff(work.time)))
    highest = np.maximum.accumulate(np.where(false, -np.inf, work.time))
    false |= np.append(False, work.time[1:] <= highest[:-1])
    order = np.argsort(work.time, kind="stable")
    if _smoother(work.theta[order], np.flatnonzero(false[order])):
        at = np.flatnonzero(false)
        finding = work.finding("time-backwards.sorted", at=at, number=counted(at.size, "row"))
        work.keep(order)
        work.keep(np.append(True, np.diff(work.time) > _rounding(work.time)))
        return finding
    if np.mean(false) > MOST_UNORDERED:
        raise InputError(
            f"{work.where}: the times must be in order, {np.sum(false)} of {false.size} are out"
            " of order, and sorted by time the angles are no smooth motion:"
            f" {by_hand(work.where, rate_hz=100)}"
        )
    return work.leave_out(false, "time-backwards.left-out", "time stamp")


def _rounding(time: Floats) -> float:
    """Return the difference below which stamps are equal, s."""
    return 2 * float(np.spacing(np.max(np.abs(time))))


def _smoother(theta: Floats, at: Indices) -> bool:
    """Return whether reordered samples are as smooth in their new places as the others."""
    if theta.size < 5 or not np.all(np.isfinite(theta)):
        return False
    bend = np.abs(np.diff(theta, 2))
    if at.size >= theta.size / 4 or not np.quantile(bend, 0.9):
        # Most were moved: a motion has second differences small against its range.
        return bool(np.median(bend) < 0.1 * np.ptp(theta))
    from scipy.ndimage import percentile_filter

    place = np.clip(at - 1, 0, bend.size - 1)
    return bool(np.all(bend[place] <= 3 * percentile_filter(bend, 90, size=AROUND)[place]))


def gaps(work: Work) -> Finding | None:
    """Report gaps, and uneven or jittering intervals; InputError for times that do not increase."""
    if work.time.size < 2 or not work.time[-1] > work.time[0]:
        raise InputError(
            f"{work.where}: the times must be in order, they do not increase:"
            f" {by_hand(work.where, rate_hz=100)}"
        )
    steps, intervals = np.diff(work.time), intervals_of(work.time)
    usual, at = intervals.tick, intervals.gaps
    if at.size > steps.size / 4:
        return work.finding("time-uneven", low=steps.min(), high=steps.max())
    spread = math.sqrt(float(np.mean((np.delete(steps, at) - usual) ** 2)))
    if spread > REPORTED_JITTER * usual:
        percent = 100 * spread / usual
        work.note("time-jitter", spread=spread, percent=percent, interval=usual)
    if not at.size:
        return None
    worst = at[int(np.argmax(steps[at]))]
    low, high = work.time[worst : worst + 2].tolist()
    return work.finding(
        "time-gap",
        at=at,
        span=(low, high),
        gaps=counted(at.size, "gap"),
        samples=counted(intervals.missing, "sample"),
        longest=steps[worst],
        at_s=moment(low),
    )


def no_clock(work: Work) -> None:
    """Drop findings about intervals that are those of turning points or encoder edges."""
    if work.peaks_only or work.edges:
        work.findings = [finding for finding in work.findings if finding.what not in SPACING]


def cut(work: Work) -> Finding | None:
    """Keep the samples between ``from_s`` and ``to_s`` of the description."""
    low, high = work.plan.from_s, work.plan.to_s
    first, last = float(work.time[0]), float(work.time[-1])
    if low <= first and last <= high:
        return None
    work.keep((work.time >= low) & (work.time <= high))
    if work.time.size < FEWEST_SAMPLES:
        raise InputError(
            f"{work.where}: from_s and to_s must be times within {first:g} to {last:g} s, they"
            f" leave {counted(work.time.size, 'sample')}:"
            f" {by_hand(work.where, from_s=first, to_s=last)}"
        )
    samples, low, high = counted(work.time.size, "sample"), max(low, first), min(high, last)
    return work.finding("cut", samples=samples, begin=moment(low), end=moment(high))


def pause(work: Work) -> None:
    """Keep the larger side, by samples, of each pause longer than the rest of the record."""
    while work.time.size > 2:
        steps = np.diff(work.time)
        at = int(np.argmax(steps)) + 1
        longest = steps[at - 1]
        rest = float(work.time[-1] - work.time[0] - longest)
        if longest <= max(rest, RESTART * float(np.median(steps))):
            break
        side = "before" if at >= work.time.size - at else "after"
        work.note("time-pause", at=np.array([at]), pause=longest, side=side)
        work.keep(np.arange(at) if side == "before" else np.arange(at, work.time.size))
