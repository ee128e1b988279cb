"""Releases of a free record: where a motion begins and ends that nobody touches."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.signal.half_cycles import after_turns, swings
from pendmap.signal.local_polynomial import local_fit
from pendmap.signal.robust import normal_scale, true_runs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Places = tuple[int, int]
    Floats = NDArray[np.float64]


RISE: Final = 0.1
"""Share of the largest swing by which a free swing grows only if somebody helps."""

HELD: Final = 1.5
"""Times longer than a release from rest takes to be seen, from where it was held before."""

UPRIGHT: Final = 0.05
"""Sine of an angle below which a pendulum leaves so slowly that a hold cannot be told."""

BEFORE: Final = ((0.5, 0.2), (0.7, 0.4))
"""Periods before a motion between which a hold is looked for: from near the top it leaves slowly,
and is seen to move later."""

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
    hand = touched(work, period, parts)
    free = [
        (_let_go(work, part, hand, middle, period, noise), part[1])
        for part in without_hand(work.time, parts, hand, period)
    ]
    return [piece for part in free for piece in grown(work, part, middle, limit)]


def _let_go(  # noqa: PLR0913, PLR0917 (a motion, and what is known of it)
    work: Work,
    part: Places,
    hand: NDArray[np.bool_],
    middle: float,
    period: float,
    noise: float,
) -> int:
    """Return where a motion that begins with a quiet hold has clearly left it."""
    low, high = part
    for shares in BEFORE:
        before, sure = (
            int(np.searchsorted(work.time, work.time[low] - share * period)) for share in shares
        )
        level = _quiet(work, before, sure, noise)
        left = None if level is None else _left(work, (sure, high), level, noise)
        if left is None:
            continue
        if hand[before:low].all():
            # A hand is known to let go only later.
            found = held_short(work, (before, high), middle, period, noise)
            return low if found is None else min(low, found)
        return max(low, left)
    return low


def _quiet(work: Work, low: int, high: int, noise: float) -> float | None:
    """Return the level that readings keep; none if they do not."""
    hold = work.theta[low:high][work.trusted[low:high]]
    if hold.size < FEWEST_HELD:
        return None
    # A hand that trembles drifts more than noise does.
    early, late = np.array_split(hold, 2)
    drift = abs(float(np.mean(early) - np.mean(late)))
    spread = float(np.diff(np.quantile(hold, [0.05, 0.95]))[0])
    still = spread <= max(4 * noise, 2 * work.count)
    calm = drift <= max(4 * noise / math.sqrt(hold.size), work.count / 4)
    return float(np.median(hold)) if still and calm else None


def _seen(work: Work, noise: float) -> float:
    """Return how far from a hold no reading of it is, rad."""
    return max(6 * noise, 1.5 * work.count, 1e-4)


def _left(work: Work, part: Places, level: float, noise: float) -> int | None:
    """Return from which place on the angle is clearly off a level, several readings in a row.

    All before may be held; of a release some readings of the first tenth of a second are lost.
    """
    good = np.flatnonzero(work.trusted[slice(*part)]) + part[0]
    off = work.theta[good] - level
    seen = _seen(work, noise)
    away = np.where(off > seen, 1, np.where(off < -seen, -1, 0))
    runs = np.flatnonzero((away[:-2] != 0) & (away[:-2] == away[1:-1]) & (away[1:-1] == away[2:]))
    return int(good[runs[0]]) if runs.size else None


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


def held_short(work: Work, part: Places, middle: float, period: float, noise: float) -> int | None:
    """Return where a motion has left a level that it was held at for less than a period before.

    Nothing is returned where it leaves as soon as a release from rest does.
    """
    low = part[0]
    if not work.trusted[low : low + 5].all():
        return None
    # The first readings say where it is held, then all that are near them.
    level = float(np.median(work.theta[low : low + 5]))
    left = _left(work, part, level, noise)
    if left is None:
        return None
    level = float(np.median(work.theta[low : max(low + 5, (low + left) // 2)]))
    left = _left(work, part, level, noise)
    pull = abs(math.sin(level - middle))
    if left is None or pull < UPRIGHT:
        return None
    w0 = 2 * math.pi / period
    usual = math.sqrt(2 * _seen(work, noise) / (w0**2 * pull))
    interval = float(np.median(np.diff(work.time)))
    if work.time[left] - work.time[low] <= HELD * usual + 4 * interval:
        return None
    return left


# Where a hand holds or carries the pendulum: there gravity alone does not explain its motion.


SHARE: Final = 0.3
"""Share of the greatest restoring torque nearby that only a hand adds: friction is some per cent of
it while the pendulum swings, and an angle at which it is held shows all of it."""

WINDOW: Final = 0.2
"""Periods that a second derivative is taken over: a cubic bends it by a few per cent then."""

CERTAIN: Final = 6.0
"""Standard deviations of the second derivative beyond which it is not noise."""

USUAL: Final = 4.0
"""Times the median remainder, which is what all that is no hand leaves."""

SAMPLES: Final = 20.0
"""Samples a period under which a second derivative says too little."""

KEPT: Final = 0.6
"""Share of the samples that are taken for free: a hand has the others at most."""

STEPS: Final = 12
"""Concentration steps; half as many are enough."""

LONG: Final = 0.5
"""Periods that a hand holds for at least: knocks and magnets act for less."""


def touched(work: Work, period: float, parts: list[Places]) -> NDArray[np.bool_]:
    """Return which samples of a free record a hand moves, shape (N,).

    The remainder of ``th'' + w0^2 sin(th - th0) + c th' + Tr sign(th')`` is large there, with
    coefficients from the samples that agree best (least trimmed squares).

    Parameters
    ----------
    work : Work
        A free record; readings that are not trusted are passed over by straight lines.
    period : float
        Of small swings, s, roughly.
    parts : list of (int, int)
        Where it moves: first place and the one after the last. A long hold would outvote the rest.
    """
    from scipy.ndimage import binary_dilation, maximum_filter1d
    from scipy.signal import savgol_filter

    none = np.zeros(work.time.size, bool)
    good = work.trusted
    interval = float(np.median(np.diff(work.time)))
    count = math.floor((work.time[-1] - work.time[0]) / interval) + 1
    window = max(round(WINDOW * period / interval), 5) | 1
    if period / interval < SAMPLES or count > 10 * work.time.size or count < 4 * window:
        return none
    even = work.time[0] + interval * np.arange(count)
    theta = np.interp(even, work.time[good], work.theta[good])
    bend = savgol_filter(theta, window, 3, deriv=2, delta=interval)
    speed = savgol_filter(theta, window, 3, deriv=1, delta=interval)
    columns = np.column_stack([np.sin(theta), np.cos(theta), speed, np.sign(speed)])
    moving = np.zeros(count, bool)
    for low, high in parts:
        moving[(even >= work.time[low]) & (even <= work.time[high - 1])] = True
    if not moving.any():
        return none
    fitted = _trimmed(columns[moving], -bend[moving], (2 * math.pi / period) ** 2)
    gravity = float(np.hypot(fitted[0], fitted[1]))
    if not 0.3 < gravity / (2 * math.pi / period) ** 2 < 3:
        return none
    rest = np.abs(bend + columns @ fitted)
    pull = np.abs(columns[:, :2] @ fitted[:2])
    # Of the swing before and of the swing after the smaller one: a hand is between unlike ones.
    half = round(period / interval / 2)
    sides = [
        maximum_filter1d(pull, 2 * half + 1, mode="nearest", origin=side * half) for side in (-1, 1)
    ]
    restoring = np.minimum(*sides)
    noise = normal_scale(local_fit(work.time[good], work.theta[good]).residual)
    # A second derivative by least squares over n samples: sigma sqrt(720 / n^5) / dt^2.
    error = max(noise, work.count / math.sqrt(12)) * math.sqrt(720 / window**5) / interval**2
    usual = USUAL * float(np.median(rest[moving]))
    moved = rest > np.maximum(np.maximum(SHARE * restoring, CERTAIN * error), usual)
    # Within a gap there are no readings that could tell.
    places = np.flatnonzero(good)
    gaps = np.flatnonzero(np.diff(work.time[good]) > window * interval / 4)
    for k in gaps:
        low, high = work.time[places[k]], work.time[places[k + 1]]
        moved[(even > low - period / 4) & (even < high + period / 4)] = False
    moved[(even < work.time[places[0]] + period / 4) & ~good[0]] = False
    moved[(even > work.time[places[-1]] - period / 4) & ~good[-1]] = False
    moved = binary_dilation(moved, iterations=window // 2)
    nearest = np.clip(np.round((work.time - work.time[0]) / interval), 0, count - 1)
    return np.asarray(moved[nearest.astype(np.intp)], bool)


def _trimmed(columns: Floats, target: Floats, gravity: float) -> Floats:
    """Return coefficients by least trimmed squares.

    Concentration steps of Rousseeuw & Van Driessen (2006), Data Mining and Knowledge Discovery 12,
    29, from a pendulum of about the right period.
    """
    answer = np.array([gravity, *[0.0] * (columns.shape[1] - 1)])
    for _ in range(STEPS):
        away = np.abs(target - columns @ answer)
        agree = away <= np.quantile(away, KEPT)
        answer = np.linalg.lstsq(columns[agree], target[agree], rcond=None)[0]
    return answer


def without_hand(
    time: NDArray[np.float64], parts: list[Places], hand: NDArray[np.bool_], period: float
) -> list[Places]:
    """Return the stretches of motions in which nobody holds the pendulum.

    Parameters
    ----------
    time : ndarray, shape (N,)
        s.
    parts : list of (int, int)
        First place of each and the one after the last.
    hand : ndarray of bool, shape (N,)
        As of :func:`touched`.
    period : float
        Of small swings, s.
    """
    touches: list[Places] = []
    for a, b in zip(*(ends.tolist() for ends in true_runs(hand)), strict=True):
        # A hand that trembles lets go for a moment.
        if touches and time[a] - time[touches[-1][1] - 1] < LONG * period / 2:
            touches[-1] = (touches[-1][0], b)
        else:
            touches.append((a, b))
    held = np.zeros(time.size, bool)
    for a, b in touches:
        if time[b - 1] - time[a] >= LONG * period:
            # One that begins to carry may move for a while as the pendulum would.
            near = [
                t for t in touches if time[a] - time[t[1] - 1] < period > time[t[0]] - time[b - 1]
            ]
            held[near[0][0] : near[-1][1]] = True
    free = []
    for low, high in parts:
        begin, end = true_runs(~held[low:high])
        free += [(low + a, low + b) for a, b in zip(begin.tolist(), end.tolist(), strict=True)]
    return [(a, b) for a, b in free if b - a > 5 and time[b - 1] - time[a] > LONG * period]
