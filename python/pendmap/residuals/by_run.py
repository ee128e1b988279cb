"""Parameters estimated run by run, and the significance of their differences between runs."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import chdtrc

from pendmap.identification.sensitivity import sensitivities

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun
    from pendmap.residuals.noise import ResidualNoise
    from pendmap.signal import Floats

CHANCE: Final = 1e-3  # Probability by noise alone below which a parameter differs between runs
BLIND: Final = 1e-9
"""Information, over a run's greatest, below which a direction of parameters is undetermined."""


@dataclasses.dataclass(frozen=True)
class RunByRun:
    """Parameters estimated run by run, with a test of their homogeneity."""

    # Value and standard error (SI) of each parameter in each run, with the other parameters fixed
    # at the fit of all runs; the error is infinite if the run does not determine the parameter.
    coefficients: dict[str, list[tuple[float, float]]]
    uneven: float  # (Q - dof) / sqrt(2 dof), with Cochran's Q of all parameters
    chance: float  # Probability that noise alone gives at least this Q

    def shown(self, name: str) -> list[tuple[float, float]]:
        """Return values and standard errors of a parameter in the runs that determine it, SI."""
        return [(v, e) for v, e in self.coefficients.get(name, []) if math.isfinite(e) and e > 0]

    def between(self, name: str) -> float:
        """Return the standard deviation of a parameter between runs beyond its errors, SI.

        Method of DerSimonian & Laird (1986), Controlled Clinical Trials 7, 177; 0 if fewer than two
        runs determine the parameter or Cochran's Q is compatible with noise alone.
        """
        shown = self.shown(name)
        if len(shown) < 2:  # noqa: PLR2004 (nothing to compare)
            return 0.0
        values = np.array([value for value, _ in shown])
        weights = np.array([error**-2 for _, error in shown])
        mean = float(np.average(values, weights=weights))
        q = float(np.sum(weights * (values - mean) ** 2))
        if chdtrc(len(shown) - 1, q) > CHANCE:
            return 0.0
        scale = float(np.sum(weights) - np.sum(weights**2) / np.sum(weights))
        return math.sqrt(max(q - (len(shown) - 1), 0.0) / scale)


def parameters_by_run(
    runs: Sequence[FitRun], fit: TrajectoryFit, noise: ResidualNoise, level: float
) -> RunByRun:
    """Return first-order estimates of each run's parameters (Cochran 1954, Biometrics 10, 101)."""
    slopes = sensitivities(fit, runs, (), fit.model)
    sizes = np.linalg.norm(slopes.columns, axis=0)
    columns = slopes.columns / np.where(sizes > 0, sizes, 1.0)
    wanted: dict[str, list[tuple[float, float]]] = {name: [] for name in slopes.names}
    q, degrees = 0.0, -_rank(columns.T @ columns)
    for k in range(len(runs)):
        rows = columns[slopes.run == k]
        pull, information = rows.T @ slopes.residual[slopes.run == k], rows.T @ rows
        q += float(pull @ np.linalg.pinv(information, rcond=BLIND, hermitian=True) @ pull)
        degrees += _rank(information)
        for place, name in enumerate(slopes.names):
            own_information = float(information[place, place])
            value = fit.estimates[name].value
            step, error = 0.0, math.inf
            if own_information > BLIND:
                step = float(pull[place]) / own_information / sizes[place]
                error = math.sqrt(level / own_information) / sizes[place]
            wanted[name].append((value + step, error))
    degrees = max(degrees, 0)
    uneven = (q / noise.level - degrees) / math.sqrt(2 * degrees) if degrees else 0.0
    return RunByRun(wanted, uneven, noise.chance_of(q, degrees))


def _rank(information: Floats) -> int:
    values = np.linalg.eigvalsh(information)
    return int(np.count_nonzero(values > BLIND * max(float(values[-1]), 1e-300)))
