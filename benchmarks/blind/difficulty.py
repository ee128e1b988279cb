"""Difficulty of a blind experiment, measured from its motion.

The same motion without noise and counts is scored with the noise of the record. ``G`` is the gain
of the best possible model, ``s = 1 - G_impostor / G`` the relative deficit of the nearest other
name. Names with ``s G < 25`` cannot be distinguished by these records with any method.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.blind.cases import record
from pendmap.comparison.data import DataSplit, split_records
from pendmap.diagnosis.baseline import fit_baseline
from pendmap.diagnosis.candidates import list_candidates
from pendmap.diagnosis.fitted_model import fit_model
from pendmap.diagnosis.refit import refit_with
from pendmap.diagnosis.scores import score_candidates
from pendmap.diagnosis.thresholds import Thresholds

if TYPE_CHECKING:
    from collections.abc import Sequence

    from benchmarks.blind.cases import Case
    from pendmap.diagnosis.fitted_model import FittedModel, Windows
    from pendmap.diagnosis.scores import Scores

CLEAR = 25.0
"""Separation times score above which names are almost always distinguished."""

REFITTED, WORTH = 3, 0.5
"""Largest number of fitted impostors, and their least gain as a share of chi-square."""

CONTAINED = 1e-3
"""Largest unexplained share of a special case, due to rounding and steps."""


def difficulty(
    case: Case, base: FittedModel, without: Sequence[str] = ()
) -> tuple[dict[str, Any], list[str]]:
    """Return ``G``, ``s``, equals and indistinguishable names of a case on noise-free records.

    Of a pair ``G`` is that of each effect alone. Excluded as impostors are names in ``without``,
    exact equals (a cosine of 1 between their changes of the readings) and effects with more
    parameters that have the true one as a special case: no method can distinguish them, at any
    noise. If an effect is withheld, those that reach its ``G`` to within 25 are excluded too: they
    are withheld with it.
    """
    gains, separation, alike, equals, left = [], 1.0, set(), set(), 0.0
    for effect in case.effects:
        alone = dataclasses.replace(case, effects=(effect,))
        recorded = record(alone, clean=True)
        data = _with_noise(split_records(recorded.experiment), recorded.sigma)
        # From the noisy fit: the effect is to be measured, not the quality of starting values.
        windows = _windows_at(data, base)
        begin = fit_model(data, base.fit.model, base.free, start=base.start, windows=windows)
        # The windows may be misplaced by disturbances or the other effect of a pair.
        begin = min((begin, fit_baseline(data)[0]), key=lambda fitted: fitted.chi2)
        gains.append(begin.chi2)
        own = effect.split(":")[0]
        reached, own_equals = _impostors(data, begin, own, without)
        if case.what == "form":
            left = _left(data, begin, own)
        near = {name for name, gain in reached.items() if begin.chi2 - gain < CLEAR}
        alike |= near | own_equals
        equals |= own_equals
        others = (
            reached if case.what != "withheld" else {n: reached[n] for n in reached.keys() - near}
        )
        nearest = max(others.values(), default=0.0)
        separation = min(separation, 1 - nearest / begin.chi2)
    hard = {"G": gains, "s": separation, "equals": sorted(equals), "beyond": left}
    return hard, sorted(alike)


def disturbance(case: Case) -> float:
    """Return the gain of a perfect model of a case's disturbances alone."""
    recorded = record(dataclasses.replace(case, effects=("none",), size=1.0))
    base, _ = fit_baseline(_with_noise(split_records(recorded.experiment), recorded.sigma))
    return base.chi2 - base.fit.degrees


def _left(data: DataSplit, begin: FittedModel, own: str) -> float:
    """Return the part of a differing form that the library's effect of its name cannot explain."""
    scores = score_candidates(
        data, begin, [c for c in list_candidates({"Tr"}, driven=True) if c[0].name == own]
    )
    found = _refitted(data, begin, scores, scores.best()[0])
    return begin.chi2 if found is None else found.chi2


def _refitted(
    data: DataSplit, begin: FittedModel, scores: Scores, place: int
) -> FittedModel | None:
    """Return a model with a candidate; each reading has weight 1, since its noise is known."""
    return refit_with(data, Thresholds(), begin, scores, [place], 1.0)


def _impostors(
    data: DataSplit, begin: FittedModel, own: str, without: Sequence[str]
) -> tuple[dict[str, float], set[str]]:
    """Return the gains of all other effects on the residual of one, and the equals of that one."""
    scores = score_candidates(data, begin, list_candidates({"Tr", *without}, driven=data.forced))
    gains, equals = {}, set()
    places = scores.best()
    at = next((k for k in places if scores.scores[k].candidate.name == own), None)
    for k in places:
        score = scores.scores[k]
        name, gain = score.candidate.name, score.gain
        if k == at:
            continue
        if at is not None and scores.same(at, k):
            equals.add(name)
            continue
        more = at is not None and score.candidate.count > scores.scores[at].candidate.count
        near = begin.chi2 - gain < CLEAR and not more
        if len(gains) < REFITTED and gain > WORTH * begin.chi2 and not near:
            # To first order the gain is a lower bound: the shape was only scanned.
            found = _refitted(data, begin, scores, k)
            gain = max(gain, begin.chi2 - found.chi2) if found else gain
            if more and begin.chi2 - gain < max(CONTAINED * begin.chi2, 1.0):
                equals.add(name)
                continue
        gains[name] = gain
    return gains, equals


def _windows_at(data: DataSplit, base: FittedModel) -> Windows:
    """Return the windows of a fit for runs of the same motion with other instants.

    Readings without noise and counts may be averaged even if the original ones are not.
    """
    moved = []
    for run, first, last, theta, velocity in base.fit.windows:
        old, new = base.runs[run].time, data.fitted[run].time
        if old.size == new.size:
            moved.append((run, first, last, theta, velocity))
            continue
        begin = int(np.searchsorted(new, old[first]))
        end = new.size if last == old.size else int(np.searchsorted(new, old[last]))
        if begin < end:
            moved.append((run, begin, end, theta + velocity * (new[begin] - old[first]), velocity))
    return tuple(moved)


def _with_noise(data: DataSplit, sigma: float) -> DataSplit:
    fitted = tuple(dataclasses.replace(run, sigma=sigma) for run in data.fitted)
    held = tuple(dataclasses.replace(run, sigma=sigma) for run in data.held)
    return dataclasses.replace(data, fitted=fitted, held=held)
