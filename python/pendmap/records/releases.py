"""Releases of a free record: detection of the free motions between holds and touches by hand."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.signal.half_cycles import after_turns, swings
from pendmap.signal.local_polynomial import local_fit
from pendmap.signal.robust import between, even_times, normal_scale, stretches, widened

if TYPE_CHECKING:
    from pendmap.records.work import Work
    from pendmap.signal import Floats, Mask, Stretch


RELEASE_RISE: Final = 0.1  # Growth of a swing, over the largest, that only a hand causes
HELD_LONGER: Final = 1.5  # Delay, over that of a release from rest, above which there is a hold
NEAR_UPRIGHT: Final = 0.05  # Sine of an angle below which a release is too slow to detect
HOLD_WINDOWS: Final = ((0.5, 0.2), (0.7, 0.4))  # Windows before a motion tested for a hold, periods
FEWEST_HELD: Final = 10  # Fewest samples of a hold
FEWEST_HALF_CYCLES: Final = 5  # Fewest half cycles of a release that is a run, about three swings
HAND_SHARE: Final = 0.3  # Least torque by a hand, over the greatest restoring torque nearby
DERIVATIVE_SPAN: Final = 0.2  # Window of the polynomials that give second derivatives, periods
CERTAIN_HAND: Final = 6.0  # Least acceleration by a hand, standard deviations of its noise
USUAL_REMAINDER: Final = 4.0  # Least acceleration by a hand, over the median residual
FEWEST_A_PERIOD: Final = 20.0  # Fewest samples per period from which second derivatives are taken
FREE_SHARE: Final = 0.6  # Share of the samples kept by least trimmed squares
CONCENTRATIONS: Final = 12  # Number of concentration steps; half as many usually suffice
SHORTEST_HOLD: Final = 0.5  # Shortest hold by a hand, periods


def releases(work: Work, parts: list[Stretch]) -> list[Stretch]:
    """Return the stretches of motions ``parts`` that are not touched by a hand, in order."""
    hand = touched(work, parts)
    free = without_hand(work.time, parts, hand, work.period)
    free = [(_let_go(work, part, hand), part[1]) for part in free]
    return [piece for part in free for piece in grown(work, part)]


def _let_go(work: Work, part: Stretch, hand: Mask) -> int:
    """Return the index at which a motion has certainly left the quiet hold before it."""
    low, high = part
    for shares in HOLD_WINDOWS:
        times = work.time[low] - np.array(shares) * work.period
        before, sure = np.searchsorted(work.time, times).tolist()
        level = _quiet(work, before, sure)
        left = None if level is None else _left(work, (sure, high), level)
        if left is None:
            continue
        if not hand[before:low].all():
            return max(low, left)
        # The hand holds the pendulum until the motion begins.
        begin = held_short(work, (before, high))
        return low if begin is None else min(low, begin)
    return low


def _quiet(work: Work, low: int, high: int) -> float | None:
    """Return the median of constant readings; None if they drift or scatter beyond the noise."""
    hold = work.theta[low:high][work.trusted[low:high]]
    if hold.size < FEWEST_HELD:
        return None
    # A trembling hand drifts more than noise.
    early, late = np.array_split(hold, 2)
    drift = abs(float(np.mean(early) - np.mean(late)))
    spread = float(np.diff(np.quantile(hold, [0.05, 0.95]))[0])
    still = spread <= max(4 * work.noise, 2 * work.count)
    calm = drift <= max(4 * work.noise / math.sqrt(hold.size), work.count / 4)
    return float(np.median(hold)) if still and calm else None


def _seen(work: Work) -> float:
    """Return the distance from a hold above which a reading is not part of it, rad."""
    return max(6 * work.noise, 1.5 * work.count, 1e-4)


def _left(work: Work, part: Stretch, level: float) -> int | None:
    """Return the first index of three consecutive readings off a level, on one side; or None."""
    good = np.flatnonzero(work.trusted[slice(*part)]) + part[0]
    off, seen = work.theta[good] - level, _seen(work)
    away = np.where(off > seen, 1, np.where(off < -seen, -1, 0))
    runs = np.flatnonzero((away[:-2] != 0) & (away[:-2] == away[1:-1]) & (away[1:-1] == away[2:]))
    return int(good[runs[0]]) if runs.size else None


def enough(work: Work, part: Stretch) -> bool:
    """Return whether a release has enough half cycles for a run."""
    good = np.flatnonzero(work.trusted[slice(*part)]) + part[0]
    if not good.size:
        return False
    theta = work.theta[good] - work.middle
    theta -= 2 * math.pi * round(float(np.median(theta)) / (2 * math.pi))  # remove whole turns
    start = after_turns(theta)
    half = swings(work.time[good][start:], theta[start:], least=work.limit)
    return half.peak.size >= FEWEST_HALF_CYCLES


def grown(work: Work, part: Stretch) -> list[Stretch]:
    """Divide a motion at growing swings: a hand took the pendulum and released it again."""
    low, high = part
    good = np.flatnonzero(work.trusted[low:high]) + low
    if good.size < 5:
        return []
    good = good[after_turns(work.theta[good] - work.middle) :]
    half = swings(work.time[good], work.theta[good] - work.middle, least=work.limit)
    size = np.abs(half.peak)
    if size.size < 4:
        return [part]
    # Pairs of neighbours: an offset makes every other half cycle larger.
    pairs = np.maximum(size[:-1], size[1:])
    rise = max(RELEASE_RISE * float(size.max()), 2 * work.limit)
    cuts: list[Stretch] = []
    least, at = pairs[0], 0
    k = 1
    while k < pairs.size:
        if pairs[k] < least:
            least, at = pairs[k], k
        elif pairs[k] > least + rise:
            top = k
            while top + 1 < pairs.size and pairs[top + 1] > pairs[top] * 1.001:
                top += 1
            ends = (min(at + 1, size.size - 1), top + int(np.argmax(size[top : top + 2])))
            stop, go = np.searchsorted(work.time, half.peak_time[list(ends)])
            cuts.append((int(stop), int(go)))
            least, at, k = pairs[top], top, top
        k += 1
    return [(a, b) for a, b in between(cuts, low, high) if b - a > 5]


def held_short(work: Work, part: Stretch) -> int | None:
    """Return the index at which a motion leaves a hold of less than a period.

    Returns None if it leaves its first level as early as after a release from rest.
    """
    low = part[0]
    if not work.trusted[low : low + 5].all():
        return None
    # The first readings give the level of the hold, then all readings near it.
    left = low
    for _ in range(2):
        level = float(np.median(work.theta[low : max(low + 5, (low + left) // 2)]))
        away = _left(work, part, level)
        if away is None:
            return None
        left = away
    pull = abs(math.sin(level - work.middle))
    if pull < NEAR_UPRIGHT:
        return None
    usual = math.sqrt(2 * _seen(work) / pull) * work.period / (2 * math.pi)
    interval = float(np.median(np.diff(work.time)))
    held = work.time[left] - work.time[low] > HELD_LONGER * usual + 4 * interval
    return left if held else None


def touched(work: Work, parts: list[Stretch]) -> Mask:
    """Return the mask of samples of a free record that a hand moves, shape (N,).

    There the residual of ``th'' + w0^2 sin(th - th0) + c th' + Tr sign(th')`` is large; the
    coefficients are estimated by least trimmed squares over the moving ``parts``.
    """
    from scipy.ndimage import maximum_filter1d
    from scipy.signal import savgol_filter

    none = np.zeros(work.time.size, bool)
    good, period = work.trusted, work.period
    interval, even = even_times(work.time)
    count, window = even.size, max(round(DERIVATIVE_SPAN * period / interval), 5) | 1
    if period / interval < FEWEST_A_PERIOD or count < 4 * window:
        return none
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
    # The smaller of the torques of the half swings before and after, which may differ by a hand.
    half = round(period / interval / 2)
    sides = [
        maximum_filter1d(pull, 2 * half + 1, mode="nearest", origin=side * half) for side in (-1, 1)
    ]
    restoring = np.minimum(*sides)
    noise = normal_scale(local_fit(work.time[good], work.theta[good]).residual)
    # A second derivative by least squares over n samples: sigma sqrt(720 / n^5) / dt^2.
    error = max(noise, work.count / math.sqrt(12)) * math.sqrt(720 / window**5) / interval**2
    usual = USUAL_REMAINDER * float(np.median(rest[moving]))
    moved = rest > np.maximum(np.maximum(HAND_SHARE * restoring, CERTAIN_HAND * error), usual)
    # In gaps there are no readings from which a hand can be detected.
    places = np.flatnonzero(good)
    gaps = np.flatnonzero(np.diff(work.time[good]) > window * interval / 4)
    for k in gaps:
        low, high = work.time[places[k]], work.time[places[k + 1]]
        moved[(even > low - period / 4) & (even < high + period / 4)] = False
    moved[(even < work.time[places[0]] + period / 4) & ~good[0]] = False
    moved[(even > work.time[places[-1]] - period / 4) & ~good[-1]] = False
    moved = widened(moved, window // 2)
    nearest = np.clip(np.round((work.time - work.time[0]) / interval), 0, count - 1)
    return np.asarray(moved[nearest.astype(np.intp)], bool)


def _trimmed(columns: Floats, target: Floats, gravity: float) -> Floats:
    """Return coefficients by least trimmed squares (Rousseeuw & Van Driessen, 2006)."""
    answer = np.array([gravity, *[0.0] * (columns.shape[1] - 1)])
    for _ in range(CONCENTRATIONS):
        away = np.abs(target - columns @ answer)
        agree = away <= np.quantile(away, FREE_SHARE)
        answer = np.linalg.lstsq(columns[agree], target[agree], rcond=None)[0]
    return answer


def without_hand(time: Floats, parts: list[Stretch], hand: Mask, period: float) -> list[Stretch]:
    """Return the stretches of motions in which no hand holds the pendulum."""
    touches: list[Stretch] = []
    for a, b in stretches(hand):
        # Touches separated by less than half the shortest hold are one hold.
        if touches and time[a] - time[touches[-1][1] - 1] < SHORTEST_HOLD * period / 2:
            a, _ = touches.pop()  # noqa: PLW2901 (joined)
        touches.append((a, b))
    held = np.zeros(time.size, bool)
    for a, b in touches:
        if time[b - 1] - time[a] >= SHORTEST_HOLD * period:
            # A carried pendulum may briefly move like a free one: join touches within a period.
            near = [
                t for t in touches if time[a] - time[t[1] - 1] < period > time[t[0]] - time[b - 1]
            ]
            held[near[0][0] : near[-1][1]] = True
    free = [(low + a, low + b) for low, high in parts for a, b in stretches(~held[low:high])]
    return [(a, b) for a, b in free if b - a > 5 and time[b - 1] - time[a] > SHORTEST_HOLD * period]
