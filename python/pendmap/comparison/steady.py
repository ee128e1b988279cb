"""Steady states: comparison of a record's final cycle with those of a model."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.interpolate import CubicSpline

from pendmap._core import Attractor
from pendmap.comparison.itinerary import LONGEST

if TYPE_CHECKING:
    from collections.abc import Callable

    from pendmap.signal import Floats


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
    def swing(self) -> Floats:
        """Angle less its mean rotation, rad."""
        return np.asarray(
            self.theta - math.tau * self.w * np.arange(self.theta.size) / self.theta.size
        )

    @property
    def amplitude(self) -> float:
        """Half of the range of :attr:`swing`, rad."""
        return 0.5 * float(np.ptp(self.swing))

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
        best = (math.inf, self)
        for at in range(0, self.n * SAMPLES, SAMPLES):
            theta = np.concatenate([self.theta[at:], self.theta[:at] + math.tau * self.w])
            theta += math.tau * round(float(np.mean(other.theta - theta)) / math.tau)
            apart = math.sqrt(float(np.mean((theta - other.theta) ** 2)))
            if apart < best[0]:
                velocity = np.roll(self.velocity, -at)
                best = apart, dataclasses.replace(self, theta=theta, velocity=velocity)
        return best


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


def folded(
    time: Floats, reading: Floats, period: float, closes: tuple[int, int], since: float
) -> tuple[Cycle, int]:
    """Return the mean of a record's last cycles, and their number.

    ``time`` is on the drive's clock; ``closes`` are ``n`` and ``w`` of the cycle, ``since`` (s) is
    the time from which it repeats itself.
    """
    n, w = closes
    length = n * period
    first = math.ceil(since / period)
    count = max(1, int((time[-1] - first * period) / length + 1e-9))
    first += max(0, count - _CYCLES) * n
    count = min(count, _CYCLES)
    at = np.arange(n * SAMPLES) * period / SAMPLES
    turns = math.tau * w * np.arange(count)
    begins = (first + n * np.arange(count)) * period
    rows = CubicSpline(time, reading)(begins[:, None] + at) - turns[:, None]
    while count > 1:  # only the last cycles while a transient decays
        early, late = rows[: count // 2].mean(axis=0), rows[count // 2 :].mean(axis=0)
        if math.sqrt(float(np.mean((late - early) ** 2))) < _STEADY:
            break
        rows = rows[count - count // 2 :]
        count //= 2
    return Cycle.of(n, w, period, rows.mean(axis=0)), count


def reached(
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
    groups: list[tuple[Cycle, int]] = []
    for row in readings[:, 1:]:
        cycle = _closed(row, period)
        if cycle is None:
            continue
        for k, (other, count) in enumerate(groups):
            if cycle.nearest(other)[0] < _ONE:
                groups[k] = other, count + 1
                break
        else:
            groups.append((cycle, 1))
    groups.sort(key=lambda group: -group[1])
    return tuple(Reached(cycle, count / len(readings)) for cycle, count in groups)


def _closed(row: Floats, period: float) -> Cycle | None:
    """Return the shortest cycle on which readings close; None if there is none."""
    for n in range(1, LONGEST + 1):
        size = n * SAMPLES
        apart = row[size:] - row[:-size]
        w = round(float(apart.mean()) / math.tau) if np.isfinite(apart).all() else 0
        if np.abs(apart - math.tau * w).max() < _CLOSED:
            return Cycle.of(n, w, period, row[:size])
    return None


def compared(measured: tuple[Cycle, int], ends: tuple[Reached, ...]) -> Steady:
    """Return the comparison of a record's cycle with the nearest one of a model."""
    cycle, cycles = measured
    pairs = [one.cycle.nearest(cycle) for one in ends]
    rms, model = min(pairs, key=lambda pair: pair[0], default=(math.inf, cycle))
    if not math.isfinite(rms):
        return Steady(cycle, cycles, ends, None, math.nan, math.nan)
    off = math.sqrt(float(np.mean((model.velocity - cycle.velocity) ** 2)))
    return Steady(cycle, cycles, ends, model, rms, off)
