"""The baseline model, viscous damping and Coulomb friction or a given one, and its first fit."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

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
from pendmap.errors import InputError
from pendmap.identification.turning import rough_start
from pendmap.model import Rig
from pendmap.model.rig import own_name

if TYPE_CHECKING:
    from collections.abc import Collection

    from pendmap.comparison.data import DataSplit

POOR: Final = 0.1
"""Residual, over the standard deviation of the angle, above which a fit does not follow it."""


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
        first = _start(data)
        base = _through_all(data, first, free) or fit_model(data, first, free)
    rates = all(run.rod_sensor is not None for run in data.fitted)
    known = {*base.taken, *without, *([ZERO] if rates else [])}  # a rate has no zero of the angle
    added = [candidate for candidate in map(Candidate, CORE) if candidate.name not in known]
    if not added:
        return base, None
    start = {candidate.free[0]: 0.0 for candidate in added}
    core = best_of(
        *(
            fit_with_candidates(data, base, added, start, level=base.level, short=short)
            for short in (False, True)
        )
    )
    if core is None:
        return base, None
    core = converge(data, core, core.level) or core
    reduced: FittedModel | None = core
    for candidate in added:
        reduced = reduced and drop_effect(data, reduced, candidate, core.level)
    return best_of(base, reduced) or base, impose_physics(data, core)


def follows(data: DataSplit, fitted: FittedModel) -> bool:
    """Return whether a model follows the motion: whether its residual is small over the angle."""
    scatter = np.mean([float(np.std(run.theta)) for run in data.fitted])
    return fitted.fit.rms <= POOR * float(scatter)


@none_if_diverged
def _through_all(data: DataSplit, start: Rig, free: list[str]) -> FittedModel | None:
    """Return a fit started from a fit to all samples if stretches are held back, else None.

    A fit with gaps fails more easily. The returned fit does not use the stretches held back.
    """
    if not data.inside:
        return None
    whole = list(data.fitted)
    for run, k in zip(data.held, data.held_of, strict=True):
        place = data.fitted_of.index(k)
        fitted_run = whole[place]
        if fitted_run.trusted is not None and run.trusted is not None:
            whole[place] = dataclasses.replace(fitted_run, trusted=fitted_run.trusted | run.trusted)
    return fit_again(data, fit_model(dataclasses.replace(data, fitted=tuple(whole)), start, free))


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
