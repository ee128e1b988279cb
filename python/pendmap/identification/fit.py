"""Fitting a pendulum to records by multiple shooting; the work is done in Rust (``src/fit``)."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import FitDiverged, InputError, core_errors
from pendmap.formatting import Estimate
from pendmap.identification.parameters import PER_RUN, PLACES, Conversion, free_quantities, interval
from pendmap.identification.runs import (
    FitRun,
    bare_run,
    bare_windows,
    rig_of,
    tolerance_of,
)
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from pendmap.identification.runs import FitRun
    from pendmap.model import Rig


LEVEL: Final = 3.841458820694124
"""The 95 % point of chi-squared with one degree of freedom."""


@dataclasses.dataclass(frozen=True)
class TrajectoryFit:
    """A pendulum fitted to records.

    Parameters
    ----------
    estimates : mapping of str to Estimate
        Of the free parameters, in SI; standard errors from the covariance, intervals from the
        profile of the likelihood, but for those that are ``mixed``. A name with ``[k]`` belongs to
        run ``k`` alone.
    ends : mapping of str to (float, float)
        The ends of their intervals, one of which may not have been found: no number.
    names : tuple of str
        The free parameters, in the order of the covariance.
    covariance : ndarray of float, shape (k, k)
        In SI.
    chi2 : float
        The sum of the squared residuals over the standard errors; of readings that are intervals
        twice minus the logarithm of the likelihood, less what makes it one for each reading.
    samples, degrees : int
        How many samples count; the same less what was adapted to them.
    rms : float
        Of the residuals, rad, over the samples that count.
    model : Rig
        The model that was given, with the values found; a negative damping is set to 0, which no
        pendulum has: ``estimates`` have it.
    curves : tuple of ndarray of float, shape (2, n)
        For each run angle and velocity (rad, rad/s) of the model at each sample; no numbers where
        there was no window.
    residuals : tuple of ndarray of float, shape (n,)
        For each run what the sensor read less the model's reading, rad; 0 where a sample does not
        count.
    white : tuple of ndarray of float, shape (n,)
        The same over the standard errors, so that noise has unit variance; of readings that are
        intervals the slope of the likelihood over its root mean square.
    windows : tuple of (int, int, int, float, float)
        Run, first sample, one after the last, angle (rad) and velocity (rad/s) at its first sample.
    steps : int
        Steps of the search.
    converged : bool
        Whether it ended.
    given_up : bool
        Whether it was given up, since it led nowhere near the target.
    widening : float
        Above 1 where the sum of squares is greater than chance allows, as it is where the model
        lacks something: the intervals are wider by its root, covariance and standard errors are
        not.
    mixed : tuple of str
        The parameters whose unit depends on an exponent that is free too: their intervals are in
        equal ratios, by the covariance.
    """

    estimates: Mapping[str, Estimate]
    ends: Mapping[str, tuple[float, float]]
    names: tuple[str, ...]
    covariance: NDArray[np.float64]
    chi2: float
    samples: int
    degrees: int
    rms: float
    model: Rig
    curves: tuple[NDArray[np.float64], ...]
    residuals: tuple[NDArray[np.float64], ...]
    white: tuple[NDArray[np.float64], ...]
    windows: tuple[tuple[int, int, int, float, float], ...]
    steps: int
    converged: bool
    given_up: bool
    widening: float
    mixed: tuple[str, ...]

    def __getitem__(self, name: str) -> float:
        """Return the value of one estimate."""
        return self.estimates[name].value


def fit_runs(  # noqa: PLR0913 (the records, and what is known of them)
    runs: Sequence[FitRun],
    model: Rig,
    free: Sequence[str] = ("w0", "c_over_m", "Tr"),
    *,
    start: Mapping[str, float] | None = None,
    profiled: Sequence[str] | None = None,
    shortest_s: float | None = None,
    windows: Sequence[tuple[int, int, int, float, float]] | None = None,
    sigma_doubt: float = 0.0,
    hold: bool = False,
    steps: int = 40,
    least_gain: float = 1e-3,
    growth: float = 4.0,
    target: float = math.inf,
) -> TrajectoryFit:
    """Return the pendulum that fits records best, by weighted least squares.

    The sum over all samples of ``((reading - model) / sigma)**2`` is least over the free
    parameters and over an initial state for each window; where readings are intervals, by counts
    coarser than the noise, ``-2 log P`` of them stands for the square. Windows begin with about one
    swing and grow from stage to stage, to the whole record of a free decay.

    Parameters
    ----------
    runs : sequence of FitRun
        The records.
    model : Rig
        What is known, and where the search starts; its ``w0`` may be off by some percent. Effects
        of the drive are left out of runs without one.
    free : sequence of str
        What is fitted: names of :class:`pendmap.Rig`, and ``effect.parameter`` of effects of the
        model. ``p``, ``Omega`` and ``phi`` are those of each run with a drive; a ``phi`` that a run
        does not know is fitted anyhow.
    start : mapping of str to float, optional
        Other starts for some; here damping may be negative.
    profiled : sequence of str, optional
        For which an interval is computed from the profile; all if none are given.
    shortest_s : float, optional
        Length of the first windows, s; one swing if none is given.
    windows : sequence, optional
        Those of a former fit: the search begins with them, without stages.
    sigma_doubt : float
        Relative standard error of ``sigma``.
    hold : bool
        Whether the parameters stay at their starts, so that initial states and phases that no run
        knows are adapted alone: a model is tried on records that it was not fitted to.
    steps : int
        The most steps of a stage.
    least_gain : float
        A step that promises less of the sum of squares than this is the last one.
    growth : float
        By how much windows grow from stage to stage: with less a motion near the top, where small
        errors of its state soon are large, is lost less often.
    target : float
        The sum of squares that is to be reached: with ``windows``, a search that after some steps
        promises far less is given up.

    Raises
    ------
    InputError
        If a name is not known, or a record is too short or not finite.
    FitDiverged
        If the start leads out of the range of numbers, or the fit to values that no model may have.

    References
    ----------
    Bock (1983), Progress in Scientific Computing 2, 95; Venzon & Moolgavkar (1988), Applied
    Statistics 37, 87.
    """
    from pendmap import _core  # noqa: PLC0415 (the core is loaded where it works)

    units = Units(model.w0, si=True)
    unknown, given = prepared(runs, model, free, start or {}, units)
    names = unknown.names
    wanted = names if profiled is None else profiled
    chosen = [k for k, n in enumerate(names) if {n, n.partition("[")[0]} & {*wanted}]
    swing = math.tau / model.w0
    choices = {
        "tolerance": tolerance_of(runs),
        "shortest": units.w0 * (swing if shortest_s is None else shortest_s),
        "growth": growth,
        "steps": steps,
        "gain": least_gain,
        "hold": len([n for n in names if n.partition("[")[0] in free]) if hold else 0,
        "target": target,
        "profiled": [k for k in chosen if k not in unknown.mixed],
        "level": LEVEL,
        "doubt": sigma_doubt,
    }
    begun = None if windows is None else bare_windows(windows, units)
    with core_errors(FitDiverged):
        found = _core.fit_runs(given, unknown.start, choices, begun)
    return _result(found, model, unknown, chosen)


def score(
    fit: TrajectoryFit, runs: Sequence[FitRun], candidates: Sequence[str], model: Rig
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what candidate parameters would gain, without fitting them (the score test).

    Parameters
    ----------
    fit : TrajectoryFit
        The fit without them.
    runs : sequence of FitRun
        Its records.
    candidates : sequence of str
        Names of further parameters, as in ``free`` of :func:`fit_runs`.
    model : Rig
        The model of the fit with the candidates' effects in it, at the values where they are
        scored: 0 for their size. With effects of the drive it needs an ``Omega``, for which that of
        each run stands.

    Returns
    -------
    pull : ndarray of float, shape (k,)
        Half of the slope of the sum of squares by each candidate, the fitted parameters and states
        following.
    information : ndarray of float, shape (k, k)
        Half of its curvature. ``pull[i]**2 / information[i, i]`` is the gain in the sum of squares
        that candidate ``i`` alone is expected to bring, ``pull[i] / information[i, i]`` its size in
        SI; sets of candidates likewise, by the parts of both.
    """
    from pendmap import _core  # noqa: PLC0415 (the core is loaded where it works)

    units = Units(model.w0, si=True)
    base = list(dict.fromkeys(name.partition("[")[0] for name in fit.names))
    start = {name: fit.estimates[name].value for name in fit.names}
    unknown, given = prepared(runs, model, [*base, *candidates], start, units)
    with core_errors(FitDiverged):
        windows = bare_windows(fit.windows, units)
        at = _core.fit_equations(given, unknown.start, tolerance_of(runs), windows)
    pull = unknown.columns(at["pull"][None], at["values"])[0]
    information = unknown.columns(unknown.columns(at["information"], at["values"]).T, at["values"])
    new = np.array([name not in fit.estimates for name in unknown.names])
    old = ~new
    through = information[np.ix_(new, old)] @ np.linalg.pinv(
        information[np.ix_(old, old)], hermitian=True
    )
    return (
        pull[new] - through @ pull[old],
        information[np.ix_(new, new)] - through @ information[np.ix_(old, new)],
    )


