"""Fitting of a pendulum to records by multiple shooting (in Rust, ``src/fit``), and its motion."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import FitDiverged, InputError, core_errors
from pendmap.formatting import Estimate
from pendmap.identification.parameters import (
    OPPOSING,
    PER_RUN,
    PLACES,
    SENSOR,
    Conversion,
    free_quantities,
    interval,
    opposing,
    widened,
)
from pendmap.identification.runs import bare_run, bare_windows, rig_of, tolerance_of
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from pendmap import _core
    from pendmap.identification.runs import FitRun
    from pendmap.model import Rig
    from pendmap.signal import Floats

    States = Sequence[tuple[float, float]]

GROWTH: Final = 4.0  # Factor by which windows grow from stage to stage
LEVEL: Final = 3.841458820694124  # 95 % point of chi-squared with one degree of freedom


@dataclasses.dataclass(frozen=True)
class TrajectoryFit:
    """Result of fitting a pendulum to records, in SI."""

    estimates: Mapping[str, Estimate]  # with profile intervals; name[k] belongs to run k
    ends: Mapping[str, tuple[float, float]]  # ends of the intervals; NaN if not found
    names: tuple[str, ...]  # free parameters, in the order of the covariance
    covariance: Floats  # shape (k, k)
    chi2: float  # sum of squares; for interval readings -2 log P
    samples: int  # number of included samples
    degrees: int  # degrees of freedom: samples less fitted parameters
    rms: float  # root mean square residual of the included samples, rad
    model: Rig  # fitted model; negative damping is set to 0
    curves: tuple[Floats, ...]  # theta, velocity by run, (2, n); NaN outside windows
    residuals: tuple[Floats, ...]  # reading less model, rad; 0 if excluded
    white: tuple[Floats, ...]  # residuals of unit variance
    windows: tuple[tuple[int, int, int, float, float], ...]  # run, first, last + 1, state
    steps: int  # number of iterations
    converged: bool  # whether the search converged
    given_up: bool  # whether the search ended because the target was out of reach
    widening: float  # squared factor on the intervals, above 1 if the model does not fit
    mixed: tuple[str, ...]  # sizes with a free exponent, whose intervals are in equal ratios

    def __getitem__(self, name: str) -> float:
        """Return the value of one estimate."""
        return self.estimates[name].value

    @property
    def negative(self) -> str | None:
        """First coefficient that opposes the motion and is estimated below 0."""
        names = (name for name in opposing(self.model.effects) if name in self.estimates)
        return next((name for name in names if self[name] < 0), None)

    def sensors_of(self, places: Sequence[int]) -> dict[str, float]:
        """Return the bias of some runs' sensors, named as in a fit to these runs alone."""
        values = {}
        for k, place in enumerate(places):
            known = self.estimates.get(f"{SENSOR}[{place}]") or self.estimates.get(SENSOR)
            if known is not None:
                values[f"{SENSOR}[{k}]" if len(places) > 1 else SENSOR] = known.value
        return values

    def drive_of(self, run: FitRun, place: int) -> Mapping[str, float | None] | None:
        """Return a run's drive, with an unknown phase replaced by its fit (run ``place``), or 0."""
        if run.drive is None or run.drive.get("phi") is not None:
            return run.drive
        names = (f"phi[{place}]", "phi")
        return {**run.drive, "phi": next((self[n] for n in names if n in self.estimates), 0.0)}


