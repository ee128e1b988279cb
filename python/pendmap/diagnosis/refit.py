"""Candidates fitted with a model's own parameters, and models without one of their effects."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

from pendmap.diagnosis.fitted_model import (
    LITTLE,
    Trial,
    fitted,
    with_candidates,
)
from pendmap.diagnosis.physical import within_physics
from pendmap.errors import FitDiverged
from pendmap.identification.fit import fit_runs

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pendmap.comparison.data import Evidence
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import Trial
    from pendmap.diagnosis.scores import Score, Scores
    from pendmap.diagnosis.thresholds import Thresholds


KICK: Final = 1e-3
"""Part of the score's step from which a candidate's size starts: far from the fit the step of all
parameters together leads astray, and a phase needs a size above 0."""

FAINT: Final = 5.0
"""Standard errors of a size within which the covariance says where the others go without it."""

Key = frozenset[tuple[str, tuple[tuple[str, float], ...]]]


def key_of(chosen: Sequence[Candidate]) -> Key:
    """Return what a set of candidates is known by."""
    return frozenset((c.name, tuple(sorted(c.shape.items()))) for c in chosen)


def best_of(*trials: Trial | None) -> Trial | None:
    """Return the fit with the least sum of squares; none where all are lost."""
    return min((t for t in trials if t is not None), key=lambda t: t.chi2, default=None)


def refitted(  # noqa: PLR0913, PLR0917 (what is fitted, and what decides)
    evidence: Evidence,
    thresholds: Thresholds,
    trial: Trial,
    scores: Scores,
    places: Sequence[int],
    level: float,
) -> Trial | None:
    """Return a model with candidates fitted to the records within physics; none where it is lost.

    The fit starts at the trial's motion with sizes of nearly 0, in the best shapes by their scores,
    and where it gains far less than promised again at the sizes of the score.
    """
    own = [scores.scores[k] for k in places]
    added = [score.candidate for score in own]
    step = {name: value for score in own for name, value in score.start.items()}
    sizes = {candidate.free[0] for candidate in added}

    def fit(added: Sequence[Candidate], step: dict[str, float], *, short: bool) -> Trial | None:
        try:
            return with_candidates(evidence, trial, added, step, level=level, short=short)
        except FitDiverged:
            return None  # the start leads out of the range of numbers

    def kicked(step: dict[str, float]) -> dict[str, float]:
        return {name: KICK * v if name in sizes else v for name, v in step.items()}

    found = fit(added, kicked(step), short=False)
    for k in _other_shapes(scores, places, thresholds):
        other = scores.scores[k]
        found = best_of(found, fit([other.candidate], kicked(other.start), short=False))
    promised = thresholds.short * scores.together(places)
    if found is None or trial.chi2 - found.chi2 < promised:
        found = best_of(found, fit(added, step, short=False))
    if found is None or found.chi2 > trial.chi2:
        # More parameters fit no worse: the motion was lost on the way.
        found = best_of(found, fit(added, step, short=True))
    if found is None or found.chi2 > trial.chi2:
        return None
    found = within_physics(evidence, better_side(evidence, found), trial.chi2)
    return found if found is not None and found.chi2 <= trial.chi2 else None


def _other_shapes(scores: Scores, places: Sequence[int], thresholds: Thresholds) -> list[int]:
    """Return the next best shapes of a candidate alone; an exponent is found from any start."""
    if len(places) > 1:
        return []
    one = scores.scores[places[0]]
    if not one.candidate.adapted or one.candidate.exponents:
        return []
    shapes = [
        k
        for k, s in enumerate(scores.scores)
        if s.candidate.name == one.candidate.name
        and k != places[0]
        and s.gain > thresholds.worth * one.gain
    ]
    return sorted(shapes, key=lambda k: -scores.scores[k].gain)[: thresholds.shapes - 1]


def without(
    evidence: Evidence, trial: Trial, dropped: Candidate, level: float, target: float = math.inf
) -> Trial | None:
    """Return a trial's model without one of its effects, fitted from the trial's motion.

    The fit is given up where it promises to end far above the sum of squares ``target``.
    """
    gone = {*dropped.free, *dropped.adapted}
    model = trial.fit.model
    own: dict[str, Any] = {name: 0.0 for name in gone if name in {"Tr", "torque"}}
    effects = tuple(e for e in model.effects if e.name != dropped.name)
    # The others move by what the covariance says, where that reaches so far.
    start = trial.start_without([dropped.free[0]]) if _faint(trial, dropped) else trial.start
    start = dict.fromkeys(trial.zeroed, 0.0) | start
    try:
        rest = fitted(
            evidence,
            dataclasses.replace(model, effects=effects, **own),
            [name for name in (*trial.free, *trial.zeroed) if name not in gone],
            tuple(c for c in trial.chosen if c.name != dropped.name),
            start={name: value for name, value in start.items() if name not in gone},
            windows=trial.fit.windows,
            least_gain=LITTLE * level,
            target=target,
        )
    except FitDiverged:
        return None
    return None if rest.fit.given_up else within_physics(evidence, rest, target)


def enlarged(
    evidence: Evidence, rest: Trial, trial: Trial, chosen: Sequence[Candidate], level: float
) -> Trial | None:
    """Return a model with all chosen effects, from one with some and a trial's values of others."""
    added = [c for c in chosen if c.name not in rest.names]
    known = {name: trial.start.get(name, 0.0) for c in added for name in c.free}
    start = known | {c.free[0]: KICK * known[c.free[0]] for c in added}
    try:
        found = with_candidates(evidence, rest, added, start, level=level)
    except FitDiverged:
        return None
    return within_physics(evidence, found)


