"""Search for an exponent, with all other parameters fitted at each value.

The sum of squares has a narrow, curved valley in an effect's size and exponent. The search follows
it by variable projection (Golub & Pereyra 1973, SIAM J. Numer. Anal. 10, 413): the step of the
exponent is computed from its derivatives, orthogonal to those of the other parameters.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import FitDiverged
from pendmap.identification.fit import LEVEL
from pendmap.identification.sensitivity import sensitivities

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun
    from pendmap.model import Rig

STAGES: Final = 8  # Most exponents tried

REACH: Final = 0.2  # Initial longest step of an exponent, less than the spacing of the scan

FARTHEST: Final = 3.0  # Largest change of the logarithm of a size in one step

SHORTER: Final = 0.25  # New longest step, over a step that made the fit worse

SHORTEST: Final = 0.01  # Longest step below which the search ends

PROMISED: Final = 0.01  # Expected gain in the sum of squares below which the search ends

HOPE: Final = 3.0  # Upper bound on the gain of a step, as a multiple of the expected gain


def refine_exponent(  # noqa: PLR0913 (what to fit, and how)
    fit: TrajectoryFit,
    runs: Sequence[FitRun],
    size: str,
    exponent: str,
    again: Callable[[Rig, Mapping[str, float], TrajectoryFit], TrajectoryFit],
    *,
    target: float = math.inf,
) -> TrajectoryFit:
    """Return a fit with an exponent, fixed in each fit, near its best value.

    ``again`` fits a model from given starting values, with the windows of a fit. The search ends
    when the sum of squares ``target`` is out of reach.
    """
    reach = REACH
    for _ in range(STAGES):
        step, gain, follow = _step(fit, runs, exponent)
        if gain < PROMISED or reach < SHORTEST or fit[size] == 0:
            break
        if fit.chi2 - HOPE * gain > target:
            break
        step = math.copysign(min(abs(step), reach), step)
        start = {name: e.value - step * follow[name] for name, e in fit.estimates.items()}
        # A size depends exponentially on its exponent, so its logarithm is extrapolated.
        power = max(-FARTHEST, min(-step * follow[size] / fit[size], FARTHEST))
        start[size] = fit[size] * math.exp(power)
        try:
            trial = again(_with(fit.model, exponent, step), start, fit)
        except FitDiverged:
            reach = SHORTER * abs(step)
            continue
        if trial.chi2 < fit.chi2:
            fit = trial
        else:
            reach = SHORTER * abs(step)
    return fit


def _step(
    fit: TrajectoryFit, runs: Sequence[FitRun], exponent: str
) -> tuple[float, float, dict[str, float]]:
    """Return an exponent's step, its expected gain, and derivatives of the other parameters."""
    seen = sensitivities(fit, runs, [exponent], fit.model)
    place = seen.names.index(exponent)
    column, others = seen.columns[:, place], np.delete(seen.columns, place, axis=1)
    sizes = np.linalg.norm(others, axis=0)
    sizes[sizes == 0] = 1.0
    follow = np.linalg.lstsq(others / sizes, column)[0] / sizes
    rest = column - others @ follow
    information, pull = float(rest @ rest), float(rest @ seen.residual)
    names = [name for name in seen.names if name != exponent]
    if information <= 0:
        return 0.0, 0.0, {}
    return pull / information, pull**2 / information, dict(zip(names, follow, strict=True))


def upper_limit(fit: TrajectoryFit, runs: Sequence[FitRun], name: str) -> float:
    """Return the upper end of the 95 % interval that a parameter held at 0 has about 0."""
    step, gain, _ = _step(fit, runs, name)
    return abs(step) * math.sqrt(LEVEL * fit.widening / gain) if gain else math.inf


def _with(model: Rig, exponent: str, step: float) -> Rig:
    """Return a model whose exponent is changed by a step, within its range."""
    name, _, parameter = exponent.rpartition(".")
    effect = next(e for e in model.effects if e.name == name)
    low, high = effect.definition[parameter].range
    value = min(max(effect.parameters[parameter] + step, low), high)
    other = dataclasses.replace(effect, parameters={**effect.parameters, parameter: value})
    effects = tuple(other if e is effect else e for e in model.effects)
    return dataclasses.replace(model, effects=effects)
