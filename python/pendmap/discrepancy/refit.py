"""Candidates fitted, from the score's step and from other shapes."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

from pendmap.discrepancy.held import Held, tried
from pendmap.discrepancy.sides import better_side
from pendmap.discrepancy.trial import (
    ASTRAY,
    CLEAN,
    Trial,
    from_short_windows,
    with_candidates,
)
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
        self._known: dict[tuple[Key, Key], Found | None] = {}

    def refit(self, trial: Trial, scores: Scores, places: Sequence[int]) -> Found | None:
        """Fit candidates from the score's whole step, and from a part of it if that fails."""
        added = [scores.scores[k].candidate for k in places]
        key = (key_of(trial.chosen), key_of(added))
        if key not in self._known:
            self._known[key] = self._refitted(trial, scores, places, added)
        return self._known[key]

    def known(self, trial: Trial, added: Sequence[Candidate]) -> Trial | None:
        """Return the fit of a trial's model with candidates, if it was made."""
        found = self._known.get((key_of(trial.chosen), key_of(added)))
        return None if found is None else found.trial

    def _refitted(
        self,
        trial: Trial,
        scores: Scores,
        places: Sequence[int],
        added: Sequence[Candidate],
    ) -> Found | None:
        start = {n: v for k in places for n, v in scores.scores[k].start.items()}
        sizes = {candidate.free[0] for candidate in added}
        kick = {n: KICK * v if n in sizes else v for n, v in start.items()}
        found = self._fit(trial, added, kick)
        if len(added) == 1 and added[0].adapted:
            for k in self._other_shapes(scores, places[0]):
                if found is not None and found.remainder.z < CLEAN:
                    break  # where nothing is left no shape gains anything
                score = scores.scores[k]
                size = score.candidate.free[0]
                faint = score.start | {size: KICK * score.start[size]}
                again = self._fit(trial, [score.candidate], faint)
                found = min((t for t in (found, again) if t is not None), key=_chi2, default=None)
        promised = scores.together(places)
        if found is None or trial.chi2 - found.chi2 < SHORT * promised:
            other = self._fit(trial, added, start)
            found = min((t for t in (found, other) if t is not None), key=_chi2, default=None)
        if found is None or found.chi2 > trial.chi2:
            # More can do all that less did: the motion was lost on the way.
            other = self._fit(trial, added, start, short=True)
            found = min((t for t in (found, other) if t is not None), key=_chi2, default=None)
            if found is None:
                return None
        else:
            short = trial.chi2 - found.chi2 < SHORT * promised and not found.fit.converged
            found = self.unslipped(found, lost=short)
        found = better_side(self.evidence, found)
        try:
            return Found(found, tried(self.evidence, found))
        except InputError:
            return None  # what was held back leads out of the range of numbers

    def _other_shapes(self, scores: Scores, place: int) -> list[int]:
        """Return the next best shapes of a candidate: the score at size 0 is not all there is."""
        one = scores.scores[place]
        shapes = [
            k
            for k, s in enumerate(scores.scores)
            if s.candidate.name == one.candidate.name and k != place and s.gain > WORTH * one.gain
        ]
        return sorted(shapes, key=lambda k: -scores.scores[k].gain)[: STARTS - 1]

    def unslipped(self, found: Trial, *, lost: bool = False) -> Trial:
        """Return a fit from short windows on, where one is lost or astray and that is better."""
        if not lost and found.chi2 <= ASTRAY * max(found.fit.degrees, 1):
            return found
        try:
            return from_short_windows(self.evidence, found)
        except InputError:
            return found  # from short windows on the motion is lost

    def _fit(
        self,
        trial: Trial,
        added: Sequence[Candidate],
        start: dict[str, float],
        *,
        short: bool = False,
    ) -> Trial | None:
        try:
            return with_candidates(self.evidence, trial, added, start, short=short)
        except InputError:
            return None  # the start leads out of the range of numbers


def key_of(chosen: Sequence[Candidate]) -> Key:
    """Return what a set of candidates is known by."""
    return frozenset((c.name, tuple(sorted(c.shape.items()))) for c in chosen)


def _chi2(trial: Trial) -> float:
    return trial.chi2
