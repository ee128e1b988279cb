"""Sweeps of basin maps: processor time of the whole over that of the integration alone.

The integration alone is the labelling of all starts with attractors, traps, step and bound known,
of the same models. Whole and integration are measured alternately, on one thread.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import pendmap
from benchmarks.peers.report import machine, note, say, table
from pendmap import _core
from pendmap.analysis.varied import with_values
from pendmap.errors import instruction_set


@dataclass(frozen=True)
class Sweep:
    """A sweep: parameters of the model, and its ranges."""

    model: dict[str, Any]
    ranges: dict[str, tuple[float, float, int]]
    effects: tuple[pendmap.Effect, ...] = field(default=())

    @property
    def pendulum(self) -> pendmap.Pendulum:
        """The model."""
        return pendmap.Pendulum(**self.model, effects=self.effects)


def sweeps(points: int) -> list[Sweep]:
    """Return the sweeps, of about ``points`` models each."""
    side = max(2, round(math.sqrt(points)))
    drag = pendmap.Effect("quadratic_drag", {"q": 0.0})
    usual = {"gamma": 0.1, "omega": 2.0}
    return [
        Sweep(usual, {"p": (0.4, 2.0, points)}),
        Sweep(usual, {"p": (0.4, 0.8, points)}),
        Sweep({"gamma": 0.02, "omega": 2.0}, {"p": (0.1, 1.2, points)}),
        Sweep({"gamma": 0.1, "p": 1.0}, {"omega": (0.6, 2.6, points)}),
        Sweep(usual | {"p": 0.8}, {"torque": (0.0, 0.4, points)}),
        Sweep(usual | {"p": 0.8}, {"theta_r": (0.0, 0.2, points)}),
        Sweep(usual | {"p": 1.0}, {"quadratic_drag.q": (0.0, 0.1, points)}, (drag,)),
        Sweep(usual, {"p": (0.4, 1.6, side), "omega": (1.6, 2.4, side)}),
        Sweep(usual, {"p": (1.9, 2.2, points)}),
    ]


def plans(one: Sweep, cells: int) -> list[_core.BasinPlan]:
    """Return the plans of all models, after all their searches."""
    axes = ((-math.pi, math.pi, cells), (-3.0, 3.0, cells))
    choices = {
        "tol": 1e-6,
        "max_periods": None,
        "threads": 1,
        "seed": 0,
        "layer_periods": None,
        "check": False,
    }
    found = []
    grids = np.meshgrid(*(np.linspace(*span) for span in one.ranges.values()), indexing="ij")
    for values in zip(*(grid.ravel().tolist() for grid in grids), strict=True):
        model = with_values(one.pendulum, dict(zip(one.ranges, values, strict=True)))
        plan = _core.BasinPlan(model, axes, choices, None, None, found[-1] if found else None)
        plan.map()
        found.append(plan)
    return found


def cpu(work: Any) -> float:  # noqa: ANN401 (a function)
    """Return the processor time of a call, s."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def measure(one: Sweep, cells: int, rounds: int) -> tuple[str, ...]:
    """Measure one sweep and format its row."""
    known = plans(one, cells)
    whole, alone = [], []
    for _ in range(rounds):
        whole.append(
            cpu(
                lambda: pendmap.sweep(
                    one.pendulum, one.ranges, grid=cells, run=pendmap.RunOptions(threads=1)
                )
            )
        )
        alone.append(cpu(lambda: [plan.label(0, cells * cells) for plan in known]))
    ratios = [a / b for a, b in zip(whole, alone, strict=True)]
    spans = [f"{name} {low:g}:{high:g}:{n}" for name, (low, high, n) in one.ranges.items()]
    fixed = [f"{name} {value:g}" for name, value in one.model.items() if name not in one.ranges]
    return (
        f"{', '.join(spans)}; {', '.join(fixed)}",
        f"{statistics.median(whole):.2f}",
        f"{statistics.median(alone):.2f}",
        f"{statistics.median(ratios):.2f}",
    )


def main() -> None:
    """Run all sweeps and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=48)
    parser.add_argument("--cells", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    say(machine(["pendmap", "numpy"], instruction_set()))
    rows = [measure(one, given.cells, given.rounds) for one in sweeps(given.points)]
    say(table(("sweep", "whole, s", "integration, s", "ratio"), rows))
    note("Aim: at most 3. Where chaos attracts everything, labels need few periods: the last one.")


if __name__ == "__main__":
    main()
