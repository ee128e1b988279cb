"""Search for the effects that a model lacks: forward selection, elimination and swaps.

1. The baseline and the physical core are fitted; the core keeps the effects that it needs.
2. The error of the best model is added to the noise; sums of squares are in independent readings.
3. All candidates are scored at the best model (Rao), alone and in pairs; at first also at the
   models without one of the core's effects. The best few are fitted with all other parameters.
4. The model of least cost (Schwarz) is accepted if noise alone is unlikely to gain as much, if it
   closes its share of the gap (with a frequency or an instant all of it), and if no held-out set
   is predicted worse.
5. Accepted effects are dropped if they gain too little with the others present, and replaced by
   better ones. Of indistinguishable models the simplest and commonest is kept.
6. Steps 2 to 5 are repeated until nothing is accepted.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Final

from pendmap.diagnosis.baseline import lost_runs
from pendmap.diagnosis.refit import key_of
from pendmap.diagnosis.state import Attempt

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import FittedModel
    from pendmap.diagnosis.refit import Key
    from pendmap.diagnosis.state import State

MOVED: Final = 0.03  # Relative change of w0 by a torque of the angle that is a spring in disguise


def search(state: State, core: FittedModel | None) -> FittedModel:
    """Return the best model."""
    best = state.reweight(min((t for t in (state.base, core) if t), key=lambda t: t.chi2))
    core = best
    best = prune_effects(state, cheapest_start(state, core))
    if core.chosen and state.most > 0:
        gain = (state.base.chi2 - core.chi2) / state.level
        fall = state.cost(state.base) - state.cost(core)
        state.attempts.append(Attempt(core.names, {}, gain, fall, None, bool(best.chosen), 0))
    # Alternatives of the core's effects are searched at models without these effects.
    reduced = [state.leave_out(best, candidate) for candidate in best.chosen]
    starts = [model for model in reduced if not lost_runs(model.runs, model.fit)]
    best_known: dict[Key, float] = {}
    # A set of effects is enlarged again only from a clearly better fit, as effects may be dropped.
    margin = state.thresholds.alike
    while state.remaining(best) > 0:
        key = key_of(best.chosen)
        if not best.chi2 + margin * best.level < best_known.get(key, math.inf):
            break
        best_known[key] = best.chi2
        step = _step(state, best, starts)
        if step is None:
            break
        best, starts = prune_effects(state, state.reweight(step)), []
    return state.reweight(best)


def cheapest_start(state: State, core: FittedModel) -> FittedModel:
    """Return the cheapest of the given model, the core and the core without one of its effects."""
    starts = [state.base]
    if core.chosen and state.most > 0:
        starts.append(core)
        state.accept(core)
        reduced = [state.leave_out(core, candidate) for candidate in core.chosen]
        starts += [model for model in reduced if model.chosen]
    return min(starts, key=state.cost)


def _step(state: State, best: FittedModel, starts: Sequence[FittedModel]) -> FittedModel | None:
    """Return the cheapest accepted model with more, or other, effects; None without one."""
    refits: list[tuple[FittedModel, FittedModel, list[int]]] = []
    most = state.thresholds.singles
    for reduced in [best, *(s for s in starts if s is not best)]:
        singles, pairs = _promising(state, reduced)
        fits = 0
        for places in [*singles, *pairs]:
            if len(places) == 1 and fits == most:
                continue
            full = state.refit(reduced, places)
            if full is not None:
                fits += 1
                refits.append((full, reduced, places))
    if not refits:
        return None
    level = min((full for full, _, _ in refits), key=lambda t: t.chi2).level
    refits.sort(key=lambda entry: state.cost(entry[0], level))
    del refits[most:]
    for fit, reduced, places in refits:
        full = state.converge(fit)
        attempt = _attempt(state, best, reduced, full, places)
        plain = disguises(state, reduced, full) if attempt.accepted else None
        if plain is not None:
            attempt = dataclasses.replace(attempt, accepted=False)
            simpler = state.refit(reduced, plain) if plain else None
            refits += [] if simpler is None else [(simpler, reduced, plain)]
        state.attempts.append(attempt)
        if attempt.accepted:
            return full
    return None


def disguises(state: State, reduced: FittedModel, full: FittedModel) -> list[int] | None:
    """Return the places of the readings' effects if further effects only stand for them.

    Effects with a shape or a phase do if scale, zero and clock of the readings together do as
    much. A torque of the angle that moves w0 stands for a spring: then the places are empty.
    """
    added = [c for c in full.chosen if c.name not in reduced.names and c.count > 1]
    moved = abs(full.fit["w0"] / reduced.fit["w0"] - 1) > MOVED
    if moved and any(c.definition.family == "position torque" for c in added):
        return []
    scores = state.scores(reduced)
    places = [k for k in scores.best() if scores.scores[k].candidate.plain]
    places = [k for k in places if scores.scores[k].information > 0]
    plain = state.refit(reduced, places) if added and places else None
    alike = plain is not None and plain.chi2 <= full.chi2 + state.thresholds.alike * full.level
    return places if alike else None


def _promising(state: State, fitted: FittedModel) -> tuple[list[list[int]], list[list[int]]]:
    """Return the candidates, and pairs, of greatest score: twice as many as are fitted."""
    limits = state.thresholds
    scores = state.scores(fitted)
    ranked = scores.best()
    chosen: list[list[int]] = []
    for k in ranked:
        if scores.scores[k].gain > 0 and not any(scores.same(j, k) for [j] in chosen):
            chosen.append([k])
    if state.remaining(fitted) < 2 or len(ranked) < 2:  # noqa: PLR2004 (a pair)
        return chosen[: 2 * limits.singles], []
    alone = scores.scores[ranked[0]].gain
    pairs = sorted(itertools.combinations(ranked, 2), key=scores.together, reverse=True)
    joint = [
        list(pair)
        for pair in pairs[: limits.pairs]
        if scores.together(pair) - alone > limits.alike * state.level
    ]
    return chosen[: 2 * limits.singles], joint


def _attempt(
    state: State, best: FittedModel, reduced: FittedModel, full: FittedModel, places: Sequence[int]
) -> Attempt:
    """Compare a model that has the candidates at some places of another's scores with the best."""
    gains = state.remaining(full) >= 0 and state.is_significant(best, full)
    accepted = gains and state.keeps_hold_out(best, full)
    scores, losses = state.scores(reduced), state.hold_out_losses
    names = tuple(scores.name(k) for k in places)
    first = full.chosen[-len(names)]
    fitted = {effect.name: effect.parameters for effect in full.fit.model.effects}
    shape = {name: fitted[first.name][name] for name in first.shape}
    score = scores.together(places) / state.level
    fall = state.cost(reduced) - state.cost(full)
    pairs = zip(losses(reduced), losses(full), strict=False) if gains else ()
    held = min(((before - after) / state.level for before, after in pairs), default=None)
    return Attempt(names, shape, score, fall, held, accepted, len(reduced.chosen))


