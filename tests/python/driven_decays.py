"""Motions for the tests of identification, integrated with scipy independently of pendmap."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import solve_ivp

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["motion"]


def motion(  # noqa: PLR0913 (the parameters of the equation)
    time: NDArray[np.float64],
    start: tuple[float, float],
    *,
    w0: float,
    c_over_m: float = 0.0,
    friction: float = 0.0,
    drag: float = 0.0,
    pivot: Callable[[float], tuple[float, float]] = lambda _: (0.0, 0.0),
) -> NDArray[np.float64]:
    """Return the angles at equally spaced times, from turn to turn until friction holds.

    ``th'' + c_over_m v + drag v |v| + w0**2 ((1 + up) sin th + side cos th) = -friction sign(v)``;
    ``pivot`` returns ``up`` and ``side`` at a time. A motion under a pivot must not stick.
    """
    angles = np.full(time.shape, np.nan)
    now, state = float(time[0]), np.array(start)

    def load(t: float, theta: float) -> float:
        up, side = pivot(t)
        return -(w0**2) * ((1 + up) * math.sin(theta) + side * math.cos(theta))

    def turn(_: float, y: NDArray[np.float64]) -> float:
        return float(y[1])

    while True:
        pull = load(now, state[0])
        if state[1] == 0 and abs(pull) <= friction:
            angles[now <= time] = state[0]
            return angles
        sense = math.copysign(1.0, state[1] if state[1] != 0 else pull)

        def slope(t: float, y: NDArray[np.float64], sense: float = sense) -> list[float]:
            damping = c_over_m * y[1] + drag * y[1] * abs(y[1]) + sense * friction
            return [y[1], load(t, y[0]) - damping]

        turn.terminal, turn.direction = True, -sense  # type: ignore[attr-defined]
        until = float(time[-1]) + 1e-9
        run = solve_ivp(
            slope,
            (now, until),
            state,
            method="DOP853",
            rtol=1e-12,
            atol=1e-12,
            events=turn,
            dense_output=True,
            max_step=0.2,
        )
        within = (now <= time) & (time <= run.t[-1])
        angles[within] = run.sol(time[within])[0]
        if run.status == 0:
            return angles
        now, state = float(run.t[-1]), np.array([run.y[0, -1], 0.0])
