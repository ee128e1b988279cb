"""Outliers, and jumps that stay: counts that an encoder missed, turns that it slipped.

A push changes the velocity of a pendulum, never its angle at once: a jump of the angle that stays
is the sensor's, one that goes back is an outlier. Where a sample is far from the polynomial through
its neighbours, the differences between samples tell the two apart: a jump makes one of them
false, an outlier those before and behind it.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted, moment
from pendmap.records.clock import slips_of
from pendmap.records.local_fits import DEGREES
from pendmap.signal.local_polynomial import POINTS, local_fit
from pendmap.signal.robust import broad_scale, normal_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]
    _Group = slice | NDArray[np.intp]
    from collections.abc import Sequence


SPIKE: Final = 10.0
"""Local standard deviations of a residual that are looked into. White noise reaches 6 once in
5e8 samples; the rest is for noise with long tails, as real encoders have."""

NEARBY: Final = 151
"""Samples around each that its scale comes from: more than a false stretch, less than a decay."""

PASSES: Final = 8
"""Times that false samples are looked for; each may uncover what stood beside another."""

MOST_SPIKES: Final = 0.1
"""Share of samples beyond which they are no outliers, but what the sensor does."""

SIDE: Final = 10
"""Samples on each side that a sample is judged by."""

TOGETHER: Final = 6
"""False samples that may stand together and be told from the motion."""

STEPS: Final = 10
"""Of the weights, until what is far has none."""

CLEAR: Final = 7.0
"""Standard errors that make a jump."""

WHOLE: Final = 0.25
"""Counts by which a jump may miss a whole number of them and be mended by that number."""

MOST: Final = 20
"""Jumps beyond which it is not counts that are missed."""

TURN: Final = 2 * math.pi

SLIP: Final = 0.1
"""Radians by which a jump may miss whole turns and be one: the angle is the same either way."""

APART: Final = 0.5
"""Radians of a jump from which two recordings may stand in one file."""


@dataclasses.dataclass(frozen=True)
class _Jump:
    """The zero moves by ``size`` +- ``error`` rad before sample ``at``."""

    at: int
    size: float
    error: float


def find(work: Work) -> None:
    """Mark outliers; mend jumps by whole counts, of others keep the longest part; and say so."""
    if work.time.size < 2 * POINTS:
        return
    theta = work.theta.copy()
    bad = ~work.trusted
    if bad.all():
        return
    _bridge(work.time, theta, bad)
    false, jumps = np.zeros(theta.size, bool), list[_Jump]()
    # Around what is clipped or frozen already the motion has corners of its own.
    # (Cut out by hand: "same" is the window's length in a record shorter than the window.)
    corner = np.convolve(bad, np.ones(2 * SIDE + 1))[SIDE : SIDE + bad.size] > 0.5
    seen = corner.copy()
    for _ in range(PASSES):
        at, scale = _suspects(work, theta)
        at, scale = at[~seen[at]], scale[~seen[at]]
        if at.size + np.count_nonzero(false) > MOST_SPIKES * theta.size:
            text = f"more than {100 * MOST_SPIKES:.0f} % of the samples contradict their neighbours"
            work.say("not-smooth", text)
            return
        told = _told(work, theta, at, scale)
        if not told:
            break
        for k, group, jump in told:
            seen[k] = True
            false[group] = True
            if jump is not None:
                jumps.append(jump)
                theta[jump.at :] -= jump.size
        _bridge(work.time, theta, false)
    false |= ~corner & false_ends(work.time, theta, ~(bad | false), SPIKE, work.count)
    _bridge(work.time, theta, false)
    _outliers(work, theta, false, jumps)
    jumps = _of_time(work, theta, sorted(jumps, key=lambda jump: jump.at))
    _moved(work, jumps)


def _bridge(time: Floats, theta: Floats, false: NDArray[np.bool_]) -> None:
    """Put straight lines where samples are false."""
    if not false.all():
        theta[false] = np.interp(time[false], time[~false], theta[~false])


def _told(
    work: Work, theta: Floats, at: NDArray[np.intp], scale: Floats
) -> list[tuple[int, _Group, _Jump | None]]:
    """Return suspects with what is false around them, those that can be told already.

    What is not told beside another false sample is looked at again once that one is mended; so is
    a jump, which some outliers together may look like.
    """
    verdicts = [
        (k, *_judge(work.time, theta, k, sigma, work.count))
        for k, sigma in zip(at.tolist(), scale.tolist(), strict=True)
    ]
    spikes = np.array([k for k, group, jump in verdicts if jump is None and theta[group].size])
    return [
        (k, group, jump)
        for k, group, jump in verdicts
        if (k in spikes if jump is None else not np.any(np.abs(spikes - k) <= 2 * SIDE))
    ]


def _suspects(work: Work, theta: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Return samples far from their neighbours, and the standard deviation around each."""
    from scipy.ndimage import maximum_filter1d, median_filter

    degree, points = _degree(work.time, theta)
    fit = local_fit(work.time, theta, degree=degree, points=points)
    size = np.abs(fit.residual)
    if size.size < POINTS:
        return np.empty(0, np.intp), np.empty(0)
    near = 1.4826 * median_filter(size, size=min(NEARBY, size.size), mode="nearest")
    scale = np.maximum(near, max(broad_scale(size), 1e-9))
    # What is false shows in every window that it is part of, most in its own.
    highest = maximum_filter1d(size, 2 * fit.neighbours + 1, mode="nearest")
    which = (size > SPIKE * scale + 2 * work.count) & (size >= highest)
    return fit.middle[which], scale[which]


