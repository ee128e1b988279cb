"""Candidates fitted, from the score's step and from other shapes."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

from pendmap.discrepancy.held import Held, tried
from pendmap.discrepancy.sides import better_side
from pendmap.discrepancy.slipped import from_short_windows
from pendmap.discrepancy.trial import (
    ASTRAY,
    CLEAN,
    Trial,
    with_candidates,
)
from pendmap.discrepancy.valley import exponents
from pendmap.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.discrepancy.candidates import Candidate
    from pendmap.discrepancy.evidence import Evidence
    from pendmap.discrepancy.scores import Scores

__all__ = ["KICK", "WORTH", "Found", "Key", "Refits", "key_of"]

WORTH: Final = 0.4
"""The part of the greatest score that a candidate's must have to be refitted beside it."""

STARTS: Final = 3
"""From so many shapes a candidate is fitted whose shape is adapted."""

KICK: Final = 1e-3
"""Part of the score's step from which a candidate is fitted. The step belongs to one of all other
parameters and initial states; by itself it may lead far astray, and from nearly nothing the first
step of the fit is the whole of it. A phase needs some size to be anything."""

SHORT: Final = 0.8
"""A first fit that gains less than this part of what the score promised is tried again."""

HOPE: Final = 1.5
"""So many times what the score promises is the most that is hoped for of what is beaten."""

Key = frozenset[tuple[str, tuple[tuple[str, float], ...]]]


@dataclasses.dataclass(frozen=True)
class Found:
    """A trial and how it does on what was held back."""

    trial: Trial
    held: Held


