"""The baseline model, viscous damping and Coulomb friction or a given one, and its first fit."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.comparison.data import split_records
from pendmap.comparison.forecast import noise_rms, share_closed
from pendmap.diagnosis.candidates import CORE, ZERO, Candidate
from pendmap.diagnosis.fitted_model import (
    FittedModel,
    converge,
    fit_again,
    fit_model,
    fit_with_candidates,
    impose_physics,
    none_if_diverged,
)
from pendmap.diagnosis.hold_out import evaluate_hold_out
from pendmap.diagnosis.refit import best_of, drop_effect
from pendmap.diagnosis.thresholds import Thresholds
from pendmap.errors import InputError
from pendmap.identification.parameters import OPPOSING
from pendmap.identification.turning import rough_start
from pendmap.model import Rig
from pendmap.model.effects import library
from pendmap.model.rig import own_name
from pendmap.tables.findings import finding_of

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from pendmap.comparison.data import DataSplit
    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun

LOST: Final = 0.1  # Residual of a run, over its swing, above which a fit does not follow it
POOR: Final = 20.0  # Residual over the noise above which each effect of damping is fitted
WINDOWS: Final = 4  # Windows in which a run is fitted that is lost as one motion
BEGIN: Final = 0.01  # Nondimensional size at which a fit of an effect of damping begins


def fit_baseline(
    data: DataSplit, model: Rig | None = None, without: Collection[str] = ()
) -> tuple[FittedModel, FittedModel | None]:
    """Fit the given model, and the physical core (None if the given model has it).

    The given model is ``th'' + c_over_m th' + w0**2 (1 + a(t)) sin th = -Tr sign(th')`` by default.
    For another model the natural frequency, viscous damping and sizes of effects are fitted,
    Coulomb friction and a constant torque only if it has them. The core adds ``q th' abs(th')`` and
    the sensor's zero, except effects in ``without``. Each is also fitted from the other's motion.
    Damping may be negative, since a bound stalls the fit.
    """
    if model is not None:
        rig = _unfolded(model)
        free = ["w0", "c_over_m", *(n for n in ("Tr", "torque") if getattr(rig, n) != 0)]
        acting = [effect for effect in rig.effects if data.forced or not effect.drives]
        sizes = [f"{effect.name}.{size}" for effect in acting for size in effect.sizes]
        base = fit_model(data, rig, [*free, *sizes])
    else:
        free = ["w0", "c_over_m", "Tr"]
        rig = _start(data)
        base = _through_all(data, rig, free) or fit_model(data, rig, free)
    rates = all(run.rod_sensor is not None for run in data.fitted)
    known = {*base.taken, *without, *([ZERO] if rates else [])}  # a rate has no zero of the angle
    added = [candidate for candidate in map(Candidate, CORE) if candidate.name not in known]
    zeros = {candidate.free[0]: 0.0 for candidate in added}
    core = _enlarged(data, base, added, (zeros, False), (zeros, True)) if added else None
    if core is None:
        return base, None
    reduced: FittedModel | None = core
    for candidate in added:
        reduced = reduced and drop_effect(data, reduced, candidate, core.level)
    base = best_of(base, reduced) or base
    core = impose_physics(data, core)
    before, noise = best_of(base, core) or base, noise_rms(data.fitted)
    if before.fit.rms < POOR * noise:
        return base, core
    # Far above the noise scores are no guide: all effects of damping are fitted.
    rough = {name: getattr(rig, name) for name in ("w0", *OPPOSING) if name in base.free}
    fits = []
    for name, law in library().items():
        always = law.family == "damping" and law.opposing is not None and law.mappable == "yes"
        if not always or own_name(name) or name in {*known, *CORE}:
            continue
        effect = Candidate(name, {e.name: e.middle for e in law.parameters if e.is_shape})
        size = {effect.free[0]: effect.effect(rig.units, BEGIN).parameters[effect.size]}
        fit = _enlarged(data, base, [effect], (size, True), (size | rough, True))
        fits.append(fit and impose_physics(data, fit))
    other = best_of(*fits)
    share = 0.0 if other is None else share_closed(before.fit.rms, other.fit.rms, noise)
    best = other if share >= Thresholds().closes else core
    # Without an effect it is the baseline, in a better place.
    return (best_of(base, best) or base, None) if best and not best.chosen else (base, best)


def _enlarged(
    data: DataSplit,
    base: FittedModel,
    added: Sequence[Candidate],
    *starts: tuple[dict[str, float], bool],
) -> FittedModel | None:
    """Return the best converged fit from starts, long or short; none after noise explains one."""
    best: FittedModel | None = None
    for start, short in starts:
        if best is None or best.noise.chance < Thresholds().rest:
            fit = fit_with_candidates(data, base, added, start, level=base.level, short=short)
            best = best_of(best, fit)
    return best and (converge(data, best, best.level) or best)


def fit_followed(
    data: DataSplit, model: Rig | None = None, without: Collection[str] = ()
) -> tuple[DataSplit, FittedModel, FittedModel | None]:
    """Return records that a model follows, and the fits of :func:`fit_baseline` to them.

    Lost runs are fitted in windows. While some are lost there too, the worst is set aside: a run
    that is lost spoils the fit to others.
    """
    base, core = fit_baseline(data, model, without)
    change: Callable[[DataSplit, Sequence[int]], DataSplit | None] = in_windows
    while lost := lost_of(data, best_of(base, core) or base):
        every = {*data.fitted_of, *data.held_of}
        changed = change(data, lost) if len(lost) < len(every) or change is in_windows else None
        if changed is None:
            break
        data, change = changed, set_aside
        base, core = fit_baseline(data, model, without)
    return data, base, core


def in_windows(data: DataSplit, lost: Collection[int]) -> DataSplit:
    """Return records with shorter windows in the lost free runs."""

    def shorter(run: FitRun, of: int) -> FitRun:
        if run.forced or of not in lost:
            return run
        return dataclasses.replace(run, longest_s=float(np.ptp(run.time)) / WINDOWS)

    fitted = tuple(map(shorter, data.fitted, data.fitted_of))
    held = data.held if data.inside else tuple(map(shorter, data.held, data.held_of))
    return dataclasses.replace(data, fitted=fitted, held=held)


def set_aside(data: DataSplit, lost: Sequence[int]) -> DataSplit | None:
    """Return the other runs, divided anew, with a finding on the worst; None if none can be fitted.

    The first of the lost runs is the worst.
    """
    worst, of = data.runs[lost[0]], {*data.fitted_of, *data.held_of}
    finding = finding_of("run-lost", where=worst.name, percent=100 * LOST)
    rest = tuple(run for k, run in enumerate(data.runs) if k in of and k != lost[0])
    try:
        again = split_records(dataclasses.replace(data.experiment, runs=rest))
    except InputError:
        return None
    pairs = zip((*data.fitted, *data.held), (*data.fitted_of, *data.held_of), strict=True)
    short = {data.runs[k].name for run, k in pairs if run.longest_s is not None}
    again = in_windows(again, {k for k, run in enumerate(again.runs) if run.name in short})
    worst = dataclasses.replace(worst, findings=(*worst.findings, finding))
    out = [k for k in range(len(data.runs)) if k not in of]
    runs = (*again.runs, *(data.runs[k] for k in out), worst)
    readings = (*again.readings, *(data.readings[k] for k in (*out, lost[0])))
    return dataclasses.replace(again, experiment=data.experiment, runs=runs, readings=readings)


def lost_of(data: DataSplit, fitted: FittedModel) -> list[int]:
    """Return the indices in ``data.runs`` of the runs that a model does not follow, worst first."""
    misses = {data.fitted_of[k]: miss for k, miss in lost_runs(data.fitted, fitted.fit).items()}
    held = None if data.inside else none_if_diverged(evaluate_hold_out)(data, fitted)
    if held is not None:
        misses |= {data.held_of[k]: miss for k, miss in lost_runs(data.held, held.fit).items()}
    return sorted(misses, key=lambda k: -misses[k])


def lost_runs(runs: Sequence[FitRun], fit: TrajectoryFit) -> dict[int, float]:
    """Return the places of runs that a fit does not follow, with residuals over their swings."""
    lost = {}
    for k, (run, residual) in enumerate(zip(runs, fit.residuals, strict=True)):
        good = np.isfinite(residual) & run.counted
        swing = min(float(np.ptp(run.theta[run.counted])) / 2, math.pi)
        miss = math.sqrt(float(np.mean(residual[good] ** 2))) / swing if good.any() else math.inf
        if miss > LOST:
            lost[k] = miss
    return lost


@none_if_diverged
def _through_all(data: DataSplit, start: Rig, free: list[str]) -> FittedModel | None:
    """Return a fit started from a fit to all samples if stretches are held back, else None.

    A fit with gaps fails more easily. The returned fit does not use the stretches held back.
    """
    if not data.inside:
        return None
    whole = dataclasses.replace(data, fitted=data.whole)
    return fit_again(data, fit_model(whole, start, free))


def _unfolded(model: Rig) -> Rig:
    """Return a model with effects that equal a parameter of the rig replaced by it."""
    parameters, effects = {}, []
    for effect in model.effects:
        name = own_name(effect.name)
        if name is None:
            effects.append(dataclasses.replace(effect, ci95={}, probability=None, approximate=None))
        else:
            parameters[name] = effect.values[0]
    return dataclasses.replace(model, **parameters, effects=tuple(effects), p=0.0, notes={})


def _start(data: DataSplit) -> Rig:
    """Return initial values from the longest free run that yields them, else raise InputError."""
    known = data.experiment.w0
    free = [(run, k) for run, k in zip(data.fitted, data.fitted_of, strict=True)]
    free = [(run, k) for run, k in free if not run.forced]
    for run, k in sorted(free, key=lambda pair: -float(np.ptp(pair[0].time))):
        good = run.counted
        rough = rough_start(run.time[good], run.angle[good], data.readings[k].sigma)
        if rough is not None:
            return Rig(
                w0=known or rough["w0"],
                c_over_m=rough["c_over_m"],
                Tr=rough.get("Tr", 0.0),
                gravity=data.experiment.gravity,
            )
    if known is None:
        raise InputError(
            f"{data.experiment.path}: one free run must show a natural frequency, in two "
            "half swings or more, or w0 must be given under [rig]; none shows it"
        )
    return Rig(w0=known, c_over_m=0.01 * known, gravity=data.experiment.gravity)
