"""``diagnose``: from records to the effect that the model lacks."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
from typing import TYPE_CHECKING, Any, Final

from pendmap.comparison.cycles import Cycles, cycles_of
from pendmap.comparison.data import Evidence, evidence_of
from pendmap.comparison.forecast import Forecast, Gap, forecasts_of, gap_of
from pendmap.comparison.further import Reasons, attempted
from pendmap.diagnosis.baseline import baseline
from pendmap.diagnosis.candidates import checked_own
from pendmap.diagnosis.functions import FunctionScore, call_once, divided, function_scores
from pendmap.diagnosis.named import NamedEffect, named_effects
from pendmap.diagnosis.next_experiment.limits import Advice, advice_of
from pendmap.diagnosis.physical import within_physics
from pendmap.diagnosis.scores import Scores
from pendmap.diagnosis.search import search
from pendmap.diagnosis.state import State
from pendmap.diagnosis.thresholds import Thresholds
from pendmap.diagnosis.verdict import Judgement, judge
from pendmap.errors import FitDiverged, InputError
from pendmap.formatting import Readable
from pendmap.identification.fit import refuse_astray
from pendmap.model.effects import definition
from pendmap.records.summary import unit_wrong
from pendmap.residuals.by_run import RunByRun, run_by_run
from pendmap.residuals.torque import Torque, residual_torque, standing_out

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator

    from pendmap.diagnosis.functions import TorqueFunction
    from pendmap.diagnosis.search import Attempt
    from pendmap.diagnosis.state import Found
    from pendmap.model import Formula, Rig
    from pendmap.records import Experiment

MOST_EFFECTS: Final = 3
"""So many effects are added at most."""


@dataclasses.dataclass(frozen=True, repr=False)
class Discrepancy(Readable):
    """Where model and records disagree, and why.

    Parameters
    ----------
    evidence : Evidence
        The records: fitted and held back.
    base, best : Found
        The model to begin with and the best one; of verdicts ``none`` and ``unknown`` the best one
        claims no effect.
    nearest : Found
        The best that candidates can do, claimed or not.
    judgement : Judgement
        Verdict and what it rests on.
    effects : tuple of NamedEffect
        The effects that are named.
    gap : Gap
        Before and after.
    torque_before, torque_after : Torque
        What the models lack.
    where : list of dict
        Bins in which the torque that the baseline lacks stands out.
    runs : RunByRun
        Parameters run by run.
    scores : Scores
        Of all candidates at the baseline.
    attempts : tuple of Attempt
        Candidates that were refitted.
    beside : Scores
        Of all others at the best model.
    level : float
        Of the noise: by what sums of squares are divided.
    without : tuple of str
        Effects that were no candidates.
    most : int
        How many effects could be added.
    own : tuple of Formula
        Candidates of the user's own beside the library's.
    functions : tuple of FunctionScore
        What Python functions of the user explain, to first order.
    reasons : dict of str to str
        Why a part beside the verdict could not be computed, by its field in the JSON object; see
        :attr:`not_computed`.
    """

    evidence: Evidence
    base: Found
    best: Found
    nearest: Found
    judgement: Judgement
    effects: tuple[NamedEffect, ...]
    gap: Gap
    torque_before: Torque
    torque_after: Torque
    where: list[dict[str, Any]]
    runs: RunByRun
    scores: Scores
    attempts: tuple[Attempt, ...]
    beside: Scores
    level: float
    without: tuple[str, ...] = ()
    most: int = MOST_EFFECTS
    own: tuple[Formula, ...] = ()
    functions: tuple[FunctionScore, ...] = ()
    reasons: Reasons = dataclasses.field(default_factory=dict)

    def definition(self, name: str) -> dict[str, Any]:
        """What the library, or the user's formula, says about a candidate."""
        return next((f.entry for f in self.own if f.name == name), None) or definition(name)

    def __repr__(self) -> str:
        names = ", ".join(effect.name for effect in self.effects)
        gap = f"rms {self.gap.before:.3g} to {self.gap.after:.3g} rad"
        said = f"{self.verdict}: {names}" if names else self.verdict
        path = self.evidence.experiment.path.name
        return f"<Discrepancy {path}: {said}; {gap}, noise {self.gap.noise_floor:.3g}>"

    def said(self) -> tuple[list[tuple[list[str], list[list[str]]]], list[str]]:
        """Return the table and the lines that ``pendmap diagnose`` prints."""
        from pendmap.diagnosis import summary  # noqa: PLC0415 (it is of diagnoses)

        return [summary.ranking_table(self)], list(summary.as_text(self))

    @property
    def verdict(self) -> str:
        """``none``, ``named``, ``partial``, ``ambiguous`` or ``unknown``."""
        return self.judgement.verdict

    @property
    def equivalent(self) -> list[list[str]]:
        """Classes of effects that these records do not tell apart, of those that are named."""
        if not self.effects:
            return []
        classes = (standing.equivalent for standing in self.judgement.standings)
        return [names for names in classes if len(names) > 1]

    @property
    def adds(self) -> bool:
        """Whether the best model is another than the baseline."""
        return self.best is not self.base

    @functools.cached_property
    def not_computed(self) -> Reasons:
        """Why a part beside the verdict could not be computed, by its field in the JSON object."""
        for part in (self.forecasts, self.advice, self.cycles):
            del part
        return self.reasons

    @functools.cached_property
    def forecasts(self) -> tuple[Forecast, ...]:
        """How the error of both models grows with the horizon, on what was held back."""
        return forecasts_of(self.evidence, self.base.fits, self.best.fits, self.reasons)

    @functools.cached_property
    def advice(self) -> Advice:
        """What to record next, and what these records would have shown."""
        return advice_of(
            self.evidence,
            self.best,
            self.nearest,
            self.judgement,
            self.beside,
            self.level,
            self.reasons,
        )

    @functools.cached_property
    def cycles(self) -> tuple[Cycles, ...]:
        """Periods and peaks of each free run against those of both models."""
        return cycles_of(self.evidence, self.base.fits, self.best.fits, self.reasons)


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
