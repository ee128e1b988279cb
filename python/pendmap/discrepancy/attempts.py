"""What a search has tried."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.discrepancy.refit import Found
    from pendmap.discrepancy.scores import Scores

__all__ = ["Attempt", "attempt_of"]


@dataclasses.dataclass(frozen=True)
class Attempt:
    """A candidate that was refitted.

    Parameters
    ----------
    names : tuple of str
        The effects.
    shape : dict of str to float
        Of the first, without dimensions.
    score : float
        What was expected of it.
    gain : float
        By how much the BIC fell.
    held_gain : float
        The same of the sum of squares on what was held back.
    accepted : bool
        Whether it is in the model from there on.
    stage : int
        How many effects the model had before.
    """

    names: tuple[str, ...]
    shape: dict[str, float]
    score: float
    gain: float
    held_gain: float
    accepted: bool
    stage: int


def attempt_of(  # noqa: PLR0913 (a model, another, and what is between them)
    current: Found,
    found: Found,
    scores: Scores,
    places: Sequence[int],
    *,
    level: float,
    accepted: bool,
) -> Attempt:
    """Return the attempt to add candidates to a model, those at some places of the scores.

    Parameters
    ----------
    current, found : Found
        The model without and with them.
    scores : Scores
        At the model without them.
    places : sequence of int
        Which candidates.
    level : float
        Of the noise: by what sums of squares are divided.
    accepted : bool
        Whether they are in the model from there on.
    """
    added = [scores.scores[k].candidate for k in places]
    return Attempt(
        tuple(candidate.name for candidate in added),
        found.trial.shape_of(found.trial.chosen[-len(added)]),
        scores.together(places) / level,
        current.trial.bic(level) - found.trial.bic(level),
        (current.held.chi2 - found.held.chi2) / level,
        accepted,
        len(current.trial.chosen),
    )
