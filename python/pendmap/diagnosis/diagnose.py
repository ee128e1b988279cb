"""Diagnosis of records: the effects that a model lacks."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

from pendmap.analysis.run import in_rounds
from pendmap.comparison.data import split_records
from pendmap.comparison.forecast import Reasons, compute_gap, compute_part
from pendmap.diagnosis.baseline import fit_followed
from pendmap.diagnosis.candidates import checked_own
from pendmap.diagnosis.fitted_model import settles
from pendmap.diagnosis.named import name_effects
from pendmap.diagnosis.result import Discrepancy
from pendmap.diagnosis.scores import Scores
from pendmap.diagnosis.search import search
from pendmap.diagnosis.state import State
from pendmap.diagnosis.thresholds import Thresholds
from pendmap.diagnosis.verdict import decide_verdict
from pendmap.errors import FitDiverged, InputError, check_whole
from pendmap.identification.experiment import provenance
from pendmap.identification.fit import refuse_astray
from pendmap.records import experiment_of
from pendmap.records.across import with_lab_times, without_hands
from pendmap.records.summary import UNIT_FINDINGS, doubt_keys
from pendmap.residuals.by_run import parameters_by_run
from pendmap.residuals.torque import Torque, outstanding_bins, residual_torque

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence
    from typing import Unpack

    from numpy.typing import ArrayLike

    from pendmap.model import Formula, Rig
    from pendmap.records import ByHand
    from pendmap.records.read import Records

_FITS = 10  # Fits that are half of the work; a diagnosis makes 15 or more


def diagnose(  # noqa: PLR0913 (each is asked for by name)
    records: Records | Sequence[Records] | ArrayLike,
    theta: ArrayLike | None = None,
    *,
    model: Rig | None = None,
    max_effects: int = 3,
    without: Collection[str] = (),
    effects: Sequence[Formula] = (),
    thresholds: Thresholds | None = None,
    progress: Callable[[int, int], None] | None = None,
    **by_hand: Unpack[ByHand],
) -> Discrepancy:
    """Find where a model and an experiment disagree, and which effects the model lacks.

    The baseline is fitted by multiple shooting. All effects of the library are scored at its fit,
    and the best are fitted. Up to ``max_effects`` are accepted on the fall of the BIC and on runs
    that were held back. The residuals of the best model then decide the verdict.

    Parameters
    ----------
    records : path, DataFrame, Experiment, Run, or a sequence of these; array, shape (N,)
        As for :func:`pendmap.identify`; forced runs too.
    theta : array, shape (N,), optional
        Angles of one free decay, whose times are ``records``.
    model : Rig, optional
        The baseline, in SI; by default viscous damping and Coulomb friction.
    max_effects : int
        Most effects that are added, 0 to 6; the sensor's zero is not included.
    without : collection of str
        Effects excluded from the candidates.
    effects : sequence of Formula
        Further candidates, treated like the library's effects.
    thresholds : Thresholds, optional
        Thresholds of all decisions.
    progress : callable, optional
        Called with the number of steps done and the number of all steps.
    **by_hand
        How records are read: :class:`pendmap.records.ByHand`.

    Returns
    -------
    Discrepancy
        Verdict, effects, gap and the statistics they are based on.

    Raises
    ------
    InputError
        If no run has samples, no start is found, an effect cannot be a candidate, no model follows
        the records, or the fit of the best model does not converge.
    OSError
        If a file cannot be read.

    Examples
    --------
    >>> import numpy as np
    >>> import pendmap
    >>> drag = pendmap.Effect("quadratic_drag", {"q": 0.03})
    >>> rig = pendmap.Rig(w0=6.2, c_over_m=0.05, Tr=0.08, effects=(drag,))
    >>> decay = pendmap.simulate(rig, theta=2.5, velocity=0.0, t_eval=np.arange(0, 15, 0.03))
    >>> angle = decay.theta.values + np.random.default_rng(0).normal(0, 1e-3, decay.time.size)
    >>> found = pendmap.diagnose(decay.time, angle, max_effects=1)
    >>> found.verdict, [effect.name for effect in found.effects]
    ('named', ['quadratic_drag'])
    """
    experiment = with_lab_times(experiment_of(records, theta, **by_hand))
    formulas = checked_own(effects)
    check_whole("max_effects", max_effects, 0, 6)
    moved = in_rounds(progress, _FITS) or (lambda _done, _total: None)
    try:
        data, base, core = fit_followed(split_records(experiment), model, without)
        moved(1, 1)
        most = 0 if "rigs-differ" in doubt_keys(experiment) else max_effects
        state = State(data, base, thresholds or Thresholds(), most, without, formulas=formulas)
        state.moved = lambda: moved(1, 1)
        last = search(state, core)
        instants = [last.fit[name] for c in last.chosen if c.once for name in c.adapted]
        shorter = without_hands(experiment, instants, math.tau / last.fit["w0"])
        if shorter is not None:
            same: dict[str, Any] = {"effects": effects, "thresholds": thresholds}
            same |= {"progress": progress, "max_effects": most, "without": without}
            return diagnose(shorter, model=model, **same)
        last = state.with_core(last, core)
        begin = state.scored(state.begun)
        if not doubt_keys(experiment, *data.runs) & UNIT_FINDINGS:
            refuse_astray(experiment.path, data.fitted, last.fit)
        fitted = state.data.fitted
        while True:
            last = last if last.chosen else state.begun
            nearest = state.scored(last)
            runs = parameters_by_run(fitted, last.fit, last.noise, last.level)
            after = residual_torque(fitted, last.fit, last.noise)
            assessment = decide_verdict(state, nearest, runs, after.chance)
            claimed = assessment.verdict in {"named", "partial", "ambiguous"}
            reasons: Reasons = {}
            named = name_effects(state, nearest, assessment, runs, reasons) if claimed else ()
            doubtful = {effect.name for effect in named if effect.reaches_0}
            if not doubtful:
                break
            # An effect whose interval contains 0 is no name: the last one found is left out.
            weakest = next(c for c in reversed(last.chosen) if c.name in doubtful)
            last = state.leave_out(last, weakest)
    except FitDiverged as error:
        raise InputError(
            f"{experiment.path}: no model can be fitted to these records: {error}. A forced run "
            'must have kind = "forced" and its drive in an experiment.toml'
        ) from None
    best = nearest if claimed else begin
    if not settles(state.data, best.fitted):
        raise InputError(
            f"{experiment.path}: the fit of the best model must converge, got one whose sum of "
            f"squares still falls from {best.fitted.chi2:.6g}"
        )
    before = after
    if nearest.fitted.chosen:
        before = compute_part(
            reasons,
            "where",
            lambda: residual_torque(fitted, begin.fitted.fit, begin.fitted.noise),
            Torque(begin.fitted.noise),
        )
    scores = state.scores(begin.fitted)
    if progress is not None:
        progress(1, 1)
    return Discrepancy(
        data,
        begin,
        best,
        nearest,
        assessment,
        named,
        compute_gap(data, begin.fits, best.fits),
        before,
        after if claimed else before,
        outstanding_bins(before),
        runs,
        scores,
        tuple(state.attempts),
        compute_part(
            reasons, "detection_limits", lambda: state.scores(best.fitted), Scores.of_none()
        ),
        nearest.fitted.level,
        tuple(without),
        max_effects,
        formulas,
        reasons,
    )


def diagnosed_model(diagnosis: Discrepancy, command: str = "") -> Rig:
    """Return the model of a diagnosis with the notes for its file.

    ``[covariance]`` is that of :attr:`Discrepancy.model`; ``[provenance]`` holds the records with
    their SHA-256, the version, the command, the verdict and coefficients fixed at 0.

    Parameters
    ----------
    diagnosis : Discrepancy
        From :func:`pendmap.diagnose`.
    command : str
        The command line.

    Returns
    -------
    Rig
        The best model, with its notes.
    """
    runs = [diagnosis.data.runs[k] for k in dict.fromkeys(diagnosis.data.fitted_of)]
    gap, experiment = diagnosis.gap, diagnosis.data.experiment
    origin = provenance(experiment, runs, command, rms=gap.after, noise=gap.noise_floor) | {
        "method": "diagnose",
        "verdict": diagnosis.verdict,
        "held_out": list(dict.fromkeys(run.name for run in diagnosis.data.held)),
    }
    if diagnosis.best.fitted.zeroed:
        origin["set_to_zero"] = list(diagnosis.best.fitted.zeroed)
    notes = {**diagnosis.model.notes, "provenance": origin}
    return dataclasses.replace(diagnosis.model, notes=notes)
