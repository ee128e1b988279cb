"""Motions by scipy, which share no code with the package."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.integrate import solve_ivp

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pendmap import Pendulum
    from pendmap.signal import Floats


def motion(  # noqa: PLR0913 (a start, and what moves it)
    x: Pendulum,
    theta: Any,  # noqa: ANN401 (numbers or arrays)
    velocity: Any,  # noqa: ANN401
    times: Sequence[float],
    further: Callable[..., Any] | None = None,
    *,
    tol: float = 1e-11,
) -> Floats:
    """Return angles and velocities, shape (2, starts, times), under a further torque if any."""

    def rate(t: float, y: Floats) -> Floats:
        angle, speed = y.reshape(2, -1)
        pull = (1 + x.p * math.cos(x.omega * t + x.phase)) * np.sin(angle)
        torque = x.torque if further is None else x.torque + further(t, angle, speed)
        return np.concatenate([speed, torque - x.gamma * speed - pull])

    start = np.concatenate([np.ravel(theta), np.ravel(velocity)])
    run = solve_ivp(rate, (0, times[-1]), start, "DOP853", times, rtol=tol, atol=tol)
    return np.asarray(run.y).reshape(2, -1, len(times))


def poincare(
    x: Pendulum, state: Sequence[float], n: int = 1, tol: float = 1e-12
) -> tuple[Floats, Floats]:
    """Return the state after n periods and its derivative, by the variational equations."""

    def rate(t: float, y: Floats) -> list[float]:
        pull = 1 + x.p * math.cos(x.omega * t + x.phase)
        bend = -pull * math.cos(y[0])
        a = x.torque - x.gamma * y[1] - pull * math.sin(y[0])
        return [y[1], a, y[4], y[5], bend * y[2] - x.gamma * y[4], bend * y[3] - x.gamma * y[5]]

    span = (0, n * math.tau / x.omega)
    run = solve_ivp(rate, span, [*state, 1, 0, 0, 1], "DOP853", rtol=tol, atol=tol)
    return run.y[:2, -1], run.y[2:, -1].reshape(2, 2)


def decays(x: Pendulum, theta: float = 0.0) -> bool:
    """Return whether small motions about a rest decay: its multipliers are less than 1."""
    _, derivative = poincare(x, (theta, 0.0))
    return bool(np.abs(np.linalg.eigvals(derivative)).max() < 1 + 1e-6)
