"""Effects of the sensor: what is read instead of the angle, and when."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.virtual_rig.effects.base import Effect, Floats, shape, size

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.virtual_rig.path import Path

_FINE: Final = 1e-3
"""Step of the lag's exact response to a cubic between two points, s."""


class ReadingEffect(Effect):
    """An effect that leaves the motion alone."""

    group = "reading"
    order = 0
    """Place in the chain: the lowest acts first."""

    def clock(self, time: Floats) -> Floats:
        """Return the true times, s, of what the record says was read at ``time``."""
        return time

    def distort(self, time: Floats, angle: Floats, path: Path) -> Floats:
        """Return what is read, rad, for true angles in order of time; shapes (N,)."""
        return angle


def read(path: Path, time: Floats, effects: list[ReadingEffect]) -> Floats:
    """Return what a sensor without noise reads of a path at true, increasing times, rad."""
    # Turning points between the samples matter to backlash.
    turns = np.array([event.time for event in path.events if event.what == "turn"])
    turns = turns[(turns > time[0]) & (turns < time[-1])]
    everything = np.concatenate([time, turns])
    order = np.argsort(everything, kind="stable")
    angle = path.angle(everything[order])
    for effect in sorted(effects, key=lambda effect: effect.order):
        angle = effect.distort(everything[order], angle, path)
    result = np.empty_like(angle)
    result[order] = angle
    return result[: time.size]


def fading(values: Floats, factor: float) -> Floats:
    """Return ``y[k] = factor y[k - 1] + values[k]``, the filter of first order, shape (N,)."""
    return np.array(list(itertools.accumulate(values.tolist(), lambda y, x: factor * y + x)))


class EncoderOffset(ReadingEffect):
    """The zero of the sensor is not at the lowest point."""

    name = "encoder_offset"
    formula = "reading th + d"
    signed = True
    order = 4

    d: float = size(0.0004, 0.0015, "rad")

    def distort(self, time: Floats, angle: Floats, path: Path) -> Floats:
        return angle + self.d


class EncoderDrift(ReadingEffect):
    """The zero of the sensor wanders off, by as much in every second."""

    name = "encoder_drift"
    formula = "reading th + r t, t lab time"
    signed = True
    order = 4

    r: float = size(4e-06, 1.5e-05, "rad/s")

    def distort(self, time: Floats, angle: Floats, path: Path) -> Floats:
        return angle + self.r * (path.lab + time)


class EncoderGain(ReadingEffect):
    """The sensor's scale is wrong."""

    name = "encoder_gain"
    formula = "reading (1 + e) th"
    signed = True
    order = 3

    e: float = size(1.7e-05, 7e-05, "", most=0.9)

    def distort(self, time: Floats, angle: Floats, path: Path) -> Floats:
        return (1 + self.e) * angle


class EncoderEccentricity(ReadingEffect):
    """The disc of the encoder is not centred on its shaft."""

    name = "encoder_eccentricity"
    formula = "reading th + e sin(th + psi)"
    order = 2

    e: float = size(0.0005, 0.002, "rad", most=0.9)
    psi: float = shape(-math.pi, math.pi, "rad")

    def distort(self, time: Floats, angle: Floats, path: Path) -> Floats:
        return angle + self.e * np.sin(angle + self.psi)


class EncoderBacklash(ReadingEffect):
    """Play between shaft and sensor, centred at the start: the reading lags on either side."""

    name = "encoder_backlash"
    formula = "reading y with abs(th - y) <= b/2, y moves only when pushed"
    order = 1

    b: float = size(0.0014, 0.006, "rad")

    def distort(self, time: Floats, angle: Floats, path: Path) -> Floats:
        half = self.b / 2
        result = []
        y = float(angle[0])
        for theta in angle.tolist():
            y = min(max(y, theta - half), theta + half)
            result.append(y)
        return np.array(result)


class SensorLag(ReadingEffect):
    """A filter of first order in the sensor, settled when the run begins."""

    name = "sensor_lag"
    formula = "reading y, y' = (th - y)/tau"
    order = 0

    tau: float = size(0.00016, 0.0006, "s", most=10.0)

    def distort(self, time: Floats, angle: Floats, path: Path) -> Floats:
        if self.tau == 0:
            return angle
        grid = np.linspace(time[0], time[-1], max(math.ceil((time[-1] - time[0]) / _FINE), 1) + 1)
        theta, velocity = path.angle(grid), path.velocity(grid)
        step = grid[1] - grid[0]
        # Hermite's cubic on each interval: theta + velocity t + c t^2 + d t^3.
        rise = np.diff(theta) / step
        c = (3 * rise - 2 * velocity[:-1] - velocity[1:]) / step
        d = (velocity[:-1] + velocity[1:] - 2 * rise) / step**2

        def settled(k: NDArray[np.intp], t: Floats) -> Floats:
            """Return the settled reading of a cubic: P - tau P' + tau^2 P'' - tau^3 P'''."""
            p = theta[k] + t * (velocity[k] + t * (c[k] + t * d[k]))
            first = velocity[k] + t * (2 * c[k] + 3 * t * d[k])
            second = 2 * c[k] + 6 * t * d[k]
            return np.asarray(p - self.tau * (first - self.tau * (second - self.tau * 6 * d[k])))

        every = np.arange(step_count := grid.size - 1)
        fade = math.exp(-step / self.tau)
        begin = settled(every, np.zeros(step_count))
        end = settled(every, np.full(step_count, step))
        # Departure from the settled reading at the start of each interval.
        jumps = np.concatenate([[0.0], end[:-1] - begin[1:]])
        departure = fading(jumps, fade)
        k = np.clip(np.searchsorted(grid, time, side="right") - 1, 0, step_count - 1)
        t = time - grid[k]
        return np.asarray(settled(k, t) + departure[k] * np.exp(-t / self.tau))


class Timebase(ReadingEffect):
    """The clock of the record runs fast or slow."""

    name = "timebase"
    formula = "recorded time (1 + e) t"
    signed = True

    e: float = size(1.3e-05, 5e-05, "", most=0.9)

    def clock(self, time: Floats) -> Floats:
        return time / (1 + self.e)

    def distort(self, time: Floats, angle: Floats, path: Path) -> Floats:
        return angle
