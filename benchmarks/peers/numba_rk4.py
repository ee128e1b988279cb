"""A hand-written Runge-Kutta method of order 4, fixed step, compiled by numba, on one thread.

Two loops are available. "starts" is the usual one: one start after another, two cosines and four
sines a step. "blocks" takes the cosine from a table of one period and advances 32 starts together
through each step, so that their sines overlap.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numba
import numpy as np

from benchmarks.peers.common import Case, Regular, loosest

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

BLOCK = 32
LADDER = tuple(sorted({round(100 * 1.02**k) for k in range(220)}))


@numba.njit(fastmath=True)
def _starts(
    case: tuple[float, float, float], theta: Floats, velocity: Floats, steps: int, periods: int
) -> None:
    gamma, p, omega = case
    h = 2.0 * math.pi / omega / steps
    for i in range(theta.size):
        x, v = theta[i], velocity[i]
        for _ in range(periods):
            f1 = 1.0 + p
            for step in range(steps):
                f2 = 1.0 + p * math.cos(omega * h * (step + 0.5))
                f3 = 1.0 + p * math.cos(omega * h * (step + 1.0))
                a1 = -gamma * v - f1 * math.sin(x)
                v2 = v + 0.5 * h * a1
                a2 = -gamma * v2 - f2 * math.sin(x + 0.5 * h * v)
                v3 = v + 0.5 * h * a2
                a3 = -gamma * v3 - f2 * math.sin(x + 0.5 * h * v2)
                v4 = v + h * a3
                a4 = -gamma * v4 - f3 * math.sin(x + h * v3)
                x += h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
                v += h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
                f1 = f3
        theta[i], velocity[i] = x, v


@numba.njit(fastmath=True)
def _blocks(
    case: tuple[float, float, float], theta: Floats, velocity: Floats, steps: int, periods: int
) -> None:
    gamma, p, omega = case
    h = 2.0 * math.pi / omega / steps
    force = np.empty(2 * steps + 1)
    for k in range(2 * steps + 1):
        force[k] = 1.0 + p * math.cos(math.pi * k / steps)
    angle, speed = np.empty(BLOCK), np.empty(BLOCK)
    for first in range(0, theta.size, BLOCK):
        for i in range(BLOCK):
            source = min(first + i, theta.size - 1)
            angle[i], speed[i] = theta[source], velocity[source]
        for _ in range(periods):
            for step in range(steps):
                f1, f2, f3 = force[2 * step], force[2 * step + 1], force[2 * step + 2]
                for i in range(BLOCK):
                    x, v = angle[i], speed[i]
                    a1 = -gamma * v - f1 * math.sin(x)
                    v2 = v + 0.5 * h * a1
                    a2 = -gamma * v2 - f2 * math.sin(x + 0.5 * h * v)
                    v3 = v + 0.5 * h * a2
                    a3 = -gamma * v3 - f2 * math.sin(x + 0.5 * h * v2)
                    v4 = v + h * a3
                    a4 = -gamma * v4 - f3 * math.sin(x + h * v3)
                    angle[i] = x + h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
                    speed[i] = v + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
        for i in range(min(BLOCK, theta.size - first)):
            theta[first + i], velocity[first + i] = angle[i], speed[i]


class NumbaRk4:
    """The fixed-step method for one case."""

    label = "numba RK4"

    def __init__(self, case: Case, steps: int, loop: Literal["starts", "blocks"]) -> None:
        """Choose the steps a forcing period and the loop."""
        self.case, self.steps, self.loop = case, steps, loop

    @property
    def setting(self) -> str:
        """The loop and the steps as text."""
        return f"loop over {self.loop}, {self.steps} steps a period"

    def advance(self, theta: Floats, velocity: Floats, periods: int) -> tuple[Floats, Floats]:
        """Return unwrapped angle and velocity, shape (N,), after whole forcing periods."""
        theta, velocity = theta.copy(), velocity.copy()
        run = _starts if self.loop == "starts" else _blocks
        numbers = (self.case.gamma, self.case.p, self.case.omega)
        run(numbers, theta, velocity, self.steps, periods)
        return theta, velocity


def at_error(
    case: Case, loop: Literal["starts", "blocks"], sample: Regular, target: float
) -> NumbaRk4:
    """Return the method with the fewest steps a period whose error is at most `target`."""
    return loosest(lambda steps: NumbaRk4(case, steps, loop), LADDER, sample, target)
