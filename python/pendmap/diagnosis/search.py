"""The search for the effects that a model lacks.

1. The given model is fitted, and the physical core: viscous damping, Coulomb friction and quadratic
   drag with the sensor's zero. The core keeps what it needs of its effects.
2. Readings get the error that the best model so far leaves, beside their noise. A sum of squares
   counts in independent readings of that model's residuals.
3. All effects of the library, in all their shapes, are scored at the best model (Rao), alone and in
   pairs; at first also at the models without one of the core's effects.
4. The best few are fitted with all other parameters, within physics.
5. The cheapest, by its sum of squares and Schwarz's penalty, is fitted until it has converged, and
   accepted if noise hardly gains as much, if it closes its share of a gap that it does not close
   whole (with a frequency or an instant all of it), and if it loses on no held-out set.
6. Accepted effects are dropped where they gain too little beside the others, and replaced by what
   fits better by as much as in step 5; of fits that the records do not tell apart the simplest and
   commonest stands. A model without an effect is never worse than one with fewer.
7. Steps 2 to 6 are repeated until nothing is accepted.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pendmap.diagnosis.baseline import follows
from pendmap.diagnosis.prune import pruned
from pendmap.diagnosis.refit import key_of
from pendmap.diagnosis.state import Attempt

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pendmap.diagnosis.fitted_model import Trial
    from pendmap.diagnosis.refit import Key
    from pendmap.diagnosis.state import State


def search(state: State, core: Trial | None, progress: Callable[[int], None]) -> Trial:
    """Return the best model."""
    best = state.weigh(min((t for t in (state.base, core) if t), key=lambda t: t.chi2))
    core = best
    best = pruned(state, beginnings(state, core)[0])
    if core.chosen and state.most > 0:
        state.attempts.append(core_attempt(state, core, accepted=bool(best.chosen)))
    # What takes the place of the core's effects starts without them.
    rests = [state.rest(best, candidate) for candidate in best.chosen]
    starts = [rest for rest in rests if follows(state.evidence, rest)]
    seen: dict[Key, float] = {}
    # What is accepted may be dropped again: no set of effects is enlarged twice, unless a fit of it
    # was found that the records tell from the first.
    margin = state.thresholds.alike
    while state.room(best) > 0 and best.chi2 + margin * best.level < seen.get(
        key_of(best.chosen), math.inf
    ):
        seen[key_of(best.chosen)] = best.chi2
        step = _step(state, best, starts)
        if step is None:
            break
        best, starts = pruned(state, state.weigh(step)), []
        progress(len(best.chosen))
    return state.weigh(best)


def beginnings(state: State, core: Trial) -> list[Trial]:
    """Return the given model and the core with what it needs of its effects, the cheapest first."""
    starts = [state.base]
    if core.chosen and state.most > 0:
        starts.append(core)
        state.accept(core)
        for candidate in core.chosen:
            rest = state.rest(core, candidate)
            starts += [rest] if rest.chosen else []
    return sorted(starts, key=state.cost)


def _step(state: State, best: Trial, starts: Sequence[Trial]) -> Trial | None:
    """Return the cheapest model with more, or other, effects that is accepted."""
    found: list[tuple[Trial, Trial, list[int]]] = []
    for rest in [best, *(s for s in starts if s is not best)]:
        singles, pairs = _promising(state, rest)
        fits = 0
        for places in [*singles, *pairs]:
            if len(places) == 1 and fits == state.thresholds.singles:
                continue
            trial = state.refit(rest, places)
            if trial is not None:
                fits += 1
                found.append((trial, rest, places))
    if not found:
        return None
    level = min((trial for trial, _, _ in found), key=lambda t: t.chi2).level
    found.sort(key=lambda each: state.cost(each[0], level))
    for fit, rest, places in found[: state.thresholds.singles]:
        trial = state.settled(fit)
        gains = state.room(trial) >= 0 and state.gains(best, trial)
        good = gains and state.holds(best, trial)
        state.attempts.append(attempt_of(state, rest, trial, places, tried=gains, accepted=good))
        if good:
            return trial
    return None


def _promising(state: State, rest: Trial) -> tuple[list[list[int]], list[list[int]]]:
    """Return the candidates, and the pairs of them, with the greatest scores at a model.

    Twice as many candidates as are wanted: not each has a fit within physics.
    """
    limits = state.thresholds
    scores = state.scores(rest)
    ranked = scores.best()
    chosen: list[list[int]] = []
    for k in ranked:
        if scores.scores[k].gain > 0 and not any(scores.same(j, k) for [j] in chosen):
            chosen.append([k])
    if state.room(rest) < 2 or len(ranked) < 2:  # noqa: PLR2004 (a pair)
        return chosen[: 2 * limits.singles], []
    alone = scores.scores[ranked[0]].gain
    pairs = [
        pair
        for pair in scores.best_pairs(ranked, limits.pairs)
        if scores.together(pair) - alone > limits.alike * state.level
    ]
    return chosen[: 2 * limits.singles], pairs


# What a search has tried.


def core_attempt(state: State, core: Trial, *, accepted: bool) -> Attempt:
    """Return the attempt to add the physical core's effects to the given model."""
    return Attempt(
        core.names,
        {},
        (state.base.chi2 - core.chi2) / state.level,
        state.cost(state.base) - state.cost(core),
        None,
        accepted,
        0,
    )


def attempt_of(  # noqa: PLR0913 (a model, another, and what is between them)
    state: State,
    rest: Trial,
    trial: Trial,
    places: Sequence[int],
    *,
    tried: bool,
    accepted: bool,
) -> Attempt:
    """Return the attempt to add candidates to a model, those at some places of its scores."""
    scores = state.scores(rest)
    added = [scores.scores[k].candidate for k in places]
    pairs = zip(state.sets(rest), state.sets(trial), strict=False) if tried else ()
    return Attempt(
        tuple(candidate.name for candidate in added),
        trial.shape_of(trial.chosen[-len(added)]),
        scores.together(places) / state.level,
        state.cost(rest) - state.cost(trial),
        min(((less - more) / state.level for less, more in pairs), default=None),
        accepted,
        len(rest.chosen),
    )
