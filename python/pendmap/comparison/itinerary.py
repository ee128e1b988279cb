"""Trajectories among the potential wells: their statistics, and the steady states they end on.

A well is the range of angles around one hanging position, from one top to the next. Chaotic
trajectories cannot be compared point by point; the statistics are the number of wells, escapes
between them, the range of the angle, the greatest speed, and the time to settle. The final cycle of
a record is compared with those that a model reaches.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import savgol_filter

from pendmap._core import Attractor
from pendmap.signal.robust import rms

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pendmap.signal import Floats


LONGEST: Final = 8  # Longest cycle that is searched for, forcing periods

_MARGIN: Final = 0.1
"""Distance from either top at which a new well is entered, rad: noise at a top is no escape."""
_REPEATED: Final = 0.05
"""Least tolerance within which readings repeat themselves, rad."""
_NOISES: Final = 6.0  # Tolerance within which readings repeat, over the noise of a difference
_HELD: Final = 5  # Forcing periods for which a motion must repeat itself to be settled
_SWING: Final = 0.06
"""Half-width of the local polynomials that give velocities, over the period of small swings."""
_DEGREE: Final = 3  # Degree of the local polynomials
SAMPLES: Final = 64  # Samples of a cycle per forcing period
_HARMONICS: Final = 12  # Harmonics of the drive kept in a cycle: higher ones are noise
_CYCLES: Final = 50  # Most cycles averaged at the end of a record
_STEADY: Final = 0.01  # Rms difference, rad, of early and late cycles below which all are averaged
_AT_REST: Final = 0.05  # Amplitude below which a cycle is rest, rad
_DECAY: Final = 10.0
"""Number of e-foldings by which viscous damping reduces transients before cycles are sought."""
_FOLLOWED: Final = (100, 2000)  # Least and greatest transient, forcing periods
_CLOSED: Final = 1e-3  # Greatest closing error of a cycle, rad
_ONE: Final = 0.02  # Rms distance below which two cycles are identical, rad


class Cycling(NamedTuple):
    """``theta(t + n T) = theta(t) + 2 pi w`` from a time on; without such a cycle ``n`` is 0."""

    n: int  # forcing periods
    w: int  # net turns
    since: float  # s after the first reading; infinite without a cycle


NEVER: Final = Cycling(0, 0, math.inf)


class Ruler(NamedTuple):
    """Time scales and noise with which trajectories are analysed."""

    tick: float  # sampling interval, s
    swing: float  # period of small swings, s
    period: float | None  # of the drive, s; None: only rest is a steady state
    sigma: float  # noise of the readings, rad

    def velocity(self, reading: Floats) -> Floats:
        """Return velocities from local cubics, rad/s, shape (N,)."""
        half = max(round(_SWING * self.swing / self.tick), 2)
        width = min(2 * half + 1, (reading.size - 1) // 2 * 2 + 1)
        return np.asarray(savgol_filter(reading, width, _DEGREE, deriv=1, delta=self.tick))

    def statistics(self, reading: Floats) -> dict[str, float]:
        """Return the statistics of a trajectory by name."""
        visited = wells(reading)
        return {
            "wells visited": np.unique(visited).size,
            "escapes from a well": int(np.abs(np.diff(visited)).sum()),
            "angle covered": float(np.ptp(reading)),
            "time to settle": self.cycling(reading).since,
            "greatest velocity": float(np.abs(self.velocity(reading)).max()),
        }

    def cycling(self, reading: Floats) -> Cycling:
        """Return the shortest cycle that holds over the last five periods.

        Without a drive it is rest, with ``n = 1``, if it lasts for a small swing.
        """
        near = max(_REPEATED, _NOISES * math.sqrt(2) * self.sigma)
        if self.period is None:
            away = np.flatnonzero(np.abs(reading - reading[-1]) > near)
            since = int(np.max(away, initial=-1)) + 1
            rests = (reading.size - since) * self.tick >= self.swing
            return Cycling(1, 0, since * self.tick) if rests else NEVER
        least = math.ceil(_HELD * self.period / self.tick)
        for n in range(1, LONGEST + 1):
            shift = n * self.period / self.tick
            whole, part = int(shift), shift - int(shift)
            pairs = reading.size - whole - 1
            if pairs < least:
                break
            later = (1 - part) * reading[whole:-1] + part * reading[whole + 1 :]
            apart = later - reading[:pairs]
            turns = np.round(apart[-least:].mean() / math.tau)
            away = np.flatnonzero(np.abs(apart - math.tau * turns) > near)
            since = int(np.max(away, initial=-1)) + 1
            if pairs - since >= least:
                return Cycling(n, int(turns), since * self.tick)
        return NEVER


UNITS: Final = {"angle covered": "rad", "time to settle": "s", "greatest velocity": "rad/s"}
"""Units of the statistics that are no pure numbers."""


def wells(reading: Floats) -> NDArray[np.int64]:
    """Return the index of the well at each sample, 0 at ``theta = 0``, shape (N,).

    Within 0.1 rad of a top the well is still the previous one.
    """
    nearest = np.round(reading / math.tau).astype(np.int64)
    inside = np.abs(reading - math.tau * nearest) < math.pi - _MARGIN
    inside[0] = True
    return nearest[np.maximum.accumulate(np.where(inside, np.arange(reading.size), 0))]


@dataclasses.dataclass(frozen=True)
class Cycle:
    """Periodic motion with S samples."""

    n: int  # length in forcing periods
    w: int  # net turns per cycle
    time: Floats  # s, from a whole number of periods of the drive
    theta: Floats  # rad, not wrapped
    velocity: Floats  # rad/s

    @classmethod
    def of(cls, n: int, w: int, period: float, theta: Floats) -> Cycle:
        """Return the cycle of equally spaced readings, smoothed by a Fourier series."""
        time = np.arange(theta.size) * n * period / theta.size
        turning = math.tau * w / (n * period)
        waves = np.fft.rfft(theta - turning * time)
        waves[n * _HARMONICS + 1 :] = 0
        rate = math.tau * np.fft.rfftfreq(theta.size, n * period / theta.size)
        smooth = turning * time + np.fft.irfft(waves, theta.size)
        velocity = turning + np.fft.irfft(1j * rate * waves, theta.size)
        return cls(n, w, time, smooth, velocity)

    @property
    def amplitude(self) -> float:
        """Half of the range of the angle less its mean rotation, rad."""
        turning = math.tau * self.w * np.arange(self.theta.size) / self.theta.size
        return 0.5 * float(np.ptp(self.theta - turning))

    @property
    def at_rest(self) -> bool:
        """Whether the motion is rest: no net turns and a negligible amplitude."""
        return self.w == 0 and self.amplitude < _AT_REST

    @property
    def attractor(self) -> Attractor:
        """Kind, period and turns of the motion."""
        if self.at_rest:
            return Attractor("inverted_rest" if math.cos(self.theta.mean()) < 0 else "rest", 1)
        return Attractor("rotation" if self.w else "oscillation", self.n, self.w)

    @property
    def name(self) -> str:
        """Name of the motion: ``rest``, ``oscillation 2:0``, ``rotation 1:+1``, ..."""
        return self.attractor.name

    def nearest(self, other: Cycle) -> tuple[float, Cycle]:
        """Return the least rms difference to another cycle, rad, and this cycle shifted to it.

        Shifts are whole forcing periods and turns; the difference is infinite if ``n`` or ``w``
        differ.
        """
        if (self.n, self.w) != (other.n, other.w):
            return math.inf, self
        pairs = []
        for at in range(0, self.n * SAMPLES, SAMPLES):
            theta = np.concatenate([self.theta[at:], self.theta[:at] + math.tau * self.w])
            theta += math.tau * round(float(np.mean(other.theta - theta)) / math.tau)
            shifted = dataclasses.replace(self, theta=theta, velocity=np.roll(self.velocity, -at))
            pairs.append((rms(theta - other.theta), shifted))
        return min(pairs, key=lambda pair: pair[0])


@dataclasses.dataclass(frozen=True)
class Reached:
    """Cycle that a model reaches, and the share of initial states that reach it."""

    cycle: Cycle
    share: float


@dataclasses.dataclass(frozen=True)
class Steady:
    """Comparison of a record's steady state with a model's."""

    measured: Cycle  # mean of the record's last cycles
    cycles: int  # number of averaged cycles
    reached: tuple[Reached, ...]  # cycles of the model, the most frequent first
    model: Cycle | None  # nearest cycle of the model, shifted; None if none has equal n and w
    rms: float  # rms difference of the angles, rad
    rms_velocity: float  # rms difference of the velocities, rad/s

    @property
    def overestimate(self) -> float:
        """Relative error of the model's amplitude; NaN without a model cycle or at rest."""
        if self.model is None or self.measured.at_rest:
            return math.nan
        return self.model.amplitude / self.measured.amplitude - 1


