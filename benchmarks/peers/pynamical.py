"""pynamicalsys: its largest exponent of a flow, one start after another, on all threads of numba.

Its manual calls `ContinuousDynamicalSystem.lyapunov` in a loop of Python, which runs on one thread;
here the compiled function behind it is called from a parallel loop, a gain beyond the number of
threads. It rescales the tangent after every step; its initial tangent differs.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numba
import numpy as np
from pynamicalsys import ContinuousDynamicalSystem
from pynamicalsys.continuous_time.lyapunov import maximum_lyapunov_exponent
from pynamicalsys.continuous_time.step import evolve_system
from pynamicalsys.continuous_time.step_methods import rk4_step_wrapped

from benchmarks.peers.common import Case, Regular, loosest

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

LADDER = tuple(sorted({round(24 * 1.05**k) for k in range(120)}))


@numba.njit
def _slope(time: float, u: Floats, parameters: Floats) -> Floats:
    gamma, p, omega = parameters
    out = np.zeros_like(u)
    out[0] = u[1]
    out[1] = -gamma * u[1] - (1.0 + p * math.cos(omega * time)) * math.sin(u[0])
    return out


@numba.njit
def _jacobian(time: float, u: Floats, parameters: Floats) -> Floats:
    gamma, p, omega = parameters
    out = np.zeros((2, 2))
    out[0, 1] = 1.0
    out[1, 0] = -(1.0 + p * math.cos(omega * time)) * math.cos(u[0])
    out[1, 1] = -gamma
    return out


@numba.njit(parallel=True)
def _exponents(
    theta: Floats, velocity: Floats, parameters: Floats, until: float, step: float
) -> Floats:
    out = np.empty(theta.size)
    for i in numba.prange(theta.size):
        start = np.array([theta[i], velocity[i]])
        found = maximum_lyapunov_exponent(
            start, parameters, until, _slope, _jacobian, None, step, 1e-6, 1e-3, rk4_step_wrapped
        )
        out[i] = found[0, 0]
    return out


@numba.njit(parallel=True)
def _ends(theta: Floats, velocity: Floats, parameters: Floats, until: float, step: float) -> Floats:
    out = np.empty((2, theta.size))
    for i in numba.prange(theta.size):
        start = np.array([theta[i], velocity[i]])
        end = evolve_system(start, parameters, until, _slope, step, 1e-6, 1e-3, rk4_step_wrapped)
        out[0, i], out[1, i] = end[0], end[1]
    return out


@numba.njit(parallel=True)
def _of_cells(cells: Floats, start: Floats, step: float, dropped: int, kept: int) -> Floats:
    out = np.empty(cells.shape[0])
    for i in numba.prange(cells.shape[0]):
        parameters = cells[i].copy()
        period = 2.0 * math.pi / parameters[2]
        end = evolve_system(
            start, parameters, dropped * period, _slope, step, 1e-6, 1e-3, rk4_step_wrapped
        )
        until = kept * period
        found = maximum_lyapunov_exponent(
            end, parameters, until, _slope, _jacobian, None, step, 1e-6, 1e-3, rk4_step_wrapped
        )
        out[i] = found[0, 0]
    return out


def exponents_of_cells(
    case: Case, cells: list[Floats], start: Floats, steps: int, periods: tuple[int, int]
) -> Floats:
    """Return an exponent for each pair of p and omega, shape (N,), after dropped periods.

    Steps are as long as `steps` a period of the case's own drive.
    """
    p, omega = cells
    table = np.stack([np.full(p.size, case.gamma), p, omega], axis=1)
    return _of_cells(table, start, case.period / steps, *periods)


def diagram(
    case: Case, p: Floats, start: tuple[float, float], steps: int, periods: tuple[int, int]
) -> Floats:
    """Return stroboscopic points, shape (N, kept, 2), by its class in a loop over p."""
    system = ContinuousDynamicalSystem(
        equations_of_motion=_slope, system_dimension=2, parameters=[case.gamma, case.p, case.omega]
    )
    system.integrator("rk4", time_step=case.period / steps)
    dropped, kept = periods
    each = [
        system.stroboscopic_map(
            list(start),
            kept,
            case.period,
            parameters=[case.gamma, one, case.omega],
            transient_time=dropped * case.period,
        )[:, 1:]
        for one in p
    ]
    return np.array(each)


class Pynamical:
    """The fixed-step method for one case."""

    label = "pynamicalsys"

    def __init__(self, case: Case, steps: int) -> None:
        """Choose the steps a forcing period."""
        self.case, self.steps = case, steps
        self.parameters = np.array([case.gamma, case.p, case.omega])

    @property
    def setting(self) -> str:
        """The integrator and the steps as text."""
        return f"rk4, {self.steps} steps a period"

    def advance(self, theta: Floats, velocity: Floats, periods: int) -> tuple[Floats, Floats]:
        """Return unwrapped angle and velocity, shape (N,), after whole forcing periods."""
        step = self.case.period / self.steps
        until = periods * self.case.period
        ends = _ends(theta, velocity, self.parameters, until, step)
        return ends[0], ends[1]

    def exponents(self, theta: Floats, velocity: Floats, periods: int) -> Floats:
        """Return the finite-time exponents, shape (N,)."""
        step = self.case.period / self.steps
        return _exponents(theta, velocity, self.parameters, periods * self.case.period, step)


class PynamicalLoop(Pynamical):
    """A Python loop over its class, as in its manual."""

    label = "pynamicalsys"

    @property
    def setting(self) -> str:
        """The integrator, the steps and the loop as text."""
        return f"rk4, {self.steps} steps a period, its class in a loop, one thread"

    def exponents(self, theta: Floats, velocity: Floats, periods: int) -> Floats:
        """Return the finite-time exponents, shape (N,)."""
        system = ContinuousDynamicalSystem(
            equations_of_motion=_slope,
            jacobian=_jacobian,
            system_dimension=2,
            parameters=self.parameters,
        )
        system.integrator("rk4", time_step=self.case.period / self.steps)
        until = periods * self.case.period
        each = (
            system.lyapunov([x, v], until, num_exponents=1, endpoint=False)
            for x, v in zip(theta, velocity, strict=True)
        )
        return np.array(list(each), dtype=np.float64)


def at_error(case: Case, sample: Regular, target: float) -> Pynamical:
    """Return the method with the fewest steps a period whose error is at most `target`."""
    return loosest(lambda steps: Pynamical(case, steps), LADDER, sample, target)
