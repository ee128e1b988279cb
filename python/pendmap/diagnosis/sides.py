"""On which side of the rest an effect is.

A pendulum that swings about its rest passes ``th0`` and ``-th0`` alike: from free decays a rough
spot's side is often not known, and a fit that begins on the wrong one does not change over.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

from pendmap.diagnosis.fitted_model import fitted
from pendmap.diagnosis.intervals import Z95
from pendmap.errors import InputError

if TYPE_CHECKING:
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.data import Evidence
    from pendmap.diagnosis.fitted_model import Trial

__all__ = ["better_side", "elsewhere"]

FEW_STEPS: Final = 6
"""Steps of a fit from the other side that is to be better: there nearly all is as it was."""

STEPS: Final = 25
"""Steps of one that is to be as good."""


def better_side(evidence: Evidence, trial: Trial) -> Trial:
    """Return a fit with places on the other side of the rest, where that is better."""
    for candidate in trial.chosen:
        for place in candidate.places:
            other = _beyond(evidence, trial, candidate, place, FEW_STEPS)
            if other is not None and other.chi2 < trial.chi2:
                trial = other
    return trial


def elsewhere(evidence: Evidence, trial: Trial) -> dict[str, dict[str, float]]:
    """Return places on the other side of the rest where effects would do as well."""
    found: dict[str, dict[str, float]] = {}
    for candidate in trial.chosen:
        for place in candidate.places:
            other = _beyond(evidence, trial, candidate, place, STEPS)
            if other is None:
                continue
            key = f"{candidate.name}.{place}"
            here, there = (t.fit.estimates[key].value for t in (trial, other))
            apart = abs(math.remainder(there - here, math.tau))
            as_good = other.chi2 - trial.chi2 < Z95**2 * trial.widening
            if as_good and apart > abs(here):
                found.setdefault(candidate.name, {})[place] = there
    return found


def _beyond(
    evidence: Evidence, trial: Trial, candidate: Candidate, place: str, steps: int
) -> Trial | None:
    """Return the fit from the other side of the rest; none where the motion is lost."""
    key = f"{candidate.name}.{place}"
    there = -trial.fit.estimates[key].value
    effects = tuple(
        dataclasses.replace(e, parameters={**e.parameters, place: there})
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
            start=trial.start | {key: there},
            windows=trial.fit.windows,
            steps=steps,
        )
    except InputError:
        return None
