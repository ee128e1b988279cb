"""The five verdicts, the alternatives of each effect, and the statistics of both."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from pendmap.diagnosis.candidates import count_choices
from pendmap.diagnosis.fitted_model import residual_ratios
from pendmap.diagnosis.scores import CONTAINS
from pendmap.diagnosis.search import fit_alternatives

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import FittedModel
    from pendmap.diagnosis.scores import Scores
    from pendmap.diagnosis.state import ScoredModel, State
    from pendmap.diagnosis.thresholds import Thresholds
    from pendmap.residuals.by_run import RunByRun

Verdict = Literal["none", "named", "partial", "ambiguous", "unknown"]

SEVERAL: Final = 1.0  # Standard errors subtracted from the largest excess of several runs

WHOLE: Final = 0.99  # Share of the squared gap from which it is closed, if all is within SLIGHT

SLIGHT: Final = 1.05  # Residual over the noise up to which nothing of use is missing

THIRDS: Final = 3  # Number of parts of a single run; a name must be better without any one

COEFFICIENTS: Final = (1.94, 0.13, -1.65, 0.74, 0.8)
"""``b0`` to ``b4`` of the probability of a name, from 163 names, of which 111 were right: 227
experiments of the seed 8401, 67 of them with disturbances that no effect describes."""

LEAST_CHANCE: Final = 1e-6
"""Lower bound of the chance of the residuals in the probability of a name."""

GAINS: Final = (10.0, 1e5)  # Range to which gains are clipped for the probability of a name


@dataclasses.dataclass(frozen=True)
class Alternative:
    """An effect that could replace an accepted one."""

    candidate: Candidate  # Effect and shape
    gain: float  # Fall of the sum of squares with it, in independent readings
    # Gain of the accepted effect minus its own, each minus the gain of a choice by chance: twice
    # the difference of log-likelihoods.
    behind: float
    separation: float  # ``s = 1 - gain / gain of the accepted effect``
    refitted: bool  # Whether the gain is that of a fit, not of a score
    # Whether the accepted effect is a special case of it, and it gains no more than by chance.
    contains: bool
    # Whether the records do not distinguish them: it is behind by less than the threshold, or by
    # the readings of one run alone (a third of a single run), unless the accepted effect acts once.
    alike: bool


@dataclasses.dataclass(frozen=True)
class Identifiability:
    """An accepted effect with its alternatives."""

    candidate: Candidate  # The effect
    gain: float  # Fall of the sum of squares with it, in independent readings
    closed: float  # Share of the squared gap above the noise that it closes with the others
    alternatives: tuple[Alternative, ...]  # The nearest first

    @property
    def equivalent(self) -> list[str]:
        """Names that the records do not distinguish, its own first.

        If there are several, effects that contain one of them are included.
        """
        alike = [r for r in self.alternatives if r.alike and not r.contains]
        wider = [r for r in self.alternatives if r.contains] if alike else []
        return [self.candidate.name, *(r.candidate.name for r in (*alike, *wider))]

    @property
    def share(self) -> float:
        """Share of its likelihood among all names, with equal prior odds."""
        others = [r for r in self.alternatives if not r.contains]
        return 1.0 / (1.0 + sum([math.exp(-0.5 * max(r.behind, 0.0)) for r in others]))


def compare_alternatives(state: State, best: FittedModel, candidate: Candidate) -> Identifiability:
    """Return an effect of the best model with its alternatives."""
    level = best.level
    reduced = state.leave_out(best, candidate)
    gain = (reduced.chi2 - best.chi2) / level
    scores = state.scores(reduced)
    places = scores.best()
    place = next((k for k in places if scores.name(k) == candidate.name), None)
    if place is None:
        return Identifiability(candidate, gain, state.closed(reduced, best), ())
    fits = dict(fit_alternatives(state, best, candidate, reduced))
    alternatives = []
    for k in places:
        score, fit = scores.scores[k], fits.get(k)
        if k == place or score.gain <= 0:
            continue
        reached = score.gain / level
        if scores.same(place, k):
            reached = gain
        elif fit is not None:
            fit = state.converge(fit)
            reached = (reduced.chi2 - fit.chi2) / level
        more = score.candidate.count > candidate.count
        chosen = score.candidate.choice_gain - candidate.choice_gain
        behind, near = gain - reached + chosen, state.thresholds.alike
        contains = more and scores.likeness(place, k) > CONTAINS and behind > -near
        alike = behind < near
        if fit is not None and not alike and not candidate.once:
            # The accepted effect must be better without any one run, or any third of a single run.
            parts = _by_part(fit) - _by_part(best)
            alike = bool(parts.sum() - parts.max() + chosen * level < 0)
        apart, refitted = 1.0 - reached / gain if gain > 0 else 0.0, fit is not None
        other = Alternative(score.candidate, reached, behind, apart, refitted, contains, alike)
        alternatives.append(other)
    alternatives.sort(key=lambda r: r.behind)
    return Identifiability(candidate, gain, state.closed(reduced, best), tuple(alternatives))


def _by_part(fitted: FittedModel) -> np.ndarray:
    """Return the sum of squares of each run, or of each third of a single one."""
    pairs = zip(fitted.runs, fitted.fit.white, strict=True)
    sums = [white[np.isfinite(white) & run.counted] ** 2 for run, white in pairs]
    parts = sums if len(sums) > 1 else np.array_split(sums[0], THIRDS)
    return np.array([float(np.sum(part)) for part in parts])


@dataclasses.dataclass(frozen=True)
class GoodnessOfFit:
    """Probabilities that noise alone leaves the residuals of the best model, by test.

    The sum of squares is insensitive to a form that is nearly right, whose error lies in one
    direction among hundreds, so each direction is tested separately.
    """

    # By test: other ``effects`` of the library in every shape (Rao's score at the best model), the
    # ``torque`` over angle, velocity, amplitude, phase and time, ``slow`` residuals, equal
    # parameters of all ``runs``, residuals of the ``held_out`` records.
    chances: Mapping[str, float]
    further: str | None  # The effect of the most significant score

    @property
    def chance(self) -> float:
        """Least of all probabilities, times their number (Bonferroni)."""
        return min(min(self.chances.values()) * len(self.chances), 1.0)


def assess_fit(
    scores: Scores, chance_of: Callable[[float, int], float], others: Mapping[str, float]
) -> GoodnessOfFit:
    """Return the goodness of fit from the scores of further effects and the other tests."""
    choices = count_choices([score.candidate for score in scores.scores])
    tails = {}
    for k in scores.best():
        score = scores.scores[k]
        name = score.candidate.name
        if score.gain > 0:
            tails[name] = choices[name] * chance_of(score.gain, len(scores.columns[k]))
    further = min(tails, key=lambda name: tails[name], default=None)
    effects = 1.0 if further is None else min(tails[further] * len(tails), 1.0)
    return GoodnessOfFit({"effects": effects, **others}, further)


@dataclasses.dataclass(frozen=True)
class Assessment:
    """Verdict and the statistics it is based on."""

    # ``none``: the baseline describes the records; ``named``: effects explain all; ``ambiguous``: a
    # class of indistinguishable effects explains all; ``partial``: effects close most of the gap,
    # but not all; ``unknown``: no candidate explains the gap.
    verdict: Verdict
    identified: tuple[Identifiability, ...]  # The effects found, among their alternatives
    left: float  # Slow part of the residuals beyond noise, over its standard error
    # Mean of squared residuals over squared noise, in the run that exceeds what is allowed most.
    ratio: float
    # Greatest such ratio of noise, by chance, by the error ``r`` of its level and by its colour:
    # ``1 + 4 sqrt(2 / N + 4 r^2)``, times ``swell`` of the residuals.
    ratio_allowed: float
    ratio_held: float  # Sum of squares over degrees of freedom on the records held back
    closed: float  # Share of the squared gap above the noise that the effects close
    uneven: float  # Difference of parameters between runs, over its standard error (Cochran's Q)
    form: GoodnessOfFit
    probabilities: tuple[float, ...]  # That each name, or one of its class, is right
    further: bool  # Whether another effect would close its share of the slight gap that is left
    thresholds: Thresholds  # Thresholds of all decisions


def decide_verdict(state: State, best: ScoredModel, runs: RunByRun, chance: float) -> Assessment:
    """Return the verdict on a search."""
    from scipy.special import chdtrc  # noqa: PLC0415 (where it is needed)

    limits, fitted, held = state.thresholds, best.fitted, best.hold_out
    noise, degrees = fitted.noise, max(fitted.fit.degrees, 1)
    # The run that exceeds its noise most; the colour of residuals swells what white noise allows.
    rows = residual_ratios(state.records, fitted)
    _, ratio, white = max(rows, key=lambda row: row[1] / row[2])
    allowed = white * noise.swell
    # The largest of several excesses is larger by chance.
    left = max(noise.z, max(noise.by_run) - SEVERAL)
    held_out = 1.0
    if fitted.chosen:
        # Probability that noise of the greatest accepted ratio leaves the held-out residuals.
        scatter = 1 + 4 * math.sqrt(2 / degrees + 4 * state.data.doubt**2)
        most = limits.forecast * max(fitted.chi2 / degrees, scatter)
        readings = max(held.degrees / fitted.level, 1.0)
        held_out = float(chdtrc(readings, held.chi2 / most / fitted.level))
    others = {"torque": chance, "slow": noise.chance, "runs": runs.chance, "held_out": held_out}
    scores = state.scores(fitted)
    form = assess_fit(scores, noise.chance_of, others)
    gap = fitted.chi2 * (1 - (state.noise / fitted.fit.rms) ** 2)
    gain = max((score.gain for score in scores.scores), default=0.0)
    further = form.chances["effects"] < limits.rest and gain > limits.closes * gap
    chance_left = form.chance if ratio <= allowed else 0.0
    closed = state.closed(state.base, fitted)
    slight = closed >= WHOLE and fitted.fit.rms <= SLIGHT * state.noise
    lacks = chance_left < limits.rest and not slight
    compared = [compare_alternatives(state, fitted, candidate) for candidate in fitted.chosen]
    identified = tuple(sorted(compared, key=lambda s: -s.gain))
    sure = probabilities(chance_left, [s.gain for s in identified])
    verdict: Verdict
    if not identified:
        verdict = "unknown" if lacks else "none"
    elif lacks:
        verdict = "partial" if closed >= limits.closes else "unknown"
    elif any(len(effect.equivalent) > 1 for effect in identified):
        verdict = "ambiguous"
    else:
        verdict = "named"
    residuals = left, ratio, allowed, held.chi2 / max(held.degrees, 1), closed, runs.uneven
    return Assessment(verdict, identified, *residuals, form, sure, further, limits)


def features(chance: float, gains: Sequence[float]) -> list[tuple[float, ...]]:
    """Return the regressors of each name's probability in :func:`probabilities`."""
    low, high = GAINS
    clipped = [min(max(gain, low), high) for gain in gains]
    left = math.log10(max(chance, LEAST_CHANCE))
    most = max(clipped, default=low)
    return [
        (1.0, left, len(clipped) - 1.0, math.log10(gain / most), math.log10(most / 100))
        for gain in clipped
    ]


def probabilities(chance: float, gains: Sequence[float]) -> tuple[float, ...]:
    """Return the probability that each name, or one of its class, is right.

    ``P = 1 / (1 + exp(-z))``, ``z = b0 + b1 log10(chance) + b2 (effects - 1)
    + b3 log10(gain / strongest) + b4 log10(strongest / 100)``, with the ``chance`` of the goodness
    of fit and the gains without each effect over the noise's level. It was fitted to blind
    experiments (``benchmarks/blind/calibration.py``), some without the true effect among the
    candidates, in which the nearest effect or several together take its place.
    """
    rows = features(chance, gains)
    sums = [sum(b * x for b, x in zip(COEFFICIENTS, row, strict=True)) for row in rows]
    return tuple(1.0 / (1.0 + math.exp(-z)) for z in sums)
