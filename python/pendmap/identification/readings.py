"""Conversion of runs for a fit: readings with standard errors estimated without a model."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import FitDiverged
from pendmap.identification.fit import fit_runs
from pendmap.identification.parameters import OFFSET, OPPOSING
from pendmap.identification.runs import FitRun, Pivot, RodSensor
from pendmap.identification.turning import rough_start, samples_per_period
from pendmap.model import Effect, Rig
from pendmap.records.noise import noise_of
from pendmap.records.resolution import step_of
from pendmap.signal.robust import from_first

if TYPE_CHECKING:
    from pendmap.records import Run
    from pendmap.records.jitter import SpeedLaw
    from pendmap.signal import Floats, Mask


LEAST: Final = 1e-15  # Least noise of a reading, rad
DITHERED: Final = 0.45
"""Noise (with rounding) over the count below which errors are correlated: intervals are fitted."""

FEWEST_A_PERIOD: Final = 20.0
"""Fewest samples per period of small swings for polynomials: a quartic has nine in a window."""

QUANTITIES: Final = {"m/s2": "acceleration", "m/s": "velocity", "m": "position"}
"""Quantity of a recorded motion of the pivot, by its unit."""


@dataclasses.dataclass(frozen=True)
class Reading:
    """Standard errors of readings; arrays have the shape (n,)."""

    sigma: float  # standard error of one reading, rad
    count: float  # step of the sensor, rad; 0 for none
    each: Floats  # standard error of each reading, rad, from the law if any
    doubt: float  # relative standard error of sigma
    coarse: bool  # whether the count is coarser than the noise
    law: SpeedLaw | None = None  # growth of the noise with speed, if significant
    shift: Floats | float = 0.0  # bias by timing jitter, rad; subtracted
    gain: float = 1.0  # sensor's reading over the equivalent angle
    unit: str = "rad"  # unit of the sensor's readings


def reading_of(
    time: Floats,
    theta: Floats,
    sigma: float | None = None,
    *,
    trusted: Mask | None = None,
    count: float | None = None,
) -> Reading:
    """Return the standard errors of readings (rad, at times in s), from the trusted ones.

    The noise is that of :func:`pendmap.noise_floor`, with its growth with speed if any. With few
    readings, or few a period, it is that of :func:`_noise_of_swings`, if less. It is at least
    ``count / sqrt(12)``. ``sigma`` and ``count`` (rad) are estimated unless they are given.
    """
    if count is None:
        count = step_of(theta)
    doubt, law = 0.0, None
    if sigma is None:
        floor = noise_of(time, theta, trusted=trusted, count=count)
        known = math.isfinite(floor.sigma) and floor.sigma > 0
        sigma = floor.sigma if known else 0.0
        law = floor.law
        doubt = min(floor.stderr / floor.sigma, 1.0) if known else 1.0
        use = np.ones(time.size, bool) if trusted is None else trusted
        if not known or samples_per_period(time[use], theta[use]) < FEWEST_A_PERIOD:
            left = _noise_of_swings(time[use], theta[use], max(sigma, LEAST))
            if not known or left < sigma:
                sigma, law = left, None
    least = max(count / math.sqrt(12), LEAST)
    sigma = max(sigma, least)
    coarse = sigma < DITHERED * count
    if law is None:
        return Reading(sigma, count, np.full(theta.shape, sigma), doubt, coarse)
    sigmas = np.maximum(law.sigma(time, theta), least)
    return Reading(sigma, count, sigmas, doubt, coarse, law, law.shift(time, theta))


def _noise_of_swings(time: Floats, theta: Floats, sigma: float) -> float:
    """Return the noise of few samples per period, which polynomials do not follow, rad.

    It is the residual of a pendulum with friction in windows of one swing, with an initial state
    each; ``sigma``, an upper limit, is returned without a fit.
    """
    start = rough_start(time, theta, sigma)
    if start is None:
        return sigma
    run = FitRun(time, theta, sigma, longest_s=math.tau / start["w0"])
    w0, c_over_m, friction = (start[name] for name in ("w0", *OPPOSING))
    model = Rig(w0, c_over_m, friction, effects=(Effect(OFFSET, {"d": 0.0}),))
    try:
        fit = fit_runs([run], model, ["w0", *OPPOSING, f"{OFFSET}.d"], profiled=())
    except FitDiverged:
        return sigma
    freedom = fit.samples - 2 * len(fit.windows) - len(fit.names)
    return fit.rms * math.sqrt(fit.samples / freedom) if freedom > 0 else sigma


def as_fit_run(run: Run, reading: Reading) -> FitRun:
    """Return a run in the format of a fit.

    Times are relative to the first sample, except under a drive, for its phase.
    """
    time, first = from_first(run.time) if run.drive is None else (run.time, 0.0)
    pivot, gyro = None, run.gyroscope
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
        rod_sensor=None if gyro is None else RodSensor(run.theta, 1 / gyro.w0, gyro.w0),
        count=reading.count if reading.coarse else None,
        clock_stderr=run.clock_stderr,
    )


def as_angles(run: Run) -> Floats:
    """Return a run's angles; for a gyroscope, readings over the gain of small swings."""
    return run.read / (1.0 if run.gyroscope is None else run.gyroscope.w0)


def reading_of_run(run: Run, sigma: float | None = None) -> Reading:
    """Return the standard errors of a run's readings; see :func:`reading_of`."""
    time = from_first(run.time)[0]
    if run.gyroscope is None:
        return reading_of(time, run.theta, sigma, trusted=run.trusted, count=run.count_rad)
    reading = reading_of(time, as_angles(run), sigma, trusted=run.trusted)
    law = reading.law
    if law is not None:
        # The error of a rate by jitter is proportional to the acceleration.
        law = dataclasses.replace(law, grows_with="acceleration")
    return dataclasses.replace(reading, law=law, gain=run.gyroscope.w0, unit="rad/s")
