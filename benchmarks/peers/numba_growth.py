"""Growth of a tangent with each start, by the numba RK4 in blocks, on all threads of numba.

The state is that of `numba_rk4` in blocks of 32 starts with a table of cosines; the tangent uses
the same stages and is scaled back to length 1 once a period. Each start has its own drive strength;
the last stroboscopic points are kept if there is room for them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numba
import numpy as np

from benchmarks.peers.common import Case, Regular, loosest
from benchmarks.peers.numba_rk4 import BLOCK, LADDER

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@numba.njit(fastmath=True, parallel=True)
def grow(  # noqa: PLR0913, PLR0917 (compiled: arrays and numbers alone)
    gamma: float,
    omega: float,
    p: Floats,
    theta: Floats,
    velocity: Floats,
    growth: Floats,
    points: Floats,
    steps: int,
    periods: int,
) -> None:
    """Advance N starts in place; add up growth, shape (N,); fill points, shape (N, kept, 2)."""
    kept = points.shape[1]
    h = 2.0 * math.pi / omega / steps
    wave = np.empty(2 * steps + 1)
    for k in range(2 * steps + 1):
        wave[k] = math.cos(math.pi * k / steps)
    for block in numba.prange((theta.size + BLOCK - 1) // BLOCK):
        first = block * BLOCK
        angle, speed, ln = np.empty(BLOCK), np.empty(BLOCK), np.zeros(BLOCK)
        drive = np.empty(BLOCK)
        across, along = np.full(BLOCK, math.sqrt(0.5)), np.full(BLOCK, math.sqrt(0.5))
        for i in range(BLOCK):
            source = min(first + i, theta.size - 1)
            angle[i], speed[i], drive[i] = theta[source], velocity[source], p[source]
        for period in range(periods):
            for step in range(steps):
                c1, c2, c3 = wave[2 * step], wave[2 * step + 1], wave[2 * step + 2]
                for i in range(BLOCK):
                    f1, f2, f3 = 1 + drive[i] * c1, 1 + drive[i] * c2, 1 + drive[i] * c3
                    x, v, y, w = angle[i], speed[i], across[i], along[i]
                    a1 = -gamma * v - f1 * math.sin(x)
                    b1 = -gamma * w - f1 * math.cos(x) * y
                    x2, v2, y2, w2 = (
                        x + 0.5 * h * v,
                        v + 0.5 * h * a1,
                        y + 0.5 * h * w,
                        w + 0.5 * h * b1,
                    )
                    a2 = -gamma * v2 - f2 * math.sin(x2)
                    b2 = -gamma * w2 - f2 * math.cos(x2) * y2
                    x3, v3, y3, w3 = (
                        x + 0.5 * h * v2,
                        v + 0.5 * h * a2,
                        y + 0.5 * h * w2,
                        w + 0.5 * h * b2,
                    )
                    a3 = -gamma * v3 - f2 * math.sin(x3)
                    b3 = -gamma * w3 - f2 * math.cos(x3) * y3
                    x4, v4, y4, w4 = x + h * v3, v + h * a3, y + h * w3, w + h * b3
                    a4 = -gamma * v4 - f3 * math.sin(x4)
                    b4 = -gamma * w4 - f3 * math.cos(x4) * y4
                    angle[i] = x + h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
                    speed[i] = v + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
                    across[i] = y + h / 6.0 * (w + 2.0 * (w2 + w3) + w4)
                    along[i] = w + h / 6.0 * (b1 + 2.0 * (b2 + b3) + b4)
            for i in range(BLOCK):
                size = math.sqrt(across[i] ** 2 + along[i] ** 2)
                ln[i] += math.log(size)
                across[i] /= size
                along[i] /= size
            place = period - periods + kept
            for i in range(min(BLOCK, theta.size - first) if place >= 0 else 0):
                points[first + i, place, 0], points[first + i, place, 1] = angle[i], speed[i]
        for i in range(min(BLOCK, theta.size - first)):
            theta[first + i], velocity[first + i] = angle[i], speed[i]
            growth[first + i] = ln[i]


def use_threads(count: int) -> None:
    """Set the number of threads of numba's parallel loops."""
    numba.set_num_threads(count)


class NumbaGrowth:
    """The fixed-step method for one case."""

    label = "numba RK4"

    def __init__(self, case: Case, steps: int) -> None:
        """Choose the steps a forcing period."""
        self.case, self.steps = case, steps

    @property
    def setting(self) -> str:
        """The loop and the steps as text."""
        return f"prange over blocks, {self.steps} steps a period"

    def _run(self, theta: Floats, velocity: Floats, periods: int) -> tuple[Floats, Floats, Floats]:
        theta, velocity, growth = theta.copy(), velocity.copy(), np.empty(theta.size)
        case, drive = self.case, np.full(theta.size, self.case.p)
        none = np.empty((theta.size, 0, 2))
        grow(case.gamma, case.omega, drive, theta, velocity, growth, none, self.steps, periods)
        return theta, velocity, growth

    def advance(self, theta: Floats, velocity: Floats, periods: int) -> tuple[Floats, Floats]:
        """Return unwrapped angle and velocity, shape (N,), after whole forcing periods."""
        return self._run(theta, velocity, periods)[:2]

    def exponents(self, theta: Floats, velocity: Floats, periods: int) -> Floats:
        """Return the finite-time exponents, shape (N,)."""
        return self._run(theta, velocity, periods)[2] / (periods * self.case.period)


def at_error(case: Case, sample: Regular, target: float) -> NumbaGrowth:
    """Return the method with the fewest steps a period whose error is at most `target`."""
    return loosest(lambda steps: NumbaGrowth(case, steps), LADDER, sample, target)
