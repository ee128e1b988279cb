"""How well the shape of an effect is known: along a bent ridge, and on which side of the rest."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

from pendmap.discrepancy.trial import fitted
from pendmap.errors import InputError
from pendmap.identification.fitting import fit_runs

if TYPE_CHECKING:
    from pendmap.discrepancy.evidence import Evidence
    from pendmap.discrepancy.trial import Trial

__all__ = ["Z95", "mirrored", "profiles"]

Z95: Final = 1.959963984540054
"""The 97.5 % point of the standard normal distribution."""

STEPS: Final = 25
"""Steps of a fit from the other side."""


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


def mirrored(evidence: Evidence, trial: Trial) -> dict[str, dict[str, float]]:
    """Return places on the other side of the rest where effects would do as well.

    A pendulum that swings about its rest passes ``th0`` and ``-th0`` alike: from free decays a
    rough spot's side is often not known.
    """
    found: dict[str, dict[str, float]] = {}
    for candidate in trial.chosen:
        for place in candidate.places:
            key = f"{candidate.name}.{place}"
            here = trial.fit.estimates[key]
            effects = tuple(
                dataclasses.replace(e, parameters={**e.parameters, place: -here.value})
                if e.name == candidate.name
                else e
                for e in trial.fit.model.effects
            )
            try:
                other = fitted(
                    evidence,
                    dataclasses.replace(trial.fit.model, effects=effects),
                    trial.free,
                    trial.chosen,
                    start=trial.start | {key: -here.value},
                    windows=trial.fit.windows,
                    steps=STEPS,
                )
            except InputError:
                continue  # there the motion is lost
            there = other.fit.estimates[key].value
            apart = abs(math.remainder(there - here.value, math.tau))
            as_good = other.chi2 - trial.chi2 < Z95**2 * trial.widening
            if as_good and apart > abs(here.value):
                found.setdefault(candidate.name, {})[place] = there
    return found
