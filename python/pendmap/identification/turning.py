"""Approximate turning points of a record, its release, and starting values of a fit."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import nnls
from scipy.special import ellipe, ellipk

from pendmap.errors import InputError
from pendmap.records.resolution import step_of
from pendmap.signal.half_cycles import after_turns, swings
from pendmap.signal.local_polynomial import fit_around

if TYPE_CHECKING:
    from pendmap.signal import Floats, Indices

_SMOOTHING: Final = 0.1  # Half-width of the running mean, periods
_SURE: Final = 6.0  # Least return of the angle after a turn, standard errors
_FEWEST: Final = 8  # Fewest samples of a record
_GAP: Final = 10.0  # Shortest gap, sampling intervals, before the period is known


@dataclasses.dataclass(frozen=True)
class Outline:
    """Outline of a record of N samples: approximate turns and period."""

    turns: Indices  # samples at turns of the smoothed angle, alternately maxima and minima
    period: float  # period of the late swings, s
    smooth: Floats  # running mean of the angle, rad, shape (N,)
    left: int  # first sample that is off the initial level


def outline(time: Floats, theta: Floats, sigma: float) -> Outline | None:
    """Return the turns by hysteresis, of the raw, then the smoothed angle; None for one or none."""
    if time.size < _FEWEST:
        return None
    # The median of five neighbours removes outliers and keeps monotone runs.
    calm = median_filter(theta, 5, mode="nearest")
    step = step_of(theta)
    span = float(np.ptp(calm))
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > _GAP * float(np.median(steps))) + 1
    rough = _zigzags(calm, max(8 * sigma + 2 * step, 1e-6 * span), gaps)
    if rough.size < 2:  # noqa: PLR2004 (a half cycle lies between two)
        return None
    halves = np.diff(time[rough])
    period = 2 * float(np.median(halves[halves.size // 2 :]))
    smooth, count = _running_mean(time, calm, _SMOOTHING * period)
    # The median of five has slightly more noise than the mean.
    noise = 1.2 * max(sigma, 1e-9 * span) / math.sqrt(count)
    gaps = np.flatnonzero(steps > _SMOOTHING * period) + 1
    # Near the end the mean has fewer samples: its turns there are noise.
    ahead = int(np.searchsorted(time, time[-1] - _SMOOTHING * period))
    turns = _zigzags(smooth[:ahead], _SURE * noise + 0.5 * step, gaps[gaps < ahead])
    turns = _far_apart(turns, time, period)
    level = float(np.median(smooth[time > time[-1] - 0.5 * period]))
    off = np.flatnonzero(np.abs(smooth[:ahead] - level) > 4 * noise + 0.5 * step)
    if off.size and time[-1] - time[off[-1]] > 0.75 * period:
        turns = turns[turns <= off[-1]]
    if turns.size < 2:  # noqa: PLR2004
        return None
    # Three consecutive samples are required: a single one is an outlier.
    away = np.abs(theta - float(np.median(theta[:3]))) > _SURE * sigma + step
    runs = away[:-2] & away[1:-1] & away[2:]
    return Outline(turns, period, smooth, int(np.argmax(runs)))


def _running_mean(time: Floats, x: Floats, half: float) -> tuple[Floats, float]:
    """Return the mean over all samples within ``half`` s, and the median number of samples."""
    first = np.searchsorted(time, time - half)
    last = np.searchsorted(time, time + half, side="right")
    # At the ends the window shrinks on both sides, to avoid a lag of the mean.
    index = np.arange(time.size)
    reach = np.minimum(index - first, last - 1 - index)
    first, last = index - reach, index + reach + 1
    total = np.concatenate(([0.0], np.cumsum(x)))
    count = last - first
    return (total[last] - total[first]) / count, float(np.median(count))


def _zigzag(x: Floats, threshold: float) -> Indices:
    """Return the indices of extremes after which the signal returns by more than a threshold."""
    extremes: list[int] = []
    values = x.tolist()
    low = high = 0
    rising: bool | None = None
    for k, value in enumerate(values):
        if value > values[high]:
            high = k
        if value < values[low]:
            low = k
        if rising is not False and value < values[high] - threshold:
            # The first extreme is the start of the record, which need not be a turn.
            if rising is not None:
                extremes.append(high)
            rising, low = False, k
        elif rising is not True and value > values[low] + threshold:
            if rising is not None:
                extremes.append(low)
            rising, high = True, k
    return np.array(extremes, dtype=np.intp)


def _zigzags(x: Floats, threshold: float, gaps: Indices) -> Indices:
    """Return the extremes of each part between gaps, without samples next to gaps."""
    begins = np.concatenate(([0], gaps))
    parts = [_zigzag(part, threshold) for part in np.split(x, gaps)]
    return np.concatenate([part + at for part, at in zip(parts, begins, strict=True)])


def _far_apart(turns: Indices, time: Floats, period: float) -> Indices:
    """Return the turns without pairs that are closer than 0.3 periods."""
    selected: list[int] = []
    for k in turns.tolist():
        if selected and time[k] - time[selected[-1]] < 0.3 * period:
            selected.pop()
        else:
            selected.append(k)
    return np.array(selected, np.intp)


_RESOLVED: Final = 8.0  # Least difference between successive peaks, standard errors
_SURE_SPEED: Final = 4.0  # Standard errors above which a velocity at the release is real
_LATENESS: Final = 5 / 32
"""Half the slope at 0 of the quartic fitted to ``s abs(s)``, over the window's half-width."""
_DOUBT: Final = 0.2  # Fraction of the delay by friction that is added to the error
_STILL: Final = 1e-3
"""Velocity at the release over amplitude and w0 that is 0 within the error of the even quartic."""


