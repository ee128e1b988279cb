"""Adaptive basin maps: agreement with the full grid, cells computed, processor time.

Plain and adaptive map of a plane are computed alternately in one process. The ratio is the median
of the rounds. ``error`` is the share of cells whose label differs from that of the plain map; it
should be within the interval that the audit gives. The exponent is the uncertainty exponent of the
boundary: 1 where it is smooth, 0 where it fills the plane.
"""

from __future__ import annotations

import argparse
import statistics
import time
from typing import TYPE_CHECKING, Any

import pendmap
from benchmarks.peers.report import machine, note, say, table
from pendmap.errors import instruction_set

if TYPE_CHECKING:
    import xarray as xr

PLANES: tuple[dict[str, Any], ...] = (
    {"gamma": 0.1, "p": 0.6, "omega": 2.0},
    {"gamma": 0.05, "p": 0.4, "omega": 2.0},
    {"gamma": 0.2, "p": 0.8, "omega": 1.8},
    {"gamma": 0.3, "p": 0.5, "omega": 2.0, "torque": 0.6},
    {"gamma": 0.1, "p": 0.0, "omega": 2.0, "torque": 0.5},
    {"gamma": 0.1, "p": 0.0, "omega": 2.0, "theta_r": 0.1},
    {"gamma": 0.5, "p": 1.2, "omega": 1.6},
    {"gamma": 0.2, "p": 0.5, "omega": 2.0, "torque": 0.4},
    {"gamma": 0.1, "p": 0.6, "omega": 2.0, "theta_r": 0.02},
    {"gamma": 0.1, "p": 0.8, "omega": 2.0},
    {"gamma": 0.2, "p": 0.8, "omega": 1.8, "theta_r": 0.05},
    {"gamma": 0.1, "p": 1.0, "omega": 2.0},
    {"gamma": 0.1, "p": 1.7, "omega": 2.0},
    {"gamma": 0.1, "p": 1.5, "omega": 1.1},
)
"""Smooth boundaries first; then those that are fractal here and there, then everywhere."""


def timed(
    model: pendmap.Pendulum, cells: int, threads: int, **more: bool
) -> tuple[xr.Dataset, float]:
    """Return a map, and its processor time in s."""
    begin = time.process_time()
    found = pendmap.basins(model, cells, threads=threads, **more)
    return found, time.process_time() - begin


def measure(parameters: dict[str, Any], cells: int, rounds: int) -> tuple[str, ...]:
    """Measure one plane and format its row."""
    model = pendmap.Pendulum(**parameters)
    seconds = []
    for _ in range(rounds):
        full, plain = timed(model, cells, 1)
        own, fast = timed(model, cells, 1, adaptive=True)
        seconds.append((plain, fast))
    wrong = float((own.label != full.label).mean())
    low, high = float(own.label_error_low), float(own.label_error_high)
    exponent = float(full.get("uncertainty_exponent", float("nan")))
    return (
        ", ".join(f"{name} {value:g}" for name, value in parameters.items()),
        f"{exponent:.2f}",
        f"{100 * float(own.computed_share):.1f} %",
        f"{wrong:.1e}",
        f"{low:.1e} to {high:.1e}",
        "yes" if low <= wrong <= high else "NO",
        f"{statistics.median(plain for plain, _ in seconds):.2f}",
        f"{statistics.median(fast / plain for plain, fast in seconds):.3f}",
    )


def main() -> None:
    """Measure all planes and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=2000)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    say(machine(["pendmap", "numpy"], instruction_set()))
    rows = [measure(one, given.cells, given.rounds) for one in PLANES]
    head = ("plane", "exponent", "computed", "error", "audit, 95 %", "inside", "plain, s", "ratio")
    say(table(head, rows))
    note(
        "Aims: where the exponent is 1 error at most 1e-3 and ratio at most 0.25; else 1.1 at most."
    )


if __name__ == "__main__":
    main()
