"""Simulated records of a model from a neighbourhood of a run's start."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import FitDiverged, core_errors
from pendmap.identification.fit import TrajectoryFit, prepared
from pendmap.identification.runs import bare_run, bare_windows, rig_of, tolerance_of
from pendmap.units import Units

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.identification.runs import FitRun
    from pendmap.model import Rig

    Floats = NDArray[np.float64]


_EXACTNESS: Final = 1e-9
"""Integrator's error allowed a step."""


@dataclasses.dataclass(frozen=True)
class Start:
    """Initial state of a run, as a model estimates it from the first seconds."""

    time: float  # s, on the run's clock
    theta: float  # rad
    velocity: float  # rad/s
    covariance: Floats  # shape (2, 2), of both

    @property
    def stderr(self) -> tuple[float, float]:
        """Standard errors, rad and rad/s."""
        return tuple(np.sqrt(np.diag(self.covariance)).tolist())

    def drawn(self, count: int, spread: float, w0: float, seed: int) -> tuple[Floats, Floats]:
        """Draw starts about it, the first of them itself, shapes (count,).

        They are normal with the covariance of the start plus ``spread^2`` in angle and ``(spread
        w0)^2`` in velocity.
        """
        wide = self.covariance + np.diag([spread**2, (spread * w0) ** 2])
        drawn = np.random.default_rng(seed).multivariate_normal(np.zeros(2), wide, count)
        drawn[0] = 0.0
        return self.theta + drawn[:, 0], self.velocity + drawn[:, 1]


def start_of(fit: TrajectoryFit, run: FitRun) -> Start:
    """Return the state at the beginning of a run's first window, with its covariance.

    ``fit`` is of this run alone, with its windows' states adapted.
    """
    from pendmap import _core  # noqa: PLC0415 (the core is loaded where it works)

    model = fit.model
    units = Units(model.w0, si=True)
    unknown, given = prepared([run], model, (), {}, units)
    first = fit.windows[:1]
    with core_errors(FitDiverged):
        found = _core.fit_rows(
            given, unknown.start, tolerance_of([run]), bare_windows(first, units)
        )
    rows = found[0].rows[:, -2:]
    scale = np.array([1.0, float(units.given(1.0, 1))])
    covariance = np.linalg.pinv(rows.T @ rows, hermitian=True) * np.outer(scale, scale)
    _, begin, _, theta, velocity = first[0]
    return Start(float(run.time[begin]), theta, velocity, np.asarray(covariance, np.float64))


@dataclasses.dataclass(frozen=True)
class Simulated:
    """Records of a model under the drive or pivot motion of a run."""

    run: FitRun
    model: Rig
    threads: int | None = None  # None: one a processor

    def readings(self, theta: Floats, velocity: Floats, times: Floats) -> Floats:
        """Return readings of the angle, rad, not wrapped, shape (M, N).

        M starts (rad, rad/s) at the first of N times (s, on the run's clock). Readings are NaN
        after a motion left the range of numbers.
        """
        from pendmap import _core  # noqa: PLC0415 (likewise)

        units = Units(self.model.w0, si=True)
        with core_errors(FitDiverged):
            return _core.replay(
                bare_run(self.run, rig_of(self.run, self.model), units),
                np.ascontiguousarray(theta, dtype=np.float64),
                np.ascontiguousarray(units.bare(velocity, 1), dtype=np.float64),
                np.ascontiguousarray(units.bare(times, -1), dtype=np.float64),
                _EXACTNESS,
                self.threads or 0,
            )
