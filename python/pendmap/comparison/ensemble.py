"""What a model does from a neighbourhood of a run's start: an ensemble of simulated records."""

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
"""The integrator's error a step."""


@dataclasses.dataclass(frozen=True)
class Start:
    """Where a run begins, as a model reads it from the first seconds.

    Attributes
    ----------
    time : float
        s, on the run's clock.
    theta, velocity : float
        rad and rad/s.
    covariance : ndarray, shape (2, 2)
        Of both.
    """

    time: float
    theta: float
    velocity: float
    covariance: Floats

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

    Parameters
    ----------
    fit : TrajectoryFit
        Of this run alone, with its windows' states adapted.
    run : FitRun
        The record.
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
    rows = found[0][1][:, -2:]
    scale = np.array([1.0, float(units.given(1.0, 1))])
    covariance = np.linalg.pinv(rows.T @ rows, hermitian=True) * np.outer(scale, scale)
    _, begin, _, theta, velocity = first[0]
    return Start(float(run.time[begin]), theta, velocity, np.asarray(covariance, np.float64))


@dataclasses.dataclass(frozen=True)
class Simulated:
    """Records of a model, made where a run was.

    Attributes
    ----------
    run : FitRun
        Its drive or its pivot's motion, and its time in the laboratory.
    model : Rig
        The model.
    threads : int or None
        Number of threads; None: one a processor.
    """

    run: FitRun
    model: Rig
    threads: int | None = None

    def readings(self, theta: Floats, velocity: Floats, times: Floats) -> Floats:
        """Return what the sensor of the angle would have read, rad, shape (M, N).

        Parameters
        ----------
        theta, velocity : ndarray, shape (M,)
            Starts at the first of the times, rad and rad/s.
        times : ndarray, shape (N,)
            s, on the run's clock, not falling.

        Returns
        -------
        ndarray, shape (M, N)
            Not wrapped; no numbers after a motion left their range.

        Raises
        ------
        InputError
            If a number is outside its range.
        KeyboardInterrupt
            After Ctrl-C, within a fraction of a second.
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
