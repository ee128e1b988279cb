"""What a search has tried."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.diagnosis.fitted_model import Trial
    from pendmap.diagnosis.state import State

__all__ = ["Attempt", "attempt_of", "core_attempt"]


@dataclasses.dataclass(frozen=True)
class Attempt:
    """Candidates that were fitted, and whether they were accepted."""

    names: tuple[str, ...]  # The effects
    shape: dict[str, float]  # Of the first, without dimensions
    score: float  # Gain that the score promises, in independent readings
    # Fall of the cost: of the sum of squares in independent readings with Schwarz's penalty.
    gain: float
    # Least fall on a held-out set, in independent readings; none where it was not asked for.
    held_gain: float | None
    accepted: bool  # Whether the search went on from there
    stage: int  # Number of effects of the model without them


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