@dataclasses.dataclass(frozen=True)
class End:
    """End of a half cycle."""

    time: float  # s
    angle: float  # rad
    stderr_time: float
    stderr_angle: float
    kind: str  # release, turn or clipped
    window: float = 0.0  # half-width of the fitted window, s

    def resolved_from(self, before: End) -> bool:
        """Return whether the angle differs significantly from that of the end before.

        Always true for a clipped end, whose error is infinite.
        """
        error = math.hypot(before.stderr_angle, self.stderr_angle)
        return not math.isfinite(error) or abs(self.angle - before.angle) > _RESOLVED * error

    def late(self, theta_r: float) -> End:
        """Return the turn corrected for the delay of a quartic's extreme by friction.

        The delay is ``5/32 h theta_r / sin A`` for a window of half-width ``h``. Its uncertainty
        (from the law of friction, and the next order) is added to the error.
        """
        size = abs(self.angle)
        bend = math.sin(min(max(size, 2 * theta_r + 1e-9), 3.0))
        shift = _LATENESS * self.window * theta_r / bend
        # The relative size of the next order is theta_r / A, which is large near the end.
        unsure = shift * min(_DOUBT + theta_r / max(size, 1e-9), 1.0)
        error = math.hypot(self.stderr_time, unsure)
        return dataclasses.replace(self, time=self.time - shift, stderr_time=error)


