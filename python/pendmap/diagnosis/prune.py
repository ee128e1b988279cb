"""Accepted effects that gain too little beside the others are dropped, or replaced."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import Trial
    from pendmap.diagnosis.state import State

__all__ = ["pruned", "rivals_of"]


def pruned(state: State, best: Trial) -> Trial:
    """Return a model without effects that gain too little, each in its cheapest form.

    Of all fits that the records do not tell from the best, the simplest and commonest stands.

    Parameters
    ----------
    state : State
        With the fits that were made.
    best : Trial
        An accepted model.
    """
    state.accept(best)
    for candidate in best.chosen:
        rest = state.rest(best, candidate)
        if rest is None:
            continue  # without it there is no motion to speak of
        if not state.gains(rest, best):
            return pruned(state, state.settled(rest))
        for _, other in rivals_of(state, best, candidate, rest):
            if (
                other is not None
                and other.chi2 < best.chi2 - state.thresholds.alike * best.level
                and state.cost(other) < state.cost(best)
                and state.holds(best, other)
            ):
                return pruned(state, state.settled(other))
    simplest = state.simplest(best)
    return best if simplest is best else pruned(state, state.settled(simplest))


def rivals_of(
    state: State, best: Trial, candidate: Candidate, rest: Trial
) -> list[tuple[int, Trial | None]]:
    """Return the candidates that promise most in an effect's place, and their fits.

    Parameters
    ----------
    state : State
        With the fits that were made.
    best : Trial
        The model.
    candidate : Candidate
        One of its effects.
    rest : Trial
        The model without it.
    """
    limits = state.thresholds
    scores = state.scores(rest)
    gain = rest.chi2 - best.chi2
    others = [
        k
        for k in scores.best()
        if scores.scores[k].candidate.name != candidate.name
        and scores.scores[k].gain > limits.worth * gain
    ]
    return [(k, state.instead(best, candidate, rest, k)) for k in others[: limits.rivals]]
