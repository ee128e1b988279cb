"""Clock errors: missing, repeated, decreasing, coarse or jittering time stamps."""

from __future__ import annotations

import dataclasses
import itertools
import math
import operator
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import Estimate, counted, estimate_text, listed, moment
from pendmap.records.noise import OUTLIER, raise_degree
from pendmap.records.resolution import FEWEST_EDGES, logs_edges, spread_stamps
from pendmap.records.steps import slips_of
from pendmap.records.work import FEWEST_SAMPLES
from pendmap.signal.local_polynomial import local_fit
from pendmap.signal.robust import broad_scale, intervals_of

if TYPE_CHECKING:
    from pendmap.records.work import Work
    from pendmap.signal import Floats, Indices, Stretch
    from pendmap.signal.local_polynomial import LocalFit
    from pendmap.tables.findings import Finding

RESTART: Final = 10  # Least decrease at a clock's restart, intervals; fewest samples of each part
REPORTED_JITTER: Final = 0.02  # Relative spread of the intervals above which jitter is reported
MOST_UNORDERED: Final = 0.3  # Share of unordered stamps above which the record is refused
STOPPED_READINGS: Final = 50  # Most readings with one stamp (or ten times the usual number)
COARSE_STAMPS: Final = 0.2  # Least share of repeated stamps of a coarse clock
SPACING: Final = frozenset(("time-gap", "time-jitter", "time-uneven"))  # Findings about intervals
AROUND: Final = 101  # Readings around one whose second differences are usual there
SMOOTHER: Final = 0.98  # Residual, over that with lost readings, of a record without
CERTAIN_SHARE: Final = 3.0  # Standard errors by which a motion follows even times or its stamps
STAMPS: Final = 16  # Stamps on each side of an interval whose means show a lost reading
PLACINGS: Final = 8  # Searches for lost readings; each may reveal one next to another
LATE: Final = 0.6  # Intervals by which stamps that follow a lost reading are late on average
EXACT: Final = 1e-6  # Share of a tick below which a distance is rounding


def missing(work: Work) -> Finding | None:
    """Remove rows without a time; InputError if no row has one."""
    bad = ~np.isfinite(work.time)
    if bad.all():
        work.refuse("the times must be numbers, got no row with a time", rate_hz=100)
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
    """Space readings evenly if stamps are in coarse ticks: over the record, else over a tick."""
    steps = np.diff(work.time)
    if not np.all(steps >= 0) or not np.any(steps > 0):
        return None
    same = float(np.mean(steps == 0))
    if logs_edges(work.theta):
        work.time = spread_stamps(work.time)
        return work.finding("time-coarse.edges", percent=100 * same) if same else None
    rise = steps - steps.min(initial=0.0 if same else math.inf)
    usual = float(np.median(steps[steps > 0]))
    rise = rise[rise > REPORTED_JITTER * usual]
    channels = np.stack([work.theta, *work.extra.values(), *work.pivot.values()])
    again = np.all(np.diff(channels, axis=1)[:, steps == 0] == 0, axis=0)  # samples and stamps
    if not rise.size or (same and np.mean(again) > 0.9):
        return None
    ticks = _ticks(work.time, rise, steps, channels, same=same)
    return _scattered(work, channels) if ticks is None else _in_ticks(work, channels, *ticks)


def _in_ticks(work: Work, channels: Floats, tick: float, even: _Even) -> Finding | None:
    """Space the readings of stamps in exact ticks evenly, if the motion does not follow them."""
    missing, few = "", ""
    place = np.arange(work.time.size)
    slips = slips_of(even.times, work.theta, fewest=1)
    if slips is not None:  # readings are lost where the others jump, if the stamps allow it
        lost = np.round((slips.time - even.times) / even.interval).astype(np.intp)
        if (whole := _even(work.time, place + lost, tick)).missed <= max(even.missed, 0.0):
            even = whole
            missing = f", {counted(int(lost[-1]), 'reading')} lost where the others jump"
    share, error, _ = _followed(work.time, even, channels)
    if share - CERTAIN_SHARE * error > 0.5:
        return None
    work.clock_stderr = even.stderr / even.interval
    if even.missed <= even.interval:
        rate = estimate_text(Estimate(1 / even.interval, work.clock_stderr / even.interval))
        work.time = even.times
        return work.finding("time-coarse.even", tick=tick, lost=missing, rate=rate)
    if slips is None and (scattered := _scattered(work, channels)) is not None:
        return scattered
    _, number = np.unique(work.time, return_counts=True)
    out = np.repeat(number < np.median(number) - 1, number)
    work.time = spread_stamps(work.time)
    work.keep(~out)
    if out.any():
        few = f"; {counted(int(out.sum()), 'reading')} in ticks that lack readings left out"
    return work.finding("time-coarse.tick", tick=tick, lost=missing, few=few)