def prune_effects(state: State, best: FittedModel) -> FittedModel:
    """Return a model after backward elimination and swaps, in the simplest equivalent form.

    No set of effects is visited twice.
    """
    visited: set[Key] = set()
    following: FittedModel | None = best
    while following is not None and key_of(following.chosen) not in visited:
        best = state.converge(following)
        visited.add(key_of(best.chosen))
        state.accept(best)
        following = _preferred(state, best)
    return best


def _preferred(state: State, best: FittedModel) -> FittedModel | None:
    """Return a model that is preferred to the best one."""
    for candidate in best.chosen:
        reduced = state.leave_out(best, candidate)
        if not state.is_significant(reduced, best):
            return reduced
        for _, other in fit_alternatives(state, best, candidate, reduced):
            if (
                other is not None
                and other.chi2 < best.chi2 - state.thresholds.alike * best.level
                and state.cost(other) < state.cost(best)
                and state.closes_enough(best, other)
                and state.is_significant(reduced, other)
                and disguises(state, reduced, other) is None
                and state.keeps_hold_out(best, other)
            ):
                return other
    return state.simplest(best)


def fit_alternatives(
    state: State, best: FittedModel, candidate: Candidate, reduced: FittedModel
) -> list[tuple[int, FittedModel | None]]:
    """Return the most promising replacements of an effect, with their fits."""
    limits = state.thresholds
    scores = state.scores(reduced)
    gain = reduced.chi2 - best.chi2
    others = [
        k
        for k in scores.best()
        if scores.name(k) != candidate.name and scores.scores[k].gain > limits.worth * gain
    ]
    return [(k, state.refit(reduced, [k])) for k in others[: limits.rivals]]