def fit_runs(  # noqa: PLR0913 (the records, and what is known of them)
    runs: Sequence[FitRun],
    model: Rig,
    free: Sequence[str] = ("w0", "c_over_m", "Tr"),
    *,
    start: Mapping[str, float] | None = None,
    profiled: Sequence[str] | None = None,
    windows: Sequence[tuple[int, int, int, float, float]] | None = None,
    sigma_doubt: float = 0.0,
    hold: bool = False,
    steps: int = 40,
    least_gain: float = 1e-3,
    target: float = math.inf,
) -> TrajectoryFit:
    """Return the pendulum that fits records best, by weighted least squares.

    The sum over all samples of ``((reading - model) / sigma)**2`` is minimized over the free
    parameters and an initial state for each window (Bock 1983, Progress in Scientific Computing 2,
    95); for readings that are intervals the square is replaced by ``-2 log P``. Windows begin with
    about one swing and grow fourfold from stage to stage, to the whole record of a free decay;
    with ``windows`` of a former fit there is one stage. Intervals are profile-likelihood intervals
    (Venzon & Moolgavkar 1988, Applied Statistics 37, 87) for the names in ``profiled``, by default
    all.

    ``model`` gives fixed parameters and starting values; ``start`` replaces starting values, where
    damping may be negative. ``free`` has names of :class:`pendmap.Rig` and ``effect.parameter``;
    those of the drive are fitted run by run, as are unknown phases. ``hold`` fixes the parameters
    at their starting values, also a bias of sensors in ``start``: only initial states and
    what is unknown of single runs are fitted. ``sigma_doubt`` is
    the relative standard error of ``sigma``, ``steps`` the maximum number of iterations in a stage;
    the search ends when the expected gain of a step is below ``least_gain``, or, with ``windows``,
    when the sum ``target`` is out of reach.
    """
    from pendmap import _core  # noqa: PLC0415 (deferred import of the core)

    unknown, given = prepared(runs, model, free, start or {})
    names, units = unknown.names, unknown.units
    wanted = names if profiled is None else profiled
    chosen = [k for k, n in enumerate(names) if {n, n.partition("[")[0]} & {*wanted}]
    begun = {name.partition("[")[0] for name in start or ()}
    held = {*free, *begun.intersection([SENSOR])} if hold else set()
    choices = {
        "tolerance": tolerance_of(runs),
        "shortest": units.w0 * (math.tau / model.w0),
        "growth": GROWTH,
        "steps": steps,
        "gain": least_gain,
        "hold": len([n for n in names if n.partition("[")[0] in held]),
        "target": target,
        "profiled": [k for k in chosen if k not in unknown.mixed],
        "level": LEVEL,
        "doubt": sigma_doubt,
    }
    first = None if windows is None else bare_windows(windows, units)
    with core_errors(FitDiverged):
        fit = _core.fit_runs(given, unknown.start, choices, first)
    return _result(fit, model, unknown, chosen, max(run.clock_stderr for run in runs))


def prepared(
    runs: Sequence[FitRun], model: Rig, free: Sequence[str], start: Mapping[str, float]
) -> tuple[Conversion, list[dict[str, Any]]]:
    """Return the free parameters, and the runs in the core's format."""
    units = Units(model.w0, si=True)
    rigs = [rig_of(run, model) for run in runs]
    given = [bare_run(run, rig, units) for run, rig in zip(runs, rigs, strict=True)]
    return Conversion(free_quantities(runs, rigs, free, start), units), given


def _result(
    fit: _core.Fit, model: Rig, unknown: Conversion, chosen: Sequence[int], clock: float
) -> TrajectoryFit:
    units, bare = unknown.units, fit.values
    values = unknown.given(bare)
    # An error of the clock's rate changes all parameters together by their power of time.
    by_clock = clock * unknown.powers(bare) * values
    covariance = unknown.covariance(fit.covariance, bare)
    covariance += np.outer(by_clock, by_clock) / fit.widening
    errors = [math.sqrt(variance) for variance in np.diag(covariance)]
    # Sizes with a free exponent have no profile: their intervals follow from the covariance.
    wide = math.sqrt(LEVEL * fit.widening)
    mixed = [k for k in unknown.mixed if k in chosen]
    intervals = {k: interval(float(values[k]), wide * errors[k], mixed=True) for k in mixed}
    profiled = [k for k in chosen if k not in unknown.mixed]
    for k, pair in zip(profiled, fit.intervals, strict=True):
        both = [float(unknown.given([*bare[:k], end, *bare[k + 1 :]])[k]) for end in pair]
        # The unit of a bias may be negative; an end that is not found is NaN.
        low = next((end for end in both if end < values[k]), math.nan)
        high = next((end for end in both if end > values[k]), math.nan)
        intervals[k] = widened(float(values[k]), (low, high), float(by_clock[k]))
    estimates, ends = {}, {}
    for k, name in enumerate(unknown.names):
        low, high = intervals.get(k, (math.nan, math.nan))
        known = math.isfinite(low) and math.isfinite(high)
        ends[name] = low, high
        estimates[name] = Estimate(float(values[k]), errors[k], (low, high) if known else None)
    try:
        found_model = _found_model(model, estimates)
    except InputError as error:
        raise FitDiverged(f"the fit ends at values that are invalid in a model: {error}") from None
    curves, residuals, squares = [], [], 0.0
    for curve in fit.runs:
        curves.append(np.stack([curve.theta, units.given(curve.velocity, 1)]))
        residuals.append(curve.residual)
        squares += float(np.nansum(residuals[-1] ** 2))
    return TrajectoryFit(
        estimates=estimates,
        ends=ends,
        names=tuple(estimates),
        covariance=covariance,
        chi2=fit.chi2,
        samples=fit.samples,
        degrees=fit.degrees,
        rms=math.sqrt(squares / max(fit.samples, 1)),
        model=found_model,
        curves=tuple(curves),
        residuals=tuple(residuals),
        white=tuple(curve.white for curve in fit.runs),
        windows=tuple(
            (r, a, b, theta, float(units.given(v, 1))) for r, a, b, theta, v in fit.windows
        ),
        steps=fit.steps,
        converged=fit.converged,
        given_up=fit.given_up,
        widening=fit.widening,
        mixed=tuple(unknown.names[k] for k in unknown.mixed),
    )