def _ticks(
    time: Floats, rise: Floats, steps: Floats, channels: Floats, *, same: float
) -> tuple[float, _Even] | None:
    """Return the tick of coarse stamps and their even times; None if stamps are not coarse."""
    # The least changes of the steps are ticks, or the rounding of the digits of longer ones.
    place, least = np.arange(time.size), float(rise.min())
    usual = float(np.median(steps[steps > 0]))
    rounded = not np.any((rise > 2 * least) & (rise <= 4 * least))
    for some in (rise, rise[rise > 4 * least] if rounded else rise[:0]):
        if not some.size:
            break
        near = some[some < 1.5 * some.min()]
        spread = 2 * least if some is not rise else near.max() - near.min()
        tick = float(near.max() + spread) + 4 * float(np.spacing(np.max(np.abs(time))))
        even = _even(time, place, tick)
        if same >= COARSE_STAMPS:
            return tick, even
        other = np.flatnonzero(np.abs(steps - np.median(steps)) > 0.5 * tick) + 1
        smooth = any(_smoother(values, other) for values in channels)
        rival = even.missed > EXACT * tick or tick > 1.5 * usual
        if not (rival or steps.size < FEWEST_EDGES or not smooth):
            return tick, even
    return None


@dataclasses.dataclass(frozen=True)
class _Even:
    """Even times, each in the tick of its stamp."""

    interval: float  # s
    stderr: float  # standard error of the interval, s
    times: Floats  # s
    missed: float  # sum of the least distances of an early and a late reading from its tick, s


def _even(time: Floats, place: Indices, tick: float) -> _Even:
    """Return the mean of all even times for which each reading is in the tick after its stamp.

    A reading that is in its tick for no interval may miss it by half an interval more than the
    least distance. ``stamp_k <= t_0 + k dt < stamp_k + tick`` is a convex region of ``(t_0, dt)``,
    in which all points are equally likely; only corners of the stamps' convex hull bound it.
    """
    from scipy.spatial import ConvexHull

    usual = float((time[-1] - time[0]) / place[-1])
    off = time - time[0] - usual * place
    scaled = np.column_stack((place / place[-1], off / tick))
    corners = ConvexHull(scaled, qhull_options="QbB").vertices
    x, y = place[corners], off[corners]
    sides = (np.roll(y, -1) - y) / (np.roll(x, -1) - x)
    missed = float(np.min(np.ptp(y - np.outer(sides, x), axis=1))) - tick
    wide = tick if missed < -EXACT * tick else tick + max(missed, 0.0) + usual
    after = x[:, None] > x
    run, up = (x[:, None] - x)[after], (y[:, None] - y)[after]
    slopes = np.linspace(np.max((up - wide) / run), np.min((up + wide) / run), 400)
    room = np.maximum(wide - np.ptp(y - np.outer(slopes, x), axis=1), 1e-9 * tick)
    slope = float(np.average(slopes, weights=room))
    spread = math.sqrt(float(np.average((slopes - slope) ** 2, weights=room)))
    left = y - slope * x
    times = time[0] + (left.max() + left.min() + tick) / 2 + (usual + slope) * place
    return _Even(usual + slope, spread, times, missed)


