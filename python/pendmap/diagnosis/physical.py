"""What a fitted model must obey to be a pendulum."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

from pendmap.diagnosis.fitted_model import LITTLE, fitted
from pendmap.errors import FitDiverged
from pendmap.model.effects import opposes

if TYPE_CHECKING:
    from pendmap.comparison.data import Evidence
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import Trial

OPPOSING: Final = ("c_over_m", "Tr")
"""Coefficients that oppose the motion: 0 or more."""

ERRORS: Final = 3.0
"""Standard errors by which an estimate may miss a limit."""

STRETCH: Final = 2.0
"""Factor by which a width may leave its typical range."""


def within_physics(evidence: Evidence, trial: Trial, target: float = math.inf) -> Trial | None:
    """Return a fit whose coefficients a pendulum can have; none where the effects have no such fit.

    Viscous damping and Coulomb friction below 0 are set to 0, and the others fitted again. An added
    effect must oppose the motion where its kind does, must not drive the motion by a drift or an
    asymmetry greater than what drifts, must take longer than a swing and no longer than the record,
    and must have a width near its typical range. A fit that leads far above the sum of squares
    ``target`` is given up.
    """
    while negative := [n for n in OPPOSING if n in trial.fit.estimates and trial.fit[n] < 0]:
        zeros: dict[str, Any] = dict.fromkeys(negative, 0.0)
        try:
            trial = fitted(
                evidence,
                dataclasses.replace(trial.fit.model, **zeros),
                [name for name in trial.free if name not in negative],
                trial.chosen,
                start=trial.start_without(negative),
                windows=trial.fit.windows,
                zeroed=(*trial.zeroed, *negative),
                least_gain=LITTLE * trial.level,
                target=target,
            )
        except FitDiverged:
            return None
    return trial if all(_possible(evidence, trial, c) for c in trial.chosen) else None


def _possible(evidence: Evidence, trial: Trial, candidate: Candidate) -> bool:
    estimates = trial.fit.estimates
    wide = math.sqrt(trial.level)
    size = estimates.get(candidate.free[0])
    if size is None:
        return True
    error = ERRORS * wide * (size.stderr or 0.0)
    if opposes(candidate.definition) and size.value < -error:
        return False
    for name in candidate.shape:
        estimate = estimates.get(f"{candidate.name}.{name}")
        if estimate is None:
            continue
        low, high = _limits(evidence, trial, candidate, name)
        if not low <= estimate.value <= high:
            return False
    return _drains(evidence, trial, candidate, error)


def _limits(
    evidence: Evidence, trial: Trial, candidate: Candidate, name: str
) -> tuple[float, float]:
    """Return the least and the greatest possible value of a shape, SI."""
    entry, model = _entry(candidate, name), trial.fit.model
    if entry["role"] == "time constant":
        return math.tau / model.w0, _span(evidence)
    if entry["role"] == "instant":
        return _end(evidence) - _span(evidence), _end(evidence)
    if entry["role"] == "width":
        low, high = entry["typical"]
        unit = model.w0 ** entry["power_of_w0"]
        return low / STRETCH * unit, high * STRETCH * unit
    return -math.inf, math.inf


def _drains(evidence: Evidence, trial: Trial, candidate: Candidate, error: float) -> bool:
    """Whether a drift or an asymmetry of damping or friction leaves it above 0."""
    entry = _entry(candidate, candidate.size)
    if candidate.definition["group"] != "damping" or entry["typical"][0] >= 0:
        return True
    drifts = candidate.definition["mappable"] == "frozen"
    # A rate has the power of w0 of what drifts, and one more.
    power = entry["power_of_w0"] - drifts
    base = "Tr" if power == 2 else "c_over_m"  # noqa: PLR2004 (a torque)
    size, longest = trial.fit[candidate.free[0]], _end(evidence) if drifts else 1.0
    known = trial.fit.estimates.get(base)
    limit = (known.value + ERRORS * math.sqrt(trial.level) * (known.stderr or 0.0)) if known else 0
    if drifts:
        return size * longest + error * longest + limit >= 0
    return abs(size) <= limit + error


def _span(evidence: Evidence) -> float:
    """Return from when to when records last, s in the laboratory."""
    first = min(run.lab_time_s + float(run.time[0]) for run in evidence.fitted)
    return _end(evidence) - first


def _end(evidence: Evidence) -> float:
    return max(run.lab_time_s + float(run.time[-1]) for run in evidence.fitted)


def _entry(candidate: Candidate, name: str) -> dict[str, Any]:
    return next(e for e in candidate.definition["parameters"] if e["name"] == name)
