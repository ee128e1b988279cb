"""The result of a diagnosis, and its summary as text."""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING, Any, Final

from pendmap.comparison.cycles import Cycles, cycles_of
from pendmap.comparison.forecast import Forecast, Gap, forecasts_of
from pendmap.comparison.further import Reasons
from pendmap.diagnosis.named import NamedEffect, values_of
from pendmap.diagnosis.next_experiment.limits import Advice, advice_of
from pendmap.diagnosis.scores import Scores
from pendmap.formatting import Readable
from pendmap.model.effects import definition
from pendmap.model.labels import unit_of
from pendmap.records.summary import doubts_said, findings_said
from pendmap.residuals.torque import Torque

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pendmap.comparison.data import Evidence
    from pendmap.comparison.further import Reasons
    from pendmap.diagnosis.functions import FunctionScore
    from pendmap.diagnosis.scores import Scores
    from pendmap.diagnosis.state import Attempt, Found
    from pendmap.diagnosis.verdict import Judgement
    from pendmap.model import Formula
    from pendmap.residuals.by_run import RunByRun
    from pendmap.residuals.torque import Torque


SAID: Final = {
    "none": "none: the baseline describes the records to within their noise",
    "named": "named: the effects below explain what the baseline lacks",
    "partial": "partial: the effects below close a part of the gap, and something is left",
    "ambiguous": "ambiguous: these records do not tell the effects of a class apart",
    "unknown": "unknown: something is missing that no candidate explains",
}

PLACES: Final[dict[str, str]] = {
    "angle": "at an angle of",
    "velocity": "at a velocity of",
    "amplitude": "at an amplitude of",
    "drive_phase": "at a phase of the drive of",
    "lab_time": "at a time in the laboratory of",
}
"""Where a torque is missing, in words."""

TORQUE: Final = unit_of("torque")
"""A torque is one per moment of inertia."""

WHERE: Final = 3
"""Places of a residual torque that are told."""

RANKED: Final = 8
"""Candidates that the table of scores shows."""


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
        return [ranking_table(self)], list(as_text(self))

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


