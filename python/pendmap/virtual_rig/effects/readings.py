"""Effects of the sensor: errors of the angle read and of the sampling times."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.signal import lfilter

from pendmap.virtual_rig.effects.base import Effect, Floats, Reading, effect, shape, size

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.virtual_rig.path import Path

_reading: Final = functools.partial(effect, "distort", "reading")

_FINE: Final = 1e-3  # Step of the cubic interpolation in the exact response of the lag, s


def read(path: Path, time: Floats, effects: list[Effect]) -> Floats:
    """Return the noise-free reading of a path at true, increasing times, rad."""
    # Backlash depends on turning points between the samples.
    turns = np.array([event.time for event in path.events if event.what == "turn"])
    turns = turns[(turns > time[0]) & (turns < time[-1])]
    everything = np.concatenate([time, turns])
    order = np.argsort(everything, kind="stable")
    seen = Reading(everything[order], path.angle(everything[order]), path)
    for acting in sorted(effects, key=lambda one: one.order):
        seen = seen._replace(angle=acting.distort(seen))
    result = np.empty_like(seen.angle)
    result[order] = seen.angle
    return result[: time.size]


@_reading("reading th + d", signed=True, order=4, d=size(0.0004, 0.0015, "rad"))
def encoder_offset(seen: Reading, d: float) -> Floats:
    """The zero of the sensor is offset from the lowest point."""
    return seen.angle + d


@_reading("reading th + r t, t lab time", signed=True, order=4, r=size(4e-06, 1.5e-05, "rad/s"))
def encoder_drift(seen: Reading, r: float) -> Floats:
    """The zero of the sensor drifts at a constant rate."""
    return seen.angle + r * (seen.path.lab + seen.time)


@_reading("reading (1 + e) th", signed=True, order=3, e=size(1.7e-05, 7e-05, "", most=0.9))
def encoder_gain(seen: Reading, e: float) -> Floats:
    """The sensor's scale is wrong."""
    return (1 + e) * seen.angle


@_reading(
    "reading th + e sin(th + psi)",
    order=2,
    e=size(0.0005, 0.002, "rad", most=0.9),
    psi=shape(-math.pi, math.pi, "rad"),
)
def encoder_eccentricity(seen: Reading, e: float, psi: float) -> Floats:
    """The disc of the encoder is not centred on its shaft."""
    return seen.angle + e * np.sin(seen.angle + psi)


@_reading(
    "reading y with abs(th - y) <= b/2, y moves only when pushed",
    order=1,
    b=size(0.0014, 0.006, "rad"),
)
def encoder_backlash(seen: Reading, b: float) -> Floats:
    """Play between shaft and sensor, centred at the start: the reading lags in both directions."""
    half = b / 2
    result = []
    y = float(seen.angle[0])
    for theta in seen.angle.tolist():
        y = min(max(y, theta - half), theta + half)
        result.append(y)
    return np.array(result)


@_reading("reading y, y' = (th - y)/tau", tau=size(0.00016, 0.0006, "s", most=10.0))
def sensor_lag(seen: Reading, tau: float) -> Floats:
    """A first-order filter in the sensor, in steady state when the run begins."""
    time, angle, path = seen
    if tau == 0:
        return angle
    grid = np.linspace(time[0], time[-1], max(math.ceil((time[-1] - time[0]) / _FINE), 1) + 1)
    theta, velocity = path.angle(grid), path.velocity(grid)
    step = grid[1] - grid[0]
    # Hermite's cubic on each interval: theta + velocity t + c t^2 + d t^3.
    rise = np.diff(theta) / step
    c = (3 * rise - 2 * velocity[:-1] - velocity[1:]) / step
    d = (velocity[:-1] + velocity[1:] - 2 * rise) / step**2

    def settled(k: NDArray[np.intp], t: Floats) -> Floats:
        """Return the steady-state response to a cubic: P - tau P' + tau^2 P'' - tau^3 P'''."""
        p = theta[k] + t * (velocity[k] + t * (c[k] + t * d[k]))
        first = velocity[k] + t * (2 * c[k] + 3 * t * d[k])
        second = 2 * c[k] + 6 * t * d[k]
        return np.asarray(p - tau * (first - tau * (second - tau * 6 * d[k])))

    every = np.arange(step_count := grid.size - 1)
    fade = math.exp(-step / tau)
    begin = settled(every, np.zeros(step_count))
    end = settled(every, np.full(step_count, step))
    # Difference from the steady-state response at the start of each interval.
    jumps = np.concatenate([[0.0], end[:-1] - begin[1:]])
    departure = lfilter([1.0], [1.0, -fade], jumps)
    k = np.clip(np.searchsorted(grid, time, side="right") - 1, 0, step_count - 1)
    t = time - grid[k]
    return np.asarray(settled(k, t) + departure[k] * np.exp(-t / tau))


@effect(
    "clock", "reading", "recorded time (1 + e) t", signed=True, e=size(1.3e-05, 5e-05, "", most=0.9)
)
def timebase(time: Floats, e: float) -> Floats:
    """The clock of the record runs fast or slow."""
    return time / (1 + e)
