"""Where a hand holds or carries the pendulum: there gravity alone does not explain its motion."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.local_fit import local_fit
from pendmap.records.robust import normal_scale
from pendmap.records.runs_of import true_runs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]
    Places = tuple[int, int]

__all__ = ["touched", "without_hand"]

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
