"""A bifurcation diagram and an exponent map over parameters: pendmap, pynamicalsys, a numba RK4."""

from __future__ import annotations

import argparse
import math
import statistics
import time
from typing import TYPE_CHECKING

import numpy as np

import pendmap
from benchmarks.peers import numba_growth, ours, pynamical
from benchmarks.peers.common import Case, median_ratio, regular_starts
from benchmarks.peers.report import machine, note, say, table

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

CASE = Case(0.1, 1.7, 2.0)
START = (1.0, 0.3)
DIAGRAM = (500, 100)
MAP = (200, 300)
"""Periods dropped and kept: the peers do not detect when a motion has settled."""
NEAR = 1e-3
HEADERS = ("method", "work", "seconds", "spread", "times ours", "as ours")


def wrapped(theta: Floats) -> Floats:
    """Return angles in [-pi, pi)."""
    return (theta + np.pi) % (2 * np.pi) - np.pi


def numba_diagram(p: Floats, steps: int) -> tuple[Floats, Floats]:
    """Return stroboscopic points, shape (N, kept, 2), and exponents by the numba RK4."""
    theta, velocity = np.full(p.size, START[0]), np.full(p.size, START[1])
    growth, points = np.zeros(p.size), np.empty((p.size, DIAGRAM[1], 2))
    gamma, omega = CASE.gamma, CASE.omega
    numba_growth.grow(gamma, omega, p, theta, velocity, growth, points, steps, sum(DIAGRAM))
    return points, growth


def numba_map(p: Floats, omega: Floats, steps: int) -> Floats:
    """Return exponents over rows of omega and columns of p by the numba RK4."""
    rows = []
    for one in omega:
        theta, velocity = np.full(p.size, START[0]), np.full(p.size, START[1])
        none, growth = np.empty((p.size, 0, 2)), np.zeros(p.size)
        for periods in MAP:
            growth[:] = 0.0
            here = math.ceil(steps * CASE.omega / one)  # steps as long as for the drive of CASE
            numba_growth.grow(CASE.gamma, one, p, theta, velocity, growth, none, here, periods)
        rows.append(growth / (MAP[1] * 2 * np.pi / one))
    return np.array(rows)


def ours_diagram(p: Floats, starts: int) -> object:
    """Return the bifurcation diagram: all attractors, branches, both sweeps, exponents."""
    values = (float(p[0]), float(p[-1]), p.size)
    return pendmap.bifurcation(
        pendmap.Pendulum(gamma=CASE.gamma, omega=CASE.omega), {"p": values}, starts=starts
    )


def ours_map(p: Floats, omega: Floats, starts: int) -> object:
    """Return the map of attractors, with the exponents of all that exist."""
    ranges = {
        "p": (float(p[0]), float(p[-1]), p.size),
        "omega": (float(omega[0]), float(omega[-1]), omega.size),
    }
    return pendmap.parameter_map(pendmap.Pendulum(gamma=CASE.gamma), ranges, starts=starts)


def agrees_with_points(found: object, p: Floats, points: Floats) -> float:
    """Return the share of values for which a peer's points lie on an attractor of ours.

    On a chaotic attractor of ours the peer must find no closed cycle either.
    """
    entry = found["point_entry"].values
    plane = np.stack([found["point_theta"].values, found["point_velocity"].values], axis=1)
    cycles = found["entry_n"].values[entry] > 0
    values = found["point_value"].values
    agreed = 0
    for k, own in enumerate(p):
        here = np.isclose(values, own, rtol=0, atol=1e-9)
        theirs = np.stack([wrapped(points[k, -32:, 0]), points[k, -32:, 1]], axis=1)
        gap = theirs[:, None, :] - plane[None, here & cycles, :]
        gap[..., 0] = wrapped(gap[..., 0])
        apart = np.hypot(gap[..., 0], gap[..., 1])
        on_cycle = apart.size > 0 and bool((apart.min(axis=1) < NEAR).all())
        agreed += on_cycle or bool((here & ~cycles).any())
    return agreed / p.size


def agrees_with_exponents(found: object, exponents: Floats) -> float:
    """Return the share of cells in which a peer's exponent equals that of an attractor of ours.

    Equal means within 0.02, or positive if ours is chaotic.
    """
    cell, own = found["entry_cell"].values, found["entry_exponent"].values
    flat = exponents.ravel()[cell]
    alike = (np.abs(flat - own) < 0.02) | ((own > 0) & (flat > 0))  # noqa: PLR2004
    return np.unique(cell[alike]).size / exponents.size


def timed(work: dict[str, Callable[[], object]], rounds: int) -> tuple[dict, dict]:
    """Return seconds of every round and the last results, methods alternating."""
    times: dict[str, list[float]] = {name: [] for name in work}
    results: dict[str, object] = {}
    for _ in range(rounds):
        for name, run in work.items():
            begin = time.perf_counter()
            results[name] = run()
            times[name].append(time.perf_counter() - begin)
    return times, results


