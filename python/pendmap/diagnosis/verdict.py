"""The five verdicts, and what they rest on."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from pendmap.diagnosis.alternatives import Standing, standing_of
from pendmap.diagnosis.candidates import choices_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pendmap.diagnosis.scores import Scores
    from pendmap.diagnosis.state import Found, State
    from pendmap.residuals.by_run import RunByRun

Verdict = Literal["none", "named", "partial", "ambiguous", "unknown"]

SEVERAL: Final = 1.0
"""Standard errors by which the greatest of several runs counts as less than all together."""


@dataclasses.dataclass(frozen=True)
class Judgement:
    """What a search amounts to."""

    # ``none``: the baseline describes the records; ``named``: effects explain all; ``ambiguous``: a
    # class of effects does, which these records do not tell apart; ``partial``: effects close most
    # of the gap and something is left; ``unknown``: something is missing that no candidate
    # explains.
    verdict: Verdict
    standings: tuple[Standing, ...]  # The effects that were found, among their rivals
    left: float  # The slow part of what is left, over its standard error
    # Sum of squares over degrees of freedom, and up to where chance and the doubt about the noise
    # allow it: ``1 + 4 sqrt(2 / N + 4 r^2)``.
    ratio: float
    ratio_allowed: float
    ratio_held: float  # Sum of squares over degrees of freedom on what was held back
    # Share of the squared gap above the noise that the effects close on what was fitted.
    closed: float
    # How differently the runs would have the parameters, over the standard error of that (Cochran's
    # Q less its degrees of freedom over ``sqrt(2 degrees)``).
    uneven: float
    # That noise alone would show such a torque over angle, velocity, amplitude, drive phase or time
    # as is left.
    chance: float
    form: Form  # What is left, looked for in every direction
    # That the name of each standing, or one of its class, is right.
    probabilities: tuple[float, ...]
    # Whether names are given with reserve: something is left, or one of them is not sure.
    approximate: bool


def judge(state: State, best: Found, runs: RunByRun, chance: float) -> Judgement:
    """Return the verdict on a search."""
    limits, trial = state.thresholds, best.trial
    degrees = max(trial.fit.degrees, 1)
    # The doubt about the noise as it is seen without a model, run by run.
    allowed = 1 + 4 * math.sqrt(2 / degrees + 4 * state.evidence.doubt**2)
    ratio = trial.chi2 / degrees
    # The greatest of several runs is greater by chance.
    left = max(trial.remainder.z, max(trial.remainder.by_run) - SEVERAL)
    held_out = limits.forecast * max(ratio, allowed)
    others = {
        "torque": chance,
        "slow": trial.remainder.chance,
        "runs": runs.chance,
        "held_out": _foretold(best, held_out) if trial.chosen else 1.0,
    }
    form = form_of(state.scores(trial), trial.remainder.chance_of, others)
    rest = form.chance < limits.rest
    closed = _closed(state, best)
    standings = tuple(
        sorted(
            (standing_of(state, trial, candidate) for candidate in trial.chosen),
            key=lambda s: -s.gain,
        )
    )
    sure = probabilities(form.chance, [s.gain for s in standings])
    verdict: Verdict
    if not standings:
        verdict = "unknown" if rest else "none"
    elif rest:
        verdict = "partial" if closed >= limits.closes else "unknown"
    elif any(len(standing.equivalent) > 1 for standing in standings):
        verdict = "ambiguous"
    else:
        verdict = "named"
    return Judgement(
        verdict,
        standings,
        left,
        ratio,
        allowed,
        best.held.chi2 / max(best.held.degrees, 1),
        closed,
        runs.uneven,
        chance,
        form,
        sure,
        verdict == "partial" or min(sure, default=1.0) < limits.sure,
    )


def _foretold(best: Found, ratio: float) -> float:
    """Return the chance that noise alone leaves as much on what was held back.

    ``ratio`` is the sum of squares per reading that counts as noise.
    """
    from scipy.special import chdtrc  # noqa: PLC0415 (where it is needed)

    readings = max(best.held.degrees / best.trial.level, 1.0)
    return float(chdtrc(readings, best.held.chi2 / ratio / best.trial.level))


def _closed(state: State, best: Found) -> float:
    """Return the share of the gap closed on what was fitted.

    The gap is the sum of squares above that of noise, as the best model's spectrum shows it; 1
    where it is no more than noise scatters.
    """
    trial, base = best.trial, state.base
    degrees = max(trial.fit.degrees, 1)
    noise = min(trial.remainder.level, trial.chi2 / degrees)
    gap = base.chi2 - noise * degrees
    if gap <= noise * math.sqrt(2 * degrees):
        return 1.0
    return float(np.clip(1 - max(trial.chi2 - noise * degrees, 0.0) / gap, -1.0, 1.0))


@dataclasses.dataclass(frozen=True)
class Form:
    """What is left beside the best model, looked for in every direction that has a name.

    A sum of squares tells little of a form that is nearly right: what is left of it lies in one
    direction among hundreds. So each says by itself how probable it is that noise leaves so much:
    every other effect in every shape (Rao's score at the best model), the torque over angle,
    velocity, amplitude, phase and time, the slow part of the residuals, whether all runs would have
    the same parameters, and the residuals of what was held back.
    """

    # By what was looked at, that noise alone leaves as much: ``effects`` of the library that are
    # not in the model, ``torque``, ``slow`` residuals, ``runs``, ``held_out`` sets.
    chances: Mapping[str, float]
    further: str | None  # The effect that would take up most of what is left

    @property
    def chance(self) -> float:
        """The least of all chances, times how many there are (Bonferroni)."""
        return min(min(self.chances.values()) * len(self.chances), 1.0)


def form_of(
    scores: Scores, chance_of: Callable[[float, int], float], others: Mapping[str, float]
) -> Form:
    """Return what is left.

    ``others`` are the chances that noise alone leaves as much of all else that was looked at.
    """
    choices = choices_of([score.candidate for score in scores.scores])
    tails = {}
    for k in scores.best():
        score = scores.scores[k]
        name = score.candidate.name
        if score.gain > 0:
            tails[name] = choices[name] * chance_of(score.gain, len(scores.columns[k]))
    further = min(tails, key=lambda name: tails[name], default=None)
    effects = 1.0 if further is None else min(tails[further] * len(tails), 1.0)
    return Form({"effects": effects, **others}, further)


COEFFICIENTS: Final = (1.94, 0.13, -1.65, 0.74, 0.8)
"""``b0`` to ``b4`` from 163 names, of which 111 were right: of 227 experiments of the seed 8401, 67
of them with disturbances that no effect describes."""

LEAST_CHANCE: Final = 1e-6
"""Below this a chance says no more."""

GAINS: Final = (10.0, 1e5)
"""Gains beyond these are taken for these."""


def features(chance: float, gains: Sequence[float]) -> list[tuple[float, ...]]:
    """Return for each name what its probability goes by.

    Parameters
    ----------
    chance : float
        That noise alone leaves as much as is left (:class:`pendmap.diagnosis.verdict.Form`).
    gains : sequence of float
        By how much the sum of squares rises without each effect, over the noise's level.
    """
    low, high = GAINS
    kept = [min(max(gain, low), high) for gain in gains]
    left = math.log10(max(chance, LEAST_CHANCE))
    most = max(kept, default=low)
    return [
        (1.0, left, len(kept) - 1.0, math.log10(gain / most), math.log10(most / 100))
        for gain in kept
    ]


def probabilities(chance: float, gains: Sequence[float]) -> tuple[float, ...]:
    """Return the probability that each name, or one of its class, is right.

    ``P = 1 / (1 + exp(-z))``, ``z = b0 + b1 log10(chance) + b2 (effects - 1)
    + b3 log10(gain / strongest) + b4 log10(strongest / 100)``, fitted to right and wrong names of
    blind experiments (``benchmarks/blind/calibration.py``), in a part of which the true effect was
    withheld: then the nearest one takes its place, or two or three together.
    """
    rows = features(chance, gains)
    sums = [sum(b * x for b, x in zip(COEFFICIENTS, row, strict=True)) for row in rows]
    return tuple(1.0 / (1.0 + math.exp(-z)) for z in sums)
