"""Maps of attractors over parameters: processor time, and attractors found of those that exist.

Of cells drawn at random, and of all in which packages differ, the basins of 2,025 starts are
computed: recall counts the kinds of attractors there that the map has too.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np

import pendmap
from benchmarks.peers.report import machine, note, say, table

ROOT = Path(__file__).parents[2]
OVER = (0.2, 2.0), (0.5, 3.0)
PLANES = {
    "gamma .1": ({"gamma": 0.1}, *OVER),
    "gamma .1, theta_r .05": ({"gamma": 0.1, "theta_r": 0.05}, *OVER),
    "gamma .02": ({"gamma": 0.02}, (0.05, 1.0), (1.2, 2.6)),
    "gamma .1, p to 3": ({"gamma": 0.1}, (1.0, 3.0), (1.5, 3.5)),
}
"""Model, range of p, range of omega."""
SIDE = 45
"""Starts of a reference along each side: 2,025."""
HEADERS = (
    "plane",
    "package",
    "CPU, s",
    "ratio",
    "kinds",
    "recall",
    "false chaos",
    "where they differ",
    "false chaos there",
)

Kinds = set[tuple[str, int, int]]


def key(kind: str, n: float, w: float) -> tuple[str, int, int]:
    """Return kind, period and number of turns: 0 and 0 of chaos."""
    words = [word for word in kind.replace("_", " ").split() if word.isalpha()]
    name = " ".join(word for word in words if word != "period")
    return (name, int(n), abs(int(w))) if n > 0 else (name, 0, 0)


def own_map(plane: str, cells: int, threads: int) -> dict[str, object]:
    """Return the kinds of attractors of every cell, and the processor time that they took."""
    model, p, omega = PLANES[plane]
    ranges = {"p": (*p, cells), "omega": (*omega, cells)}
    before = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    found = pendmap.parameter_map(
        pendmap.Pendulum(**model), ranges, run=pendmap.RunOptions(threads=threads)
    )
    seconds = resource.getrusage(resource.RUSAGE_SELF).ru_utime - before
    kinds = found["kind"].values
    parts = (found[f"entry_{part}"].values for part in ("cell", "kind", "n", "w"))
    all_of = {
        (int(cell), *key(str(kinds[kind]), n, w)) for cell, kind, n, w in zip(*parts, strict=True)
    }
    return {"seconds": seconds, "kinds": sorted(all_of)}


def map_of(package: str, plane: str, cells: int, threads: int) -> tuple[float, list[Kinds]]:
    """Return seconds and kinds of all cells from the package in that folder."""
    command = [sys.executable, "-m", __spec__.name, "--one", plane]
    options = ["--cells", str(cells), "--threads", str(threads)]
    path = os.pathsep.join(filter(None, (package, str(ROOT))))
    done = subprocess.run(  # noqa: S603 (our command)
        [*command, *options],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": path},
    )
    found = json.loads(done.stdout)
    kinds: list[Kinds] = [set() for _ in range(cells * cells)]
    for cell, *kind in found["kinds"]:
        kinds[cell].add(tuple(kind))
    return found["seconds"], kinds


def reference(plane: str, cells: int, cell: int) -> Kinds:
    """Return the kinds of attractors on which starts of the cell's basins end."""
    model, p, omega = PLANES[plane]
    at = {
        "p": np.linspace(*p, cells)[cell % cells],
        "omega": np.linspace(*omega, cells)[cell // cells],
    }
    found = pendmap.basins(pendmap.Pendulum(**model, **at), SIDE)
    labels = found["label"].values
    parts = (found[part].values for part in ("id", "kind", "n", "w"))
    return {
        key(str(kind), n, w)
        for label, kind, n, w in zip(*parts, strict=True)
        if (labels == label).any()
    }


def judged(truth: dict[int, Kinds], kinds: list[Kinds]) -> tuple[str, str]:
    """Return the kinds found of those that exist, and the number of chaotic ones that do not."""
    found = sum(len(exist & kinds[cell]) for cell, exist in truth.items())
    chaotic = (kind for cell, exist in truth.items() for kind in kinds[cell] - exist)
    false = sum(n == 0 for _, n, _ in chaotic)
    return f"{found} of {sum(map(len, truth.values()))}", str(false)


def main() -> None:
    """Print a table: of every plane and package the time, its ratio to the first one's, recall."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=60, help="cells along each side")
    parser.add_argument("--sample", type=int, default=40, help="cells drawn at random")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--planes", nargs="*", choices=PLANES, default=list(PLANES))
    parser.add_argument(
        "--against", default=[], nargs="*", help="folders of other pendmap packages"
    )
    parser.add_argument("--one", choices=PLANES, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        sys.stdout.write(json.dumps(own_map(given.one, given.cells, given.threads)))
        return
    say(machine(("pendmap", "numpy")))
    rows = []
    packages = [*given.against, str(Path(pendmap.__file__).parents[1])]
    for plane in given.planes:
        maps = [map_of(package, plane, given.cells, given.threads) for package in packages]
        count = given.cells**2
        drawn = np.random.default_rng(0).choice(count, given.sample, replace=False).tolist()
        differ = [k for k in range(count) if any(kinds[k] != maps[0][1][k] for _, kinds in maps)]
        note(f"{plane}: {len(drawn)} basins drawn, {len(differ)} where packages differ")
        truths = [{k: reference(plane, given.cells, k) for k in cells} for cells in (drawn, differ)]
        for package, (seconds, kinds) in zip(packages, maps, strict=True):
            marks = [mark for truth in truths for mark in judged(truth, kinds)]
            ratio = f"{seconds / maps[0][0]:.2f}"
            total = str(sum(map(len, kinds)))
            rows.append((plane, package, f"{seconds:.1f}", ratio, total, *marks))
    say(table(HEADERS, rows))


if __name__ == "__main__":
    main()
