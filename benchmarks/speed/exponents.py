"""Finite-time exponents of a grid of starts at equal error: pendmap, pynamicalsys, a numba RK4."""

from __future__ import annotations

import argparse
import importlib
import math
import statistics
import time
from typing import TYPE_CHECKING, Protocol

from benchmarks.peers import numba_growth, ours, pynamical
from benchmarks.peers.common import SEED, Case, errors, grid, median_ratio, regular_starts
from benchmarks.peers.report import machine, note, say, table

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

CASES = (Case(0.1, 2.0, 2.0), Case(0.1, 1.7, 0.87))
HEADERS = (
    "method",
    "setting",
    "starts",
    "worst error",
    "mean exponent",
    "ns",
    "spread",
    "times ours",
)
LEAST = 4


class Growing(Protocol):
    """A method that gives exponents as well as states."""

    @property
    def setting(self) -> str:
        """The setting of the method."""

    def advance(self, theta: Floats, velocity: Floats, periods: int) -> tuple[Floats, Floats]:
        """Return angle and velocity."""

    def exponents(self, theta: Floats, velocity: Floats, periods: int) -> Floats:
        """Return finite-time exponents."""


class Pendmap(ours.Pendmap):
    """The lane kernel with a tangent for each state."""

    def exponents(self, theta: Floats, velocity: Floats, periods: int) -> Floats:
        """Return the finite-time exponents, shape (N,)."""
        core = importlib.import_module("pendmap._core")
        growth: Floats = core.growth(
            self.pendulum, theta, velocity, 1, periods, self.steps, self.threads
        )
        return growth[:, 0] / (periods * self.case.period)


def clock(method: Growing, side: int, periods: int) -> tuple[float, float]:
    """Return ns a start and forcing period, and the mean exponent, on side x side starts."""
    theta, velocity = grid(side)
    begin = time.perf_counter()
    found = method.exponents(theta, velocity, periods)
    took = time.perf_counter() - begin
    return took * 1e9 / (theta.size * periods), float(found.mean())


def side_for(method: Growing, periods: int, seconds: float) -> int:
    """Return the side of a grid that takes about `seconds`."""
    method.exponents(*grid(LEAST // 2), 1)
    cost, _ = clock(method, LEAST, periods)
    side = math.sqrt(seconds * 1e9 / (cost * periods))
    return max(LEAST, LEAST * math.ceil(side / LEAST))


def main() -> None:
    """Print one table a case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--error", type=float, default=1e-6, help="the error of all, as measured")
    parser.add_argument("--periods", type=int, default=100, help="forcing periods of an exponent")
    parser.add_argument("--rounds", type=int, default=5, help="rounds, methods alternating")
    parser.add_argument("--seconds", type=float, default=1.0, help="least length of one timing")
    parser.add_argument("--threads", type=int, default=2)
    opts = parser.parse_args()
    numba_growth.use_threads(opts.threads)
    say(
        f"Finite-time exponents, {opts.threads} threads: ns (wall clock, median) a start and period"
    )
    say(machine(("pendmap", "pynamicalsys", "numba", "numpy"), ours.simd()))
    for case in CASES:
        sample = regular_starts(case)
        note(f"{case}: choosing settings on {sample.theta.size} regular starts")
        steps = ours.at_error(case, sample, opts.error).steps
        theirs = pynamical.at_error(case, sample, opts.error)
        methods: dict[str, Growing] = {
            "pendmap": Pendmap(case, steps, threads=opts.threads),
            "pynamicalsys, parallel": theirs,
            "pynamicalsys": pynamical.PynamicalLoop(case, theirs.steps),
            "numba RK4": numba_growth.at_error(case, sample, opts.error),
        }
        note(f"{case}: timing")
        sides = {name: side_for(m, opts.periods, opts.seconds) for name, m in methods.items()}
        times: dict[str, list[float]] = {name: [] for name in methods}
        means: dict[str, float] = {}
        for _ in range(opts.rounds):
            for name, method in methods.items():
                took, means[name] = clock(method, sides[name], opts.periods)
                times[name].append(took)
        rows: list[Sequence[str]] = []
        for name, method in methods.items():
            took = times[name]
            median = statistics.median(took)
            rows.append(
                (
                    name,
                    method.setting,
                    f"{sides[name] ** 2}",
                    f"{errors(method, sample).max():.1e}",
                    f"{means[name]:.4f}",
                    f"{median:.1f}",
                    f"{(max(took) - min(took)) / median:.0%}",
                    f"{median_ratio(took, times['pendmap']):.1f}x",
                )
            )
        say(f"\n{case}: {opts.periods} periods, grid of starts; worst error <= {opts.error:g}")
        say(
            f"after {sample.periods} periods on {sample.theta.size} regular starts (perturbations "
            f"grow at most 10 times; of 2000, seed {SEED}); {opts.rounds} rounds"
        )
        say(table(HEADERS, rows))


if __name__ == "__main__":
    main()
