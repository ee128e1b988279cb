"""Coulomb friction at equal error, on one thread: pendmap, heyoka with events, a naive RK4."""

from __future__ import annotations

import argparse
import math
import statistics
import time
from typing import TYPE_CHECKING

import numba
import numpy as np

from benchmarks.peers import ours
from benchmarks.peers.common import SEED, THETA_RANGE, VELOCITY_RANGE, Case, Method, median_ratio
from benchmarks.peers.heyoka_friction import HeyokaFriction
from benchmarks.peers.report import machine, note, say, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

CASE, THETA_R = Case(0.02, 1.0, 2.0), 0.05
PERIODS = 5
SAMPLE = 300
PERCENTILE = 95.0
NAIVE_STEPS = (100, 1000, 10000, 100000)


@numba.njit
def naive(
    case: tuple[float, float, float, float],
    theta: Floats,
    velocity: Floats,
    counts: tuple[int, int],
) -> None:
    """Advance by a Runge-Kutta method of order 4 with sign(v) on the right, without events."""
    gamma, p, omega, theta_r = case
    steps, periods = counts
    h = 2.0 * math.pi / omega / steps
    for i in range(theta.size):
        x, v = theta[i], velocity[i]
        for step in range(steps * periods):
            t = h * step
            f1 = 1.0 + p * math.cos(omega * t)
            f2 = 1.0 + p * math.cos(omega * (t + 0.5 * h))
            f3 = 1.0 + p * math.cos(omega * (t + h))
            a1 = -gamma * v - f1 * math.sin(x) - theta_r * np.sign(v)
            v2 = v + 0.5 * h * a1
            a2 = -gamma * v2 - f2 * math.sin(x + 0.5 * h * v) - theta_r * np.sign(v2)
            v3 = v + 0.5 * h * a2
            a3 = -gamma * v3 - f2 * math.sin(x + 0.5 * h * v2) - theta_r * np.sign(v3)
            v4 = v + h * a3
            a4 = -gamma * v4 - f3 * math.sin(x + h * v3) - theta_r * np.sign(v4)
            x += h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
            v += h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
        theta[i], velocity[i] = x, v


class Naive:
    """The RK4 at a number of steps a period."""

    label = "numba RK4, sign(v)"

    def __init__(self, steps: int) -> None:
        """Choose the steps a forcing period."""
        self.steps = steps

    @property
    def setting(self) -> str:
        """The steps as text."""
        return f"{self.steps} steps a period"

    def advance(self, theta: Floats, velocity: Floats, periods: int) -> tuple[Floats, Floats]:
        """Return unwrapped angle and velocity, shape (N,), after whole forcing periods."""
        theta, velocity = theta.copy(), velocity.copy()
        case = (CASE.gamma, CASE.p, CASE.omega, THETA_R)
        naive(case, theta, velocity, (self.steps, periods))
        return theta, velocity


def errors(method: Method, starts: tuple[Floats, Floats], ends: tuple[Floats, Floats]) -> Floats:
    """Return max(abs(d theta), abs(d velocity)) after five periods, shape (N,)."""
    theta, velocity = method.advance(*starts, PERIODS)
    apart = np.remainder(theta - ends[0] + math.pi, 2.0 * math.pi) - math.pi
    return np.maximum(np.abs(apart), np.abs(velocity - ends[1]))


def clock(method: Method, starts: tuple[Floats, Floats], periods: int) -> float:
    """Return ns a trajectory and forcing period."""
    begin = time.perf_counter()
    method.advance(*starts, periods)
    return (time.perf_counter() - begin) * 1e9 / (starts[0].size * periods)


def draw(count: int) -> tuple[Floats, Floats]:
    """Draw starts over the plane."""
    rng = np.random.default_rng(SEED)
    return rng.uniform(*THETA_RANGE, count), rng.uniform(*VELOCITY_RANGE, count)


def main() -> None:
    """Print one table: equal error first, then the naive method, whose error does not decrease."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--error", type=float, default=1e-9, help="95th percentile of all")
    parser.add_argument("--rounds", type=int, default=3, help="rounds, methods alternating")
    opts = parser.parse_args()
    say("Coulomb friction, one thread: ns (wall clock, median) a trajectory and forcing period")
    say(machine(("pendmap", "heyoka", "numba", "numpy"), ours.simd()))
    starts = draw(SAMPLE)
    note("reference: heyoka at its smallest tolerance")
    ends = HeyokaFriction(CASE, THETA_R, 1e-18).advance(*starts, PERIODS)

    def high(method: Method) -> float:
        return float(np.percentile(errors(method, starts, ends), PERCENTILE))

    ladder = (ours.Pendmap(CASE, n, theta_r=THETA_R) for n in range(10, 200))
    mine = next(m for m in ladder if high(m) <= opts.error)
    tols = (10.0**-k for k in np.arange(6.0, 16.0, 0.5))
    peer = next(
        m for m in (HeyokaFriction(CASE, THETA_R, t) for t in tols) if high(m) <= opts.error
    )
    methods: list[tuple[Method, int, int]] = [(mine, 50_000, 20), (peer, SAMPLE, 20)]
    methods += [(Naive(n), max(20, 200_000 // n), PERIODS) for n in NAIVE_STEPS]
    times: list[list[float]] = [[] for _ in methods]
    for _ in range(opts.rounds):
        for k, (method, count, periods) in enumerate(methods):
            times[k].append(clock(method, draw(count), periods))
    rows = []
    for (method, _, _), took in zip(methods, times, strict=True):
        error = errors(method, starts, ends)
        rows.append(
            (
                method.label,
                method.setting,
                f"{np.median(error):.1e}",
                f"{np.percentile(error, PERCENTILE):.1e}",
                f"{statistics.median(took):.0f}",
                f"{median_ratio(took, times[0]):.1f}x",
            )
        )
    _, velocity = mine.advance(*draw(50_000), 20)
    say(
        f"\n{CASE}, theta_r {THETA_R}: error after {PERIODS} periods on {SAMPLE} starts "
        f"(seed {SEED})"
    )
    say(table(("method", "setting", "median error", "95 %", "ns", "times ours"), rows))
    say(f"stuck after 20 periods: {np.mean(velocity == 0.0):.1%} of the starts")


if __name__ == "__main__":
    main()
