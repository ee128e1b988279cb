"""The baseline model, viscous damping and Coulomb friction or a given one, and its first fit."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.comparison.data import counted
from pendmap.diagnosis.candidates import CORE, Candidate
from pendmap.diagnosis.fitted_model import (
    GENTLE,
    FittedModel,
    converge,
    fit_again,
    fit_model,
    fit_with_candidates,
    impose_physics,
    none_if_diverged,
)
from pendmap.diagnosis.refit import best_of, drop_effect
from pendmap.errors import FitDiverged, InputError
from pendmap.identification.fit import fit_runs
from pendmap.identification.methods.start import starting_values
from pendmap.identification.turning import rough_start
from pendmap.model import Rig
from pendmap.model.rig import own_name

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from pendmap.comparison.data import DataSplit
    from pendmap.identification.runs import FitRun

SOUND: Final = 1.5
"""Sum of squares per degree of freedom up to which a model follows a run."""

PARTS: Final = (1, 3, 10)
"""Numbers of windows into which a run is divided, in turn, until a model follows it."""

POOR: Final = 0.1
"""Residual, over the standard deviation of the angle, above which a fit went astray."""


def fit_baseline(
    data: DataSplit, model: Rig | None = None, without: Collection[str] = ()
) -> tuple[FittedModel, FittedModel | None]:
    """Fit the given model, and the physical core (None if the given model has it).

    The given model is ``th'' + c_over_m th' + w0**2 (1 + a(t)) sin th = -Tr sign(th')`` by default.
    Of another one the natural frequency, viscous damping and sizes of effects are fitted, Coulomb
    friction and a constant torque only if it has them. The core adds ``q th' abs(th')`` and the
    sensor's zero, but no effects of ``without``. Each is fitted from the other's motion too.
    Damping may be negative, since a bound stalls the fit.
    """
    if model is not None:
        own = _unfolded(model)
        free = ["w0", "c_over_m", *(n for n in ("Tr", "torque") if getattr(own, n) != 0)]
        sizes = [f"{effect.name}.{size}" for effect in own.effects for size in effect.sizes]
        base = fit_model(data, own, [*free, *sizes])
    else:
        free = ["w0", "c_over_m", "Tr"]
        first = _start(data)
        base = _through_all(data, first, free) or fit_model(data, first, free)
    added = [c for c in map(Candidate, CORE) if c.name not in {*base.taken, *without}]
    if not added:
        return base, None
    start = {candidate.free[0]: 0.0 for candidate in added}

    def fit_core(*, short: bool = False) -> FittedModel | None:
        return fit_with_candidates(data, base, added, start, level=base.level, short=short)

    core = best_of(fit_core(), fit_core(short=True))
    if model is None and (core is None or not follows(data, core)):
        base = _rescued(data, first, base)
        core = best_of(core, fit_core())
    if core is None:
        return base, None
    core = converge(data, core, core.level) or core
    reduced: FittedModel | None = core
    for candidate in added:
        reduced = reduced and drop_effect(data, reduced, candidate, core.level)
    return best_of(base, reduced) or base, impose_physics(data, core)


def follows(data: DataSplit, fitted: FittedModel) -> bool:
    """Whether a model follows the motion, whatever its residuals lack."""
    scatter = np.mean([float(np.std(run.theta)) for run in data.fitted])
    return fitted.fit.rms <= POOR * float(scatter)


def _rescued(data: DataSplit, first: Rig, found: FittedModel) -> FittedModel:
    """Return the given model fitted with slowly growing windows, in parts, or from other starts."""
    free = list(found.free)
    if not found.fit.converged:
        gently = fit_model(data, first, free, growth=GENTLE)
        divided = None if gently.fit.converged else _in_parts(data, first, free)
        found = best_of(found, gently, divided) or found
    if found.fit.converged and follows(data, found):
        return found
    for begin in _other_starts(data):
        found = best_of(found, fit_model(data, begin, free)) or found
        if follows(data, found):
            break
    return found


@none_if_diverged
def _in_parts(data: DataSplit, start: Rig, free: list[str]) -> FittedModel | None:
    """Return the fit with those runs divided that a model does not follow as a whole.

    A run released near the top easily diverges, and takes the fit of the other runs with it. None
    where there is no such run.
    """
    runs = [run if run.forced else _divide(run, start, free) for run in data.fitted]
    if all(new is old for new, old in zip(runs, data.fitted, strict=True)):
        return None
    return fit_model(dataclasses.replace(data, fitted=tuple(runs)), start, free)


def _divide(run: FitRun, start: Rig, free: Sequence[str]) -> FitRun:
    """Return a run with windows as long as its own model can follow it."""
    for part in PARTS:
        longest = float(np.ptp(run.time)) / part
        divided = run if part == 1 else dataclasses.replace(run, longest_s=longest)
        try:
            fit = fit_runs([divided], start, free, profiled=())
        except FitDiverged:
            continue  # its motion is lost
        if fit.converged and fit.chi2 < SOUND * max(fit.degrees, 1):
            return divided
    return run


@none_if_diverged
def _through_all(data: DataSplit, start: Rig, free: list[str]) -> FittedModel | None:
    """Return the fit started from a fit to all samples, where stretches are held back, else None.

    A fit through gaps goes astray more easily. The returned fit does not use what is held back.
    """
    if not data.inside:
        return None
    whole = list(data.fitted)
    for run, k in zip(data.held, data.held_of, strict=True):
        place = data.fitted_of.index(k)
        own = whole[place]
        if own.trusted is not None and run.trusted is not None:
            whole[place] = dataclasses.replace(own, trusted=own.trusted | run.trusted)
    return fit_again(data, fit_model(dataclasses.replace(data, fitted=tuple(whole)), start, free))


def _unfolded(model: Rig) -> Rig:
    """Return a model with effects that equal one of its own parameters replaced by these."""
    own, effects = {}, []
    for effect in model.effects:
        name = own_name(effect.name)
        if name is None:
            effects.append(dataclasses.replace(effect, ci95={}, probability=None, approximate=None))
        else:
            own[name] = effect.values[0]
    return dataclasses.replace(model, **own, effects=tuple(effects), p=0.0, notes={})


def _start(data: DataSplit) -> Rig:
    """Return a start from the longest free run that shows one; raises InputError without any."""
    known = data.experiment.w0
    free = [(run, k) for run, k in zip(data.fitted, data.fitted_of, strict=True)]
    free = [(run, k) for run, k in free if not run.forced]
    for run, k in sorted(free, key=lambda pair: -float(np.ptp(pair[0].time))):
        good = counted(run)
        rough = rough_start(run.time[good], run.theta[good], data.readings[k].sigma)
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


def _other_starts(data: DataSplit) -> list[Rig]:
    """Return further starts, one from each free run that swings."""
    found = []
    for run, k in zip(data.fitted, data.fitted_of, strict=True):
        if run.forced:
            continue
        good = counted(run)
        try:
            begin = starting_values(run.time[good], run.theta[good], sigma=data.readings[k].sigma)
        except InputError:
            continue
        gravity = data.experiment.gravity
        found.append(Rig(w0=begin.w0, c_over_m=begin.c_over_m, Tr=begin.Tr, gravity=gravity))
    return found
