"""Rules of outliers and persistent jumps: missed counts of an encoder, slipped turns.

A push changes the velocity of a pendulum, but its angle is continuous: a jump that persists is an
error of the sensor, one that returns an outlier. A jump makes one difference between samples wrong,
an outlier two. Samples at an end of a record or a gap are judged by a cubic.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted, moment
from pendmap.records.angle import angle_of_rate
from pendmap.records.clock import longest_between
from pendmap.records.noise import DEGREES, fastest
from pendmap.records.steps import MOST_INTERVALS, sides_of, slips_of
from pendmap.records.work import Jump
from pendmap.signal.local_polynomial import POINTS, local_fit
from pendmap.signal.robust import broad_scale, normal_scale, widened

if TYPE_CHECKING:
    from pendmap.records.work import Work
    from pendmap.signal import Floats, Indices, Mask
    from pendmap.tables.findings import Finding

    Verdict = tuple[slice | Indices, Jump | None]

SUSPECT: Final = 10.0  # Local standard deviations of a residual above which it is examined
SUSPECT_SLOW: Final = 6.0  # The same where sampling is too slow for cubics
NEAR: Final = 4  # Readings on each side of a suspect that may be false as well
SCALE_SAMPLES: Final = 151  # Samples from which the local standard deviation is estimated
PASSES: Final = 8  # Most searches for outliers; each may reveal one next to another
MOST_OUTLIERS: Final = 0.1  # Greatest share of outliers; with more, no sample is marked
SIDE: Final = 10  # Samples on each side from which a sample is judged
MOST_TOGETHER: Final = 6  # Most neighbouring outliers that are distinguished from the motion
WEIGHT_STEPS: Final = 10  # Iterations of the weights of least absolute deviations
CERTAIN_JUMP: Final = 7.0  # Standard errors above which a step is a jump
OFF_COUNT: Final = 0.25  # Greatest deviation of a corrected jump from whole counts, counts
MOST_JUMPS: Final = 20  # Most jumps that are corrected
OFF_FRAME: Final = 0.05  # Greatest deviation of a slip from half or whole frames, frames
OFF_TURN: Final = 0.1  # Greatest deviation of a jump from whole turns, rad
OTHER_RECORD: Final = 0.5  # Size of a jump, rad, above which a second recording may begin
END_SAMPLES: Final = 10  # Samples of each end that are compared with predictions
END_GAP: Final = POINTS // 2  # Longest gap, intervals, that windows cross
FARTHEST_CUBIC: Final = 1.5  # Phase of a side, rad, above which a cubic does not follow a swing
PREDICTIONS: Final = 40  # Predictions further inside that give the usual error
END_DEGREES: Final = (2, 3)  # Degrees of the predicting polynomials


def outliers(work: Work) -> Finding | None:
    """Mark outliers, and note the jumps of the reading."""
    time, theta, bad = work.time.copy(), work.theta.copy(), ~work.trusted
    if theta.size < 2 * POINTS or bad.all():
        return None
    _bridge(time, theta, bad)
    false, jumps = np.zeros(theta.size, bool), list[Jump]()
    # The motion has corners next to clipped or frozen samples.
    corner = widened(bad, SIDE)
    judged = corner.copy()
    for _ in range(PASSES):
        seen = dataclasses.replace(work, time=time, theta=theta, trusted=~(bad | false))
        at, scale = _suspects(seen)
        at, scale = at[~judged[at]], scale[~judged[at]]
        if at.size + np.count_nonzero(false) > MOST_OUTLIERS * theta.size:
            return work.finding("not-smooth", percent=100 * MOST_OUTLIERS)
        verdicts = _judged(seen, at, scale)
        if not verdicts:
            break
        for k, group, jump in verdicts:
            judged[k] = True
            false[group] = True
            if jump is not None:
                jumps.append(jump)
                theta[jump.at :] -= jump.size
                time[jump.at :] += jump.slip
        _bridge(time, theta, false)
    false |= ~corner & false_ends(time, theta, ~(bad | false), SUSPECT, work.count)
    _bridge(time, theta, false)
    work.jumps = sorted(jumps, key=lambda jump: jump.at)
    moved = np.zeros(theta.size)
    for jump in work.jumps:
        moved[jump.at :] += jump.size
    work.bridged = theta + moved
    at, away = np.flatnonzero(false & work.trusted), np.abs(work.theta - moved - theta)
    worst = np.max(away[at], initial=0.0)
    return work.distrust(at, "outliers", "outlier", worst=worst, unit="rad")


def _bridge(time: Floats, theta: Floats, false: Mask) -> None:
    """Replace outliers by linear interpolation, in place."""
    if not false.all():
        theta[false] = np.interp(time[false], time[~false], theta[~false])


def _by_sides(seen: Work, k: int, verdict: Verdict) -> Verdict:
    """Return the outliers and the jump around ``k`` by the swings on both sides of it."""
    group, jump = verdict
    if jump is None and not _slow(seen):
        return verdict
    places = np.arange(seen.time.size)[group]
    low, high = min([k - NEAR, *(places - 1)]), max([k + NEAR + 1, *(places + 2)])
    between = slice(max(low, 0), high)
    sides = sides_of(seen.time, seen.theta, seen.trusted, between, seen.count)
    limit = CERTAIN_JUMP**2
    if sides is None or min(sides.steps, sides.slips) > limit:
        return verdict
    group = np.flatnonzero(sides.false)
    if sides.both < limit:
        return group, None
    if sides.steps > sides.slips:
        return group, Jump(sides.at, sides.step, sides.step_error, certain=True)
    # A clock slips by frames, or by half of one.
    interval = float(np.median(np.diff(seen.time)))
    slip = round(2 * sides.slip / interval) * interval / 2
    near = abs(sides.slip - slip) < 3 * sides.slip_error + OFF_FRAME * interval
    if not slip or not near or abs(slip) > MOST_INTERVALS * interval:
        return verdict
    return group, Jump(sides.at, 0.0, 0.0, slip)


def _slow(seen: Work) -> bool:
    """Return whether the sampling is too slow for cubics."""
    phase = fastest(seen.time, seen.theta, seen.count)[1] * float(np.median(np.diff(seen.time)))
    return SIDE * phase > FARTHEST_CUBIC


def _judged(
    seen: Work, at: Indices, scale: Floats
) -> list[tuple[int, slice | Indices, Jump | None]]:
    """Return suspects, with outliers and jumps; jumps near outliers are judged after them."""
    verdicts = [
        (k, *_by_sides(seen, k, _judge(seen.time, seen.theta, k, sigma, seen.count)))
        for k, sigma in zip(at.tolist(), scale.tolist(), strict=True)
    ]
    spikes = np.array([k for k, group, jump in verdicts if jump is None and seen.rows[group].size])
    return [
        (k, group, jump)
        for k, group, jump in verdicts
        if (k in spikes if jump is None else not np.any(np.abs(spikes - k) <= 2 * SIDE))
    ]


def _suspects(seen: Work) -> tuple[Indices, Floats]:
    """Return samples far from their neighbours, and the standard deviation around each."""
    from scipy.ndimage import maximum_filter1d, median_filter

    time, theta = seen.time, seen.theta
    best, *others = (local_fit(time, theta, degree=d, points=points) for d, points in DEGREES)
    for other in others:
        if normal_scale(other.residual) < 0.7 * normal_scale(best.residual):
            best = other
    size = np.abs(best.residual)
    if size.size < POINTS:
        return np.empty(0, np.intp), np.empty(0)
    limit = SUSPECT
    if _slow(seen):  # what the swings on both sides do not confirm is dropped
        limit = SUSPECT_SLOW
        size = np.maximum(size, np.abs(np.diff(best.residual, prepend=best.residual[0])) / 2**0.5)
    near = 1.4826 * median_filter(size, size=min(SCALE_SAMPLES, size.size), mode="nearest")
    scale = np.maximum(near, max(broad_scale(size), 1e-9))
    highest = maximum_filter1d(
        size, 2 * best.neighbours + 1, mode="nearest"
    )  # of windows in common
    which = (size > limit * scale + 2 * seen.count) & (size >= highest)
    return best.middle[which], scale[which]


def _judge(
    time: Floats, theta: Floats, k: int, sigma: float, count: float
) -> tuple[slice | Indices, Jump | None]:
    """Return the outliers around ``k``, and the jump there or None."""
    low, high = max(k - SIDE, 0), min(k + SIDE + 1, theta.size)
    t, part = time[low:high] - time[k], theta[low:high] - theta[k]
    step = np.diff(t)
    middle = (t[1:] + t[:-1]) / 2
    away = np.abs(_smooth(middle, np.diff(part) / step) * step)
    limit = max(5 * normal_scale(away), 3 * sigma) + count
    near = np.abs(np.arange(away.size) + 0.5 - (k - low)) <= MOST_TOGETHER
    odd = np.flatnonzero((away > limit) & near)
    if not odd.size:
        return slice(0), None
    first, last = int(odd[0]), int(odd[-1])
    # Include the other difference of an outlier at the border.
    while first > 0 and away[first - 1] > limit:
        first -= 1
    while last + 1 < away.size and away[last + 1] > limit:
        last += 1
    group = slice(low + first + 1, low + last + 1)
    before, after = slice(0, first + 1), slice(last + 1, part.size)
    if min(first + 1, part.size - last - 1) < 4:
        # Near an end a jump cannot be distinguished from outliers: mark the shorter side.
        if low == 0 and first + 1 < 4:
            return slice(0, group.stop), None
        return slice(group.start, theta.size) if high == theta.size else group, None
    width = max(abs(t[0]), abs(t[-1]))
    x = np.concatenate([t[before], t[after]]) / width
    jumped = np.concatenate([np.zeros(first + 1), np.ones(part.size - last - 1)])
    columns = np.column_stack([np.vander(x, 4), jumped])
    values = np.concatenate([part[before], part[after]])
    # Least absolute deviations tolerate other outliers nearby.
    answer = _least_absolute(columns, values)
    rest = normal_scale(values - columns @ answer)
    gain = math.sqrt(float(np.linalg.pinv(columns.T @ columns)[-1, -1]))
    error = gain * max(sigma, rest, count / math.sqrt(12))
    size = float(answer[-1])
    if abs(size) > CERTAIN_JUMP * error:
        return group, Jump(low + last + 1, size, error)
    # Samples between two outliers may be correct.
    inner = slice(first + 1, last + 1)
    off = np.abs(_smooth(t, part))
    far = 5 * max(sigma, normal_scale(off), count / math.sqrt(12)) + count
    return low + first + 1 + np.flatnonzero(off[inner] > far), None


def _smooth(x: Floats, y: Floats) -> Floats:
    """Return the residual of ``y`` from the cubic of least absolute deviations."""
    columns = np.vander(x / max(float(np.max(np.abs(x))), 1e-300), 4)
    return y - columns @ _least_absolute(columns, y)


def _least_absolute(columns: Floats, y: Floats) -> Floats:
    """Return coefficients of least absolute deviations, by iteratively reweighted fits."""
    weights = np.ones(y.size)
    answer = np.zeros(columns.shape[1])
    for _ in range(WEIGHT_STEPS):
        weighted = columns * weights[:, None]
        answer = np.asarray(
            np.linalg.lstsq(weighted.T @ columns, weighted.T @ y, rcond=None)[0], np.float64
        )
        away = np.abs(y - columns @ answer)
        weights = 1 / np.maximum(away, 1e-6 * float(np.max(away)) + 1e-300)
        weights /= float(np.max(weights))
    return answer


def slips(work: Work) -> Finding | None:
    """Correct the clock for jumps that are its slips."""
    if not work.jumps:
        return None
    clock = None if work.clock_stderr else slips_of(work.time, work.bridged)
    if clock is None:
        return _slips_of_jumps(work)
    number, size, error = counted(clock.places.size, "slip"), 1e3 * clock.slip, 1e3 * clock.stderr
    finding = work.finding("time-slips", at=clock.places, slips=number, size=size, error=error)
    work.time = clock.time
    work.jumps = [j for j in work.jumps if np.min(np.abs(clock.places - j.at)) > SIDE]
    return finding


def _slips_of_jumps(work: Work) -> Finding | None:
    """Move the times after each jump that is a slip of the clock."""
    late = [jump for jump in work.jumps if jump.slip]
    if not late:
        return None
    work.jumps = [jump for jump in work.jumps if not jump.slip]
    sizes = ", ".join(f"{1e3 * jump.slip:+.3g}" for jump in late[:4])
    at = np.array([jump.at for jump in late])
    finding = work.finding("time-slips.each", at=at, slips=counted(at.size, "slip"), sizes=sizes)
    for jump in late:
        work.time[jump.at :] += jump.slip
    # A frame that comes twice has the time of the one before.
    early = np.minimum.accumulate(work.time[::-1])[::-1]
    again = np.append(np.diff(early) < OFF_FRAME * np.median(np.diff(work.time)), False)
    if again.any():
        before = np.cumsum(again)
        work.jumps = [dataclasses.replace(j, at=j.at - int(before[j.at - 1])) for j in work.jumps]
        work.bridged = work.bridged[~again]
        work.keep(~again)
    return finding


def jumps(work: Work) -> Finding | None:
    """Correct jumps by whole turns or counts, or keep the longest part between jumps."""
    if not work.jumps:
        return None
    places = np.asarray([jump.at for jump in work.jumps], np.intp)
    number = counted(places.size, "jump")
    if places.size > MOST_JUMPS:
        return work.finding("missed-counts.many", at=places, jumps=number)
    sizes = [jump.size for jump in work.jumps]
    turns = [round(size / math.tau) for size in sizes]
    off = [abs(size - n * math.tau) for size, n in zip(sizes, turns, strict=True)]
    counts = [_whole(jump, work.count) for jump in work.jumps]
    step, whole, key = work.count, counts, "missed-counts.whole"
    if all(turns) and max(off) < OFF_TURN:
        step, whole, key = math.tau, turns, "turns-slipped"
    if all(whole):
        for at, steps in zip(places, whole, strict=True):
            work.theta[at:] -= steps * step
        by = ", ".join(f"{count:+d}" for count in counts[:4])
        return work.finding(key, at=places, jumps=number, counts=by)
    noise = normal_scale(local_fit(work.time, work.bridged).residual)
    if all(jump.certain and jump.error < max(noise, OFF_COUNT * work.count) for jump in work.jumps):
        for jump in work.jumps:
            work.theta[jump.at :] -= jump.size
        errors = [f"{j.size:+.3g} +- {j.error:.1g}" for j in work.jumps[:4]]
        return work.finding("missed-counts.sized", at=places, jumps=number, sizes=", ".join(errors))
    low, high = longest_between([0, *places.tolist()], work.time.size)
    work.trusted[:low] = work.trusted[high:] = False
    other = ", or another recording begins" if max(map(abs, sizes)) > OTHER_RECORD else ""
    return work.finding(
        "missed-counts",
        at=places,
        jumps=number,
        sizes=", ".join(f"{size:+.3g}" for size in sizes[:4]),
        other=other,
        begin=moment(work.time[low]),
        end=moment(work.time[high - 1]),
    )


def _whole(jump: Jump, count: float) -> int:
    """Return the number of counts of a jump, 0 if it is uncertain."""
    if not count or jump.error > OFF_COUNT * count:
        return 0
    number = round(jump.size / count)
    return number if abs(jump.size / count - number) < OFF_COUNT else 0


def spikes(work: Work) -> Finding | None:
    """Mark readings of a rate far from all their neighbours; steps are none."""
    from scipy.ndimage import median_filter

    values = work.extra["velocity"]
    fit = local_fit(work.time, values)
    size = np.abs(fit.residual)
    if size.size < POINTS:
        return None
    away = values - median_filter(values, 5, mode="nearest")
    limit = 2 * SUSPECT * broad_scale(size)
    at = fit.middle[(size > limit) & (np.abs(away[fit.middle]) > limit)]
    if at.size > MOST_OUTLIERS * values.size:
        return None
    worst = np.max(np.abs(away[at]), initial=0.0)
    return work.distrust(at, "outliers", "outlier", worst=worst, unit="rad/s")


def integrate_again(work: Work) -> None:
    """Integrate a rate without the readings that are marked."""
    work.theta = angle_of_rate(work.time, work.extra["velocity"], work.trusted)


def false_ends(time: Floats, theta: Floats, trusted: Mask, limit: float, count: float) -> Mask:
    """Return the mask of outliers at ends and gaps; ``limit`` is in usual errors of prediction."""
    false = np.zeros(theta.size, bool)
    good = np.flatnonzero(trusted)
    if good.size < 2:
        return false
    interval = float(np.median(np.diff(time[good])))
    cuts = np.flatnonzero(np.diff(time[good]) > END_GAP * interval) + 1
    near = END_SAMPLES + PREDICTIONS + POINTS
    for piece in np.split(good, cuts):
        if piece.size < near:
            continue
        for end in (piece[:near], piece[:-near:-1]):
            lag = (time[end] - time[end[0]]) / interval
            false[end[:END_SAMPLES]] |= _missed_at_end(lag, theta[end].copy(), limit, count)
    return false


def _missed_at_end(lag: Floats, theta: Floats, limit: float, count: float) -> Mask:
    """Return the mask of outliers among the first readings, tested from the inside outward."""

    def missed(k: int, degree: int) -> float:
        """Return how far a reading is from the polynomial through the nine after it."""
        after = slice(k + 1, k + 1 + POINTS)
        return float(theta[k] - np.polyfit(lag[after] - lag[k], theta[after], degree)[-1])

    inner = range(END_SAMPLES, lag.size - POINTS)
    usual = {d: normal_scale(np.array([missed(k, d) for k in inner])) for d in END_DEGREES}
    degree = min(usual, key=usual.__getitem__)
    false = np.zeros(END_SAMPLES, bool)
    for k in range(END_SAMPLES - 1, -1, -1):
        away = missed(k, degree)
        if abs(away) > limit * usual[degree] + 2 * count:
            false[k] = True
            theta[k] -= away
    return false
