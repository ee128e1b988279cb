"""Which effects are missing: candidates refitted, accepted, dropped and exchanged."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pendmap.discrepancy.baseline import taken_by
from pendmap.discrepancy.candidates import Candidate, candidates
from pendmap.discrepancy.exchange import LOSS, pruned
from pendmap.discrepancy.held import tried
from pendmap.discrepancy.race import GATE, LEFT, beginnings, best_following, better
from pendmap.discrepancy.refit import Found, Key, Refits, key_of
from pendmap.discrepancy.rests import Rests, consistent
from pendmap.discrepancy.scores import Scores, scores_of
from pendmap.discrepancy.slipped import slipped
from pendmap.discrepancy.trial import ALIKE, Trial, settled
from pendmap.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from pendmap.discrepancy.attempts import Attempt
    from pendmap.discrepancy.evidence import Evidence
    from pendmap.model import Formula

__all__ = ["GAIN", "Search"]

GAIN: Final = 12.0
"""The least fall of the BIC for which an effect is accepted."""

CHANCE: Final = 5e-4
"""Or the chance of what it gains, times how many were looked at: for several parameters at once the
BIC asks for more than that."""

DOUBT: Final = 0.01
"""The same chance beside a fall of the BIC that suffices: of white noise that falls so far with far
less, of noise whose colour is half known it may not."""

SCATTER: Final = 3.0
"""And by so many standard errors less than is expected: an effect that gains ``G`` where it was
fitted gains ``f G``, give or take ``2 sqrt(f G)``, of ``f`` times as many samples held back."""

PATIENCE: Final = 0.5
"""Of what is expected there as much may be lost while another effect is missing too."""

AT_LAST: Final = 0.1
"""And in the end: where phases of the drive are adapted to what was held back, that says little."""

LEAST_LEVEL: Final = 0.5
"""Noise is not taken for less, of what its readings are stated to have, than this."""

MOSTLY: Final = 0.5
"""Part of what an effect has gained that it gains still from a better baseline: with less the
search begins again from that."""

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
        self._settled: list[Found] = []
        self._refits = Refits(evidence)
        self.rests = Rests(evidence, base, self._refits)

    def _begin_again(self, base: Trial) -> None:
        """Forget everything but a better baseline."""
        self._begun += 1
        self.attempts, self.first = [], None
        self._scores, self._refits = {}, Refits(self.evidence)
        self._base_is(base)

    def _base_is(self, base: Trial) -> None:
        self.base = Found(base, tried(self.evidence, base))
        self.rests = Rests(self.evidence, base, self._refits)

    def _rests_on(self, better: Trial, found: Trial) -> bool:
        """Whether what an effect gained was for the most part the baseline's being worse."""
        return better.chi2 - found.chi2 < MOSTLY * (self.base.trial.chi2 - found.chi2)

    def run(self) -> Found:
        """Return the best model."""
        best = self._pruned(self._path([self.base])[-1])
        if self.most and not self.at_end(best):
            for other in beginnings(self, best):
                further = self._pruned(self._path([self.base, self.settled(other)])[-1])
                if better(self, further, best):
                    best = further
                if self.at_end(best):
                    break
        return best

    def _pruned(self, found: Found) -> Found:
        """Return a model without what is idle or beaten, fitted to its end."""
        return self.settled(pruned(self, found) if found.trial.chosen else found)

    def at_end(self, best: Found) -> bool:
        """Whether a model leaves no more than chance, and is no beginning that led nowhere."""
        begun = any(attempt.accepted for attempt in self.attempts)
        return best.trial.remainder.chance > LEFT and bool(best.trial.chosen or not begun)

    def _path(self, path: list[Found]) -> list[Found]:
        """Return models from the baseline on, each with an effect or two more."""
        while self.room(path[-1].trial) > 0:
            following = best_following(self, path[-1])
            if following is None:
                break
            if len(path) == 1 and self._begun < BEGUN:
                better = self._better_base(following.trial)
                if better is not None and self._rests_on(better, following.trial):
                    self._begin_again(better)
                    path = [self.base]
                    continue
                if better is not None:
                    self._base_is(better)
                    path = [self.base]
            path.append(self.settled(following))
            best = path[-1].trial
            self.rests.keep(best)
            self.progress(len(best.chosen))
        # What was worse on what was held back, for want of another effect, must be better with it.
        while len(path) > 1 and not self.holds(self.base, path[-1], AT_LAST):
            path.pop()
        return path

    def settled(self, found: Found) -> Found:
        """Return a fit with all the steps that it wants: candidates are given few."""
        if found.trial.fit.converged or any(f is found for f in self._settled):
            return found
        try:
            full = settled(self.evidence, found.trial)
            if not full.fit.converged:
                full = self._refits.unslipped(full, lost=True, gently=True)
            found = Found(full, tried(self.evidence, full))
        except InputError:
            pass
        self._settled.append(found)
        return found

    def regained(self, found: Found) -> Found:
        """Return a fit from short windows on, where one has slipped and that is better."""
        if not slipped(found.trial):
            return found
        other = self._refits.unslipped(found.trial, lost=True, gently=True)
        try:
            return found if other is found.trial else Found(other, tried(self.evidence, other))
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

    def room(self, trial: Trial) -> int:
        """Return how many effects may be added to a trial's."""
        return self.most - len(self.counted(trial.names))

    @staticmethod
    def counted(names: Collection[str]) -> set[str]:
        """Return the names of those effects that count."""
        return set(names) - {ZERO}

    def target(self, best: Trial, adapted: int, margin: float = ALIKE) -> float:
        """Return the sum of squares that a model must reach to matter beside another one.

        Parameters
        ----------
        best : Trial
            The other one.
        adapted : int
            How many numbers the model has.
        margin : float
            By how much it may be worse, over the noise's level.
        """
        penalty = math.log(max(best.fit.samples / self.level(), 2.0))
        return best.chi2 + self.level() * (margin + penalty * max(best.adapted - adapted, 0))

    def refit(
        self, trial: Trial, scores: Scores, places: Sequence[int], target: float = math.inf
    ) -> Found | None:
        """Return a trial's model with candidates, those at some places of the scores, fitted."""
        return self._refits.refit(trial, scores, places, target)

    def fitted(
        self, trial: Trial, scores: Scores, places: Sequence[int], target: float = math.inf
    ) -> Trial | None:
        """Return the same, not tried on what was held back."""
        return self._refits.fitted(trial, scores, places, target)

    def rival(
        self, trial: Trial, scores: Scores, place: int, target: float = math.inf
    ) -> Trial | None:
        """Return the same for one candidate, with all the steps that its target is worth."""
        found = self._refits.fitted(trial, scores, [place], target)
        if found is None or (found.fit.given_up and found.chi2 > target):
            return found
        try:
            return settled(self.evidence, found, target)
        except InputError:
            return found

    def accepts(self, current: Found, found: Found) -> bool:
        """Whether a model is better than one with fewer effects, by more than chance."""
        return self.gains(current.trial, found.trial) and self.holds(current, found, PATIENCE)

    def holds(self, current: Found, found: Found, patience: float = 0.0) -> bool:
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
