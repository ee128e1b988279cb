"""``diagnose``: from records to the effect that the model lacks."""

from __future__ import annotations

import contextlib
import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap.comparison.data import evidence_of
from pendmap.comparison.forecast import gap_of
from pendmap.comparison.further import Reasons, attempted
from pendmap.diagnosis.baseline import baseline
from pendmap.diagnosis.candidates import checked_own
from pendmap.diagnosis.functions import call_once, divided, function_scores
from pendmap.diagnosis.named import named_effects
from pendmap.diagnosis.physical import within_physics
from pendmap.diagnosis.result import MOST_EFFECTS, Discrepancy
from pendmap.diagnosis.scores import Scores
from pendmap.diagnosis.search import search
from pendmap.diagnosis.state import State
from pendmap.diagnosis.thresholds import Thresholds
from pendmap.diagnosis.verdict import judge
from pendmap.errors import FitDiverged, InputError
from pendmap.identification.experiment import provenance
from pendmap.identification.fit import refuse_astray
from pendmap.model.rig import own_name
from pendmap.records.summary import unit_wrong
from pendmap.residuals.by_run import run_by_run
from pendmap.residuals.torque import Torque, residual_torque, standing_out

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator

    from pendmap.diagnosis.functions import TorqueFunction
    from pendmap.model import Effect, Formula, Rig
    from pendmap.records import Experiment