def steady_state(
    time: Floats, reading: Floats, period: float, last: Cycling, ends: tuple[Reached, ...]
) -> Steady:
    """Return the comparison of a record's last cycles, ``last``, with the nearest of a model.

    ``time``, s, is on the drive's clock.
    """
    measured, cycles = _folded(time, reading, period, last)
    pairs = [end.cycle.nearest(measured) for end in ends]
    apart, model = min(pairs, key=lambda pair: pair[0], default=(math.inf, measured))
    if math.isinf(apart):
        return Steady(measured, cycles, ends, None, math.nan, math.nan)
    return Steady(measured, cycles, ends, model, apart, rms(model.velocity - measured.velocity))


def _folded(time: Floats, reading: Floats, period: float, last: Cycling) -> tuple[Cycle, int]:
    """Return the mean of a record's last cycles, and their number."""
    n, w, since = last
    length = n * period
    first = math.ceil((time[0] + since) / period)
    count = max(1, int((time[-1] - first * period) / length + 1e-9))
    first += max(0, count - _CYCLES) * n
    count = min(count, _CYCLES)
    at = np.arange(n * SAMPLES) * period / SAMPLES
    turns = math.tau * w * np.arange(count)
    begins = (first + n * np.arange(count)) * period
    rows = CubicSpline(time, reading)(begins[:, None] + at) - turns[:, None]
    while count > 1:  # only the last cycles while a transient decays
        early, late = rows[: count // 2].mean(axis=0), rows[count // 2 :].mean(axis=0)
        if rms(late - early) < _STEADY:
            break
        rows = rows[count - count // 2 :]
        count //= 2
    return Cycle.of(n, w, period, rows.mean(axis=0)), count


def reached_cycles(
    simulated: Callable[[Floats, Floats], Floats],
    begin: float,
    starts: Floats,
    period: float,
    damping: float,
) -> tuple[Reached, ...]:
    """Return the cycles that a model reaches, the most frequent first.

    ``simulated`` returns readings from initial states at times, s, of which the first is ``begin``;
    ``starts``, shape (2, M), are angles and velocities (rad, rad/s); ``damping`` is ``c/m``, 1/s.
    """
    rate = 0.5 * damping * period
    periods = min(max(_DECAY / rate if rate else math.inf, _FOLLOWED[0]), _FOLLOWED[1])
    first = math.ceil(begin / period) + math.ceil(periods)
    times = (first + np.arange(2 * LONGEST * SAMPLES + 1) / SAMPLES) * period
    readings = simulated(starts, np.concatenate([[begin], times]))
    groups: list[list[Cycle]] = []
    for cycle in filter(None, (_closed(row, period) for row in readings[:, 1:])):
        same = next((group for group in groups if cycle.nearest(group[0])[0] < _ONE), None)
        if same is None:
            groups.append([cycle])
        else:
            same.append(cycle)
    groups.sort(key=len, reverse=True)
    return tuple(Reached(group[0], len(group) / len(readings)) for group in groups)


def _closed(row: Floats, period: float) -> Cycle | None:
    """Return the shortest cycle on which readings close; None if there is none."""
    for n in range(1, LONGEST + 1):
        size = n * SAMPLES
        apart = row[size:] - row[:-size]
        w = round(float(apart.mean()) / math.tau) if np.isfinite(apart).all() else 0
        if np.abs(apart - math.tau * w).max() < _CLOSED:
            return Cycle.of(n, w, period, row[:size])
    return None