def _degree(time: Floats, theta: Floats) -> tuple[int, int]:
    """Return the polynomial that leaves least: higher ones where the sampling is slow."""
    best, least = DEGREES[0], math.inf
    for degree, points in DEGREES[:3]:
        scale = normal_scale(local_fit(time, theta, degree=degree, points=points).residual)
        if scale < 0.7 * least:
            best, least = (degree, points), scale
    return best


def _judge(
    time: Floats, theta: Floats, k: int, sigma: float, count: float
) -> tuple[_Group, _Jump | None]:
    """Return which samples around ``k`` are false, and the jump there, if there is one."""
    low, high = max(k - SIDE, 0), min(k + SIDE + 1, theta.size)
    t, part = time[low:high] - time[k], theta[low:high] - theta[k]
    step = np.diff(t)
    middle = (t[1:] + t[:-1]) / 2
    away = np.abs(_smooth(middle, np.diff(part) / step) * step)
    limit = max(5 * normal_scale(away), 3 * sigma) + count
    near = np.abs(np.arange(away.size) + 0.5 - (k - low)) <= TOGETHER
    odd = np.flatnonzero((away > limit) & near)
    if not odd.size:
        return slice(0), None
    first, last = int(odd[0]), int(odd[-1])
    # The other half of an outlier that stands just beyond.
    while first > 0 and away[first - 1] > limit:
        first -= 1
    while last + 1 < away.size and away[last + 1] > limit:
        last += 1
    group = slice(low + first + 1, low + last + 1)
    before, after = slice(0, first + 1), slice(last + 1, part.size)
    if min(first + 1, part.size - last - 1) < 4:
        # At an end of the record nobody can tell; the shorter side is not believed.
        if low == 0 and first + 1 < 4:
            return slice(0, group.stop), None
        return slice(group.start, theta.size) if high == theta.size else group, None
    width = max(abs(t[0]), abs(t[-1]))
    x = np.concatenate([t[before], t[after]]) / width
    jumped = np.concatenate([np.zeros(first + 1), np.ones(part.size - last - 1)])
    columns = np.column_stack([np.vander(x, 4), jumped])
    values = np.concatenate([part[before], part[after]])
    # By least absolute distances: other false samples may be near.
    answer = _least_absolute(columns, values)
    rest = normal_scale(values - columns @ answer)
    gain = math.sqrt(float(np.linalg.pinv(columns.T @ columns)[-1, -1]))
    error = gain * max(sigma, rest, count / math.sqrt(12))
    size = float(answer[-1])
    if abs(size) > CLEAR * error:
        return group, _Jump(low + last + 1, size, error)
    # Between two outliers there may be samples that are sound.
    inner = slice(first + 1, last + 1)
    off = np.abs(_smooth(t, part))
    far = 5 * max(sigma, normal_scale(off), count / math.sqrt(12)) + count
    return low + first + 1 + np.flatnonzero(off[inner] > far), None


def _smooth(x: Floats, y: Floats) -> Floats:
    """Return what ``y`` is away from the cubic of least absolute distances."""
    columns = np.vander(x / max(float(np.max(np.abs(x))), 1e-300), 4)
    return y - columns @ _least_absolute(columns, y)


