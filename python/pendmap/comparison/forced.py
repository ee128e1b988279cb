"""Comparison of a model with a forced run: ensemble statistics and steady state."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap import errors
from pendmap.comparison.itinerary import UNITS, Ruler, reached_cycles, steady_state
from pendmap.errors import FitDiverged, InputError
from pendmap.identification.fit import fit_runs
from pendmap.identification.readings import as_fit_run, reading_of_run
from pendmap.identification.runs import bare_run, rig_of
from pendmap.identification.sensitivity import window_slopes
from pendmap.signal.robust import intervals_of
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pendmap.comparison.itinerary import Steady
    from pendmap.formatting import Estimate
    from pendmap.identification.runs import FitRun
    from pendmap.model import Rig
    from pendmap.records import Run
    from pendmap.signal import Floats


_AT_ONCE: Final = 4_000_000  # Samples held in memory at once
_FOLLOWED: Final = 100  # Ensemble members that are integrated to their steady state
FEWEST: Final = 32  # Fewest samples from which noise and initial state are estimated
_EXACTNESS: Final = 1e-9  # Error tolerance of the integrator per step
_EVEN: Final = (2.5, 97.5)  # Percentiles of the central 95 % interval


@dataclasses.dataclass(frozen=True)
class Ensemble:
    """Ensemble of initial states from which a model is integrated.

    Parameters
    ----------
    members : int
        Number of initial states; 20 to 100,000.
    spread : float
        Their standard deviation about the measured initial state, rad, and over ``w0``; its
        standard error is added.
    seed : int
        Seed of the random initial states.

    Raises
    ------
    InputError
        If a value is outside its range.
    """

    members: int = 400
    spread: float = 0.01
    seed: int = 0

    def __post_init__(self) -> None:
        errors.check_whole("members", self.members, 20, 100_000)
        if not 0 <= errors.check_number("spread", self.spread) <= 1:
            raise InputError(f"spread must be a number from 0 to 1 rad, got {self.spread:g}")
        errors.check_whole("seed", self.seed, 0, errors.MOST_SEED)


def simulated_readings(
    run: FitRun, model: Rig, starts: Floats, times: Floats, threads: int | None
) -> Floats:
    """Return readings of a model under the drive or pivot motion of a run, rad, shape (M, N).

    ``starts``, shape (2, M), are angles and velocities (rad, rad/s) at the first of N times (s, on
    the run's clock). Readings are not wrapped, and NaN after an overflow.
    """
    from pendmap import _core  # noqa: PLC0415 (deferred import of the core)

    units = Units(model.w0, si=True)
    theta, velocity = starts
    with errors.core_errors(FitDiverged):
        return _core.replay(
            bare_run(run, rig_of(run, model), units),
            np.ascontiguousarray(theta, dtype=np.float64),
            np.ascontiguousarray(units.bare(velocity, 1), dtype=np.float64),
            np.ascontiguousarray(units.bare(times, -1), dtype=np.float64),
            _EXACTNESS,
            threads or 0,
        )


@dataclasses.dataclass(frozen=True)
class Statistic:
    """Statistic of a record and of each member of an ensemble."""

    name: str
    unit: str
    measured: float  # of the record; infinite for a time beyond its end
    ensemble: Floats  # of each member, shape (M,)

    @property
    def median(self) -> float:
        """Median of the ensemble."""
        return float(np.quantile(self.ensemble, 0.5, method="inverted_cdf"))

    @property
    def ci95(self) -> tuple[float, float]:
        """Ends of the central 95 % interval of the ensemble."""
        low, high = np.percentile(self.ensemble, _EVEN, method="inverted_cdf")
        return float(low), float(high)

    @property
    def chance(self) -> float:
        """Two-sided p-value of the measured value in the ensemble."""
        below = 1 + int((self.ensemble <= self.measured).sum())
        above = 1 + int((self.ensemble >= self.measured).sum())
        return min(1.0, 2 * min(below, above) / (self.ensemble.size + 1))


@dataclasses.dataclass(frozen=True, repr=False)
class ForcedComparison:
    """Comparison of a model with one forced run."""

    run: Run  #: The record.
    sigma: float  #: Noise of the record, rad.
    #: Root mean square residual, rad, in windows of up to three swings with fitted initial states.
    rms: float
    windows: int  #: Number of these windows.
    start: tuple[float, float]  #: Angle (rad) and velocity (rad/s) fitted at the beginning.
    start_stderr: tuple[float, float]  #: Their standard errors.
    phase: Estimate | None  #: Fitted phase of the drive, rad, if it was not stated.
    time: Floats  #: Equal times, s, shape (N,).
    measured: Floats  #: The record at these times, rad.
    velocity: Floats  #: Velocity of the record, rad/s.
    #: Reading and velocity, shape (2, N), of the member nearest to the ensemble's medians.
    example: Floats
    #: Wells visited, escapes, angle covered, time to settle, greatest velocity.
    statistics: tuple[Statistic, ...]
    steady: Steady | None  #: The steady state, if the record reaches one under a periodic drive.
    ensemble: Ensemble  #: Choice of the members' initial states.

    def __repr__(self) -> str:
        held = ", held out" if self.run.hold_out else ""
        ends = "no steady state" if self.steady is None else self.steady.measured.name
        return (
            f"<ForcedComparison {self.run.name}{held}: rms {self.rms:.3g} rad in "
            f"{self.windows} windows, noise {self.sigma:.3g} rad; {ends}>"
        )


def compare_forced(
    model: Rig,
    run: Run,
    ensemble: Ensemble,
    threads: int | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> ForcedComparison:
    """Compare a model with a forced run; only an unknown phase of the drive is fitted."""
    worth = reading_of_run(run)
    given = as_fit_run(run, worth)
    fit = fit_runs([given], model, free=(), profiled=())
    phase = next((e for name, e in fit.estimates.items() if name.startswith("phi")), None)
    given = dataclasses.replace(given, drive=fit.drive_of(given, 0))
    _, begin, _, *start = fit.windows[0]
    first = dataclasses.replace(fit, windows=fit.windows[:1], names=())
    _, (window,) = window_slopes(first, [given], (), fit.model)
    inverse = np.linalg.pinv(window.states.T @ window.states, hermitian=True)
    covariance = inverse * np.outer((1.0, fit.model.w0), (1.0, fit.model.w0))
    time, measured = _evenly(run, given, float(given.time[begin]))
    period = None if given.drive is None else math.tau / float(given.drive["Omega"] or math.nan)
    ruler = Ruler(time[1] - time[0], math.tau / model.w0, period, worth.sigma)
    starts = drawn_starts(start, covariance, ensemble, model.w0)
    simulated = functools.partial(simulated_readings, given, model, threads=threads)
    members = _members(simulated, starts, time, ruler, progress)
    statistics = tuple(
        Statistic(
            name, UNITS.get(name, ""), float(value), np.array([m[name] for m in members], float)
        )
        for name, value in ruler.statistics(measured).items()
    )
    reading = simulated(starts[:, [_example(statistics)]], time)[0]
    last, cycles = ruler.cycling(measured), None
    if period is not None and last.n:
        followed = starts[:, :_FOLLOWED]
        ends = reached_cycles(simulated, time[0], followed, period, model.c_over_m)
        cycles = steady_state(time, measured, period, last, ends)
    return ForcedComparison(
        run=run,
        sigma=worth.sigma,
        rms=fit.rms,
        windows=len(fit.windows),
        start=(float(start[0]), float(start[1])),
        start_stderr=tuple(np.sqrt(np.diag(covariance)).tolist()),
        phase=phase,
        time=time,
        measured=measured,
        velocity=ruler.velocity(measured),
        example=np.stack([reading, ruler.velocity(reading)]),
        statistics=statistics,
        steady=cycles,
        ensemble=ensemble,
    )


def drawn_starts(
    start: Sequence[float], covariance: Floats, ensemble: Ensemble, w0: float
) -> Floats:
    """Return random initial states about a measured one, which is the first, shape (2, M).

    Their distribution is normal, with this covariance plus ``spread^2`` in angle and ``(spread
    w0)^2`` in velocity.
    """
    wide = covariance + np.diag([ensemble.spread**2, (ensemble.spread * w0) ** 2])
    draw = np.random.default_rng(ensemble.seed)
    drawn = draw.multivariate_normal(np.zeros(2), wide, ensemble.members)
    drawn[0] = 0.0
    return np.array(start)[:, None] + drawn.T


def _evenly(run: Run, given: FitRun, begin: float) -> tuple[Floats, Floats]:
    """Return equally spaced times from the initial state on, and the record's angle at them."""
    tick = intervals_of(run.time).tick
    time = np.arange(begin, given.time[-1] + 0.5 * tick, tick)
    known = run.trusted.copy()
    for segment in run.segments:
        if segment.what == "rest":
            known |= (run.time >= segment.from_s) & (run.time <= segment.to_s)
    return time, np.interp(time, given.time[known], given.angle[known])


def _members(
    simulated: Callable[[Floats, Floats], Floats],
    starts: Floats,
    time: Floats,
    ruler: Ruler,
    progress: Callable[[int, int], object] | None,
) -> list[dict[str, float]]:
    """Return the statistics of each member, with noise like the record's."""
    draw = np.random.default_rng(0)  # results are insensitive to the noise's seed
    count, many = starts.shape[1], max(1, _AT_ONCE // time.size)
    members: list[dict[str, float]] = []
    for first in range(0, count, many):
        block = simulated(starts[:, first : first + many], time)
        if not np.isfinite(block).all():
            raise InputError("the model overflows from a start near the measured one")
        block += draw.normal(0.0, ruler.sigma, block.shape)
        members += [ruler.statistics(reading) for reading in block]
        if progress is not None:
            progress(min(first + many, count), count)
    return members


def _example(statistics: tuple[Statistic, ...]) -> int:
    """Return the index of the member whose ranks are nearest to the medians of all statistics."""
    order = [np.argsort(np.argsort(one.ensemble, kind="stable")) for one in statistics]
    ranks = np.array(order) / max(len(order[0]) - 1, 1) - 0.5
    return int(np.argmin(np.abs(ranks).max(axis=0)))
