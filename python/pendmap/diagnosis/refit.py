"""Fits of a model with candidates added, and without one of its effects."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Final

from pendmap.diagnosis.fitted_model import (
    LITTLE,
    FittedModel,
    fit_again,
    fit_with_candidates,
    fit_without,
    impose_physics,
)
from pendmap.identification.fit import fit_runs
from pendmap.signal.robust import Z95

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pendmap.comparison.data import DataSplit
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.scores import Score, Scores
    from pendmap.diagnosis.thresholds import Thresholds

KICK: Final = 1e-3
"""Initial size of a candidate over its score's step: the full step diverges far from the fit, and a
phase needs a size above 0."""

MIRROR_STEPS: Final = 6  # Most steps of a fit from a mirrored place
EQUIVALENT_STEPS: Final = 25  # Most steps of a fit from another shape, tested for equivalence

Key = frozenset[tuple[str, tuple[tuple[str, float], ...]]]


def key_of(chosen: Sequence[Candidate]) -> Key:
    """Return the key of a set of candidates."""
    return frozenset((c.name, tuple(sorted(c.shape.items()))) for c in chosen)


def best_of(*models: FittedModel | None) -> FittedModel | None:
    """Return the model with the least sum of squares; None without a model."""
    return min((m for m in models if m is not None), key=lambda m: m.chi2, default=None)


def refit_with(  # noqa: PLR0913, PLR0917 (what is fitted, and what decides)
    data: DataSplit,
    thresholds: Thresholds,
    fitted: FittedModel,
    scores: Scores,
    places: Sequence[int],
    level: float,
) -> FittedModel | None:
    """Return a model with candidates, within physical limits; None if the fit diverges.

    The fit starts at the fitted motion with sizes of nearly 0, in the shapes of the best scores; if
    it gains far less than the score promised, it is repeated from the sizes of the score.
    """
    selected = [scores.scores[k] for k in places]
    added = [score.candidate for score in selected]
    step = {name: value for score in selected for name, value in score.start.items()}
    sizes = {candidate.free[0] for candidate in added}

    fit = functools.partial(fit_with_candidates, data, fitted, level=level)
    others = [scores.scores[k] for k in _other_shapes(scores, places, thresholds)]
    best: FittedModel | None = None
    for one, begin in [(added, step), *(([other.candidate], other.start) for other in others)]:
        kick = {name: KICK * v if name in sizes else v for name, v in begin.items()}
        best = best_of(best, fit(one, kick))
    promised = thresholds.short * scores.together(places)
    if best is None or fitted.chi2 - best.chi2 < promised:
        best = best_of(best, fit(added, step))
    if best is None or best.chi2 > fitted.chi2:
        # A larger model fits at least as well: the fit lost the motion.
        best = best_of(best, fit(added, step, short=True))
    if best is None or best.chi2 > fitted.chi2:
        return None
    best = impose_physics(data, try_mirrored_places(data, best), fitted.chi2)
    if best is None or best.chi2 > fitted.chi2 or not {c.name for c in added} <= {*best.names}:
        return None
    return best


def _other_shapes(scores: Scores, places: Sequence[int], thresholds: Thresholds) -> list[int]:
    """Return the next best shapes of one candidate; none with exponents, found from any start."""
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


def drop_effect(
    data: DataSplit, fitted: FittedModel, dropped: Candidate, level: float, target: float = math.inf
) -> FittedModel | None:
    """Return a model without one of its effects, fitted from the present motion.

    None if the fit fails or is far above ``target``.
    """
    start = dict.fromkeys(fitted.zeroed, 0.0) | fitted.start
    least, freed, size = LITTLE * level, fitted.zeroed, dropped.free[0]
    reduced = fit_without(data, fitted, size, start, least=least, target=target, freed=freed)
    if reduced is None or reduced.fit.given_up:
        return None
    return impose_physics(data, reduced, target)


def add_effects(
    data: DataSplit,
    reduced: FittedModel,
    full: FittedModel,
    chosen: Sequence[Candidate],
    level: float,
) -> FittedModel | None:
    """Return a reduced model with all chosen effects, starting from the values of a full one."""
    added = [c for c in chosen if c.name not in reduced.names]
    known = {name: full.start.get(name, 0.0) for c in added for name in c.free}
    start = known | {c.free[0]: KICK * known[c.free[0]] for c in added}
    fit = fit_with_candidates(data, reduced, added, start, level=level)
    return None if fit is None else impose_physics(data, fit)


def try_mirrored_places(data: DataSplit, fitted: FittedModel) -> FittedModel:
    """Return the best of a fit and of fits with places mirrored about the rest position.

    A swinging pendulum passes ``th0`` and ``-th0`` alike, and a knock of the other sign half a
    swing later does nearly the same; no fit moves from one to the other. An instant is moved
    again while that gains more than an independent reading.
    """
    for candidate in fitted.chosen:
        starts = _mirrored(fitted, candidate)
        while starts:
            other = _fit_from(data, fitted, candidate, starts.pop(), MIRROR_STEPS)
            if other is not None and other.chi2 < fitted.chi2:
                moves = candidate.once and other.chi2 < fitted.chi2 - fitted.level
                fitted, starts = other, _mirrored(other, candidate) if moves else starts
    return fitted


def find_equivalents(
    data: DataSplit, fitted: FittedModel, sought: Mapping[str, Sequence[Score]]
) -> dict[str, dict[str, float]]:
    """Return other shapes of equally good fits, by effect.

    They are mirrored places, and other frequencies or instants from ``sought``.
    """
    equivalents: dict[str, dict[str, float]] = {}
    for candidate in fitted.chosen:
        starts = _mirrored(fitted, candidate)
        for score in sought.get(candidate.name, ()):
            effect = score.candidate.effect(fitted.fit.model.units)
            shape = {f"{candidate.name}.{n}": effect.parameters[n] for n in score.candidate.shape}
            starts.append(shape | score.start)
        fits = [_fit_from(data, fitted, candidate, start, EQUIVALENT_STEPS) for start in starts]
        for other in sorted((f for f in fits if f is not None), key=lambda f: -f.chi2):
            if other.fit.negative or other.chi2 - fitted.chi2 >= Z95**2 * fitted.widening:
                continue
            for key in starts[0]:
                here, there = fitted.fit.estimates[key], other.fit.estimates[key]
                apart, parameter = abs(there.value - here.value), key.rpartition(".")[2]
                if parameter in candidate.places:
                    apart = abs(math.remainder(apart, math.tau)) - abs(here.value)
                elif parameter in candidate.shape:
                    apart -= Z95 * math.hypot(here.stderr or 0.0, there.stderr or 0.0)
                else:
                    continue
                if apart > 0:
                    equivalents.setdefault(candidate.name, {})[parameter] = there.value
    return equivalents


def _mirrored(fitted: FittedModel, candidate: Candidate) -> list[dict[str, float]]:
    """Return an effect's places mirrored about the rest position, or instants half a swing off."""
    keys = [f"{candidate.name}.{place}" for place in candidate.places]
    starts = [{key: -fitted.fit.estimates[key].value} for key in keys]
    if candidate.once:
        (size, *_), (key,) = candidate.free, candidate.adapted
        half = math.pi / fitted.fit["w0"]
        starts += [{size: -fitted.fit[size], key: fitted.fit[key] + x} for x in (half, -half)]
    return starts


