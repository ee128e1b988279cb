"""The model to begin with: viscous damping and Coulomb friction, or the one that is given."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.diagnosis.candidates import CORE, Candidate
from pendmap.diagnosis.fitted_model import GENTLE, Trial, fitted, settled, with_candidates
from pendmap.diagnosis.physical import within_physics
from pendmap.diagnosis.refit import best_of
from pendmap.diagnosis.refit import without as leave_out
from pendmap.errors import FitDiverged, InputError
from pendmap.identification.fit import fit_runs
from pendmap.identification.methods.start import starting_values
from pendmap.identification.turning import rough_start
from pendmap.model import Rig
from pendmap.model.rig import own_name

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from pendmap.comparison.data import Evidence
    from pendmap.identification.runs import FitRun

SOUND: Final = 1.5
"""Sum of squares for each degree of freedom up to which a fit is taken for what it is."""

PARTS: Final = (1, 3, 10)
"""Windows that a run is divided into, in turn, until the model follows it."""

POOR: Final = 0.1
"""Residuals above this part of a record's own scatter are no fit: the search went astray."""


def baseline(
    evidence: Evidence, model: Rig | None = None, without: Collection[str] = ()
) -> tuple[Trial, Trial | None]:
    """Fit the model to begin with, and the physical core.

    The given model is ``th'' + c_over_m th' + w0**2 (1 + a(t)) sin th = -Tr sign(th')`` by default.
    The core adds ``q th' abs(th')`` and the sensor's zero; it is none where the given model has
    them. Each is fitted from the other's motion too. Damping may come out negative: a bound stalls
    the fit, and what is missing in the model may drive it there.

    Of a given model the natural frequency, viscous damping and sizes of effects are fitted, Coulomb
    friction and a constant torque only if it has them. Effects of ``without`` are not in the core.
    """
    if model is not None:
        own = _unfolded(model)
        free = ["w0", "c_over_m", *(n for n in ("Tr", "torque") if getattr(own, n) != 0)]
        sizes = [f"{effect.name}.{size}" for effect in own.effects for size in effect.sizes]
        base = fitted(evidence, own, [*free, *sizes])
    else:
        free = ["w0", "c_over_m", "Tr"]
        first = _start(evidence)
        base = _through_all(evidence, first, free) or fitted(evidence, first, free)
    added = [c for c in map(Candidate, CORE) if c.name not in {*taken_by(base), *without}]
    if not added:
        return base, None
    core = best_of(*(_core(evidence, base, added, short=short) for short in (False, True)))
    if model is None and (core is None or _poor(evidence, core)):
        base = _rescued(evidence, first, base)
        core = best_of(core, _core(evidence, base, added, short=False))
    if core is None:
        return base, None
    core = settled(evidence, core, core.level)
    rest: Trial | None = core
    for candidate in added:
        rest = rest and leave_out(evidence, rest, candidate, core.level)
    return best_of(base, rest) or base, within_physics(evidence, core)


def follows(evidence: Evidence, trial: Trial) -> bool:
    """Whether a model follows the motion, whatever it leaves."""
    return not _poor(evidence, trial)


def _core(
    evidence: Evidence, base: Trial, added: Sequence[Candidate], *, short: bool
) -> Trial | None:
    start = {candidate.free[0]: 0.0 for candidate in added}
    try:
        return with_candidates(evidence, base, added, start, level=base.level, short=short)
    except FitDiverged:
        return None  # the motion is lost


def _rescued(evidence: Evidence, first: Rig, found: Trial) -> Trial:
    """Return the given model fitted with gentler windows, in parts, or from other starts."""
    free = list(found.free)
    if not found.fit.converged:
        gently = fitted(evidence, first, free, growth=GENTLE)
        divided = None if gently.fit.converged else _in_parts(evidence, first, free)
        found = best_of(found, gently, divided) or found
    if found.fit.converged and not _poor(evidence, found):
        return found
    for begin in _other_starts(evidence):
        found = best_of(found, fitted(evidence, begin, free)) or found
        if not _poor(evidence, found):
            break
    return found