def ranking_table(found: Discrepancy) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of the table of candidates at the baseline."""
    refitted = {a.names[0]: a for a in reversed(found.attempts) if a.stage == 0}
    rows = []
    for row in _ranking(found)[:RANKED]:
        tried = refitted.get(row["name"])
        shape = ", ".join(
            f"{name} = {value:.3g} {_unit(found, row['name'], name)}".rstrip()
            for name, value in row["shape"].items()
        )
        rows.append(
            [
                row["name"],
                shape,
                f"{row['score']:.1f}",
                "" if tried is None else f"{tried.gain:.1f}",
                "" if tried is None or tried.held_gain is None else f"{tried.held_gain:.1f}",
            ]
        )
    return ["candidate", "shape", "score G", "fall of BIC", "gain held out"], rows


def as_text(found: Discrepancy) -> Iterator[str]:
    """Yield the lines of a summary, the verdict first, but for doubts about a unit."""
    runs = found.evidence.runs
    yield from doubts_said(found.evidence.experiment, *runs)
    gap, judgement = found.gap, found.judgement
    yield f"Verdict: {SAID[found.verdict]}"
    for effect in found.effects:
        units = {name: _unit(found, effect.name, name) for name in effect.parameters}
        values = ", ".join(
            f"{name} = {value:.4g} {units[name]}".rstrip()
            + (" [{:.4g}, {:.4g}]".format(*effect.ci95[name]) if name in effect.ci95 else "")
            for name, value in effect.parameters.items()
        )
        nearly = (
            ", with reserve: what is missing may only resemble it" if effect.approximate else ""
        )
        share = next(100 * s.closed for s in judgement.standings if s.candidate.name == effect.name)
        yield (
            f"  {effect.name}: {values}; closes {share:.0f} % of the squared gap that the others "
            f"leave; probability {effect.probability:.3f}, given that the effect is in the "
            f"library{nearly}"
        )
        for name, value in effect.elsewhere.items():
            said = f"{name} = {value:.4g} {units[name]}".rstrip()
            yield f"    or {said}, which does as well: the records do not tell which"
    for names in found.equivalent:
        yield f"  not told apart here: {', '.join(names)}"
    if found.without:
        yield f"  left out of the candidates: {', '.join(found.without)}"
    if found.most == 0 and found.verdict != "none":
        yield "  no candidate was fitted: at most 0 effects were allowed"
    if found.verdict == "unknown" and found.nearest.trial.names:
        yield f"  nearest, and not claimed: {', '.join(found.nearest.trial.names)}"
    yield (
        f"Residual, rms: {gap.before:.4g} rad before, {gap.after:.4g} after, noise "
        f"{gap.noise_floor:.4g}; held out {gap.held_out_before:.4g} before, "
        f"{gap.held_out_after:.4g} after, noise {gap.held_out_noise_floor:.4g}"
    )
    if judgement.standings:
        by = "" if found.effects else " by what is nearest"
        yield f"Share of the squared gap closed{by}: {100 * max(judgement.closed, 0.0):.0f} %"
    yield from zeroed(found)
    yield from _between(found)
    yield from confined(found)
    # Of each thing that it may go by the clearest place: neighbours say the same.
    clearest = {row["over"]: row for row in reversed(found.where)}
    for row in sorted(clearest.values(), key=lambda row: -abs(row["z"]))[:WHERE]:
        what = "torque along the motion" if row["along_motion"] else "torque"
        yield (
            f"Where: a {what} of {row['torque']:.3g} {TORQUE} is missing {PLACES[row['over']]} "
            f"{row['from']:.3g} to {row['to']:.3g} {row['unit']} ({row['z']:.1f} standard errors)"
        )
    for score in found.functions:
        yield (
            f"Function {score.name}, to first order: {score.size:.3g} +- {score.stderr:.2g} times "
            f"it, G = {score.gain:.1f}; {score.left:.1f} beside the effects found"
        )
    yield from _further(found)
    yield from findings_said(found.evidence.experiment, *runs)


def _between(found: Discrepancy) -> Iterator[str]:
    """Yield which parameters differ from run to run by more than their errors."""
    for name in found.best.trial.fit.names:
        between = found.runs.between(name)
        if between > 0:
            yield (
                f"{name} differs from run to run by {between:.3g} "
                f"{unit_of(name, found.definition)}".rstrip()
                + ", more than its error: intervals are wider by it"
            )


def _further(found: Discrepancy) -> Iterator[str]:
    """Yield what to record next, and what could not be computed beside the verdict."""
    if found.advice.next_experiment is not None:
        yield f"Next: {found.advice.next_experiment}"
    for field, reason in found.not_computed.items():
        yield f"Not computed: {field}: {reason}"


def _unit(found: Discrepancy, effect: str, parameter: str) -> str:
    """Return the unit of an effect's parameter; empty where it has none."""
    return unit_of(f"{effect}.{parameter}", found.definition)


def given_out(found: Found) -> dict[str, float]:
    """Return the parameters of the model file, SI; initial states and phases of runs left out."""
    trial = found.trial
    values = {name: value for name, value in trial.start.items() if "[" not in name}
    for effect in trial.fit.model.effects:
        values |= {f"{effect.name}.{name}": value for name, value in effect.parameters.items()}
    for candidate in trial.chosen:
        parameters, _ = values_of(found, candidate)
        values |= {f"{candidate.name}.{name}": value for name, value in parameters.items()}
    return values


def confined(found: Discrepancy) -> Iterator[str]:
    """Yield which effects of the model no map over initial conditions can have."""
    for effect in found.best.trial.fit.model.effects:
        if effect.definition["mappable"] == "no":
            yield f"{effect.name}: simulate, compare and diagnose can have it; no map has it"


def zeroed(found: Discrepancy) -> Iterator[str]:
    """Yield which coefficients are held at 0."""
    for name in found.best.trial.zeroed:
        yield f"{name} is held at 0: the fit would make it negative, and no pendulum drives itself"


def _ranking(found: Discrepancy) -> list[dict[str, Any]]:
    level = found.base.trial.remainder.level
    rows = []
    for k in found.scores.best():
        score = found.scores.scores[k]
        rows.append(
            {
                "name": score.candidate.name,
                "shape": dict(score.candidate.shape),
                "score": score.gain / level,
                "size": next(iter(score.start.values()), None),
            }
        )
    return rows
