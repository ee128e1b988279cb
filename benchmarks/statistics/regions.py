"""Regions of a plane against basins or a map: at random points the same orbits must be stable.

Attractors are counted by kind, period and turns, up to the longest period. What basins or a map
lack, since none of their starts leads to it, is looked up by ``orbit``. What friction holds at rest
is not compared.
"""

from __future__ import annotations

import argparse
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

import pendmap
from pendmap.analysis.continuation import stable_orbits
from pendmap.analysis.orbit_table import attractors_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

OVER = {"p": (0.0, 2.5), "omega": (0.5, 3.0)}
ROWS = 10  # Values of omega of a map

Types = Counter[tuple[str, int, int]]
Points = tuple[dict[str, float], Types]


def by_basins(model: dict[str, Any], asked: argparse.Namespace) -> Iterator[Points]:
    """Yield random points and the attractors that starts on a grid lead to."""
    random = np.random.default_rng(asked.seed)
    for _ in range(asked.count):
        at = {name: float(random.uniform(*ends)) for name, ends in OVER.items()}
        basins = pendmap.basins(pendmap.Pendulum(**model, **at), asked.grid, threads=1)
        columns = (basins[name].values.tolist() for name in ("kind", "n", "w"))
        yield at, Counter((k.replace(" ", "_"), n, w) for k, n, w in zip(*columns, strict=True))


def by_map(model: dict[str, Any], asked: argparse.Namespace) -> Iterator[Points]:
    """Yield the cells of a map at random values of both parameters, and their attractors."""
    random = np.random.default_rng(asked.seed)
    counts = {"p": asked.count // ROWS, "omega": ROWS}
    values = {name: np.sort(random.uniform(*OVER[name], n)) for name, n in counts.items()}
    plane = pendmap.parameter_map(pendmap.Pendulum(**model), values, threads=1)
    kinds = np.array([one.kind for one in attractors_of(plane, "kind_")], dtype=str)
    kinds, cell = kinds[plane["entry_kind"].values], plane["entry_cell"].values
    n, w = plane["entry_n"].values, plane["entry_w"].values
    for k in range(counts["p"] * ROWS):
        rows = zip(kinds[cell == k], n[cell == k], w[cell == k], strict=True)
        row, column = divmod(k, counts["p"])
        at = {"p": float(values["p"][column]), "omega": float(values["omega"][row])}
        yield at, Counter((str(kind), int(n), int(w)) for kind, n, w in rows)


TRUTHS: dict[str, Callable[..., Iterator[Points]]] = {"basins": by_basins, "map": by_map}


def exists(pendulum: pendmap.Pendulum, n: int, w: int, count: int) -> bool:
    """Return whether a search finds at least so many stable orbits of a type."""
    orbits = pendmap.orbit(pendulum, n=n, w=w, threads=1)
    return int(orbits["stable"].values.sum()) >= count


def main() -> None:
    """Print the points where both differ, and their number."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--by", choices=TRUTHS, default="basins")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--grid", type=int, default=60)
    parser.add_argument("--up-to", type=int, default=4)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--gamma", type=float, default=0.1)
    parser.add_argument("--torque", type=float, default=0.0)
    parser.add_argument("--theta-r", type=float, default=0.0)
    asked = parser.parse_args()
    model: dict[str, Any] = {"gamma": asked.gamma, "torque": asked.torque, "theta_r": asked.theta_r}
    plane: Any = pendmap.continuation(pendmap.Pendulum(**model), OVER, up_to=asked.up_to, threads=1)
    held = {"rest", "inverted_rest"} if asked.theta_r else set()
    points = missing = many = beyond = 0
    for at, every in TRUTHS[asked.by](model, asked):
        points += 1
        truth = {of: k for of, k in every.items() if 1 <= of[1] <= asked.up_to}
        listed = {(o["kind"], o["n"], o["w"]): o["stable"] for o in stable_orbits(plane, at)}
        for key in sorted({*listed, *truth}):
            if key[0] in held or (less := listed.get(key, 0) - truth.get(key, 0)) == 0:
                continue
            pendulum = pendmap.Pendulum(**model, **at)
            if less > 0 and exists(pendulum, key[1], key[2], listed[key]):
                beyond += 1
                continue
            missing, many = missing + (less < 0), many + (less > 0)
            has = f"{asked.by} has {truth.get(key, 0)}"
            print(f"{at}: {key} listed {listed.get(key, 0)}, {has}", flush=True)
    print(
        f"{points} points: {missing} missing, {many} too many;"
        f" {beyond} that {asked.by} misses and orbit finds"
    )


if __name__ == "__main__":
    main()