class Refits:
    """Fits of candidates; what was computed once is not again.

    Parameters
    ----------
    evidence : Evidence
        The records.
    """

    def __init__(self, evidence: Evidence) -> None:
        self.evidence = evidence
        self._known: dict[tuple[Key, Key], Trial | None] = {}
        self._targets: dict[tuple[Key, Key], float] = {}
        self._held: dict[tuple[Key, Key], Found | None] = {}

    def refit(
        self, trial: Trial, scores: Scores, places: Sequence[int], target: float = math.inf
    ) -> Found | None:
        """Fit candidates as :meth:`fitted` does, and try them on what was held back."""
        full = self.fitted(trial, scores, places, target)
        if full is None:
            return None
        key = key_of(trial.chosen), key_of([scores.scores[k].candidate for k in places])
        if key not in self._held:
            try:
                self._held[key] = Found(full, tried(self.evidence, full))
            except InputError:
                self._held[key] = None  # what was held back leads out of the range of numbers
        return self._held[key]

    def fitted(
        self, trial: Trial, scores: Scores, places: Sequence[int], target: float = math.inf
    ) -> Trial | None:
        """Fit candidates from the score's whole step, and from a part of it if that fails.

        Parameters
        ----------
        trial : Trial
            The model without them.
        scores : Scores
            At that model.
        places : sequence of int
            Which of the scores.
        target : float
            The sum of squares that is to be reached: candidates that promise far less are beaten,
            and not fitted to the end.
        """
        added = [scores.scores[k].candidate for k in places]
        key = key_of(trial.chosen), key_of(added)
        if key not in self._known or target > self._targets[key]:
            if trial.chi2 - HOPE * scores.together(places) > target:
                # Not even by what the score promises: its size alone, in the shape that it has.
                found, whole = self._fit(trial, added, _kick(scores, places), bare=True), False
            else:
                found = self._refitted(trial, scores, places, added, target)
                whole = found is None or found.fit.converged or found.chi2 <= target
            self._known[key] = found
            self._targets[key] = math.inf if whole else target
            self._held.pop(key, None)
        return self._known[key]

    def known(self, trial: Trial, added: Sequence[Candidate]) -> Trial | None:
        """Return the fit of a trial's model with candidates, if it was made to the end."""
        key = key_of(trial.chosen), key_of(added)
        return self._known.get(key) if self._targets.get(key) == math.inf else None

    def _refitted(
        self,
        trial: Trial,
        scores: Scores,
        places: Sequence[int],
        added: Sequence[Candidate],
        target: float,
    ) -> Trial | None:
        start = _step(scores, places)
        found = self._fit(trial, added, _kick(scores, places), target)
        if len(added) == 1 and added[0].adapted:
            for k in self._other_shapes(scores, places[0]):
                if found is not None and found.remainder.z < CLEAN:
                    break  # where nothing is left no shape gains anything
                other = [scores.scores[k].candidate]
                again = self._fit(trial, other, _kick(scores, [k]), _least(target, found))
                found = min((t for t in (found, again) if t is not None), key=_chi2, default=None)
        promised = scores.together(places)
        if found is None or trial.chi2 - found.chi2 < SHORT * promised:
            again = self._fit(trial, added, start, _least(target, found))
            found = min((t for t in (found, again) if t is not None), key=_chi2, default=None)
        beaten = found is not None and found.chi2 > target
        found = self._regained(trial, added, start, found, promised, beaten=beaten)
        if found is not None and found.chi2 <= target:
            found = better_side(self.evidence, found)
        return found

    def _regained(  # noqa: PLR0913 (what was tried, and how it went)
        self,
        trial: Trial,
        added: Sequence[Candidate],
        start: dict[str, float],
        found: Trial | None,
        promised: float,
        *,
        beaten: bool,
    ) -> Trial | None:
        """Return a fit from short windows on, where the one that was found lost the motion."""
        if found is None or found.chi2 > trial.chi2:
            # More can do all that less did: the motion was lost on the way.
            other = self._fit(trial, added, start, short=True)
            best = min((t for t in (found, other) if t is not None), key=_chi2, default=None)
            if found is None or best is None or best.chi2 <= trial.chi2:
                return best
            return min(best, self.unslipped(found, lost=True), key=_chi2)
        less = trial.chi2 - found.chi2 < SHORT * promised
        if beaten and not less:
            return found
        return self.unslipped(found, lost=less and not found.fit.converged)

    def _other_shapes(self, scores: Scores, place: int) -> list[int]:
        """Return the next best shapes of a candidate: the score at size 0 is not all there is.

        An exponent is found from any.
        """
        one = scores.scores[place]
        if exponents(one.candidate):
            return []
        shapes = [
            k
            for k, s in enumerate(scores.scores)
            if s.candidate.name == one.candidate.name and k != place and s.gain > WORTH * one.gain
        ]
        return sorted(shapes, key=lambda k: -scores.scores[k].gain)[: STARTS - 1]

    def unslipped(self, found: Trial, *, lost: bool = False, gently: bool = False) -> Trial:
        """Return a fit from short windows on, where one is lost or astray and that is better."""
        if not lost and found.chi2 <= ASTRAY * max(found.fit.degrees, 1):
            return found
        try:
            return from_short_windows(self.evidence, found, gently=gently)
        except InputError:
            return found  # from short windows on the motion is lost

    def _fit(  # noqa: PLR0913 (what to fit, and from where)
        self,
        trial: Trial,
        added: Sequence[Candidate],
        start: dict[str, float],
        target: float = math.inf,
        *,
        short: bool = False,
        bare: bool = False,
    ) -> Trial | None:
        try:
            return with_candidates(
                self.evidence, trial, added, start, short=short, bare=bare, target=target
            )
        except InputError:
            return None  # the start leads out of the range of numbers


def key_of(chosen: Sequence[Candidate]) -> Key:
    """Return what a set of candidates is known by."""
    return frozenset((c.name, tuple(sorted(c.shape.items()))) for c in chosen)


def _step(scores: Scores, places: Sequence[int]) -> dict[str, float]:
    return {n: v for k in places for n, v in scores.scores[k].start.items()}


def _kick(scores: Scores, places: Sequence[int]) -> dict[str, float]:
    sizes = {scores.scores[k].candidate.free[0] for k in places}
    return {n: KICK * v if n in sizes else v for n, v in _step(scores, places).items()}


def _least(target: float, found: Trial | None) -> float:
    return target if found is None else min(target, found.chi2)


def _chi2(trial: Trial) -> float:
    return trial.chi2
