"""The effects that a diagnosis names, with their values and intervals."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

from pendmap.comparison.forecast import Reasons, compute_part
from pendmap.diagnosis.refit import find_equivalents, profile_intervals
from pendmap.identification.parameters import interval
from pendmap.model import Effect
from pendmap.model.rig import own_name
from pendmap.records.summary import doubt_keys
from pendmap.signal.robust import Z95

if TYPE_CHECKING:
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.state import ScoredModel, State
    from pendmap.diagnosis.verdict import Assessment
    from pendmap.model import Formula
    from pendmap.model.effects import EffectDefinition
    from pendmap.residuals.by_run import RunByRun


@dataclasses.dataclass(frozen=True)
class NamedEffect:
    """An effect that a diagnosis names."""

    name: str  # Name in the library
    parameters: dict[str, float]  # SI
    ci95: dict[str, tuple[float, float]]  # 95 % intervals of fitted parameters
    # Probability of the name, given that the effect is in the library: its share among its
    # alternatives, times the probability that one of them is right.
    probability: float
    approximate: bool  # Whether its form may be right only approximately
    closes: float  # Share of the squared gap above the noise that it closes with the others
    formula: Formula | None = None  # Of the user's own effect
    # Mirrored place, or another frequency or instant, of an equally good fit.
    elsewhere: dict[str, float] = dataclasses.field(default_factory=dict)

    @property
    def definition(self) -> EffectDefinition:
        """Entry in the library, or of the user's formula."""
        return self.effect.definition

    @property
    def reserve(self) -> str:
        """Text after its probability, wherever that is printed; empty for a sure name."""
        return ", with reserve: the missing effect may only resemble it" if self.approximate else ""

    @property
    def reaches_0(self) -> bool:
        """Whether the interval of its size contains 0, or values below where it opposes."""
        size = next(entry.name for entry in self.definition.parameters if entry.role == "size")
        low, high = self.ci95.get(size, (-math.inf, math.inf))
        return low <= 0 <= high or (self.definition.opposing == size and low <= 0)

    @property
    def effect(self) -> Effect:
        """The effect as part of a model."""
        sure = self.probability, self.approximate
        return Effect(self.name, self.parameters, self.ci95, *sure, self.formula)


def name_effects(
    state: State, best: ScoredModel, assessment: Assessment, runs: RunByRun, reasons: Reasons
) -> tuple[NamedEffect, ...]:
    """Return the effects of the best model."""
    data, widening = state.data, best.fitted.widening
    none: dict[str, dict[str, tuple[float, float]]] = {}
    profiled = compute_part(
        reasons, "effects.ci95", lambda: profile_intervals(data, best.fitted), none
    )
    # Frequencies or instants that the residuals show without the effect.
    sought = {}
    for c in (c for c in best.fitted.chosen if c.sought):
        scores = state.scores(state.leave_out(best.fitted, c)).scores
        sought[c.name] = [score for score in scores if score.candidate.name == c.name]
    others = find_equivalents(data, best.fitted, sought)
    untimed = any(one.what == "lab-time-missing" for one in data.experiment.findings)
    named = []
    for effect, sure in zip(assessment.identified, assessment.probabilities, strict=True):
        candidate = effect.candidate
        if candidate.name not in best.fitted.names:
            continue
        parameters, errors = effect_values(best, candidate)
        mixed = best.fitted.fit.mixed
        ci95 = {}
        for n, error in errors.items():
            between = runs.between(f"{candidate.name}.{n}")
            half = Z95 * math.hypot(math.sqrt(widening) * error, between)
            if math.isfinite(half):
                ci95[n] = interval(parameters[n], half, mixed=f"{candidate.name}.{n}" in mixed)
            if not between:
                ci95 |= {k: v for k, v in profiled.get(candidate.name, {}).items() if k == n}
        probability = effect.share * sure
        named.append(
            NamedEffect(
                candidate.name,
                parameters,
                ci95,
                probability,
                assessment.verdict == "partial"
                or assessment.further
                or round(probability, 3) < assessment.thresholds.sure
                or (untimed and "laboratory" in candidate.definition.formula)
                or bool(doubt_keys(data.experiment, *data.runs)),
                effect.closed,
                candidate.formula,
                others.get(candidate.name, {}),
            )
        )
    return tuple(named)


def effect_values(
    best: ScoredModel, candidate: Candidate
) -> tuple[dict[str, float], dict[str, float]]:
    """Return parameters and standard errors of an effect; with a phase its size is positive."""
    estimates = best.fitted.fit.estimates
    parameter = own_name(candidate.name)
    if parameter is not None:
        size, estimate = candidate.size, estimates[parameter]
        return {size: estimate.value}, {size: estimate.stderr or 0}
    effect = next(e for e in best.fitted.fit.model.effects if e.name == candidate.name)
    errors = {
        name: estimates[key].stderr or math.inf
        for name in effect.parameters
        if (key := f"{effect.name}.{name}") in estimates
    }
    values = dict(effect.parameters)
    if candidate.phase is not None:
        turned = values[candidate.phase] + math.pi * (values[candidate.size] < 0)
        values[candidate.phase] = math.remainder(turned, math.tau)
        values[candidate.size] = abs(values[candidate.size])
    return values, errors