def prepared(
    runs: Sequence[FitRun],
    model: Rig,
    free: Sequence[str],
    start: Mapping[str, float],
    units: Units,
) -> tuple[Conversion, list[dict[str, Any]]]:
    """Return the free parameters, and the runs as the core takes them."""
    if not runs:
        raise InputError("runs must hold one record or more, got none")
    rigs = [rig_of(run, model) for run in runs]
    given = [bare_run(run, rig, units) for run, rig in zip(runs, rigs, strict=True)]
    return Conversion(free_quantities(runs, rigs, free, start), units), given


def _result(
    found: Mapping[str, Any], model: Rig, unknown: Conversion, chosen: Sequence[int]
) -> TrajectoryFit:
    units, bare = unknown.units, found["values"]
    values = unknown.given(bare)
    covariance = unknown.covariance(found["covariance"], bare)
    errors = [math.sqrt(variance) for variance in np.diag(covariance)]
    # Of sizes that are no number of the core's there is no profile: the covariance stands for it.
    wide = math.sqrt(LEVEL * found["widening"])
    intervals = {
        k: interval(float(values[k]), wide * errors[k], mixed=True)
        for k in unknown.mixed
        if k in chosen
    }
    profiled = [k for k in chosen if k not in unknown.mixed]
    for k, ends in zip(profiled, found["intervals"], strict=True):
        both = [float(unknown.given([*bare[:k], end, *bare[k + 1 :]])[k]) for end in ends]
        # The unit of a bias may be negative; an end that was not found is no number.
        low = next((end for end in both if end < values[k]), math.nan)
        high = next((end for end in both if end > values[k]), math.nan)
        intervals[k] = low, high
    estimates, ends = {}, {}
    for k, name in enumerate(unknown.names):
        low, high = intervals.get(k, (math.nan, math.nan))
        known = math.isfinite(low) and math.isfinite(high)
        ends[name] = low, high
        estimates[name] = Estimate(float(values[k]), errors[k], (low, high) if known else None)
    try:
        found_model = _found_model(model, estimates)
    except InputError as error:
        raise FitDiverged(f"the fit ends at values that no model may have: {error}") from None
    curves, residuals, squares = [], [], 0.0
    for curve in found["runs"]:
        curves.append(np.stack([curve["theta"], units.given(curve["velocity"], 1)]))
        residuals.append(curve["residual"])
        squares += float(np.nansum(residuals[-1] ** 2))
    return TrajectoryFit(
        estimates=estimates,
        ends=ends,
        names=tuple(estimates),
        covariance=covariance,
        chi2=found["chi2"],
        samples=found["samples"],
        degrees=found["degrees"],
        rms=math.sqrt(squares / max(found["samples"], 1)),
        model=found_model,
        curves=tuple(curves),
        residuals=tuple(residuals),
        white=tuple(curve["white"] for curve in found["runs"]),
        windows=tuple(
            (r, a, b, theta, float(units.given(v, 1))) for r, a, b, theta, v in found["windows"]
        ),
        steps=found["steps"],
        converged=found["converged"],
        given_up=found["given_up"],
        widening=found["widening"],
        mixed=tuple(unknown.names[k] for k in unknown.mixed),
    )


