"""State of a search: fits, scores and hold-out evaluations, each computed once."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.comparison.forecast import Fits, noise_rms, share_closed
from pendmap.diagnosis.candidates import ZERO, commonness, count_choices, list_candidates
from pendmap.diagnosis.fitted_model import (
    converge,
    fit_again,
    impose_physics,
    model_errors,
    none_if_diverged,
    weight_records,
)
from pendmap.diagnosis.hold_out import HoldOut, evaluate_hold_out, hold_out_losses
from pendmap.diagnosis.refit import add_effects, drop_effect, key_of, refit_with
from pendmap.diagnosis.scores import Scores, score_candidates
from pendmap.identification.experiment import CLOSED, MISSES

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from pendmap.comparison.data import DataSplit
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import FittedModel
    from pendmap.diagnosis.refit import Key
    from pendmap.diagnosis.thresholds import Thresholds
    from pendmap.model import Formula

SAME: Final = 0.2
"""Change of a run's model error, over its total error, below which readings keep their weights."""


@dataclasses.dataclass(frozen=True)
class ScoredModel:
    """A fitted model with its hold-out evaluation."""

    fitted: FittedModel
    hold_out: HoldOut

    @property
    def fits(self) -> Fits:
        """Fits to the fitted records and to the records held back."""
        return Fits(self.fitted.fit, self.hold_out.fit)


@dataclasses.dataclass(frozen=True)
class Attempt:
    """Candidates that were fitted, and whether they were accepted."""

    effects: tuple[str, ...]
    shape: dict[str, float]  # Shape of the first effect, SI
    score: float  # Gain promised by the score, in independent readings
    # Fall of the cost: sum of squares in independent readings with Schwarz's penalty.
    bic_gain: float
    # Least fall on a held-out set, in independent readings; None if unused.
    held_out_gain: float | None
    accepted: bool  # Whether the search continued with them
    stage: int  # Number of effects before they were added