def diagnose(  # noqa: PLR0913 (each is asked for by name)
    experiment: Experiment,
    *,
    model: Rig | None = None,
    max_effects: int = MOST_EFFECTS,
    without: Collection[str] = (),
    effects: Collection[Formula | TorqueFunction] = (),
    thresholds: Thresholds | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Discrepancy:
    """Find where a model and an experiment disagree, and which effects it lacks.

    The baseline is fitted by multiple shooting, all effects of the library are scored at its fit,
    the best refitted, up to ``max_effects`` accepted on the fall of the BIC and on runs that were
    held back. What is left then decides the verdict.

    Parameters
    ----------
    experiment : Experiment
        As of :func:`pendmap.read_experiment`.
    model : Rig, optional
        The model to begin with; by default viscous damping and Coulomb friction.
    max_effects : int
        How many effects are added at most; the sensor's zero does not count.
    without : collection of str
        Effects that are no candidates.
    effects : collection of Formula and TorqueFunction
        Candidates of your own, beside the library's: formulas as the library's own effects, Python
        functions of any kind to first order.
    thresholds : Thresholds, optional
        The numbers that decide; by default those of :class:`Thresholds`.
    progress : callable, optional
        Called with the steps done and those to do.

    Returns
    -------
    Discrepancy
        Verdict, effects, gap and all that they rest on.

    Raises
    ------
    InputError
        If there is no run with samples, no start can be found, an effect of your own cannot be a
        candidate, or no model follows the records.
    """
    functions, others = divided(effects)
    own = checked_own(others)
    report = progress or (lambda _done, _total: None)
    steps = max_effects + 3
    evidence = evidence_of(experiment)
    call_once(evidence.runs, functions)
    with _followed(experiment):
        base, core = baseline(evidence, model, without)
    # Windows are as long as the model could follow the runs.
    evidence = dataclasses.replace(evidence, fitted=base.runs)
    report(1, steps)
    state = State(evidence, base, thresholds or Thresholds(), max_effects, without, own=own)
    with _followed(experiment):
        nearest = state.found(search(state, core, lambda done: report(1 + done, steps)))
        begin = state.found(within_physics(state.evidence, state.base) or state.base)
    if not unit_wrong(experiment, *evidence.runs):
        refuse_astray(experiment.path, evidence.fitted, nearest.trial.fit)
    report(steps - 1, steps)
    with _followed(experiment):
        last, fitted = nearest.trial, state.evidence.fitted
        runs = run_by_run(fitted, last.fit, last.remainder, last.level)
        after = residual_torque(fitted, last.fit, last.remainder)
    judgement = judge(state, nearest, runs, after.chance)
    claimed = judgement.verdict in {"named", "partial", "ambiguous"}
    best = nearest if claimed else begin
    reasons: Reasons = {}
    before = after
    if nearest.trial.chosen:
        before = attempted(
            reasons,
            "where",
            lambda: residual_torque(fitted, begin.trial.fit, begin.trial.remainder),
            Torque.unknown(begin.trial.remainder),
        )
    scores = state.scores(begin.trial)
    return Discrepancy(
        evidence,
        begin,
        best,
        nearest,
        judgement,
        named_effects(state, best, judgement, runs, reasons) if claimed else (),
        gap_of(evidence, begin.fits, best.fits),
        before,
        after if claimed else before,
        standing_out(before),
        runs,
        scores,
        tuple(state.attempts),
        attempted(reasons, "detection_limits", lambda: state.scores(best.trial), Scores.of_none()),
        nearest.trial.level,
        tuple(without),
        max_effects,
        own,
        attempted(
            reasons,
            "functions",
            lambda: function_scores(evidence, begin.trial, best.trial, functions),
            (),
        ),
        reasons,
    )


@contextlib.contextmanager
def _followed(experiment: Experiment) -> Iterator[None]:
    """Say of which records a motion is lost that the verdict rests on."""
    try:
        yield
    except FitDiverged as error:
        raise InputError(
            f"{experiment.path}: no model follows these records: {error}. A run under a drive "
            'must have the drive, in an experiment.toml: kind = "forced"'
        ) from None


def diagnosed_model(found: Discrepancy, command: str = "") -> Rig:
    """Return the model of a diagnosis with the notes of its file.

    Effects have ``ci95``, ``probability`` and ``approximate``; ``[covariance]`` holds all that was
    fitted, widened as those intervals are, and ``between_runs`` in it the standard deviation of
    each parameter that differs between runs by more than its error; ``[provenance]`` the records
    with their SHA-256, the version, the command, the verdict and which coefficients are held at 0.

    Parameters
    ----------
    found : Discrepancy
        As of :func:`pendmap.diagnosis.diagnose`.
    command : str
        How it was called.
    """
    fit = found.best.trial.fit
    model = fit.model
    covariance = found.best.trial.widening * fit.covariance
    named = {effect.name: effect.effect for effect in found.effects}
    own = {own_name(name) for name in named} - {None}
    kept = tuple(e for e in model.effects if e.name not in named)
    runs = [found.evidence.runs[k] for k in dict.fromkeys(found.evidence.fitted_of)]
    sha256 = found.evidence.experiment.sha256
    files = {run.file: run.sha256 or sha256.get(run.file, "") for run in runs}
    notes: dict[str, Any] = {
        "covariance": {
            "names": [_called(name, named) for name in fit.names],
            "matrix": np.where(np.isfinite(covariance), covariance, 0.0).tolist(),
            "between_runs": {
                _called(name, named): between
                for name in fit.names
                if "[" not in name and (between := found.runs.between(name)) > 0
            },
        },
        "provenance": provenance(files, command, rms=found.gap.after, noise=found.gap.noise_floor)
        | {"method": "diagnose", "verdict": found.verdict, "held_out": list(_held(found))},
    }
    if found.best.trial.zeroed:
        notes["provenance"]["set_to_zero"] = list(found.best.trial.zeroed)
    return dataclasses.replace(
        model,
        **{name: 0.0 for name in own if name is not None},
        effects=(*kept, *named.values()),
        Omega=0.0
        if model.p == 0 and not any(e.drives for e in (*kept, *named.values()))
        else (model.Omega or 1.0),
        notes=notes,
    )


def _called(name: str, named: dict[str, Effect]) -> str:
    for effect in named.values():
        if own_name(effect.name) == name:
            return f"{effect.name}.{next(iter(effect.parameters))}"
    return name


def _held(found: Discrepancy) -> list[str]:
    return list(dict.fromkeys(run.name for run in found.evidence.held))
