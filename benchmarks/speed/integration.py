"""Integration alone at equal error, on one thread: pendmap, heyoka's batch mode, a numba RK4."""

from __future__ import annotations

import argparse
import statistics
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.peers import heyoka_batch, numba_rk4, ours
from benchmarks.peers.common import (
    CASES,
    SEED,
    Case,
    Method,
    Regular,
    alternate,
    errors,
    median_ratio,
    regular_starts,
    side_for,
)
from benchmarks.peers.report import machine, note, say, table

if TYPE_CHECKING:
    from collections.abc import Sequence

WORST = 100.0
WANTED = {CASES[0]: 6.0, CASES[1]: 10.0}
HEADERS = (
    "method",
    "setting",
    "starts",
    "worst error",
    "95 %",
    "ns",
    "spread",
    "times ours",
    "wanted",
)


def contenders(
    case: Case, sample: Regular, target: float, *, peers_only: bool
) -> tuple[dict[str, Method], str]:
    """Return the methods by name, each at its setting for the target error, and heyoka's survey."""
    methods: dict[str, Method] = {}
    if not peers_only:
        methods["pendmap"] = ours.at_error(case, sample, target)
    survey = heyoka_batch.survey(case, sample, target)
    methods["heyoka, best"] = survey[0][1]
    for how in heyoka_batch.plain_settings():
        name = f"heyoka, default {how.batch}" + " avx512" * how.force_avx512
        methods[name] = heyoka_batch.at_error(case, how, sample, target)
    methods["numba RK4, starts"] = numba_rk4.at_error(case, "starts", sample, target)
    methods["numba RK4, blocks"] = numba_rk4.at_error(case, "blocks", sample, target)
    rows = [(f"{ns:.0f}", method.setting) for ns, method in survey]
    return methods, table(("ns", "heyoka's setting"), rows)


def rows_of(
    case: Case,
    methods: dict[str, Method],
    sides: dict[str, int],
    times: dict[str, list[float]],
    sample: Regular,
) -> list[Sequence[str]]:
    """Return the table's rows, one a method."""
    rows: list[Sequence[str]] = []
    for name, method in methods.items():
        error = errors(method, sample)
        took = times[name]
        median = statistics.median(took)
        wanted = "-"
        if method.label == "heyoka":
            wanted = f"{WANTED.get(case, 1):g}x"
        elif method.label == "numba RK4":
            wanted = "100x"
        ratio = f"{median_ratio(took, times['pendmap']):.1f}x" if "pendmap" in times else "-"
        rows.append(
            (
                name,
                method.setting,
                f"{sides[name] ** 2}",
                f"{error.max():.1e}",
                f"{np.percentile(error, 95):.1e}",
                f"{median:.1f}",
                f"{(max(took) - min(took)) / median:.0%}",
                ratio,
                wanted,
            )
        )
    return rows


def options() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--error", type=float, default=1e-9, help="the error of all, as measured")
    parser.add_argument(
        "--percentile", type=float, default=WORST, help="of the errors: 100, the worst, or less"
    )
    parser.add_argument("--periods", type=int, default=200, help="forcing periods that are timed")
    parser.add_argument("--rounds", type=int, default=5, help="rounds, methods alternating")
    parser.add_argument("--seconds", type=float, default=1.0, help="least length of one timing")
    parser.add_argument("--survey", action="store_true", help="also print heyoka's settings tried")
    parser.add_argument("--peers-only", action="store_true", help="leave pendmap out")
    return parser.parse_args()


def main() -> None:
    """Print one table a case."""
    opts = options()
    what = "worst" if opts.percentile == WORST else f"{opts.percentile:g}th percentile of the"
    say("Integration alone, one thread: ns (wall clock, median) a trajectory and forcing period")
    say(machine(("pendmap", "heyoka", "numba", "numpy"), "" if opts.peers_only else ours.simd()))
    for case in CASES:
        sample = regular_starts(case, percentile=opts.percentile)
        note(f"{case}: choosing settings on {sample.theta.size} regular starts")
        methods, tried = contenders(case, sample, opts.error, peers_only=opts.peers_only)
        note(f"{case}: timing")
        sides = {name: side_for(m, opts.periods, opts.seconds) for name, m in methods.items()}
        times = alternate(methods, sides, opts.periods, opts.rounds)
        say(f"\n{case}: {opts.periods} periods, grid of starts; {what} error <= {opts.error:g}")
        say(
            f"after {sample.periods} periods on {sample.theta.size} regular starts (perturbations "
            f"grow at most 10 times; of 2000, seed {SEED}); {opts.rounds} rounds"
        )
        say(table(HEADERS, rows_of(case, methods, sides, times, sample)))
        if opts.survey:
            say("\n" + tried)


if __name__ == "__main__":
    main()