def _fit_from(
    data: DataSplit,
    fitted: FittedModel,
    candidate: Candidate,
    start: Mapping[str, float],
    steps: int,
) -> FittedModel | None:
    """Return the fit from another start of an effect; None if it diverges."""
    values = {key.rpartition(".")[2]: value for key, value in start.items()}
    effects = {effect.name: effect for effect in fitted.fit.model.effects}
    moved = {**effects[candidate.name].parameters, **values}
    effects[candidate.name] = dataclasses.replace(effects[candidate.name], parameters=moved)
    model = dataclasses.replace(fitted.fit.model, effects=tuple(effects.values()))
    return fit_again(data, fitted, model=model, start=fitted.start | dict(start), steps=steps)


def profile_intervals(
    data: DataSplit, fitted: FittedModel
) -> dict[str, dict[str, tuple[float, float]]]:
    """Return 95 % intervals of effects with a shape, from the profile likelihood.

    Size and shape are strongly and nonlinearly correlated; for other effects the covariance
    suffices.
    """
    wanted = {
        f"{c.name}.{name}": (c.name, name)
        for c in fitted.chosen
        if c.adapted and c.phase is None
        for name in (c.size, *c.shape)
    }
    names = [name for name in wanted if name in fitted.fit.names and name not in fitted.fit.mixed]
    if not names or not fitted.fit.converged:
        return {}
    profile = fit_runs(
        data.fitted,
        fitted.fit.model,
        fitted.free,
        start=fitted.start,
        windows=fitted.fit.windows,
        profiled=names,
    )
    wider = math.sqrt(fitted.widening / profile.widening)
    intervals: dict[str, dict[str, tuple[float, float]]] = {}
    for key in names:
        effect, name = wanted[key]
        value = profile[key]
        half = Z95 * math.sqrt(fitted.widening) * (fitted.fit.estimates[key].stderr or math.inf)
        # An end that the profile does not have is taken from the covariance.
        low, high = (
            value + wider * (end - value) if math.isfinite(end) else value + side * half
            for end, side in zip(profile.ends[key], (-1, 1), strict=True)
        )
        if math.isfinite(low) and math.isfinite(high):
            intervals.setdefault(effect, {})[name] = low, high
    return intervals