class State:
    """Fits of a diagnosis, computed on demand."""

    def __init__(  # noqa: PLR0913 (what is searched, and among what)
        self,
        data: DataSplit,
        base: FittedModel,
        thresholds: Thresholds,
        most: int,
        without: Collection[str],
        *,
        formulas: Collection[Formula] = (),
    ) -> None:
        self.records = self.data = data
        self.noise = noise_rms(data.fitted)
        self.thresholds, self.most = thresholds, most
        self.left_out, self.own = without, formulas
        self.errors = (0.0,) * len(data.fitted)
        self.attempts: list[Attempt] = []
        self.moved: Callable[[], object] = lambda: None  # called after each fit
        self._begin(base)

    def _begin(self, base: FittedModel) -> None:
        """Discard all fits except that of a baseline."""
        self.base = self._best = base
        # The baseline within physical limits; as it is where no such fit is found.
        self.begun = impose_physics(self.data, base) or base
        self._fits: dict[Key, FittedModel] = {key_of(()): base}
        self._reduced: set[tuple[Key, str]] = set()
        self._refits: dict[tuple[FittedModel, Key], FittedModel | None] = {}
        self._scores: dict[FittedModel, Scores] = {}
        self._held: dict[FittedModel, HoldOut | None] = {}
        self._losses: dict[FittedModel, tuple[float, ...]] = {}

    def reweight(self, best: FittedModel) -> FittedModel:
        """Add a model's error to the weights of the readings; return the model fitted with them.

        All fits with other weights are discarded. Nothing changes if the errors are nearly the same
        as before, or if a fit diverges with the new ones.
        """
        errors = model_errors(self.records, best)
        pairs = zip(errors, self.errors, self.records.fitted, strict=True)
        if all(abs(new - old) < SAME * np.hypot(old, np.mean(r.sigma)) for new, old, r in pairs):
            return best
        before = self.errors, self.data
        self.errors, self.data = errors, weight_records(self.records, errors)
        base = self._fit_again(self.base)
        again = self._fit_again(best) if best.chosen else base
        if base is None or again is None:
            self.errors, self.data = before
            return best
        self._begin(base)
        return self.remember(again) or best

    def _fit_again(self, fitted: FittedModel) -> FittedModel | None:
        """Return a model fitted with the present weights of readings."""
        free = [*fitted.free, *fitted.zeroed]
        start = dict.fromkeys(fitted.zeroed, 0.0) | fitted.start
        fit = fit_again(self.data, fitted, free=free, start=start)
        if fit is None or not fitted.chosen:
            return fit
        return impose_physics(self.data, fit) or fit

    @property
    def level(self) -> float:
        """Sum of squares of one independent reading, from the best model's residuals."""
        return self._best.level

    def accept(self, fitted: FittedModel) -> None:
        """Set the best model to an accepted one that fits better."""
        if fitted.chi2 < self._best.chi2:
            self._best = fitted

    def remember(self, fitted: FittedModel | None) -> FittedModel | None:
        """Store a fit; return the best one with the same effects."""
        if fitted is None:
            return None
        self.moved()
        key = key_of(fitted.chosen)
        known = self._fits.get(key)
        best = fitted if known is None or fitted.chi2 < known.chi2 else known
        self._fits[key] = best
        return best

    def converge(self, fitted: FittedModel) -> FittedModel:
        """Return a converged fit, within physical limits."""
        full = converge(self.data, fitted, self.level)
        if full is None or full is fitted:
            return fitted
        return self.remember(impose_physics(self.data, full) or fitted) or fitted

    def scores(self, fitted: FittedModel) -> Scores:
        """Return the scores of all candidates at a fit."""
        if fitted not in self._scores:
            self.moved()
            self._scores[fitted] = score_candidates(self.data, fitted, self._candidates(fitted))
        return self._scores[fitted]

    def _candidates(self, fitted: FittedModel) -> list[list[Candidate]]:
        """Return the candidates that a model does not have, each in all its shapes."""
        return list_candidates(
            fitted.taken,
            driven=self.data.forced,
            without=self.left_out,
            user_formulas=self.own,
            reach=max(float(np.ptp(run.angle[run.counted])) for run in self.data.fitted),
        )

    def refit(self, fitted: FittedModel, places: Sequence[int]) -> FittedModel | None:
        """Return a model with the candidates at some places of its scores; None if it diverges."""
        scores = self.scores(fitted)
        key = fitted, key_of([scores.scores[k].candidate for k in places])
        if key not in self._refits:
            fit = refit_with(self.data, self.thresholds, fitted, scores, places, self.level)
            self._refits[key] = self.remember(fit)
        return self._refits[key]

    def leave_out(self, fitted: FittedModel, dropped: Candidate) -> FittedModel:
        """Return the best known model with a subset of a model's effects other than ``dropped``."""
        chosen = tuple(c for c in fitted.chosen if c.name != dropped.name)
        key = key_of(fitted.chosen), dropped.name
        if key not in self._reduced:
            self._reduced.add(key)
            target = self._best_among(chosen).chi2
            self.remember(drop_effect(self.data, fitted, dropped, self.level, target))
            reduced = self._best_among(chosen)
            if len(reduced.chosen) < len(chosen):
                # A larger model fits at least as well: the fit lost the motion.
                self.remember(add_effects(self.data, reduced, fitted, chosen, self.level))
        return self._best_among(chosen)

    def _best_among(self, chosen: Sequence[Candidate]) -> FittedModel:
        """Return the best known model with a subset of ``chosen``."""
        names = {candidate.name for candidate in chosen}
        known = (t for t in self._fits.values() if names.issuperset(t.names))
        return min(known, key=lambda t: t.chi2)

    def simplest(self, best: FittedModel) -> FittedModel:
        """Return the simplest, then commonest, model that is indistinguishable from the best.

        This is the given model if no known one is as good as the best accepted one.
        """
        reach = max(self._best.chi2 + self.thresholds.alike * self.level, best.chi2)
        most = self.thresholds.alike * max(best.level, self.level)

        def order(fitted: FittedModel) -> tuple[float, ...]:
            common = sum(commonness(name) for name in fitted.names)
            return fitted.adapted, common, fitted.chi2

        alike = [t for t in self._fits.values() if t.chi2 <= reach and self.remaining(t) >= 0]
        # Held-out sets must not distinguish it from the best one either.
        return next(
            fitted
            for fitted in sorted((best, *alike), key=order)
            if fitted is best or self._loses_at_most(most, best, fitted)
        )

    def with_core(self, last: FittedModel, core: FittedModel | None) -> FittedModel:
        """Return a model without effects with that of the core if it halves the squared gap.

        Coloured residuals have too few independent readings for a significant gain: instead the
        gap without the effect must be halved in all records, with its share of those held back.
        """
        gap = self.begun.fit.rms > MISSES * self.noise and 0 < self.most == self.remaining(last)
        full = self.remember(self._fit_again(core)) if core is not None and gap else None
        if full is None:
            return last
        for part in (*(self.leave_out(full, candidate) for candidate in full.chosen), full):
            effect = next((c for c in part.chosen if c.name != ZERO), None)
            if effect is not None and {*last.names} <= {*part.names}:
                less = self.leave_out(part, effect)
                if self._halves_gap(less if less.chosen else self.begun, part):
                    return part
        return last

    def _halves_gap(self, reduced: FittedModel, full: FittedModel) -> bool:
        """Return whether a model halves another's squared gap, and closes a third of that held."""
        before, after = self.hold_out(reduced), self.hold_out(full)
        if before is None or after is None:
            return False
        parts = [(full.fit.samples, reduced.fit.rms, full.fit.rms, self.noise)]
        parts += [(after.fit.samples, before.fit.rms, after.fit.rms, noise_rms(self.records.held))]
        count, *squares = np.array([(n, *(n * x**2 for x in part)) for n, *part in parts]).T
        whole = share_closed(*(math.sqrt(x.sum() / count.sum()) for x in squares))
        return whole >= 1 - CLOSED and share_closed(*parts[1][1:]) >= self.thresholds.closes

    def hold_out(self, fitted: FittedModel) -> HoldOut | None:
        """Return the hold-out evaluation of a model; None if it diverges."""
        if fitted not in self._held:
            self._held[fitted] = none_if_diverged(evaluate_hold_out)(self.data, fitted)
        return self._held[fitted]

    def hold_out_losses(self, fitted: FittedModel) -> tuple[float, ...]:
        """Return the increase of a model's sum of squares by each held-out set."""
        if fitted not in self._losses:
            held = self.hold_out(fitted)
            losses: tuple[float, ...] = (math.inf,)
            if held is not None:
                losses = hold_out_losses(self.data, fitted, held, self.level)
            self._losses[fitted] = losses
        return self._losses[fitted]

    def scored(self, fitted: FittedModel) -> ScoredModel:
        """Return a model with its hold-out evaluation; raise FitDiverged if that diverges."""
        return ScoredModel(fitted, self.hold_out(fitted) or evaluate_hold_out(self.data, fitted))

    def remaining(self, fitted: FittedModel) -> int:
        """Return how many effects may be added to a model; the sensor's zero is not included."""
        return self.most - len(set(fitted.names) - {ZERO})

    def cost(self, fitted: FittedModel, level: float | None = None) -> float:
        """Return the sum of squares in independent readings with Schwarz's penalty.

        A choice among many values adds twice the logarithm of their number.
        """
        level = level or self.level
        readings = max(fitted.fit.samples / level, self._best.chi2 / level, 3.0)
        penalty = fitted.adapted * math.log(min(readings, fitted.fit.samples))
        return fitted.chi2 / level + penalty + sum(c.choice_gain for c in fitted.chosen)

    def chance(self, reduced: FittedModel, full: FittedModel) -> float:
        """Return the probability that noise alone gains as much as the further effects.

        Fisher's F of the fall of the sum of squares over the greater of the noise and the residuals
        of the full model, times the number of candidates and of the effect's shapes (Bonferroni).
        """
        from scipy.special import fdtrc  # noqa: PLC0415 (where it is needed)

        more = full.adapted - reduced.adapted
        gain = reduced.chi2 - full.chi2
        if more <= 0:
            return 0.0 if gain > 0 else 1.0
        readings = max(full.chi2 / full.level, 2.0)
        chance = max(
            full.noise.chance_of(gain, more, full.level if full.level < 1 else 0.0),
            float(fdtrc(more, readings, max(gain, 0.0) / more / full.level)),
        )
        shapes = [candidate for group in self._candidates(reduced) for candidate in group]
        choices = count_choices(shapes)
        shape_choices = max((choices.get(c.name, 1) for c in full.chosen), default=1)
        return min(chance * len(choices) * shape_choices, 1.0)

    def is_significant(self, reduced: FittedModel, full: FittedModel) -> bool:
        """Return whether further effects gain more than chance, and close their share of the gap.

        One of a thousand frequencies or instants always fits part of a gap far above the noise, so
        an effect that has one must close all of it.
        """
        if self.chance(reduced, full) >= self.thresholds.chance:
            return False
        sought = any(c.sought and c.name not in reduced.names for c in full.chosen)
        return self.explains(full) or (not sought and self.closes_enough(reduced, full))

    def explains(self, fitted: FittedModel) -> bool:
        """Return whether the residuals of a model are explained by noise alone."""
        return fitted.noise.chance >= self.thresholds.rest

    def closes_enough(self, reduced: FittedModel, full: FittedModel) -> bool:
        """Return whether further effects close their share of the gap, or all of it."""
        return self.explains(full) or self.closed(reduced, full) >= self.thresholds.closes

    def closed(self, reduced: FittedModel, full: FittedModel) -> float:
        """Return the share of the squared gap above the noise that further effects close."""
        # A model with more effects than the baseline that fits worse has lost the motion.
        before = min(reduced.fit.rms, self.begun.fit.rms) if reduced.chosen else self.begun.fit.rms
        return share_closed(before, full.fit.rms, self.noise)

    def keeps_hold_out(self, reduced: FittedModel, full: FittedModel) -> bool:
        """Return whether further effects worsen no held-out set.

        A set is worse if its loss exceeds a few independent readings, or if the sum of squares of
        whole runs, with fixed parameters, rises by more than the factor ``forecast``.
        """
        before, after = self.hold_out(reduced), self.hold_out(full)
        if before is None or after is None:
            return False
        most = self.thresholds.forecast * max(before.chi2, full.noise.level * after.degrees)
        if not self.data.inside and after.chi2 > most:
            return False
        return self._loses_at_most(self.thresholds.loss * full.level, reduced, full)

    def _loses_at_most(self, most: float, one: FittedModel, other: FittedModel) -> bool:
        pairs = zip(self.hold_out_losses(one), self.hold_out_losses(other), strict=False)
        return all(after - before <= most for before, after in pairs)
