"""The trajectory method on an experiment: all its runs together, each with its own start."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.identification.methods.trajectory import fit_from_start
from pendmap.identification.readings import Reading, reading_of
from pendmap.identification.runs import FitRun, Pivot, RodSensor
from pendmap.signal.robust import from_first

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.model import Effect, Rig
    from pendmap.records import Run


QUANTITIES: Final = {"m/s2": "acceleration", "m/s": "velocity", "m": "position"}
"""Quantity that a recorded motion of the pivot has, by its unit."""


@dataclasses.dataclass(frozen=True)
class JointFit:
    """A pendulum fitted to several runs, in the order of its curves and residuals."""

    fit: TrajectoryFit
    runs: tuple[Run, ...]
    readings: tuple[Reading, ...]

    @property
    def noise(self) -> float:
        """Root mean square of the noise of the readings that count, rad."""
        counts = [int(run.trusted.sum()) for run in self.runs]
        square = np.average([reading.sigma**2 for reading in self.readings], weights=counts)
        return math.sqrt(square)


def as_fit_run(run: Run, reading: Reading) -> FitRun:
    """Return a run as the fit takes it.

    Times count from the first sample; under a drive from 0, for its phase.
    """
    time, first = from_first(run.time) if run.drive is None else (run.time, 0.0)
    pivot = None
    if run.pivot is not None:
        quantity = QUANTITIES[run.pivot_unit or "m/s2"]
        pivot = Pivot(
            time, run.pivot.get("vertical"), run.pivot.get("horizontal"), quantity=quantity
        )
    return FitRun(
        time,
        as_angles(run) - reading.shift,
        reading.each,
        trusted=run.trusted,
        drive=run.drive,
        pivot=pivot,
        lab_time_s=run.lab_time_s + first,
        name=run.name,
        rod_sensor=_rod_sensor(run),
        count=reading.interval,
    )


def as_angles(run: Run) -> NDArray[np.float64]:
    """Return a run's angles; of a sensor on the rod the readings over the gain of small swings."""
    return run.read / (1.0 if run.rod_sensor is None else run.rod_sensor.gain)


def reading_of_run(run: Run) -> Reading:
    """Return the standard errors of a run's readings; see :func:`reading_of`."""
    time, sensor = from_first(run.time)[0], run.rod_sensor
    if sensor is None:
        return reading_of(time, run.theta, trusted=run.trusted, count=run.count_rad)
    found = reading_of(time, as_angles(run), trusted=run.trusted)
    law = found.law
    if law is not None and run.gyroscope is not None:
        # The error of a late reading of a rate is proportional to the acceleration.
        law = dataclasses.replace(law, grows_with="acceleration")
    return dataclasses.replace(found, law=law, gain=abs(sensor.gain), unit=sensor.unit)


def _rod_sensor(run: Run) -> RodSensor | None:
    if run.gyroscope is not None:
        gain = run.gyroscope.gain
        return RodSensor(run.theta, rate=1 / gain, unit=gain, leans=False)
    sensor = run.accelerometer
    if sensor is None:
        return None
    place, gravity = sensor.distance_m / sensor.gain, sensor.gravity / sensor.gain
    leans = sensor.direction != "angular"
    return RodSensor(run.theta, place=place, gravity=gravity, unit=sensor.gain, leans=leans)


def fit_together(
    runs: Sequence[Run],
    *,
    start: Rig | None = None,
    known: dict[str, float] | None = None,
    effects: Sequence[Effect | str] = (),
) -> JointFit:
    """Fit natural frequency, damping, the sensor's zero and effects to one run or more.

    ``start``, with its effects, or ``known`` parameters are where the search begins, else it is
    found from the first run: TooShortError is raised where that gives none. Sizes of ``effects``
    are fitted.
    """
    if not runs:
        raise InputError("runs must hold one record or more, got none")
    readings = [reading_of_run(run) for run in runs]
    fit, worth = fit_from_start(
        [as_fit_run(run, reading) for run, reading in zip(runs, readings, strict=True)],
        readings,
        start=start or known,
        effects=effects,
    )
    return JointFit(fit, tuple(runs), worth)
