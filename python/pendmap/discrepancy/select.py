"""Which effects are missing: candidates refitted, accepted, dropped and exchanged."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pendmap.discrepancy.attempts import Attempt, attempt_of
from pendmap.discrepancy.baseline import taken_by
from pendmap.discrepancy.candidates import Candidate, candidates
from pendmap.discrepancy.exchange import LOSS, pruned
from pendmap.discrepancy.held import tried
from pendmap.discrepancy.refit import WORTH, Found, Key, Refits, key_of
from pendmap.discrepancy.rests import Rests, consistent
from pendmap.discrepancy.scores import Scores, scores_of
from pendmap.discrepancy.trial import Trial, settled
from pendmap.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from pendmap.discrepancy.evidence import Evidence
    from pendmap.model import Formula

__all__ = ["GATE", "Search"]

GATE: Final = 12.0
"""The least score of a candidate that is refitted: of all candidates together none passes 8.5
where nothing is missing."""

GAIN: Final = 12.0
"""The least fall of the BIC for which an effect is accepted."""

CHANCE: Final = 5e-4
"""Or the chance of what it gains, times how many were looked at: for several parameters at once the
BIC asks for more than that."""

DOUBT: Final = 0.01
"""The same chance beside a fall of the BIC that suffices: of white noise that falls so far with far
less, of noise whose colour is half known it may not."""

REFITTED: Final = 4
"""So many candidates are refitted, those with the greatest scores."""

SCATTER: Final = 3.0
"""And by so many standard errors less than is expected: an effect that gains ``G`` where it was
fitted gains ``f G``, give or take ``2 sqrt(f G)``, of ``f`` times as many samples held back."""

PATIENCE: Final = 0.5
"""Of what is expected there as much may be lost while another effect is missing too."""

AT_LAST: Final = 0.1
"""And in the end: where phases of the drive are adapted to what was held back, that says little."""

PAIRED: Final = 8
"""Pairs are looked for that have one of so many candidates: alone, what hides behind another shows
little."""

BEGINNINGS: Final = 1
"""So many more beginnings are followed where the best one does not lead to the end."""

LEFT: Final = 1e-3
"""Chance of what is left above which the end is reached."""

LEAST_LEVEL: Final = 0.5
"""Noise is not taken for less, of what its readings are stated to have, than this."""

BEGUN: Final = 2
"""So often a search begins again from a better baseline."""

ZERO: Final = "encoder_offset"
"""Where the sensor reads zero says nothing of the pendulum: it does not count as an effect."""


class Search:
    """The search for the effects that a model lacks.

    Parameters
    ----------
    evidence : Evidence
        The records.
    base : Trial
        The model to begin with.
    most : int
        How many effects are added at most; the sensor's zero does not count.
    without : collection of str
        Effects that are no candidates.
    progress : callable
        Called with the number of effects found so far.
    own : collection of Formula
        Candidates of the user's own.
    """

    def __init__(  # noqa: PLR0913 (what is searched, and among what)
        self,
        evidence: Evidence,
        base: Trial,
        most: int,
        without: Collection[str],
        progress: Callable[[int], None],
        *,
        own: Collection[Formula] = (),
    ) -> None:
        self.evidence = evidence
        self.most = most
        self.without = without
        self.own = own
        self.progress = progress
        self.base = Found(base, tried(evidence, base))
        self.attempts: list[Attempt] = []
        self.first: Scores | None = None
        self._begun = 0
        # What was computed once is not again: rivals are often candidates that were tried.
        self._scores: dict[Key, Scores] = {}
        self._refits = Refits(evidence)
        self.rests = Rests(evidence, base, self._refits)

    def _begin_again(self, base: Trial) -> None:
        """Forget everything but a better baseline."""
        self._begun += 1
        self.base = Found(base, tried(self.evidence, base))
        self.attempts, self.first = [], None
        self._scores, self._refits = {}, Refits(self.evidence)
        self.rests = Rests(self.evidence, base, self._refits)

    def run(self) -> Found:
        """Return the best model."""
        best = self._path([self.base])[-1]
        if self.most and not self._at_end(best):
            for other in self._beginnings(best):
                further = self._path([self.base, self.settled(other)])[-1]
                best = min((best, further), key=lambda found: found.trial.bic(self.level()))
                if self._at_end(best):
                    break
        return self.settled(pruned(self, best) if best.trial.chosen else best)

    def _at_end(self, best: Found) -> bool:
        """Whether a model leaves no more than chance, and is no beginning that led nowhere."""
        begun = any(attempt.accepted for attempt in self.attempts)
        return best.trial.remainder.chance > LEFT and bool(best.trial.chosen or not begun)

    def _beginnings(self, best: Found) -> list[Found]:
        """Return other beginnings than the one that led to a model: the best pair and effects."""
        scores = self.scores(self.base.trial)
        ranked = scores.best()
        pairs = [scores.best_pair(ranked[:PAIRED], PAIRED)[1:]] if len(ranked) > 1 else []
        begun = set(best.trial.names)
        found = []
        for places in [*pairs, *((k,) for k in ranked[:REFITTED])]:
            names = {scores.scores[k].candidate.name for k in places}
            if names <= begun or len(names - {ZERO}) > self.most:
                continue
            other = self.refit(self.base.trial, scores, places)
            if other and self.gains(self.base.trial, other.trial):
                found.append(other)
        found = [other for other in found if self._holds(self.base, other)]
        return sorted(found, key=lambda other: other.trial.bic(self.level()))[:BEGINNINGS]

    def _path(self, path: list[Found]) -> list[Found]:
        """Return models from the baseline on, each with an effect or two more."""
        while self._room(path[-1].trial) > 0:
            following = self._following(path[-1])
            if following is None:
                break
            if len(path) == 1 and self._begun < BEGUN:
                better = self._better_base(following.trial)
                if better is not None:
                    self._begin_again(better)
                    path = [self.base]
                    continue
            path.append(self.settled(following))
            best = path[-1].trial
            self.rests.keep(best)
            self.progress(len(best.chosen))
        # What was worse on what was held back, for want of another effect, must be better with it.
        while len(path) > 1 and not self._holds(self.base, path[-1], AT_LAST):
            path.pop()
        return path

    def settled(self, found: Found) -> Found:
        """Return a fit with all the steps that it wants: candidates are given few."""
        if found.trial.fit.converged:
            return found
        try:
            full = settled(self.evidence, found.trial)
            if not full.fit.converged:
                full = self._refits.unslipped(full, lost=True)
            return Found(full, tried(self.evidence, full))
        except InputError:
            return found

    def _better_base(self, found: Trial) -> Trial | None:
        """Return the baseline from where a further effect has led, if it is better there.

        A search may end in the wrong valley, out of which an effect leads that has nothing to do
        with the pendulum.
        """
        first = found.chosen[0]
        alone = len(found.chosen) == 1 and not first.adapted
        if alone and consistent(self.base.trial, found, first):
            return None
        rest = found
        try:
            for candidate in found.chosen:
                chosen = tuple(c for c in rest.chosen if c.name != candidate.name)
                rest = self.rests.fit_without(rest, candidate, chosen)
        except InputError:
            return None
        return rest if rest.chi2 < self.base.trial.chi2 - GATE * self.level() else None

    def pool(self, trial: Trial) -> list[list[Candidate]]:
        """Return the candidates that a trial's model does not have yet."""
        return candidates(
            taken_by(trial), driven=self.evidence.forced, without=self.without, own=self.own
        )

    def scores(self, trial: Trial) -> Scores:
        """Return the scores of all candidates at a trial."""
        key = key_of(trial.chosen)
        if key not in self._scores:
            self._scores[key] = scores_of(self.evidence, trial, self.pool(trial))
        return self._scores[key]

    def level(self) -> float:
        """Return by what sums of squares are divided: the noise as the baseline leaves it."""
        return max(self.base.trial.remainder.level, LEAST_LEVEL)

    def chance_of(self, gain: float, count: int) -> float:
        """Return the chance that noise alone makes the sum of squares fall by so much."""
        return self.base.trial.remainder.chance_of(gain, count, LEAST_LEVEL)

    def _room(self, trial: Trial) -> int:
        return self.most - len([name for name in trial.names if name != ZERO])

    def _following(self, current: Found) -> Found | None:
        """Return the model with the best further effect, or pair of them, that is accepted."""
        scores = self.scores(current.trial)
        if self.first is None:
            self.first = scores
        level = self.level()
        ranked = scores.best()
        least = GATE * level
        if ranked:
            least = max(least, WORTH * scores.scores[ranked[0]].gain)
        strong = [k for k in ranked[:REFITTED] if scores.scores[k].gain >= least]
        wanted = [
            [k] for n, k in enumerate(strong) if not any(scores.same(j, k) for j in strong[:n])
        ]
        if self._room(current.trial) > 1:
            wanted += self._promising_pairs(scores, ranked, level)
        refitted = []
        for places in wanted:
            found = self.refit(current.trial, scores, places)
            if found is not None:
                refitted.append((found, places))
        refitted.sort(key=lambda pair: pair[0].trial.bic(level))
        accepted = None
        for found, places in refitted:
            good = accepted is None and self.accepts(current, found)
            accepted = found if good else accepted
            self.attempts.append(
                attempt_of(current, found, scores, places, level=level, accepted=good)
            )
        return accepted

    def _promising_pairs(
        self, scores: Scores, ranked: Sequence[int], level: float
    ) -> list[list[int]]:
        """Return the best pair, if it promises more than its members one after the other."""
        if len(ranked) < 2:  # noqa: PLR2004 (a pair)
            return []
        gain, a, b = scores.best_pair(ranked, PAIRED)
        alone = max(scores.scores[a].gain, scores.scores[b].gain, scores.scores[ranked[0]].gain)
        return [[a, b]] if gain - alone > 2 * GATE * level else []

    def refit(self, trial: Trial, scores: Scores, places: Sequence[int]) -> Found | None:
        """Return a trial's model with candidates, those at some places of the scores, fitted."""
        return self._refits.refit(trial, scores, places)

    def accepts(self, current: Found, found: Found) -> bool:
        """Whether a model is better than one with fewer effects, by more than chance."""
        return self.gains(current.trial, found.trial) and self._holds(current, found, PATIENCE)

    def _holds(self, current: Found, found: Found, patience: float = 0.0) -> bool:
        """Whether a model is no worse on what was held back than a right one may be."""
        level = self.level()
        held = (current.held.chi2 - found.held.chi2) / level
        share = current.held.degrees / max(current.trial.fit.degrees, 1)
        expected = max(current.trial.chi2 - found.trial.chi2, 0.0) / level * share
        scatter = SCATTER * 2 * math.sqrt(expected)
        return held >= min(expected - scatter, -patience * expected, 0.0) - LOSS

    def gains(self, rest: Trial, full: Trial) -> bool:
        """Whether further effects gain more than chance."""
        level = self.level()
        looked = len(self.scores(rest).scores)
        more = full.adapted - rest.adapted
        chance = looked * self.chance_of(rest.chi2 - full.chi2, more)
        return chance < (DOUBT if rest.bic(level) - full.bic(level) >= GAIN else CHANCE)