def _scattered(work: Work, channels: Floats) -> Finding | None:
    """Space readings evenly if the motion shows that they are, and their stamps scatter."""
    if work.time.size < FEWEST_EDGES:
        return None
    place = np.arange(work.time.size, dtype=float)
    lines = [_line(work.time, places) for places in (_with_lost(work.time, place), place)]
    tries = [_followed(work.time, line, channels) for line in lines]
    # Stamps show lost readings, unless the motion is clearly smoother without them.
    which = int(tries[1][2] < SMOOTHER * tries[0][2])
    even, (share, error, _) = lines[which], tries[which]
    off = work.time - even.times
    runs = np.convolve(off, np.ones(STAMPS) / STAMPS, "valid")
    steady = np.ptp(runs) < LATE * even.interval and share + CERTAIN_SHARE * error < 0.5
    if not steady or slips_of(even.times, work.theta, fewest=1):
        return None
    width, lost = even.missed, round((even.times[-1] - even.times[0]) / even.interval - place[-1])
    work.time, work.clock_stderr = even.times, even.stderr / even.interval
    rate = estimate_text(Estimate(1 / even.interval, work.clock_stderr / even.interval))
    missing = f", {counted(lost, 'reading')} lost" if lost else ""
    return work.finding("time-coarse.scatter", width=width, lost=missing, rate=rate)


def _line(time: Floats, place: Floats) -> _Even:
    """Return the even times nearest to stamps; ``missed`` is the range of the differences."""
    far = place - place.mean()
    interval = float(far @ time) / float(far @ far)
    times = time.mean() + interval * far
    # Stamps of one tick are alike: the error is that of independent means of blocks.
    block = math.isqrt(time.size)
    means = (time - times)[: block * block].reshape(block, block).mean(axis=1)
    spread = max(float(np.std(time - times)), math.sqrt(block) * float(np.std(means)))
    stderr = spread / math.sqrt(float(far @ far))
    return _Even(interval, stderr, times, float(np.ptp(time - times)))


def _with_lost(time: Floats, place: Floats) -> Floats:
    """Return the places of readings, of which some are lost where all later stamps are late."""
    from scipy.ndimage import maximum_filter1d

    places, beside = place.copy(), min(STAMPS, time.size // 8)
    edge = np.arange(3, time.size - 2)
    low, high = np.maximum(edge - beside, 0), np.minimum(edge + beside, time.size)

    def steps(values: Floats) -> Floats:
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
            places[k:] += round(lost) if abs(lost) < RESTART else lost
    line = _line(time, places)
    nearest = np.round((time - line.times[0]) / line.interval)
    for better in (nearest, places):
        if np.all(np.diff(better) > 0.5) and _line(time, better).missed <= line.missed:
            return better
    return place


def _followed(time: Floats, even: _Even, channels: Floats) -> tuple[float, float, float]:
    """Return what :func:`_share` does, of the channel that determines the share best."""
    off = time - even.times
    return min((_share(even.times, off, v) for v in channels), key=operator.itemgetter(1))


def _share(times: Floats, off: Floats, values: Floats) -> tuple[float, float, float]:
    """Return the share of the stamps' scatter that a motion follows, its error, and the residual.

    About even times a reading is ``s(t) + share v off``: the share is 1 if the stamps are the
    instants of the readings, and 0 if the even times are.
    """

    def fitted(degree: int = 4, points: int = 9) -> LocalFit:
        fit = local_fit(times, values, degree=degree, points=points)
        size = np.abs(fit.residual)
        return fit.only(size <= OUTLIER * broad_scale(size))

    fit = raise_degree(fitted, fitted())
    if fit.middle.size < FEWEST_EDGES:
        return 1.0, math.inf, math.inf
    moved = np.interp(np.arange(times.size), fit.middle, fit.slope) * off
    points = 2 * fit.neighbours + 1
    other = local_fit(times, moved, degree=points - 5, points=points)
    follows = np.interp(fit.middle, other.middle, other.residual)
    power = max(float(follows @ follows), 1e-300)
    share = float(follows @ fit.residual) / power
    left = float(np.mean((fit.residual - share * follows) ** 2))
    return share, math.sqrt(left * fit.sum_of_squares / power), fit.rms


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
        work.refuse(
            f"the times must be in order, {np.sum(false)} of {false.size} are out of order, and"
            " sorted by time the angles are no smooth motion",
            rate_hz=100,
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
        work.refuse("the times must be in order, they do not increase", rate_hz=100)
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
        text = f"from_s and to_s must be times within {first:g} to {last:g} s, they leave"
        work.refuse(f"{text} {counted(work.time.size, 'sample')}", from_s=first, to_s=last)
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