def _faint(trial: Trial, dropped: Candidate) -> bool:
    """Whether the size of an effect is little beside its standard error."""
    size = dropped.free[0]
    if size not in trial.fit.names or dropped.phase is not None:
        return False
    error = trial.fit.estimates[size].stderr
    if error is None or not 0 < error < math.inf:
        return False
    return abs(trial.start[size]) <= FAINT * error


BACK_STEPS: Final = 6
"""Steps of a fit from the other side that is to be better: there nearly all is as it was."""

ALIKE_STEPS: Final = 25
"""Steps of one that is to be as good."""


def better_side(evidence: Evidence, trial: Trial) -> Trial:
    """Return a fit with places on the other side of the rest, where that is better.

    A pendulum that swings about its rest passes ``th0`` and ``-th0`` alike: a fit that begins on
    the wrong side does not change over.
    """
    for candidate in trial.chosen:
        for start in _mirrored(trial, candidate):
            other = _from(evidence, trial, candidate, start, BACK_STEPS)
            if other is not None and other.chi2 < trial.chi2:
                trial = other
    return trial


def elsewhere(
    evidence: Evidence, trial: Trial, sought: Mapping[str, Sequence[Score]]
) -> dict[str, dict[str, float]]:
    """Return shapes where effects would do as well.

    Of a place that on the other side of the rest, of a frequency or an instant the best of those
    that residuals ask for, as ``sought`` has them by effect.
    """
    found: dict[str, dict[str, float]] = {}
    for candidate in trial.chosen:
        starts = _mirrored(trial, candidate)
        for score in sought.get(candidate.name, ()):
            effect = score.candidate.effect(trial.fit.model.units)
            shape = {f"{candidate.name}.{n}": effect.parameters[n] for n in score.candidate.shape}
            starts.append(shape | score.start)
        fits = [_from(evidence, trial, candidate, start, ALIKE_STEPS) for start in starts]
        for other in sorted((f for f in fits if f is not None), key=lambda f: -f.chi2):
            if other.chi2 - trial.chi2 >= Z95**2 * trial.widening:
                continue
            for key in starts[0]:
                here, there = trial.fit.estimates[key], other.fit.estimates[key]
                apart, own = abs(there.value - here.value), key.rpartition(".")[2]
                if own in candidate.places:
                    apart = abs(math.remainder(apart, math.tau)) - abs(here.value)
                elif own in candidate.shape:
                    apart -= Z95 * math.hypot(here.stderr or 0.0, there.stderr or 0.0)
                else:
                    continue
                if apart > 0:
                    found.setdefault(candidate.name, {})[own] = there.value
    return found


def _mirrored(trial: Trial, candidate: Candidate) -> list[dict[str, float]]:
    """Return an effect's places on the other side of the rest, one at a time."""
    keys = [f"{candidate.name}.{place}" for place in candidate.places]
    return [{key: -trial.fit.estimates[key].value} for key in keys]


def _from(
    evidence: Evidence, trial: Trial, candidate: Candidate, start: Mapping[str, float], steps: int
) -> Trial | None:
    """Return the fit from another start of an effect; none where the motion is lost."""
    own = {key.rpartition(".")[2]: value for key, value in start.items()}
    effects = tuple(
        dataclasses.replace(e, parameters={**e.parameters, **own})
        if e.name == candidate.name
        else e
        for e in trial.fit.model.effects
    )
    try:
        return fitted(
            evidence,
            dataclasses.replace(trial.fit.model, effects=effects),
            trial.free,
            trial.chosen,
            start=trial.start | dict(start),
            windows=trial.fit.windows,
            steps=steps,
        )
    except FitDiverged:
        return None


# How well the shape of an effect is known, along a bent ridge.


Z95: Final = 1.959963984540054
"""The 97.5 % point of the standard normal distribution."""


def profiles(evidence: Evidence, trial: Trial) -> dict[str, dict[str, tuple[float, float]]]:
    """Return the intervals, from the profile of the likelihood, of effects with a shape.

    Size and shape are found along a bent ridge: a warming of half the time constant does nearly
    the same with another size. Elsewhere the covariance says the same for less.
    """
    wanted = {
        f"{c.name}.{name}": (c.name, name)
        for c in trial.chosen
        if c.adapted and c.phase is None
        for name in (c.size, *c.shape)
    }
    names = [name for name in wanted if name in trial.fit.names and name not in trial.fit.mixed]
    if not names or not trial.fit.converged:
        return {}
    found = fit_runs(
        evidence.fitted,
        trial.fit.model,
        trial.free,
        start=trial.start,
        windows=trial.fit.windows,
        profiled=names,
    )
    wider = math.sqrt(trial.widening / found.widening)
    intervals: dict[str, dict[str, tuple[float, float]]] = {}
    for key in names:
        effect, name = wanted[key]
        value = found[key]
        half = Z95 * math.sqrt(trial.widening) * (trial.fit.estimates[key].stderr or math.inf)
        # Where the ridge folds back there may be no end to be found: the covariance has one.
        low, high = (
            value + wider * (end - value) if math.isfinite(end) else value + side * half
            for end, side in zip(found.ends[key], (-1, 1), strict=True)
        )
        if math.isfinite(low) and math.isfinite(high):
            intervals.setdefault(effect, {})[name] = low, high
    return intervals
