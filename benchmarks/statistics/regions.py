"""Regions of a plane against basins: at random points the same orbits must be stable.

Attractors of the basins of a grid of starts are counted by kind, period and turns, up to the
longest period. What the basins lack, since no start of the grid leads to it, is looked up by
``orbit``.
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np

import pendmap
from pendmap.analysis.continuation import stable_orbits

OVER = {"p": (0.0, 2.5), "omega": (0.5, 3.0)}

Types = Counter[tuple[str, int, int]]


def by_basins(pendulum: pendmap.Pendulum, grid: int, longest: int) -> Types:
    """Return the periodic attractors that starts on a grid lead to."""
    found = pendmap.basins(pendulum, grid, threads=1)
    columns = (found[name].values.tolist() for name in ("kind", "n", "w"))
    return Counter(
        (str(kind).replace(" ", "_"), int(n), int(w))
        for kind, n, w in zip(*columns, strict=True)
        if 1 <= n <= longest
    )


def exists(pendulum: pendmap.Pendulum, n: int, w: int, count: int) -> bool:
    """Return whether a search finds at least so many stable orbits of a type."""
    found = pendmap.orbit(pendulum, n=n, w=w, threads=1)
    return int(found["stable"].values.sum()) >= count


def main() -> None:
    """Print the points where both differ, and their number."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--grid", type=int, default=60)
    parser.add_argument("--up-to", type=int, default=4)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--gamma", type=float, default=0.1)
    parser.add_argument("--torque", type=float, default=0.0)
    parser.add_argument("--theta-r", type=float, default=0.0)
    asked = parser.parse_args()
    model = {"gamma": asked.gamma, "torque": asked.torque, "theta_r": asked.theta_r}
    plane = pendmap.continuation(pendmap.Pendulum(**model), OVER, up_to=asked.up_to)
    random = np.random.default_rng(asked.seed)
    missing = many = beyond = 0
    for _ in range(asked.count):
        at = {name: float(random.uniform(*ends)) for name, ends in OVER.items()}
        pendulum = pendmap.Pendulum(**model, **at)
        listed: Types = Counter()
        for one in stable_orbits(plane, at):
            listed[one["kind"], one["n"], one["w"]] += one["stable"]
        truth = by_basins(pendulum, asked.grid, asked.up_to)
        for key in listed | truth:
            if listed[key] < truth[key]:
                missing += 1
                print(f"{at}: {key} listed {listed[key]}, basins have {truth[key]}")
            elif listed[key] > truth[key]:
                if exists(pendulum, key[1], key[2], listed[key]):
                    beyond += 1
                else:
                    many += 1
                    print(f"{at}: {key} listed {listed[key]}, basins have {truth[key]}")
    print(
        f"{asked.count} points: {missing} missing, {many} too many;"
        f" {beyond} that the grid of starts misses and orbit finds"
    )


if __name__ == "__main__":
    main()