def _least_absolute(columns: Floats, y: Floats) -> Floats:
    """Return the coefficients of least absolute distances, by weighting squares again and again."""
    weights = np.ones(y.size)
    answer = np.zeros(columns.shape[1])
    for _ in range(STEPS):
        weighted = columns * weights[:, None]
        answer = np.asarray(
            np.linalg.lstsq(weighted.T @ columns, weighted.T @ y, rcond=None)[0], np.float64
        )
        away = np.abs(y - columns @ answer)
        weights = 1 / np.maximum(away, 1e-6 * float(np.max(away)) + 1e-300)
        weights /= float(np.max(weights))
    return answer


def _outliers(work: Work, theta: Floats, false: NDArray[np.bool_], jumps: list[_Jump]) -> None:
    at = np.flatnonzero(false & work.trusted)
    if not at.size:
        return
    moved = np.zeros(theta.size)
    for jump in jumps:
        moved[jump.at :] += jump.size
    worst = float(np.max(np.abs(work.theta - moved - theta)[at]))
    work.trusted[at] = False
    text = f"{counted(at.size, 'outlier')}, the farthest by {worst:.3g} rad: not for fitting"
    work.say("outliers", text, at=at)


def _of_time(work: Work, smooth: Floats, jumps: list[_Jump]) -> list[_Jump]:
    """Mend the clock where jumps are its slips; return those that are not."""
    if not jumps:
        return []
    moved = np.zeros(smooth.size)
    for jump in jumps:
        moved[jump.at :] += jump.size
    found = slips_of(work.time, smooth + moved)
    if found is None:
        return jumps
    many = counted(found.places.size, "slip")
    text = (
        f"{many} of time: the readings jump by their velocity times {1e3 * found.slip:.4g} +-"
        f" {1e3 * found.stderr:.1g} ms, an interval, and not by counts: the times after each are"
        " moved by whole intervals"
    )
    work.say("time-slips", text, mended=True, at=found.places)
    work.time = found.time
    return [j for j in jumps if np.min(np.abs(found.places - j.at)) > SIDE]


def _moved(work: Work, jumps: list[_Jump]) -> None:
    """Mend jumps by a whole number of counts; of others keep the longest part."""
    if not jumps:
        return
    places = np.asarray([jump.at for jump in jumps], np.intp)
    if len(jumps) > MOST:
        text = f"{counted(len(jumps), 'jump')} of the reading that stay: the zero wanders"
        work.say("missed-counts", text, at=places)
        return
    turns = [round(jump.size / TURN) for jump in jumps]
    off = [abs(j.size - n * TURN) for j, n in zip(jumps, turns, strict=True)]
    if all(turns) and max(off) < SLIP:
        for at, number in zip(places, turns, strict=True):
            work.theta[at:] -= number * TURN
        text = f"{counted(len(jumps), 'jump')} of the reading by whole turns, taken back"
        work.say("turns-slipped", text, mended=True, at=places)
        return
    whole = [_whole(jump, work.count) for jump in jumps]
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
    said = ", ".join(f"{jump.size:+.3g}" for jump in jumps[:4])
    or_else = ""
    if max(abs(jump.size) for jump in jumps) > APART:
        or_else = ", or another recording begins"
    text = (
        f"{counted(len(jumps), 'jump')} of the reading ({said} rad) that stay{or_else}:"
        f" {moment(work.time[edges[longest]])} to {moment(work.time[edges[longest + 1] - 1])} s is"
        " for fitting"
    )
    work.say("missed-counts", text, at=places)


def _whole(jump: _Jump, count: float) -> int:
    """Return the counts of a jump, 0 where they are not certain."""
    if not count or jump.error > WHOLE * count:
        return 0
    number = round(jump.size / count)
    return number if abs(jump.size / count - number) < WHOLE else 0


# Outliers of an accelerometer and a gyroscope: readings far from their neighbours.


