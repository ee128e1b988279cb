"""The effects that a diagnosis names: values, intervals, and the model that has them."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

from pendmap.comparison.further import Reasons, attempted
from pendmap.diagnosis.refit import Z95, elsewhere, profiles
from pendmap.identification.parameters import interval
from pendmap.model import Effect
from pendmap.model.rig import own_name
from pendmap.records.summary import doubted

if TYPE_CHECKING:
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import Trial
    from pendmap.diagnosis.scores import Score
    from pendmap.diagnosis.state import Found, State
    from pendmap.diagnosis.verdict import Judgement
    from pendmap.model import Formula
    from pendmap.residuals.by_run import RunByRun


@dataclasses.dataclass(frozen=True)
class NamedEffect:
    """An effect that a diagnosis names.

    Parameters
    ----------
    name : str
        As the library calls it.
    parameters : mapping of str to float
        In SI.
    ci95 : mapping of str to (float, float)
        Intervals of 95 % of what was fitted; a shape that was scanned has none.
    probability : float
        That this name is right, given that the effect is in the library: its share among its
        rivals, times the probability that one of them is.
    approximate : bool
        Whether its form may be only nearly right.
    formula : Formula, optional
        Where it is the user's own.
    elsewhere : mapping of str to float
        Another place on the other side of the rest, or another frequency or instant, where it would
        do as well.
    """

    name: str
    parameters: dict[str, float]
    ci95: dict[str, tuple[float, float]]
    probability: float
    approximate: bool
    formula: Formula | None = None
    elsewhere: dict[str, float] = dataclasses.field(default_factory=dict)

    @property
    def definition(self) -> dict[str, Any]:
        """What the library, or the user's formula, says about it."""
        return self.effect.definition

    @property
    def effect(self) -> Effect:
        """As a model has it."""
        return Effect(
            self.name,
            self.parameters,
            self.ci95,
            self.probability,
            self.approximate,
            self.formula,
        )


def named_effects(
    state: State, best: Found, judgement: Judgement, runs: RunByRun, reasons: Reasons
) -> tuple[NamedEffect, ...]:
    """Return the effects of the best model."""
    evidence, widening = state.evidence, best.trial.widening
    none: dict[str, dict[str, tuple[float, float]]] = {}
    profiled = attempted(reasons, "effects.ci95", lambda: profiles(evidence, best.trial), none)
    others = elsewhere(evidence, best.trial, _sought(state, best.trial))
    named = []
    for standing, sure in zip(judgement.standings, judgement.probabilities, strict=True):
        candidate = standing.candidate
        if candidate.name not in best.trial.names:
            continue
        parameters, errors = values_of(best, candidate)
        mixed = best.trial.fit.mixed
        ci95 = {}
        for n, error in errors.items():
            between = runs.between(f"{candidate.name}.{n}")
            half = Z95 * math.hypot(math.sqrt(widening) * error, between)
            if math.isfinite(half):
                ci95[n] = interval(parameters[n], half, mixed=f"{candidate.name}.{n}" in mixed)
            if not between:
                ci95 |= {k: v for k, v in profiled.get(candidate.name, {}).items() if k == n}
        named.append(
            NamedEffect(
                candidate.name,
                parameters,
                ci95,
                standing.share * sure,
                judgement.approximate or doubted(evidence.experiment, *evidence.runs),
                candidate.formula,
                others.get(candidate.name, {}),
            )
        )
    return tuple(named)


def _sought(state: State, best: Trial) -> dict[str, list[Score]]:
    """Return, by effect, the frequencies or instants that residuals ask for without it."""
    found = {}
    for candidate in best.chosen:
        if candidate.sought:
            scores = state.scores(state.rest(best, candidate)).scores
            found[candidate.name] = [s for s in scores if s.candidate.name == candidate.name]
    return found


def values_of(best: Found, candidate: Candidate) -> tuple[dict[str, float], dict[str, float]]:
    """Return an effect's parameters, sizes positive and phases within half a turn, and errors."""
    estimates = best.trial.fit.estimates
    own = own_name(candidate.name)
    if own is not None:
        return {candidate.size: estimates[own].value}, {candidate.size: estimates[own].stderr or 0}
    effect = next(e for e in best.trial.fit.model.effects if e.name == candidate.name)
    errors = {
        name: estimates[key].stderr or math.inf
        for name in effect.parameters
        if (key := f"{effect.name}.{name}") in estimates
    }
    values = dict(effect.parameters)
    if candidate.phase is not None and values[candidate.size] < 0:
        # A negative size is a positive one half a turn on.
        values[candidate.size] = -values[candidate.size]
        values[candidate.phase] += math.pi
    if candidate.phase is not None:
        values[candidate.phase] = math.remainder(values[candidate.phase], math.tau)
    return values, errors
