"""Free decays integrated with scipy, half cycle by half cycle, without code of pendmap."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

if TYPE_CHECKING:
    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Decay:
    """A decay without noise: peaks from the release on, and the angle at any time."""

    peak_time: Floats
    peak: Floats
    spline: CubicHermiteSpline

    def angle(self, time: Floats) -> Floats:
        """Return the angle at these times, rad; constant after the pendulum has stopped."""
        end = self.spline.x[-1]
        return np.asarray(self.spline(np.minimum(time, end)))


@functools.cache
def decay(  # noqa: PLR0913 (the pendulum, the release)
    w0: float = 6.2,
    c_over_m: float = 0.0496,
    tr: float = 0.08,
    release: float = 3.0,
    until: float = 90.0,
    *,
    linear: bool = False,
) -> Decay:
    """Integrate from a release at rest until it stops, or until a time."""
    times, peaks = [0.0], [release]
    knots: list[tuple[Floats, Floats, Floats]] = []

    def restoring(x: float) -> float:
        return x if linear else math.sin(x)

    while w0**2 * abs(restoring(peaks[-1])) > tr and times[-1] < until:
        way = -math.copysign(1.0, peaks[-1])

        def rate(_: float, y: Floats, way: float = way) -> list[float]:
            return [y[1], -c_over_m * y[1] - w0**2 * restoring(y[0]) - way * tr]

        def turn(_: float, y: Floats, way: float = way) -> float:
            return float(y[1] * way) if _ > 1e-3 else 1.0

        turn.terminal = True  # type: ignore[attr-defined]
        turn.direction = -1  # type: ignore[attr-defined]
        step = solve_ivp(
            rate,
            (0, 20 / w0),
            [peaks[-1], 0.0],
            method="DOP853",
            rtol=1e-11,
            atol=1e-13,
            events=turn,
            max_step=0.15 / w0,
        )
        knots.append((times[-1] + step.t[:-1], step.y[0][:-1], step.y[1][:-1]))
        times.append(times[-1] + float(step.t[-1]))
        peaks.append(float(step.y[0][-1]))
    knots.append((np.array(times[-1:]), np.array(peaks[-1:]), np.zeros(1)))
    spline = CubicHermiteSpline(*(np.concatenate(part) for part in zip(*knots, strict=True)))
    return Decay(np.array(times), np.array(peaks), spline)


def record(  # noqa: PLR0913 (the sensor)
    made: Decay,
    *,
    seconds: float = 85.0,
    rate: float = 100.0,
    noise_deg: float = 0.1,
    counts: int = 0,
    offset: float = 0.0,
    seed: int = 0,
) -> tuple[Floats, Floats]:
    """Return times and angles of a decay with noise, rounded to counts."""
    time = np.arange(round(seconds * rate) + 1) / rate
    noise = math.radians(noise_deg) * np.random.default_rng(seed).standard_normal(time.size)
    angle = made.angle(time) + offset + noise
    if counts:
        step = math.tau / counts
        angle = step * np.round(angle / step)
    return time, angle
