"""Comparison at equal error: starts, reference, and the loosest sufficient setting of a method.

The equation is th'' = -gamma th' - (1 + p cos(omega t)) sin th, nondimensional, angles in rad.
"""

from __future__ import annotations

import math
import statistics
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeVar

import numpy as np
from scipy.integrate import solve_ivp  # type: ignore[import-untyped]

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

Rung = TypeVar("Rung")
AMethod = TypeVar("AMethod", bound="Method")

SEED = 20240
THETA_RANGE = (-math.pi, math.pi)
VELOCITY_RANGE = (-3.0, 3.0)


@dataclass(frozen=True)
class Case:
    """A pendulum of eq. 1.2 without phase and torque."""

    gamma: float
    p: float
    omega: float

    @property
    def period(self) -> float:
        """The forcing period 2 pi / omega."""
        return 2.0 * math.pi / self.omega

    def __str__(self) -> str:
        """Return the parameters as shown in the tables."""
        return f"gamma {self.gamma:g}, p {self.p:g}, omega {self.omega:g}"


CASES = (Case(0.1, 1.0, 2.0), Case(0.1, 1.7, 0.87))


class Method(Protocol):
    """An integrator at one setting, for one case, on one thread."""

    @property
    def label(self) -> str:
        """Package or author of the method."""

    @property
    def setting(self) -> str:
        """The setting as text."""

    def advance(self, theta: Floats, velocity: Floats, periods: int) -> tuple[Floats, Floats]:
        """Return angle (any branch) and velocity, shape (N,), after whole forcing periods."""


@dataclass(frozen=True)
class Regular:
    """Starts whose trajectories are regular, and where they are after some periods.

    Attributes
    ----------
    theta, velocity : arrays of shape (N,)
        The starts.
    theta_end, velocity_end : arrays of shape (N,)
        The reference after `periods` forcing periods; the angle is unwrapped.
    percentile : float
        Which of the sorted errors is *the* error of a method, in percent; 100 is the worst.
    """

    theta: Floats
    velocity: Floats
    theta_end: Floats
    velocity_end: Floats
    periods: int
    percentile: float


def regular_starts(
    case: Case,
    *,
    count: int = 2000,
    periods: int = 5,
    growth: float = 10.0,
    percentile: float = 100.0,
) -> Regular:
    """Draw starts and keep those that magnify no small perturbation more than `growth` times.

    The growth is the largest singular value of the tangent map over `periods` forcing periods.
    State and tangent map come from scipy's DOP853 at rtol = atol = 1e-13, all starts in one run.
    """
    rng = np.random.default_rng(SEED)
    theta = rng.uniform(*THETA_RANGE, count)
    velocity = rng.uniform(*VELOCITY_RANGE, count)

    def rhs(t: float, flat: Floats) -> Floats:
        angle, speed, a, b, c, d = flat.reshape(6, count)
        force = 1.0 + case.p * math.cos(case.omega * t)
        stiffness = force * np.cos(angle)
        out = np.empty((6, count))
        out[0] = speed
        out[1] = -case.gamma * speed - force * np.sin(angle)
        out[2], out[3] = c, d
        out[4] = -case.gamma * c - stiffness * a
        out[5] = -case.gamma * d - stiffness * b
        return out.ravel()

    ones, zeros = np.ones(count), np.zeros(count)
    start = np.concatenate([theta, velocity, ones, zeros, zeros, ones])
    solution = solve_ivp(
        rhs, (0.0, periods * case.period), start, method="DOP853", rtol=1e-13, atol=1e-13
    )
    end = solution.y[:, -1].reshape(6, count)
    largest = np.linalg.svd(end[2:].T.reshape(count, 2, 2), compute_uv=False)[:, 0]
    keep = largest <= growth
    starts, ends = (theta[keep], velocity[keep]), (end[0, keep], end[1, keep])
    return Regular(*starts, *ends, periods, percentile)


def errors(method: Method, sample: Regular) -> Floats:
    """Return max(abs(d theta), abs(d velocity)) against the reference, shape (N,)."""
    theta, velocity = method.advance(sample.theta, sample.velocity, sample.periods)
    turn = 2.0 * math.pi
    apart = np.remainder(theta - sample.theta_end + math.pi, turn) - math.pi
    return np.maximum(np.abs(apart), np.abs(velocity - sample.velocity_end))


def loosest(
    build: Callable[[Rung], AMethod], ladder: Sequence[Rung], sample: Regular, target: float
) -> AMethod:
    """Return the method at the first rung, from loose to strict, whose error is at most `target`.

    Raises
    ------
    ValueError
        If every rung misses the target.
    """
    for rung in ladder:
        method = build(rung)
        if np.percentile(errors(method, sample), sample.percentile) <= target:
            return method
    msg = f"error {target:g} is out of reach at {ladder[-1]}"
    raise ValueError(msg)


def grid(side: int) -> tuple[Floats, Floats]:
    """Return side x side starts, cell centres, theta running fastest, each of shape (N,)."""
    middles = (np.arange(side) + 0.5) / side
    theta = THETA_RANGE[0] + (THETA_RANGE[1] - THETA_RANGE[0]) * middles
    velocity = VELOCITY_RANGE[0] + (VELOCITY_RANGE[1] - VELOCITY_RANGE[0]) * middles
    angles, speeds = np.meshgrid(theta, velocity)
    return angles.ravel(), speeds.ravel()


def clock(method: Method, side: int, periods: int) -> float:
    """Return wall-clock ns a trajectory and forcing period on a grid of side x side starts."""
    theta, velocity = grid(side)
    begin = time.perf_counter()
    method.advance(theta, velocity, periods)
    return (time.perf_counter() - begin) * 1e9 / (theta.size * periods)


def side_for(method: Method, periods: int, seconds: float) -> int:
    """Return the side, a multiple of 16, of a grid that takes about `seconds` to integrate."""
    method.advance(*grid(16), 1)
    cost = clock(method, 16, periods) * 1e-9 * periods
    side = math.sqrt(seconds / cost)
    return max(16, 16 * math.ceil(side / 16))


def alternate(
    methods: Mapping[str, Method], sides: Mapping[str, int], periods: int, rounds: int
) -> dict[str, list[float]]:
    """Time every method once per round, alternating; return the ns of each round by name."""
    times: dict[str, list[float]] = {name: [] for name in methods}
    for _ in range(rounds):
        for name, method in methods.items():
            times[name].append(clock(method, sides[name], periods))
    return times


def median_ratio(times: Sequence[float], base: Sequence[float]) -> float:
    """Return the median over the rounds of times / base."""
    return statistics.median(a / b for a, b in zip(times, base, strict=True))