def _in_parts(evidence: Evidence, start: Rig, free: list[str]) -> Trial | None:
    """Return the fit with runs divided that a model does not follow as a whole even by themselves.

    So released near the top, where a swing that is nearly right becomes a turn: in a fit of all
    runs one that is lost draws the others along. None where there is no such run.
    """
    runs = [run if run.forced else _followed(run, start, free) for run in evidence.fitted]
    if all(new is old for new, old in zip(runs, evidence.fitted, strict=True)):
        return None
    try:
        return fitted(dataclasses.replace(evidence, fitted=tuple(runs)), start, free)
    except FitDiverged:
        return None


def _followed(run: FitRun, start: Rig, free: Sequence[str]) -> FitRun:
    """Return a run with windows as long as a model of its own can follow it."""
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


def _through_all(evidence: Evidence, start: Rig, free: list[str]) -> Trial | None:
    """Return the fit from where one to all samples leads, where stretches are held back.

    A search through gaps goes astray more easily. The fit itself does not see what is held back.
    """
    if not evidence.inside:
        return None
    whole = list(evidence.fitted)
    for run, k in zip(evidence.held, evidence.held_of, strict=True):
        place = evidence.fitted_of.index(k)
        own = whole[place]
        if own.trusted is not None and run.trusted is not None:
            whole[place] = dataclasses.replace(own, trusted=own.trusted | run.trusted)
    try:
        begin = fitted(dataclasses.replace(evidence, fitted=tuple(whole)), start, free)
        return fitted(evidence, begin.fit.model, free, start=begin.start, windows=begin.fit.windows)
    except FitDiverged:
        return None


def taken_by(trial: Trial) -> set[str]:
    """Return effects that a trial's model has, and parameters of its own that are free."""
    return {e.name for e in trial.fit.model.effects} | {n.partition("[")[0] for n in trial.free}


def _unfolded(model: Rig) -> Rig:
    """Return a model whose effects that have a parameter of their own stand in that."""
    own, effects = {}, []
    for effect in model.effects:
        name = own_name(effect.name)
        if name is None:
            effects.append(dataclasses.replace(effect, ci95={}, probability=None, approximate=None))
        else:
            own[name] = effect.values[0]
    return dataclasses.replace(model, **own, effects=tuple(effects), p=0.0, notes={})


def _start(evidence: Evidence) -> Rig:
    """Return a start from the free runs, the longest first; the natural frequency may be known."""
    known = evidence.experiment.w0
    free = [(run, k) for run, k in zip(evidence.fitted, evidence.fitted_of, strict=True)]
    free = [(run, k) for run, k in free if not run.forced]
    for run, k in sorted(free, key=lambda pair: -float(np.ptp(pair[0].time))):
        good = np.ones(run.time.shape, bool) if run.trusted is None else run.trusted
        rough = rough_start(run.time[good], run.theta[good], evidence.readings[k].sigma)
        if rough is not None:
            return Rig(
                w0=known or rough["w0"],
                c_over_m=rough["c_over_m"],
                Tr=rough.get("Tr", 0.0),
                gravity=evidence.experiment.gravity,
            )
    if known is None:
        raise InputError(
            f"{evidence.experiment.path}: one free run must show a natural frequency, in two "
            "half swings or more, or w0 must be given under [rig]; none shows it"
        )
    return Rig(w0=known, c_over_m=0.01 * known, gravity=evidence.experiment.gravity)


def _other_starts(evidence: Evidence) -> list[Rig]:
    found = []
    for run, k in zip(evidence.fitted, evidence.fitted_of, strict=True):
        if run.forced:
            continue
        good = np.ones(run.time.shape, bool) if run.trusted is None else run.trusted
        try:
            begin = starting_values(
                run.time[good], run.theta[good], sigma=evidence.readings[k].sigma
            )
        except InputError:
            continue  # it does not swing
        gravity = evidence.experiment.gravity
        found.append(Rig(w0=begin.w0, c_over_m=begin.c_over_m, Tr=begin.Tr, gravity=gravity))
    return found


def _poor(evidence: Evidence, trial: Trial) -> bool:
    scatter = np.mean([float(np.std(run.theta)) for run in evidence.fitted])
    return trial.fit.rms > POOR * float(scatter)