def _found_model(model: Rig, estimates: Mapping[str, Estimate]) -> Rig:
    values = {n: e.value for n, e in estimates.items() if n in PLACES}
    values |= {n: max(values[n], 0.0) for n in OPPOSING if n in values}
    if model.p == 0:
        values = {n: value for n, value in values.items() if n not in PER_RUN}
    effects = []
    for effect in model.effects:
        names = {p: f"{effect.name}.{p}" for p in effect.parameters}
        known = {p: estimates[n].value for p, n in names.items() if n in estimates}
        bounds = {p: estimates[n].ci95 for p, n in names.items() if n in estimates}
        ci95 = {p: ci for p, ci in bounds.items() if ci is not None}
        parameters = dict(effect.parameters) | known
        effects.append(dataclasses.replace(effect, parameters=parameters, ci95=ci95))
    return dataclasses.replace(model, **values, effects=tuple(effects), notes={})


MISSED: Final = 0.5
"""Rms residual over the readings' standard deviation above which a fit is refused."""

FAR: Final = 1.0  # Rms residual, rad, above which a fit is refused, also for rotations


def refuse_astray(path: Path, runs: Sequence[FitRun], fit: TrajectoryFit) -> None:
    """Raise InputError for a fit with a residual comparable to the motion of a run."""
    for run, residual in zip(runs, fit.residuals, strict=True):
        counted = np.isfinite(residual) & run.counted
        if not counted.any():
            continue
        rms = float(np.sqrt(np.mean(residual[counted] ** 2)))
        scatter = float(np.std(run.theta[counted]))
        if rms > min(MISSED * scatter, FAR):
            raise InputError(
                f"{path}: no model can be fitted to these records: the residual of "
                f"{run.name or 'a run'} is {rms:.3g} rad rms, its motion {scatter:.3g} rad rms: "
                "they must be free decays of one pendulum, and a forced run must have "
                'kind = "forced" and its drive in an experiment.toml'
            )


OWN: Final = ("w0", "c_over_m", "Tr", "torque")
"""Parameters kept apart from the model, whose damping cannot be negative as a fitted one can."""

STATE_STEPS: Final = 12  # Most least-squares iterations for initial states


@dataclasses.dataclass(frozen=True)
class Motion:
    """Equation of motion of a fitted pendulum."""

    model: Rig  # Model with its effects
    own: Mapping[str, float]  # Values of the model's parameters, and of sensors by their run

    @classmethod
    def of(cls, fit: TrajectoryFit) -> Motion:
        """Return the motion of a fitted model."""
        return cls(fit.model, {name: fit[name] for name in OWN if name in fit.estimates})


def run_forward(
    motion: Motion, runs: Sequence[FitRun], states: States
) -> list[tuple[Floats, Floats]]:
    """Return readings (n,), rad, and angle and velocity (2, n), rad and rad/s, of each run.

    ``runs`` give times, drives and laboratory times; ``states`` are angle (rad) and velocity
    (rad/s) at the first time of each. Raises FitDiverged.
    """
    blank = [dataclasses.replace(run, theta=np.zeros(run.time.shape), trusted=None) for run in runs]
    fit = _fit_motion(motion, blank, states, steps=0)
    pairs = zip(fit.residuals, fit.curves, strict=True)
    return [(-residual, curve) for residual, curve in pairs]


def fit_states(motion: Motion, runs: Sequence[FitRun], states: States) -> list[tuple[float, float]]:
    """Return the least-squares initial states of runs; raises FitDiverged."""
    fit = _fit_motion(motion, runs, states, steps=STATE_STEPS)
    return [(theta, velocity) for *_, theta, velocity in fit.windows]


def _fit_motion(
    motion: Motion, runs: Sequence[FitRun], states: States, *, steps: int
) -> TrajectoryFit:
    """Fit initial states, in one window a run, with all parameters fixed."""
    whole = [dataclasses.replace(run, longest_s=math.inf) for run in runs]
    windows = [
        (k, 0, run.time.size, *state)
        for k, (run, state) in enumerate(zip(whole, states, strict=True))
    ]
    return fit_runs(
        whole,
        motion.model,
        tuple(name for name in motion.own if name in OWN),
        start=motion.own,
        windows=windows,
        profiled=(),
        hold=True,
        steps=steps,
    )
