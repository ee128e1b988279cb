"""Records in the format of a fit, and in that of the core, with time in units of ``1 / w0``."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pendmap.model import Rig
    from pendmap.signal import Floats, Mask
    from pendmap.units import Units

FORCED_WINDOW_SWINGS: Final = 3.0
"""Longest window of a forced run, periods of small swings: chaos amplifies initial errors."""

EXACTNESS: Final = 1e-6
"""Integrator's error per step, over the smallest standard error of a reading."""

SHARPEST: Final = 0.1
"""Least noise before rounding, over a count: without noise the likelihood is discontinuous."""

TOLERANCES: Final = (1e-13, 1e-8)  # Least and greatest error per step that the integrator is set to


@dataclasses.dataclass(frozen=True)
class Pivot:
    """Recorded motion of the pivot."""

    time: Floats  # s, on the clock of the run, increasing
    vertical: Floats | None = None  # shape (n,), upward: m/s^2, m/s or m
    horizontal: Floats | None = None  # shape (n,), toward positive theta
    quantity: str = "acceleration"  # or velocity, position


@dataclasses.dataclass(frozen=True)
class RodSensor:
    """Gyroscope on the rod, whose readings ``rate th' + bias`` are fitted instead of angles."""

    angle: Floats  # initial guess of the angle, rad, shape (n,)
    rate: float  # reading per rad/s
    unit: float  # unit of a bias over the unit of the readings


@dataclasses.dataclass(frozen=True)
class FitRun:
    """Record to be fitted; arrays have the shape (n,)."""

    time: Floats  # s, increasing; the drive's phase is that at time 0
    theta: Floats  # reading, rad unwrapped; of a rod sensor over its gain
    sigma: float | Floats  # standard error with rounding, rad, above 0
    trusted: Mask | None = None  # included samples; None: all
    drive: Mapping[str, float | None] | None = None  # p, Omega (rad/s), phi (rad; may be unknown)
    pivot: Pivot | None = None  # recorded motion instead of a drive
    lab_time_s: float = 0.0  # laboratory time at time 0, for drifts
    longest_s: float | None = None  # longest window, s; None: all, or 3 swings if forced
    name: str = ""
    rod_sensor: RodSensor | None = None  # effects on the reading do not act on it
    count: float | None = None  # sensor's step, rad, if readings are intervals
    clock_stderr: float = 0.0  # relative standard error of the sampling interval

    @property
    def angle(self) -> Floats:
        """Angle, rad; for a sensor on the rod the one computed from its readings."""
        return self.theta if self.rod_sensor is None else self.rod_sensor.angle

    @property
    def counted(self) -> Mask:
        """Mask of the included samples."""
        return np.ones(self.time.shape, bool) if self.trusted is None else self.trusted

    @property
    def sigmas(self) -> Floats:
        """Standard error of each reading, rad."""
        return np.broadcast_to(np.asarray(self.sigma, np.float64), self.time.shape)

    @property
    def forced(self) -> bool:
        """Whether the pivot moves."""
        return self.drive is not None or self.pivot is not None


def rig_of(run: FitRun, model: Rig) -> Rig:
    """Return the model with a run's drive and laboratory time."""
    drive = {"p": 0.0, "Omega": 0.0, "phi": 0.0}
    if run.drive is not None:
        drive |= {name: value or 0.0 for name, value in run.drive.items()}
    effects = model.effects if run.drive else tuple(e for e in model.effects if not e.drives)
    return dataclasses.replace(model, **drive, effects=effects, lab_time_s=run.lab_time_s, notes={})


def bare_run(run: FitRun, rig: Rig, units: Units) -> dict[str, Any]:
    """Return a run in the core's format."""
    sigma = run.sigmas
    if not (np.all(np.isfinite(sigma)) and np.all(sigma > 0)):
        raise InputError("sigma must be finite numbers above 0, it is not everywhere")
    if run.count is not None:  # the noise before readings were rounded
        least = (SHARPEST * run.count) ** 2
        sigma = np.sqrt(np.maximum(sigma**2 - run.count**2 / 12, least))
    weight = np.where(np.asarray(run.counted, dtype=bool), 1.0 / sigma, 0.0)
    longest = run.longest_s
    if longest is None:
        longest = FORCED_WINDOW_SWINGS * math.tau / rig.w0 if run.forced else math.inf
    return {
        "model": rig.pendulum,
        "time": units.bare(np.ascontiguousarray(run.time, np.float64), -1),
        "reading": np.ascontiguousarray(run.theta, np.float64),
        "weight": np.ascontiguousarray(weight),
        "count": run.count,
        "longest": float(units.bare(longest, -1)),
        "pivot": None if run.pivot is None else _bare_pivot(run.pivot, rig, units),
        "rod_sensor": run.rod_sensor
        and {
            "rate": float(units.given(run.rod_sensor.rate, 1)),
            "angle": np.ascontiguousarray(run.rod_sensor.angle, np.float64),
        },
    }


def _bare_pivot(pivot: Pivot, rig: Rig, units: Units) -> dict[str, Any]:
    # Lengths are in units of g / w0^2, so that accelerations are in units of gravity.
    powers = {"acceleration": 0, "velocity": 1, "position": 2}
    factor = units.w0 ** powers[pivot.quantity] / rig.gravity

    def bare(values: Floats | None) -> Floats | None:
        return None if values is None else factor * np.ascontiguousarray(values, np.float64)

    return {
        "quantity": pivot.quantity,
        "time": units.bare(np.ascontiguousarray(pivot.time, np.float64), -1),
        "vertical": bare(pivot.vertical),
        "horizontal": bare(pivot.horizontal),
    }


def bare_windows(
    windows: Sequence[tuple[int, int, int, float, float]], units: Units
) -> list[tuple[int, int, int, float, float]]:
    """Return windows in the core's format."""
    return [(r, a, b, theta, units.bare(v, 1)) for r, a, b, theta, v in windows]


def tolerance_of(runs: Sequence[FitRun]) -> float:
    """Return the integrator's tolerance per step."""
    smallest = min(float(np.min(run.sigma)) for run in runs)
    return float(np.clip(EXACTNESS * smallest, *TOLERANCES))
