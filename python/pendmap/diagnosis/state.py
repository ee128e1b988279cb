"""What a search knows: fits, scores and hold-out results, each computed once."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.comparison.replay import Fits
from pendmap.diagnosis.baseline import taken_by
from pendmap.diagnosis.candidates import ZERO, candidates, choices_of, commonness
from pendmap.diagnosis.fitted_model import fitted, settled
from pendmap.diagnosis.held import Held, predictive, tried
from pendmap.diagnosis.model_error import model_errors, weighted
from pendmap.diagnosis.physical import within_physics
from pendmap.diagnosis.refit import Key, enlarged, key_of, refitted, without
from pendmap.diagnosis.scores import Scores, scores_of
from pendmap.errors import FitDiverged

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from pendmap.comparison.data import Evidence
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import Trial
    from pendmap.diagnosis.refit import Key
    from pendmap.diagnosis.thresholds import Thresholds
    from pendmap.model import Formula


SAME: Final = 0.2
"""Part of a standard error by which an error of the model may change and readings keep their
weights."""


@dataclasses.dataclass(frozen=True)
class Found:
    """A fitted model and how it does on what was held back."""

    trial: Trial
    held: Held

    @property
    def fits(self) -> Fits:
        """The fits to the records and to what was held back."""
        return Fits(self.trial.fit, self.held.fit)


class State:
    """Fits of a diagnosis, computed when they are asked for."""

    def __init__(  # noqa: PLR0913 (what is searched, and among what)
        self,
        evidence: Evidence,
        base: Trial,
        thresholds: Thresholds,
        most: int,
        without: Collection[str],
        *,
        own: Collection[Formula] = (),
    ) -> None:
        self.records = self.evidence = evidence
        self.thresholds, self.most = thresholds, most
        self.left_out, self.own = without, own
        self.errors = (0.0,) * len(evidence.fitted)
        self.attempts: list[Attempt] = []
        self._begin(base)

    def _begin(self, base: Trial) -> None:
        self.base = self._best = base
        self._fits: dict[Key, Trial] = {key_of(()): base}
        self._without: set[tuple[Key, str]] = set()
        # By the fit that they begin at: a better one of the same effects has its own.
        self._refits: dict[tuple[int, Key], tuple[Trial, Trial | None]] = {}
        self._scores: dict[int, tuple[Trial, Scores]] = {}
        self._held: dict[int, tuple[Trial, Held | None, tuple[float, ...]]] = {}

    def weigh(self, best: Trial) -> Trial:
        """Give readings the error that a model leaves, and return the model fitted with it.

        Fits, scores and hold-out results with other weights are forgotten. Nothing changes where
        the errors are nearly what they were, or where a motion is lost with the new ones.
        """
        errors = model_errors(self.records, best)
        pairs = zip(errors, self.errors, self.records.fitted, strict=True)
        if all(abs(new - old) < SAME * np.hypot(old, np.mean(r.sigma)) for new, old, r in pairs):
            return best
        before = self.errors, self.evidence
        self.errors, self.evidence = errors, weighted(self.records, errors)
        try:
            base = self._again(self.base)
            again = self._again(best) if best.chosen else base
        except FitDiverged:
            self.errors, self.evidence = before
            return best
        self._begin(base)
        return self.keep(again) or best

    def _again(self, trial: Trial) -> Trial:
        """Return a model fitted with the weights that readings have now."""
        found = fitted(
            self.evidence,
            trial.fit.model,
            [*trial.free, *trial.zeroed],
            trial.chosen,
            start=dict.fromkeys(trial.zeroed, 0.0) | trial.start,
            windows=trial.fit.windows,
        )
        return found if not trial.chosen else within_physics(self.evidence, found) or found

    @property
    def level(self) -> float:
        """Sum of squares of one independent reading, by the residuals of the best model."""
        return self._best.level

    def accept(self, trial: Trial) -> None:
        """Take an accepted model for the best one, if it fits better than those before it."""
        if trial.chi2 < self._best.chi2:
            self._best = trial

    def keep(self, trial: Trial | None) -> Trial | None:
        """Remember a fit; return the best one of the same effects."""
        if trial is None:
            return None
        key = key_of(trial.chosen)
        known = self._fits.get(key)
        best = trial if known is None or trial.chi2 < known.chi2 else known
        self._fits[key] = best
        return best

    def settled(self, trial: Trial) -> Trial:
        """Return a fit that has converged, within physics."""
        if trial.fit.converged:
            return trial
        try:
            full = within_physics(self.evidence, settled(self.evidence, trial, self.level))
        except FitDiverged:
            return trial
        return self.keep(full if full is not None else trial) or trial

    def scores(self, trial: Trial) -> Scores:
        """Return the scores of all candidates at a fit."""
        if id(trial) not in self._scores:
            self._scores[id(trial)] = trial, scores_of(self.evidence, trial, self._pool(trial))
        return self._scores[id(trial)][1]

    def _pool(self, trial: Trial) -> list[list[Candidate]]:
        """Return the candidates that a model does not have, each in all its shapes."""
        return candidates(
            taken_by(trial), driven=self.evidence.forced, without=self.left_out, own=self.own
        )

    def refit(self, trial: Trial, places: Sequence[int]) -> Trial | None:
        """Return a trial's model with candidates, those at some places of its scores."""
        scores = self.scores(trial)
        key = id(trial), key_of([scores.scores[k].candidate for k in places])
        if key not in self._refits:
            found = refitted(self.evidence, self.thresholds, trial, scores, places, self.level)
            self._refits[key] = trial, self.keep(found)
        return self._refits[key][1]

    def rest(self, trial: Trial, dropped: Candidate) -> Trial:
        """Return the best model with a trial's other effects, with fewer where these do no good."""
        chosen = tuple(c for c in trial.chosen if c.name != dropped.name)
        way = key_of(trial.chosen), dropped.name
        if way not in self._without:
            self._without.add(way)
            target = self._fewer(chosen).chi2
            self.keep(without(self.evidence, trial, dropped, self.level, target))
            rest = self._fewer(chosen)
            if len(rest.chosen) < len(chosen):
                # More parameters fit no worse: the motion was lost on the way.
                self.keep(enlarged(self.evidence, rest, trial, chosen, self.level))
        return self._fewer(chosen)

    def _fewer(self, chosen: Sequence[Candidate]) -> Trial:
        """Return the best known model with no other effects than these."""
        names = {candidate.name for candidate in chosen}
        known = (t for t in self._fits.values() if names.issuperset(t.names))
        return min(known, key=lambda t: t.chi2)

    def simplest(self, best: Trial) -> Trial:
        """Return the simplest, then commonest, fit that the records do not tell from the best.

        The given model stands where none is as good as the best accepted one.
        """
        reach = max(self._best.chi2 + self.thresholds.alike * self.level, best.chi2)

        def order(trial: Trial) -> tuple[float, ...]:
            common = sum(commonness(name) for name in trial.names)
            return trial.adapted, common, trial.chi2

        alike = [t for t in self._fits.values() if t.chi2 <= reach and self.room(t) >= 0]
        for trial in sorted((best, *alike), key=order):
            if trial is best or self.foretells(best, trial):
                return trial
        return best

    def held(self, trial: Trial) -> Held | None:
        """Return how a model does on what was held back; none where its motion is lost there."""
        return self._tried(trial)[1]

    def sets(self, trial: Trial) -> tuple[float, ...]:
        """Return what each held-out set adds to a model's sum of squares."""
        return self._tried(trial)[2]

    def _tried(self, trial: Trial) -> tuple[Trial, Held | None, tuple[float, ...]]:
        if id(trial) not in self._held:
            try:
                held = tried(self.evidence, trial)
                sets = predictive(self.evidence, trial, held, self.level)
            except FitDiverged:
                held, sets = None, (math.inf,)
            self._held[id(trial)] = trial, held, sets
        return self._held[id(trial)]

    def found(self, trial: Trial) -> Found:
        """Return a model with its hold-out results; FitDiverged where its motion is lost."""
        held = self.held(trial)
        return Found(trial, held if held is not None else tried(self.evidence, trial))

    def room(self, trial: Trial) -> int:
        """Return how many effects may be added to a trial's."""
        return self.most - len(self.counted(trial))

    @staticmethod
    def counted(trial: Trial) -> set[str]:
        """Return the names of the added effects that count."""
        return set(trial.names) - {ZERO}

    def cost(self, trial: Trial, level: float | None = None) -> float:
        """Return the sum of squares in independent readings with Schwarz's penalty.

        What was chosen among many values costs twice the logarithm of their number besides.
        """
        level = level or self.level
        readings = max(trial.fit.samples / level, self._best.chi2 / level, 3.0)
        penalty = trial.adapted * math.log(min(readings, trial.fit.samples))
        return trial.chi2 / level + penalty + sum(c.looks for c in trial.chosen)

    def chance(self, rest: Trial, full: Trial) -> float:
        """Return the probability that noise alone gains as much as the further effects of a model.

        Fisher's F of the fall of the sum of squares over the greater one of the noise and of what
        the larger model leaves, times the number of candidates and that of the effect's shapes.
        """
        from scipy.special import fdtrc  # noqa: PLC0415 (where it is needed)

        more = full.adapted - rest.adapted
        gain = rest.chi2 - full.chi2
        if more <= 0:
            return 0.0 if gain > 0 else 1.0
        readings = max(full.chi2 / full.level, 2.0)
        chance = max(
            full.remainder.chance_of(gain, more, full.level if full.level < 1 else 0.0),
            float(fdtrc(more, readings, max(gain, 0.0) / more / full.level)),
        )
        choices = choices_of([candidate for shapes in self._pool(rest) for candidate in shapes])
        own = max((choices.get(c.name, 1) for c in full.chosen), default=1)
        return min(chance * len(choices) * own, 1.0)

    def gains(self, rest: Trial, full: Trial) -> bool:
        """Whether further effects gain more than chance, and close what they must.

        Away from the noise a frequency or an instant of a thousand fits part of anything: an effect
        that has one closes the whole gap or none.
        """
        if self.chance(rest, full) >= self.thresholds.chance:
            return False
        sought = any(c.sought and c.name not in rest.names for c in full.chosen)
        return self.explains(full) or (not sought and self.closes(rest, full))

    def explains(self, trial: Trial) -> bool:
        """Whether noise alone leaves as much as a model."""
        return trial.remainder.chance >= self.thresholds.rest

    def closes(self, rest: Trial, full: Trial) -> bool:
        """Whether a model closes the share of another one's gap that it has to, or all of it."""
        return self.explains(full) or self.closed(rest, full) >= self.thresholds.closes

    @staticmethod
    def closed(rest: Trial, full: Trial) -> float:
        """Return the share of the squared gap above the noise that further effects close."""
        noise = min(full.remainder.level, full.chi2 / max(full.fit.degrees, 1))
        gap = rest.chi2 - noise * rest.fit.degrees
        return (rest.chi2 - full.chi2) / gap if gap > 0 else 1.0

    def holds(self, rest: Trial, full: Trial) -> bool:
        """Whether further effects lose on no held-out set.

        A set loses by more than a few independent readings, or the sum of squares of whole runs,
        with parameters frozen, rises by more than the factor ``forecast``.
        """
        before, after = self.held(rest), self.held(full)
        if before is None or after is None:
            return False
        noise = full.remainder.level
        pairs = zip(self.sets(rest), self.sets(full), strict=False)
        most = self.thresholds.forecast * max(before.chi2, noise * after.degrees)
        if not self.evidence.inside and after.chi2 > most:
            return False
        return all(more - less <= self.thresholds.loss * full.level for less, more in pairs)

    def foretells(self, best: Trial, other: Trial) -> bool:
        """Whether held-out sets do not tell a model from the best one."""
        pairs = zip(self.sets(best), self.sets(other), strict=False)
        most = self.thresholds.alike * max(best.level, self.level)
        return all(more - less <= most for less, more in pairs)


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
