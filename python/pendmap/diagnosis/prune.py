"""Accepted effects that gain too little beside the others are dropped, or replaced."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pendmap.diagnosis.refit import key_of

if TYPE_CHECKING:
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import Trial
    from pendmap.diagnosis.refit import Key
    from pendmap.diagnosis.state import State


def pruned(state: State, best: Trial) -> Trial:
    """Return a model without effects that gain too little, each in its cheapest form.

    Of all fits that the records do not tell from the best, the simplest and commonest stands. No
    set of effects is looked at twice.
    """
    seen: set[Key] = set()
    following: Trial | None = best
    while following is not None and key_of(following.chosen) not in seen:
        best = state.settled(following)
        seen.add(key_of(best.chosen))
        state.accept(best)
        following = _following(state, best)
    return best


def _following(state: State, best: Trial) -> Trial | None:
    """Return a model that is preferred to another one; none where that stands."""
    for candidate in best.chosen:
        rest = state.rest(best, candidate)
        if not state.gains(rest, best):
            return rest
        for _, other in rivals_of(state, best, candidate, rest):
            if (
                other is not None
                and other.chi2 < best.chi2 - state.thresholds.alike * best.level
                and state.cost(other) < state.cost(best)
                and state.closes(best, other)
                and state.gains(rest, other)
                and state.holds(best, other)
            ):
                return other
    return state.simplest(best)


def rivals_of(
    state: State, best: Trial, candidate: Candidate, rest: Trial
) -> list[tuple[int, Trial | None]]:
    """Return the candidates that promise most in an effect's place, and their fits."""
    limits = state.thresholds
    scores = state.scores(rest)
    gain = rest.chi2 - best.chi2
    others = [
        k
        for k in scores.best()
        if scores.name(k) != candidate.name and scores.scores[k].gain > limits.worth * gain
    ]
    return [(k, state.refit(rest, [k])) for k in others[: limits.rivals]]
