"""Where a hand holds or carries the pendulum: there gravity alone does not explain its motion."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.local_fit import local_fit
from pendmap.records.noise import normal_scale
from pendmap.records.runs_of import true_runs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Places = tuple[int, int]

__all__ = ["touched", "without_hand"]

SHARE: Final = 0.3
"""Share of the greatest restoring torque nearby that only a hand adds: friction is some per cent of
it while the pendulum swings, and an angle at which it is held shows all of it."""

WINDOW: Final = 0.2
"""Periods that a second derivative is taken over: a cubic bends it by a few per cent then."""

CERTAIN: Final = 6.0
"""Standard deviations of the second derivative beyond which it is not noise."""

SAMPLES: Final = 20.0
"""Samples a period under which a second derivative says too little."""

LONG: Final = 0.5
"""Periods that a hand holds for at least: knocks and magnets act for less."""


def touched(work: Work, period: float, middle: float) -> NDArray[np.bool_]:
    """Return which samples of a free record a hand moves, shape (N,).

    The remainder of ``th'' + w0^2 sin th`` is large there, with ``w0^2`` the median of
    ``-th'' / sin th`` where the angle is large.

    Parameters
    ----------
    work : Work
        A free record; readings that are not trusted are passed over by straight lines.
    period : float
        Of small swings, s, roughly.
    middle : float
        What it swings about, rad.
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
    theta = np.interp(even, work.time[good], work.theta[good]) - middle
    bend = savgol_filter(theta, window, 3, deriv=2, delta=interval)
    sine = np.sin(theta)
    large = np.abs(sine) > 0.5 * float(np.quantile(np.abs(sine), 0.9))
    gravity = float(np.median(-bend[large] / sine[large])) if large.any() else 0.0
    if not 0.3 < gravity / (2 * math.pi / period) ** 2 < 3:
        return none
    reach = round(period / interval) | 1
    restoring = gravity * maximum_filter1d(np.abs(sine), reach, mode="nearest")
    noise = normal_scale(local_fit(work.time[good], work.theta[good]).residual)
    # A second derivative by least squares over n samples: sigma sqrt(720 / n^5) / dt^2.
    error = max(noise, work.count / math.sqrt(12)) * math.sqrt(720 / window**5) / interval**2
    moved = np.abs(bend + gravity * sine) > np.maximum(SHARE * restoring, CERTAIN * error)
    # Within a gap there are no readings that could tell.
    places = np.flatnonzero(good)
    gaps = np.flatnonzero(np.diff(work.time[good]) > window * interval / 4)
    for k in gaps:
        low, high = work.time[places[k]], work.time[places[k + 1]]
        moved[(even > low - period / 4) & (even < high + period / 4)] = False
    moved = binary_dilation(moved, iterations=window // 2)
    nearest = np.clip(np.round((work.time - work.time[0]) / interval), 0, count - 1)
    return np.asarray(moved[nearest.astype(np.intp)], bool)


def without_hand(
    time: NDArray[np.float64], part: Places, hand: NDArray[np.bool_], period: float
) -> list[Places]:
    """Return the stretches of a motion in which nobody holds the pendulum.

    Parameters
    ----------
    time : ndarray, shape (N,)
        s.
    part : (int, int)
        First place and the one after the last.
    hand : ndarray of bool, shape (N,)
        As of :func:`touched`.
    period : float
        Of small swings, s.
    """
    low, high = part
    begin, end = true_runs(hand[low:high])
    touches: list[Places] = []
    for a, b in zip((begin + low).tolist(), (end + low).tolist(), strict=True):
        # A hand that trembles lets go for a moment.
        if touches and time[a] - time[touches[-1][1] - 1] < LONG * period / 2:
            touches[-1] = (touches[-1][0], b)
        else:
            touches.append((a, b))
    held = [(a, b) for a, b in touches if time[b - 1] - time[a] >= LONG * period]
    edges = [low, *(place for touch in held for place in touch), high]
    pieces = zip(edges[::2], edges[1::2], strict=True)
    return [(a, b) for a, b in pieces if b - a > 5 and time[b - 1] - time[a] > LONG * period]