def _found_model(model: Rig, estimates: Mapping[str, Estimate]) -> Rig:
    own = {n: e.value for n, e in estimates.items() if n in PLACES}
    own |= {n: max(own[n], 0.0) for n in ("c_over_m", "Tr") if n in own}
    if model.p == 0:
        own = {n: value for n, value in own.items() if n not in PER_RUN}
    effects = []
    for effect in model.effects:
        names = {p: f"{effect.name}.{p}" for p in effect.parameters}
        known = {p: estimates[n].value for p, n in names.items() if n in estimates}
        bounds = {p: estimates[n].ci95 for p, n in names.items() if n in estimates}
        ci95 = {p: ci for p, ci in bounds.items() if ci is not None}
        parameters = dict(effect.parameters) | known
        effects.append(dataclasses.replace(effect, parameters=parameters, ci95=ci95))
    return dataclasses.replace(model, **own, effects=tuple(effects), notes={})


# Whether a fit follows the records that it was made from.


MISSED: Final = 0.5
"""Part of the readings' own standard deviation from which a residual is no smaller than motion."""

FAR: Final = 1.0
"""The same in rad: a pendulum that is off by this is elsewhere, also one that turns."""


def refuse_astray(path: Path, runs: Sequence[FitRun], fit: TrajectoryFit) -> None:
    """Refuse a fit that plainly is not one of its records.

    Parameters
    ----------
    path : Path
        The experiment.
    runs : sequence of FitRun
        What was fitted.
    fit : TrajectoryFit
        The fit.

    Raises
    ------
    InputError
        If the residual of a run is as large as its motion.
    """
    for run, residual in zip(runs, fit.residuals, strict=True):
        counted = np.isfinite(residual)
        if run.trusted is not None:
            counted &= run.trusted
        if not counted.any():
            continue
        rms = float(np.sqrt(np.mean(residual[counted] ** 2)))
        scatter = float(np.std(run.theta[counted]))
        if rms > min(MISSED * scatter, FAR):
            raise InputError(
                f"{path}: no model follows these records: of {run.name or 'a run'} {rms:.3g} rad "
                f"rms are missed, of a motion of {scatter:.3g}: they must be free decays of one "
                "pendulum, and a run under a drive must have the drive, in an experiment.toml: "
                'kind = "forced"'
            )
