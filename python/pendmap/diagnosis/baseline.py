"""The baseline model, viscous damping and Coulomb friction or a given one, and its first fit."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

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
    from collections.abc import Collection, Sequence

    from pendmap.comparison.data import DataSplit

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
    return base, other if share >= Thresholds().closes else core


def _enlarged(
    data: DataSplit,
    base: FittedModel,
    added: Sequence[Candidate],
    *starts: tuple[dict[str, float], bool],
) -> FittedModel | None:
    """Return the best converged fit of a model with effects from starts, or from short windows."""
    fits = (
        fit_with_candidates(data, base, added, start, level=base.level, short=short)
        for start, short in starts
    )
    best = best_of(*fits)
    return best and (converge(data, best, best.level) or best)


def fit_followed(
    data: DataSplit, model: Rig | None = None, without: Collection[str] = ()
) -> tuple[DataSplit, FittedModel, FittedModel | None]:
    """Return records that a model follows, and the fits of :func:`fit_baseline` to them.

    A run that is lost is fitted in windows, and set aside if it is lost there too.
    """
    base, core = fit_baseline(data, model, without)
    for change in (in_windows, set_aside):
        lost = lost_runs(data, best_of(base, core) or base)
        if lost and (changed := change(data, lost)) is not None:
            data = changed
            base, core = fit_baseline(data, model, without)
    return data, base, core


def in_windows(data: DataSplit, lost: Sequence[int]) -> DataSplit:
    """Return records with shorter windows in the lost free runs."""
    fitted = list(data.fitted)
    for k in (k for k in lost if not fitted[k].forced):
        longest = float(np.ptp(fitted[k].time)) / WINDOWS
        fitted[k] = dataclasses.replace(fitted[k], longest_s=longest)
    return dataclasses.replace(data, fitted=tuple(fitted))


def set_aside(data: DataSplit, lost: Sequence[int]) -> DataSplit | None:
    """Return records without the lost runs, with a finding about each; None if none remains."""
    out = {data.fitted_of[k] for k in lost}
    places = [k for k, of in enumerate(data.fitted_of) if of not in out]
    held = [k for k, of in enumerate(data.held_of) if of not in out]
    if not places or not held:
        return None
    runs = list(data.runs)
    for k in out:
        finding = finding_of("run-lost", where=runs[k].name, percent=100 * LOST)
        runs[k] = dataclasses.replace(runs[k], findings=(*runs[k].findings, finding))
    return dataclasses.replace(
        data,
        runs=tuple(runs),
        fitted=tuple(data.fitted[k] for k in places),
        fitted_of=tuple(data.fitted_of[k] for k in places),
        held=tuple(data.held[k] for k in held),
        held_of=tuple(data.held_of[k] for k in held),
    )


def lost_runs(data: DataSplit, fitted: FittedModel) -> list[int]:
    """Return the places of the runs that a model does not follow."""
    lost = []
    for k, (run, residual) in enumerate(zip(data.fitted, fitted.fit.residuals, strict=True)):
        good = np.isfinite(residual) & run.counted
        swing = min(float(np.ptp(run.theta[run.counted])) / 2, math.pi)
        if not good.any() or float(np.mean(residual[good] ** 2)) > (LOST * swing) ** 2:
            lost.append(k)
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
