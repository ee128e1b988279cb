"""Where a record turns, roughly; where it was held, and where it rests."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.steps import step_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["Outline", "median_of_five", "outline", "zigzags"]

_SMOOTHING: Final = 0.1
"""Half width of the running mean over the period."""
_SURE: Final = 6.0
"""A turn is believed once the angle has come back by this many standard errors."""
_FEWEST: Final = 8
_GAP: Final = 10.0
"""A pause of this many samples is a gap, before the period is known."""


@dataclasses.dataclass(frozen=True)
class Outline:
    """The rough course of a record.

    Parameters
    ----------
    turns : ndarray of int
        Samples next to which the smoothed angle turns, in order; tops and bottoms alternate.
    period : float
        Of the late swings, s.
    smooth : ndarray, shape (N,)
        Running mean of the angle, rad.
    noise : float
        Standard error of ``smooth``, rad.
    rest : int or None
        Sample from which the record rests, if it does.
    left : int
        First sample that is clearly off the level at which the record begins.
    """

    turns: NDArray[np.intp]
    period: float
    smooth: Floats
    noise: float
    rest: int | None
    left: int


def outline(time: Floats, theta: Floats, sigma: float) -> Outline | None:
    """Find the turns of a record by hysteresis, first of the raw, then of the smoothed angle.

    Parameters
    ----------
    time, theta : array, shape (N,)
        s, increasing, and rad.
    sigma : float
        Standard deviation of the noise, rad.

    Returns
    -------
    Outline or None
        ``None`` if it does not swing: fewer than two turns.
    """
    if time.size < _FEWEST:
        return None
    calm = median_of_five(theta)
    step = step_of(theta)
    span = float(np.ptp(calm))
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > _GAP * float(np.median(steps))) + 1
    rough = zigzags(calm, max(8 * sigma + 2 * step, 1e-6 * span), gaps)
    if rough.size < 2:  # noqa: PLR2004 (a half cycle lies between two)
        return None
    halves = np.diff(time[rough])
    period = 2 * float(np.median(halves[halves.size // 2 :]))
    smooth, count = _running_mean(time, calm, _SMOOTHING * period)
    # The median of five has a little more noise than the samples' mean would leave.
    noise = 1.2 * max(sigma, 1e-9 * span) / math.sqrt(count)
    gaps = np.flatnonzero(steps > _SMOOTHING * period) + 1
    # Towards the end the mean is over ever fewer samples: what it does there is noise.
    ahead = int(np.searchsorted(time, time[-1] - _SMOOTHING * period))
    turns = zigzags(smooth[:ahead], _SURE * noise + 0.5 * step, gaps[gaps < ahead])
    turns = _far_apart(turns, time, period)
    level = float(np.median(smooth[time > time[-1] - 0.5 * period]))
    off = np.flatnonzero(np.abs(smooth[:ahead] - level) > 4 * noise + 0.5 * step)
    rest = int(off[-1]) + 1 if off.size and time[-1] - time[off[-1]] > 0.75 * period else None
    if rest is not None:
        turns = turns[turns < rest]
    if turns.size < 2:  # noqa: PLR2004
        return None
    # Several in a row: a single one is an outlier.
    away = np.abs(theta - float(np.median(theta[:3]))) > _SURE * sigma + step
    runs = away[:-2] & away[1:-1] & away[2:]
    return Outline(turns, period, smooth, noise, rest, int(np.argmax(runs)))


def median_of_five(x: Floats) -> Floats:
    """The median of five neighbours: single outliers vanish, a monotone run stays as it is."""
    padded = np.concatenate((x[:1], x[:1], x, x[-1:], x[-1:]))
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1))


def _running_mean(time: Floats, x: Floats, half: float) -> tuple[Floats, float]:
    """Mean over all samples within ``half`` seconds, and how many these are, typically."""
    first = np.searchsorted(time, time - half)
    last = np.searchsorted(time, time + half, side="right")
    # At the ends the window shrinks on both sides, or the mean would lag behind.
    index = np.arange(time.size)
    reach = np.minimum(index - first, last - 1 - index)
    first, last = index - reach, index + reach + 1
    total = np.concatenate(([0.0], np.cumsum(x)))
    count = last - first
    return (total[last] - total[first]) / count, float(np.median(count))


def _zigzag(x: Floats, threshold: float) -> NDArray[np.intp]:
    """Samples of the extremes from which the signal comes back by more than a threshold."""
    found: list[int] = []
    values = x.tolist()
    low = high = 0
    rising: bool | None = None
    for k, value in enumerate(values):
        if value > values[high]:
            high = k
        if value < values[low]:
            low = k
        if rising is not False and value < values[high] - threshold:
            # The first extreme is where the record begins: whether it is a turn is not known here.
            if rising is not None:
                found.append(high)
            rising, low = False, k
        elif rising is not True and value > values[low] + threshold:
            if rising is not None:
                found.append(low)
            rising, high = True, k
    return np.array(found, dtype=np.intp)


def zigzags(x: Floats, threshold: float, gaps: NDArray[np.intp]) -> NDArray[np.intp]:
    """The same for each part between two gaps: what is next to a gap need not be a turn."""
    begins = np.concatenate(([0], gaps))
    parts = [_zigzag(part, threshold) for part in np.split(x, gaps)]
    return np.concatenate([part + at for part, at in zip(parts, begins, strict=True)])


def _far_apart(turns: NDArray[np.intp], time: Floats, period: float) -> NDArray[np.intp]:
    """The turns without pairs that follow one another sooner than any pendulum swings."""
    kept: list[int] = []
    for k in turns.tolist():
        if kept and time[k] - time[kept[-1]] < 0.3 * period:
            kept.pop()
        else:
            kept.append(k)
    return np.array(kept, np.intp)