def told(times: dict, scale: dict[str, float], said: dict[str, str], agreed: dict) -> None:
    """Print a table; partial times are scaled to the whole."""
    first = next(iter(times))
    rows = []
    for name, took in times.items():
        whole = [one * scale.get(name, 1.0) for one in took]
        median = statistics.median(whole)
        rows.append(
            (
                name,
                said[name],
                f"{median:.2f}",
                f"{(max(whole) - min(whole)) / median:.0%}",
                f"{median_ratio(whole, times[first]):.1f}x",
                "" if name not in agreed else f"{agreed[name]:.1%}",
            )
        )
    say(table(HEADERS, rows))


def main() -> None:
    """Print a table for the diagram and one for the map."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--error", type=float, default=1e-6, help="the error of all, as measured")
    parser.add_argument("--values", type=int, default=2000, help="values of the diagram")
    parser.add_argument("--side", type=int, default=100, help="cells along a side of the map")
    parser.add_argument("--part", type=int, default=100, help="pynamicalsys does one cell in PART")
    parser.add_argument("--rounds", type=int, default=3, help="rounds, methods alternating")
    parser.add_argument("--threads", type=int, default=2)
    opts = parser.parse_args()
    numba_growth.use_threads(opts.threads)
    say(machine(("pendmap", "pynamicalsys", "numba", "numpy"), ours.simd()))
    sample = regular_starts(CASE)
    note(f"{CASE}: choosing settings on {sample.theta.size} regular starts")
    rk4 = numba_growth.at_error(CASE, sample, opts.error).steps
    theirs = pynamical.at_error(CASE, sample, opts.error).steps
    p = np.linspace(0.9, 2.0, opts.values)
    some = p[:: opts.part].copy()
    one_start = f"1 start, {DIAGRAM[0]} periods dropped, {DIAGRAM[1]} points"
    work: dict[str, Callable[[], object]] = {
        "pendmap": lambda: ours_diagram(p, 1),
        "pendmap, 9 starts": lambda: ours_diagram(p, 9),
        "numba RK4": lambda: numba_diagram(p, rk4),
        "pynamicalsys": lambda: pynamical.diagram(CASE, some, START, theirs, DIAGRAM),
    }
    said = {
        "pendmap": "1 start a value: all attractors, exponents, both sweeps",
        "pendmap, 9 starts": "9 starts a value: likewise, the default",
        "numba RK4": f"{one_start}, exponents; {rk4} steps a period",
        "pynamicalsys": f"{one_start}; {theirs} steps, its class in a loop, 1 in {opts.part}",
    }
    numba_diagram(p[:2], rk4)
    pynamical.diagram(CASE, some[:1], START, theirs, (1, 2))
    times, results = timed(work, opts.rounds)
    say(f"\nBifurcation diagram, {CASE}, p = 0.9 to 2: seconds for {p.size} values")
    ours_all = results["pendmap, 9 starts"]
    agreed = {
        "numba RK4": agrees_with_points(ours_all, p, results["numba RK4"][0]),
        "pynamicalsys": agrees_with_points(ours_all, some, results["pynamicalsys"]),
    }
    told(times, {"pynamicalsys": p.size / some.size}, said, agreed)

    p, omega = np.linspace(0.05, 2.5, opts.side), np.linspace(0.5, 3.0, opts.side)
    cells = [axis.ravel()[:: opts.part].copy() for axis in np.meshgrid(p, omega)]
    start = np.array(START)

    def part(where: list[Floats]) -> Floats:
        return pynamical.exponents_of_cells(CASE, where, start, theirs, MAP)

    part([axis[:1] for axis in cells])
    one_start = f"1 start, {MAP[0]} periods dropped, {MAP[1]} averaged"
    work = {
        "pendmap": lambda: ours_map(p, omega, 1),
        "pendmap, 9 starts": lambda: ours_map(p, omega, 9),
        "numba RK4": lambda: numba_map(p, omega, rk4),
        "pynamicalsys": lambda: part(cells),
    }
    said |= {
        "pendmap": "1 start a cell: all attractors and their exponents",
        "pendmap, 9 starts": "9 starts a cell: likewise, the default",
        "numba RK4": f"{one_start}; {rk4} steps a period",
        "pynamicalsys": f"{one_start}; {theirs} steps, parallel loop, 1 in {opts.part}",
    }
    times, results = timed(work, opts.rounds)
    say(f"\nExponents over p = 0.05 to 2.5, omega = 0.5 to 3: seconds for {p.size}^2 cells")
    agreed = {
        "numba RK4": agrees_with_exponents(results["pendmap, 9 starts"], results["numba RK4"])
    }
    told(times, {"pynamicalsys": p.size**2 / cells[0].size}, said, agreed)
    say(
        "\n'as ours': the share of values or cells where what it finds is an attractor of ours. "
        "Its transients may last longer than what is dropped; ours end when a motion is captured."
    )


if __name__ == "__main__":
    main()