def find_spikes(work: Work, values: Floats, unit: str, free: Sequence[tuple[int, int]]) -> None:
    """Mark readings of another kind that are far from their neighbours, and say so.

    An accelerometer may jump, where friction turns round; what does not come back is not looked
    into. It does jump where a hand lets go or takes hold, at the ends of the ``free`` swings
    (first place and the one after the last), and outside of them nothing is fitted.
    """
    from scipy.ndimage import maximum_filter1d

    if work.time.size < 2 * POINTS:
        return
    fit = local_fit(work.time, values)
    size = np.abs(fit.residual)
    if size.size < POINTS:
        return
    # What is false shows in every window that it is part of, most in its own.
    highest = maximum_filter1d(size, 2 * fit.neighbours + 1, mode="nearest")
    at = fit.middle[(size > 2 * SPIKE * broad_scale(size)) & (size >= highest)]
    inside = np.zeros(values.size, bool)
    for low, high in free:
        begin = low + POINTS if low else 0
        inside[begin : high if high == values.size else high - POINTS] = True
    at = at[inside[at]]
    if not at.size or at.size > MOST_SPIKES * values.size:
        return
    near = np.array([np.median(values[max(k - SIDE, 0) : k + SIDE + 1]) for k in at])
    worst = float(np.max(np.abs(values[at] - near)))
    work.trusted[at] = False
    text = f"{counted(at.size, 'outlier')}, the farthest by {worst:.3g} {unit}: not for fitting"
    work.say("outliers", text, at=at)


# Outliers with neighbours on one side only: at the ends of a record and beside its gaps.
#
# No window has such a sample in its middle, so each is predicted from those further in. How far a
# prediction may miss is seen in the record itself, a little further in, where outliers are known.


REACH: Final = 10
"""Samples of each end that are judged: of the first few no window is the middle, and behind them
are too few to tell an outlier from a jump."""

GAP: Final = POINTS // 2
"""Intervals without a sample beyond which no window goes."""

TRIED: Final = 40
"""Predictions further in that show how far they miss."""

DEGREES_AT_END: Final = (2, 3)
"""Of the polynomials: higher ones carry noise too far beyond their last sample."""


def false_ends(
    time: Floats, theta: Floats, trusted: NDArray[np.bool_], limit: float, count: float
) -> NDArray[np.bool_]:
    """Return which readings at the ends of a record and of its gaps are outliers, shape (N,).

    Parameters
    ----------
    time, theta : ndarray, shape (N,)
        s, increasing; rad, without the outliers that are known.
    trusted : ndarray of bool, shape (N,)
        What is known to be false is neither judged nor believed.
    limit : float
        Times the usual miss of a prediction that make an outlier.
    count : float
        Step of the readings, rad; 0 if they have none.
    """
    false = np.zeros(theta.size, bool)
    good = np.flatnonzero(trusted)
    if good.size < 2:
        return false
    interval = float(np.median(np.diff(time[good])))
    cuts = np.flatnonzero(np.diff(time[good]) > GAP * interval) + 1
    near = REACH + TRIED + POINTS
    for piece in np.split(good, cuts):
        if piece.size < near:
            continue
        for end in (piece[:near], piece[:-near:-1]):
            lag = (time[end] - time[end[0]]) / interval
            false[end[:REACH]] |= _missed_at_end(lag, theta[end].copy(), limit, count)
    return false


def _missed_at_end(lag: Floats, theta: Floats, limit: float, count: float) -> NDArray[np.bool_]:
    """Judge the first readings, the inner ones first; of outliers the prediction is believed."""
    tried = {degree: _usual(lag, theta, degree) for degree in DEGREES_AT_END}
    degree = min(tried, key=tried.__getitem__)
    missed = np.zeros(REACH, bool)
    for k in range(REACH - 1, -1, -1):
        there = float(_before(lag, theta, np.array([k]), degree)[0])
        if abs(theta[k] - there) > limit * tried[degree] + 2 * count:
            missed[k] = True
            theta[k] = there
    return missed


def _usual(lag: Floats, theta: Floats, degree: int) -> float:
    """Return by how much predictions miss further in, as a standard deviation."""
    places = np.arange(REACH, lag.size - POINTS)
    return normal_scale(theta[places] - _before(lag, theta, places, degree))


def _before(lag: Floats, theta: Floats, places: NDArray[np.intp], degree: int) -> Floats:
    """Return what polynomials through the nine samples behind each place are there."""
    behind = places[:, None] + np.arange(1, POINTS + 1)
    x = lag[behind] - lag[places, None]
    powers = (x / x[:, -1:])[:, :, None] ** np.arange(degree + 1)
    return np.asarray(np.einsum("mp,mp->m", np.linalg.pinv(powers)[:, 0, :], theta[behind]))