def release(
    time: Floats, theta: Floats, sigma: float, scale: tuple[float, float], course: Outline
) -> End | None:
    """Return the release from rest at the first sample; None if the record begins otherwise.

    The angle is even about a release. ``scale`` is the approximate natural frequency, rad/s, and
    the half-width of a window, s.
    """
    if course.left == 0:
        return None
    w0, half = scale
    step = float(np.median(np.diff(time)))
    level, leaves = float(np.median(theta[: max(course.left // 2, 3)])), float(time[course.left])
    bend = w0**2 * max(math.sin(min(abs(level), math.pi)), 0.02)
    quick = math.sqrt(2 * (6 * sigma + 1e-9) / bend)
    half = max(half, 5.5 * step)
    even = fit_around(time, theta, float(time[0]), half, (0, 2, 4), sigma=sigma)
    moving = fit_around(time, theta, float(time[0]), half, (0, 1, 2, 4), sigma=sigma)
    if leaves - time[0] > 2 * quick + 4 * step or even is None or moving is None:
        return None
    # With a velocity, or a curvature away from the middle, the record begins in motion.
    (angle, gain), (bend, _) = even.at(float(time[0])), even.at(float(time[0]), 2)
    speed, speed_gain = moving.at(float(time[0]), 1)
    slack = _STILL * abs(angle) * w0
    if bend * angle >= 0 or abs(speed) > _SURE_SPEED * speed_gain * sigma + slack:
        return None
    return End(float(time[0]), angle, step / 10, gain * sigma, "release")


FEWEST_SWINGS: Final = 2  # Fewest half swings from which starting values are estimated
QUIET: Final = 10.0  # Greatest range of readings at rest, standard errors


class TooShortError(InputError):
    """Error raised for a record with too few decaying half swings for starting values."""


def swinging(time: Floats, theta: Floats) -> tuple[Floats, Floats]:
    """Return times and angles after any rotations, in the turn in which the pendulum rests."""
    rest = math.tau * round(float(np.median(theta[-max(theta.size // 4, 1) :])) / math.tau)
    first = after_turns(theta - rest)
    return time[first:], theta[first:] - rest


def samples_per_period(time: Floats, theta: Floats) -> float:
    """Return the number of samples per period of small swings; infinite if no swing is seen."""
    start = rough_start(time, theta, 0.0) if theta.size >= _FEWEST else None
    if start is None:
        return math.inf
    return math.tau / (start["w0"] * float(np.median(np.diff(time))))


TURN_PARTS: Final = 12  # Parts of a turn whose mean speeds show the ripple by gravity
FEWEST_TURNS: Final = 2  # Fewest turns in one sense from which starting values are estimated
SLOW: Final = np.arange(4)  # Powers of the angle in the slow loss of energy over turns


def rotating_start(time: Floats, theta: Floats) -> dict[str, float] | None:
    """Return starting values from the longest rotation in one sense; None without its ripple.

    ``v^2 = 2 w0^2 cos th + P(th)``, with a cubic ``P`` by the initial energy and its loss, is
    fitted to mean speeds over parts of a turn.
    """
    steps = np.abs(np.diff(theta))
    every = max(int(math.tau / TURN_PARTS / max(float(np.median(steps)), 1e-9)), 1)
    time, theta = time[::every], theta[::every]
    if time.size < _FEWEST:
        return None
    speed = np.diff(theta) / np.diff(time)
    ends = np.flatnonzero(np.diff(np.sign(speed))) + 1
    part = max(np.split(np.arange(speed.size), ends), key=len)
    first, last, speed = theta[part], theta[part + 1], speed[part]
    turned = abs(float(last[-1] - first[0]))
    if turned < FEWEST_TURNS * math.tau or part.size <= 2 * SLOW.size or not speed.all():
        return None
    slow = ((first - first[0]) / turned)[:, None] ** SLOW
    columns = np.column_stack([(np.sin(last) - np.sin(first)) / (last - first), slow])
    fitted, *_ = np.linalg.lstsq(columns, speed**2)
    left = float(np.sum((speed**2 - columns @ fitted) ** 2)) / (part.size - SLOW.size - 1)
    error = math.sqrt(left * float(np.linalg.pinv(columns.T @ columns)[0, 0]))
    if fitted[0] < _SURE * error:
        return None
    w0, energies = math.sqrt(fitted[0] / 2), slow[[0, -1]] @ fitted[1:] / 2
    loss = max(float(energies[0] - energies[1]) / turned, 0.0)
    viscous = 0.5 * loss / float(np.mean(np.abs(speed)))
    return {"w0": w0, "c_over_m": max(viscous, 1e-4 * w0), "Tr": max(0.5 * loss, 1e-5 * w0**2)}


def rough_start(time: Floats, theta: Floats, sigma: float) -> dict[str, float] | None:
    """Return starting values of ``w0``, ``c_over_m`` and ``Tr``; None with fewer than two swings.

    A half swing of amplitude ``A`` takes ``2 K(m) / w0`` with ``m = sin(A/2)**2``; from one to the
    next the energy ``w0**2 (1 - cos A)`` falls by ``c_over_m w0 8 (E(m) - (1 - m) K(m))`` (from the
    integral of the velocity over the angle) and ``2 A Tr``. Swings below four ``sigma`` are
    excluded. Rotations have those of :func:`rotating_start`.
    """
    whole, (time, theta) = (time, theta), swinging(time, theta)
    tail = theta[-max(len(theta) // 10, 1) :]
    # Only the mean of readings at rest is their centre.
    centre = float(np.mean(tail)) if np.ptp(tail) < QUIET * sigma else 0.0
    half = swings(time, theta - centre, least=4.0 * sigma)
    peaks = np.minimum(np.abs(half.peak), math.pi - 1e-3)
    if len(peaks) < FEWEST_SWINGS or np.median(np.abs(half.peak)) > math.pi:
        turning = rotating_start(*whole)
        if turning is not None or len(peaks) < FEWEST_SWINGS:
            return turning
    m = np.sin(np.minimum(peaks, 3.1) / 2) ** 2
    w0 = float(np.median(2 * ellipk(m) / np.diff(half.crossing)))
    if len(peaks) < FEWEST_SWINGS + 1:
        return {"w0": w0, "c_over_m": 0.02 * w0, "Tr": 1e-3 * w0**2}
    viscous, friction = rough_damping(peaks)
    # Starting values are above 0, where a step of the search may be too large.
    return {"w0": w0, "c_over_m": max(viscous, 1e-4) * w0, "Tr": max(friction, 1e-5) * w0**2}


def rough_damping(peaks: Floats) -> tuple[float, float]:
    """Return non-negative ``c_over_m / w0`` and ``Tr / w0^2`` (rad) from at least 3 peaks."""
    m = np.sin(np.minimum(peaks, 3.1) / 2) ** 2
    action = 8 * (ellipe(m) - (1 - m) * ellipk(m))
    columns = np.stack([0.5 * (action[1:] + action[:-1]), peaks[1:] + peaks[:-1]], axis=1)
    lost = np.diff(np.cos(peaks))
    # The error of an energy is about A sigma: small swings have larger weights.
    weight = 1 / (peaks[1:] + peaks[:-1])
    (viscous, friction), _ = nnls(columns * weight[:, None], lost * weight)
    return float(viscous), float(friction)
