"""Records as a fit takes them, and their way to the core: there time counts in ``1 / w0``."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import InputError, short_repr

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from pendmap.model import Rig
    from pendmap.units import Units

FORCED_WINDOW_SWINGS: Final = 3.0
"""The longest window of a forced run, in periods of small swings: forced motions may be chaotic,
and what is not known of a state grows in them."""

EXACTNESS: Final = 1e-6
"""The integrator's error allowed to a step, over the smallest standard error of a reading."""

SHARPEST: Final = 0.1
"""The least noise before the rounding, over a count: the edges of real counts are not perfect, and
readings that may not err at all would be walls to a search."""

TOLERANCES: Final = (1e-13, 1e-8)
"""Its least and its greatest value."""


@dataclasses.dataclass(frozen=True)
class Pivot:
    """A recorded motion of the pivot.

    Parameters
    ----------
    time : ndarray of float, shape (n,)
        In s, on the clock of the run; each after the one before it.
    vertical, horizontal : ndarray of float, shape (n,), or None
        Upward, and toward positive theta: accelerations in m/s^2, velocities in m/s or positions
        in m.
    quantity : str
        Which of them: ``acceleration``, ``velocity`` or ``position``.
    """

    time: NDArray[np.float64]
    vertical: NDArray[np.float64] | None = None
    horizontal: NDArray[np.float64] | None = None
    quantity: str = "acceleration"


@dataclasses.dataclass(frozen=True)
class RodSensor:
    """A gyroscope or an accelerometer on the rod, whose readings a fit compares instead of angles.

    A gyroscope reads ``rate th' + bias``, an accelerometer
    ``place (th'' cos(tilt) + th'**2 sin(tilt)) + gravity sin(th + tilt) + bias``, where
    ``bias`` and ``tilt`` are fitted. Where friction turns round, at every turn, ``th''`` and the
    reading jump by ``2 place Tr``, which the reading whose interval of sampling holds the turn
    shares; while friction holds the pendulum, ``th''`` is 0.

    Parameters
    ----------
    angle : ndarray of float, shape (n,)
        About which angles the readings were taken, rad: where the search starts.
    rate : float
        Reading per rad/s; 0 of an accelerometer.
    place : float
        Reading per rad/s^2; 0 of a gyroscope.
    gravity : float
        Reading of the whole of gravity; 0 where the sensor gives none.
    unit : float
        What a bias is given in, over the unit of the readings.
    leans : bool
        Whether its axis has a tilt.
    """

    angle: NDArray[np.float64]
    rate: float = 0.0
    place: float = 0.0
    gravity: float = 0.0
    unit: float = 1.0
    leans: bool = True


@dataclasses.dataclass(frozen=True)
class FitRun:
    """A record to be fitted.

    Parameters
    ----------
    time : ndarray of float, shape (n,)
        In s; each after the one before it. The drive's phase counts from ``time = 0``.
    theta : ndarray of float, shape (n,)
        What the sensor read, rad, unwrapped; of a sensor on the rod in the unit of its factors.
    sigma : float or ndarray of float, shape (n,)
        Standard error of the readings, rad; above 0; the rounding to counts included.
    trusted : ndarray of bool, shape (n,), or None
        Which samples count; all if none.
    drive : mapping of str to float or None
        ``p``, ``Omega`` (rad/s) and ``phi`` (rad; None or left out: not known) of a harmonic drive.
    pivot : Pivot or None
        A recorded motion of the pivot instead.
    lab_time_s : float
        Time in the laboratory at ``time = 0``, for effects that drift.
    longest_s : float or None
        The longest window; none: the whole record for a free decay, three swings for a forced run.
    name : str
        What to call it.
    rod_sensor : RodSensor or None
        What read, if it was no sensor of the angle; effects on the reading do not act on it.
    count : float or None
        The step of the sensor, rad, where readings are intervals: the angle with the noise lay
        within half a count of what was read. None where ``sigma`` says all.
    """

    time: NDArray[np.float64]
    theta: NDArray[np.float64]
    sigma: float | NDArray[np.float64]
    trusted: NDArray[np.bool_] | None = None
    drive: Mapping[str, float | None] | None = None
    pivot: Pivot | None = None
    lab_time_s: float = 0.0
    longest_s: float | None = None
    name: str = ""
    rod_sensor: RodSensor | None = None
    count: float | None = None

    @property
    def angle(self) -> NDArray[np.float64]:
        """The angle, rad; of a sensor on the rod the one that was made of its readings."""
        return self.theta if self.rod_sensor is None else self.rod_sensor.angle

    @property
    def forced(self) -> bool:
        """Whether its pivot moves."""
        return self.drive is not None or self.pivot is not None


