"""Which other effects would explain the same: computed from these records, never from a list."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.discrepancy.trial import ALIKE
from pendmap.errors import InputError

if TYPE_CHECKING:
    from pendmap.discrepancy.candidates import Candidate
    from pendmap.discrepancy.evidence import Evidence
    from pendmap.discrepancy.refit import Found
    from pendmap.discrepancy.select import Search
    from pendmap.discrepancy.trial import Trial

__all__ = ["Rival", "Standing", "margin_of", "standing_of"]

CHANCE: Final = 1e-3
"""Chance of what is left below which the model is wrong by so much at least: a form that is wrong
moves the effects' gains against each other by as much."""

NEARBY: Final = 0.1
"""But what falls short of a gain by more than this part does less."""

NEAR: Final = (30.0, 0.3)
"""A rival is refitted if its score falls short of the winner's gain by less than the first, or than
this part of it."""

REFITTED: Final = 4
"""So many rivals are refitted at most."""

CONTAINS: Final = 0.99
"""An effect with a shape of its own that does the same to within this cosine has the other one as a
special case: it stands in no class with it."""

BETTER: Final = 3.84
"""Unless its shape gains more than this (95 % point of chi-squared): then it may be the truth."""

SPECIAL: Final = 0.06
"""Odds of an effect against its special case that was found, where it does as well: 10 of 162
blind names that had one were it, in another run of the benchmark 9 of 154. Its shape would have to
be where it cannot be told from the simpler one."""


@dataclasses.dataclass(frozen=True)
class Rival:
    """Another effect in the place of one that was found.

    Parameters
    ----------
    candidate : Candidate
        Effect and shape.
    gain : float
        By how much the sum of squares falls with it, over the noise's level; of a fit that was
        given up far behind, by how much it had fallen.
    behind : float
        How much less that is than with the effect that was found: twice the difference of
        log-likelihoods.
    separation : float
        ``s = 1 - gain / gain of the effect found``.
    likeness : float
        Cosine of the angle between what both do to the readings, with shapes as they are adapted.
    refitted : bool
        Whether the gain is that of a fit; else it is the score's.
    contains : bool
        Whether it has the effect found as a special case.
    margin : float
        By how much it may be behind and not be told apart.
    """

    candidate: Candidate
    gain: float
    behind: float
    separation: float
    likeness: float
    refitted: bool
    contains: bool
    margin: float

    @property
    def alike(self) -> bool:
        """Whether the records do not tell it from the effect that was found."""
        return self.behind < self.margin and not self.contains


@dataclasses.dataclass(frozen=True)
class Standing:
    """An effect that was found, among its rivals.

    Parameters
    ----------
    candidate : Candidate
        The effect.
    gain : float
        By how much the sum of squares falls with it, over the noise's level.
    rivals : tuple of Rival
        The nearest first.
    """

    candidate: Candidate
    gain: float
    rivals: tuple[Rival, ...]

    @property
    def equivalent(self) -> list[str]:
        """The names that these records do not tell apart, its own first."""
        return [self.candidate.name, *(r.candidate.name for r in self.rivals if r.alike)]

    @property
    def share(self) -> float:
        """The share of its likelihood among all names, with equal odds for each beforehand.

        Of effects that have it as a special case the odds are :data:`SPECIAL`. Where the model is
        wrong by more than noise, likelihoods count as so much less.
        """
        weights = [
            (SPECIAL if r.contains else 1.0)
            * math.exp(-0.5 * max(r.behind, 0.0) * ALIKE / r.margin)
            for r in self.rivals
        ]
        return 1.0 / (1.0 + sum(weights))


def margin_of(trial: Trial, gain: float) -> float:
    """Return by how much a rival may do less and not be told from an effect of a model.

    Parameters
    ----------
    trial : Trial
        The model.
    gain : float
        Of the effect, over the noise's level, as the margin.
    """
    if trial.remainder.chance >= CHANCE:
        return ALIKE
    return max(ALIKE, min(trial.remainder.excess, NEARBY * gain))


def standing_of(search: Search, best: Found, candidate: Candidate) -> Standing:
    """Return an effect of the best model among those that might stand in its place.

    Parameters
    ----------
    search : Search
        That found it.
    best : Found
        The best model.
    candidate : Candidate
        One of its effects.
    """
    level = search.level()
    try:
        rest = search.rests.less(best.trial, candidate)
    except InputError:
        return Standing(candidate, math.inf, ())  # without it there is no motion to speak of
    gain = (rest.chi2 - best.trial.chi2) / level
    scores = search.scores(rest)
    places = scores.best()
    own = next((k for k in places if scores.scores[k].candidate.name == candidate.name), None)
    if own is None:
        return Standing(candidate, gain, ())
    others = [k for k in places if k != own and scores.scores[k].gain > 0]
    margin = margin_of(best.trial, gain)
    reach = max(NEAR[0], NEAR[1] * gain, margin)
    rivals = []
    for rank, k in enumerate(others):
        score = scores.scores[k]
        reached, refitted = score.gain / level, False
        if scores.same(own, k):
            reached = gain
        elif rank < REFITTED and gain - reached < reach:
            target = search.target(best.trial, rest.adapted + score.candidate.count, margin)
            rival = search.rival(rest, scores, k, target)
            if rival is not None:
                if not rival.fit.converged and scores.likeness(own, k) > CONTAINS:
                    # What does the same begins at the same motion.
                    other = search.rests.instead(best.trial, candidate, score, target)
                    rival = min((t for t in (rival, other) if t), key=lambda t: t.chi2)
                reached, refitted = (rest.chi2 - rival.chi2) / level, True
        likeness = scores.likeness(own, k)
        if refitted and rival is not None:
            # Its shape has been adapted since: what counts is what it does now.
            likeness = max(likeness, _likeness(search.evidence, best.trial, rival, rest))
        more = score.candidate.count > candidate.count
        rivals.append(
            Rival(
                score.candidate,
                reached,
                gain - reached,
                1.0 - reached / gain if gain > 0 else 0.0,
                likeness,
                refitted,
                contains=more and likeness > CONTAINS and reached - gain < BETTER,
                margin=margin,
            )
        )
    rivals.sort(key=lambda r: r.behind)
    return Standing(candidate, gain, tuple(rivals))


def _likeness(evidence: Evidence, one: Trial, other: Trial, rest: Trial) -> float:
    """Return how alike two fits' curves are: 1 if they are the same, 0 if as far as from none.

    As the cosine that would put them so far apart, ``sqrt(1 - d^2 / G)``.
    """
    apart = 0.0
    for k, run in enumerate(evidence.fitted):
        difference = (one.fit.residuals[k] - other.fit.residuals[k]) / run.sigma
        counted = np.isfinite(difference)
        if run.trusted is not None:
            counted &= run.trusted
        apart += float(np.sum(difference[counted] ** 2))
    gain = max(rest.chi2 - one.chi2, 1e-300)
    return math.sqrt(max(1.0 - apart / gain, 0.0))
