"""Whether all runs would have the same parameters, and what each of them would have."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.identification.sensitivity import sensitivities

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun
    from pendmap.residuals.noise import Remainder

CHANCE: Final = 1e-3
"""Probability that noise alone makes a parameter differ between runs, below which it differs."""

BLIND: Final = 1e-9
"""A direction with this part of a run's greatest information is not seen in it."""


@dataclasses.dataclass(frozen=True)
class RunByRun:
    """Parameters run by run."""

    # For each parameter its value in each run with its standard error (SI), the others kept as all
    # runs together have them; an infinite error where the run does not show it.
    coefficients: dict[str, list[tuple[float, float]]]
    # Cochran's Q over all parameters together, less its degrees of freedom, over its standard
    # deviation: what the sum of squares would gain if each run had parameters of its own.
    uneven: float
    chance: float  # That noise alone makes it so great

    def shown(self, name: str) -> list[tuple[float, float]]:
        """Return values and standard errors of a parameter in the runs that show it, SI."""
        return [(v, e) for v, e in self.coefficients.get(name, []) if math.isfinite(e) and e > 0]

    def between(self, name: str) -> float:
        """Return the standard deviation of a parameter between the runs beyond its errors, SI.

        That of DerSimonian & Laird (1986), Controlled Clinical Trials 7, 177; 0 where fewer than
        two runs show the parameter, or chance makes it differ as much (Cochran's Q).
        """
        from scipy.special import chdtrc  # noqa: PLC0415 (where it is needed)

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


def run_by_run(
    runs: Sequence[FitRun], fit: TrajectoryFit, noise: Remainder, level: float
) -> RunByRun:
    """Return what each run would have, to first order from the fit of all.

    References
    ----------
    Cochran (1954), Biometrics 10, 101.
    """
    found = sensitivities(fit, runs, (), fit.model)
    sizes = np.linalg.norm(found.columns, axis=0)
    columns = found.columns / np.where(sizes > 0, sizes, 1.0)
    wanted: dict[str, list[tuple[float, float]]] = {name: [] for name in found.names}
    q, degrees = 0.0, -_rank(columns.T @ columns)
    for k in range(len(runs)):
        own = columns[found.run == k]
        pull, information = own.T @ found.residual[found.run == k], own.T @ own
        q += float(pull @ np.linalg.pinv(information, rcond=BLIND, hermitian=True) @ pull)
        degrees += _rank(information)
        for place, name in enumerate(found.names):
            seen = float(information[place, place])
            value = fit.estimates[name].value
            if seen <= BLIND:
                wanted[name].append((value, math.inf))
                continue
            step = float(pull[place]) / seen / sizes[place]
            wanted[name].append((value + step, math.sqrt(level / seen) / sizes[place]))
    degrees = max(degrees, 0)
    uneven = (q / noise.level - degrees) / math.sqrt(2 * degrees) if degrees else 0.0
    return RunByRun(wanted, uneven, noise.chance_of(q, degrees))


def _rank(information: NDArray[np.float64]) -> int:
    values = np.linalg.eigvalsh(information)
    return int(np.count_nonzero(values > BLIND * max(float(values[-1]), 1e-300)))
