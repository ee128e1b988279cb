"""Whether the form of what was found is right: what is left, looked for in every direction.

A sum of squares tells little of a form that is nearly right: what is left of it lies in one
direction among hundreds. So each direction that has a name is tried by itself: every other effect
of the library in every shape (Rao's score at the best model), the torque over angle, velocity,
amplitude, drive phase and time, the slow part of the residuals, whether all runs would have the
same parameters, and the residuals of what was held back. Each says how probable it is that noise
alone leaves so much.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pendmap.diagnosis.scores import Scores

__all__ = ["Form", "form_of"]


@dataclasses.dataclass(frozen=True)
class Form:
    """What is left beside the best model.

    Parameters
    ----------
    chances : mapping of str to float
        By what was looked at, that noise alone leaves as much: ``effects`` of the library that are
        not in the model, ``torque``, ``slow`` residuals, ``runs``, ``held_out`` sets.
    further : str or None
        The effect that would take up most of what is left.
    """

    chances: Mapping[str, float]
    further: str | None

    @property
    def chance(self) -> float:
        """The least of all chances, times how many there are (Bonferroni)."""
        return min(min(self.chances.values()) * len(self.chances), 1.0)

    @property
    def unnamed(self) -> float:
        """The same without the library's effects: what one of them takes up is not unknown."""
        others = [chance for name, chance in self.chances.items() if name != "effects"]
        return min(min(others) * len(others), 1.0)


def form_of(
    scores: Scores, chance_of: Callable[[float, int], float], others: Mapping[str, float]
) -> Form:
    """Return what is left.

    Parameters
    ----------
    scores : Scores
        Of all candidates at the best model.
    chance_of : callable
        Of a gain and how many numbers were adapted for it, the chance that noise alone makes it.
    others : mapping of str to float
        Chances that noise alone leaves as much of all else that was looked at.
    """
    shapes = Counter(score.candidate.name for score in scores.scores)
    best = scores.best()
    tails = {
        scores.scores[k].candidate.name: shapes[scores.scores[k].candidate.name]
        * chance_of(scores.scores[k].gain, len(scores.columns[k]))
        for k in best
        if scores.scores[k].gain > 0
    }
    further = min(tails, key=lambda name: tails[name], default=None)
    effects = 1.0 if further is None else min(tails[further] * len(tails), 1.0)
    return Form({"effects": effects, **others}, further)
