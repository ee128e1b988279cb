"""How well the shape of an effect is known, along a bent ridge."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pendmap.identification.fitting import fit_runs

if TYPE_CHECKING:
    from pendmap.comparison.data import Evidence
    from pendmap.diagnosis.fitted_model import Trial

__all__ = ["Z95", "profiles"]

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
