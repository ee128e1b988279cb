"""Which other effects explain the same, by the records at hand."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from pendmap.diagnosis.prune import rivals_of
from pendmap.diagnosis.scores import CONTAINS

if TYPE_CHECKING:
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import Trial
    from pendmap.diagnosis.state import State

THIRDS: int = 3
"""Parts of a single run, each of which a name must survive without."""


@dataclasses.dataclass(frozen=True)
class Rival:
    """Another effect in the place of one that was accepted."""

    candidate: Candidate  # Effect and shape
    gain: float  # Fall of the sum of squares with it, in independent readings
    # Gain of the accepted effect less its own, each less what chance gains by a choice among many
    # values: twice the difference of log-likelihoods.
    behind: float
    separation: float  # ``s = 1 - gain / gain of the accepted effect``
    likeness: float  # Cosine of the angle between what both do to the readings
    refitted: bool  # Whether the gain is that of a fit; else it is the score's
    # Whether it has the accepted effect as a special case and gains no more than chance by it.
    contains: bool
    # Whether the records do not tell it from the accepted effect: it is behind by less than the
    # threshold, or by the readings of one run alone, of a single run by those of a third, unless
    # the accepted effect happens once.
    alike: bool


@dataclasses.dataclass(frozen=True)
class Standing:
    """An accepted effect among its rivals."""

    candidate: Candidate  # The effect
    gain: float  # Fall of the sum of squares with it, in independent readings
    closed: float  # Share of the squared gap above the noise that it closes beside the others
    rivals: tuple[Rival, ...]  # The nearest first

    @property
    def equivalent(self) -> list[str]:
        """The names that these records do not tell apart, its own first.

        Where there are several, effects that contain one of them are among them.
        """
        alike = [r for r in self.rivals if r.alike and not r.contains]
        wider = [r for r in self.rivals if r.contains] if alike else []
        return [self.candidate.name, *(r.candidate.name for r in (*alike, *wider))]

    @property
    def share(self) -> float:
        """The share of its likelihood among all names, with equal odds for each beforehand."""
        weights = [math.exp(-0.5 * max(r.behind, 0.0)) for r in self.rivals if not r.contains]
        return 1.0 / (1.0 + sum(weights))


def standing_of(state: State, best: Trial, candidate: Candidate) -> Standing:
    """Return an effect of the best model among those that might stand in its place."""
    level = best.level
    rest = state.rest(best, candidate)
    gain = (rest.chi2 - best.chi2) / level
    scores = state.scores(rest)
    places = scores.best()
    own = next((k for k in places if scores.name(k) == candidate.name), None)
    if own is None:
        return Standing(candidate, gain, state.closed(rest, best), ())
    fits = dict(rivals_of(state, best, candidate, rest))
    rivals = []
    for k in places:
        score, fit = scores.scores[k], fits.get(k)
        if k == own or score.gain <= 0:
            continue
        reached = score.gain / level
        if scores.same(own, k):
            reached = gain
        elif fit is not None:
            fit = state.settled(fit)
            reached = (rest.chi2 - fit.chi2) / level
        likeness = scores.likeness(own, k)
        more = score.candidate.count > candidate.count
        chosen = score.candidate.looks - candidate.looks
        behind = gain - reached + chosen
        contains = more and likeness > CONTAINS and behind > -state.thresholds.alike
        alike = behind < state.thresholds.alike
        if fit is not None and not alike and not candidate.once:
            alike = _of_one_part(best, fit, chosen * level)
        rivals.append(
            Rival(
                score.candidate,
                reached,
                behind,
                1.0 - reached / gain if gain > 0 else 0.0,
                likeness,
                fit is not None,
                contains,
                alike,
            )
        )
    rivals.sort(key=lambda r: r.behind)
    return Standing(candidate, gain, state.closed(rest, best), tuple(rivals))


def _of_one_part(best: Trial, other: Trial, chosen: float) -> bool:
    """Whether a model is better than another by one run alone, or by a third of a single one.

    ``chosen`` is what the other one gains by a choice among many values.
    """
    behind = _by_part(other) - _by_part(best)
    return bool(behind.sum() - behind.max() + chosen < 0)


def _by_part(trial: Trial) -> np.ndarray:
    """Return the sum of squares of each run, of a single one of each third."""
    sums = []
    for run, white in zip(trial.runs, trial.fit.white, strict=True):
        counted = np.isfinite(white)
        if run.trusted is not None:
            counted &= run.trusted
        sums.append(white[counted] ** 2)
    parts = sums if len(sums) > 1 else np.array_split(sums[0], THIRDS)
    return np.array([float(np.sum(part)) for part in parts])