def rig_of(run: FitRun, model: Rig) -> Rig:
    """Return the pendulum of one run: its drive, its time in the laboratory."""
    drive = {"p": 0.0, "Omega": 0.0, "phi": 0.0}
    if run.drive is not None:
        drive |= {name: value or 0.0 for name, value in run.drive.items()}
    effects = model.effects if run.drive else tuple(e for e in model.effects if not e.drives)
    return dataclasses.replace(model, **drive, effects=effects, lab_time_s=run.lab_time_s, notes={})


def bare_run(run: FitRun, rig: Rig, units: Units) -> dict[str, Any]:
    """Return a run as the core takes it."""
    time = _floats("time", run.time)
    theta = _floats("theta", run.theta)
    sigma = np.broadcast_to(np.asarray(run.sigma, dtype=np.float64), time.shape)
    if not (np.all(np.isfinite(sigma)) and np.all(sigma > 0)):
        raise InputError("sigma must be finite numbers above 0, it is not everywhere")
    weight = 1.0 / (sigma if run.count is None else _before_rounding(sigma, run.count))
    if run.trusted is not None:
        weight = np.where(np.asarray(run.trusted, dtype=bool), weight, 0.0)
    longest = run.longest_s
    if longest is None:
        longest = FORCED_WINDOW_SWINGS * math.tau / rig.w0 if run.forced else math.inf
    return {
        "model": rig.pendulum,
        "time": units.bare(time, -1),
        "reading": theta,
        "weight": np.ascontiguousarray(weight),
        "count": run.count,
        "longest": float(units.bare(longest, -1)),
        "pivot": None if run.pivot is None else _bare_pivot(run.pivot, rig, units),
        "rod_sensor": _bare_sensor(run, units),
    }


def _before_rounding(sigma: NDArray[np.float64], count: float) -> NDArray[np.float64]:
    """Return the noise before readings were rounded, ``sqrt(sigma^2 - count^2 / 12)``."""
    least = (SHARPEST * count) ** 2
    return np.asarray(np.sqrt(np.maximum(sigma**2 - count**2 / 12, least)), np.float64)


def _bare_sensor(run: FitRun, units: Units) -> dict[str, Any] | None:
    sensor = run.rod_sensor
    if sensor is None:
        return None
    # What the pivot does is no part of a rate, but of an acceleration.
    if run.forced and (sensor.place or sensor.gravity):
        raise InputError(f"{run.name or 'run'}: an accelerometer on a moving pivot is not fitted")
    return {
        "rate": float(units.given(sensor.rate, 1)),
        "place": float(units.given(sensor.place, 2)),
        "gravity": sensor.gravity,
        # A reading is the mean over an interval of sampling.
        "interval": float(units.bare(float(np.median(np.diff(run.time))), -1)),
        "angle": _floats("angle", sensor.angle),
    }


def _bare_pivot(pivot: Pivot, rig: Rig, units: Units) -> dict[str, Any]:
    # Lengths in g / w0^2: then accelerations are over gravity.
    powers = {"acceleration": 0, "velocity": 1, "position": 2}
    if pivot.quantity not in powers:
        raise InputError(
            f"quantity must be one of {', '.join(powers)}, got {short_repr(pivot.quantity)}"
        )
    factor = units.w0 ** powers[pivot.quantity] / rig.gravity

    def bare(values: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
        return None if values is None else factor * _floats("pivot", values)

    return {
        "quantity": pivot.quantity,
        "time": units.bare(_floats("pivot time", pivot.time), -1),
        "vertical": bare(pivot.vertical),
        "horizontal": bare(pivot.horizontal),
    }


def _floats(what: str, values: object) -> NDArray[np.float64]:
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.ndim != 1:
        raise InputError(f"{what} must have 1 dimension, got {array.ndim}")
    return array


def bare_windows(
    windows: Sequence[tuple[int, int, int, float, float]], units: Units
) -> list[tuple[int, int, int, float, float]]:
    """Return windows as the core takes them."""
    return [(r, a, b, theta, units.bare(v, 1)) for r, a, b, theta, v in windows]


def tolerance_of(runs: Sequence[FitRun]) -> float:
    """Return the error allowed to a step of the integrator."""
    smallest = min(float(np.min(run.sigma)) for run in runs)
    return float(np.clip(EXACTNESS * smallest, *TOLERANCES))
