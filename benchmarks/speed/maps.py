"""Basin maps of 1000 x 1000 cells from the command line: seconds, mean periods, results."""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import tempfile
import time
from dataclasses import dataclass
from typing import Any

from benchmarks.peers import ours
from benchmarks.peers.report import machine, note, say, table


@dataclass(frozen=True)
class Map:
    """Options of `pendmap basins`, and the target of a map."""

    options: tuple[str, ...]
    wanted: str


MAPS = (
    Map(("--p", "1"), "aim 2 s, at most 4 s, under 45 periods"),
    Map(("--p", "1", "--theta-r", "0.05"), "at most 3 times the map without friction"),
    Map(("--p", "1.7"), "at most 15 s"),
    Map(("--p", "0.6"), ""),
    Map(("--p", "1.7", "--omega", "0.87"), ""),
)
HEADERS = (
    "basins (gamma .1, omega 2)",
    "map, s",
    "command, s",
    "with files, s",
    "mean periods",
    "attractors",
    "undecided",
    "unreliable",
    "reached error",
    "wanted",
)


def run(options: list[str], folder: str) -> tuple[str, float]:
    """Run the command in `folder`; return its stdout and the wall-clock seconds."""
    begin = time.perf_counter()
    done = subprocess.run(  # noqa: S603 (our command)
        [ours.command(), "basins", *options, "--quiet"],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        cwd=folder,
    )
    return done.stdout, time.perf_counter() - begin


def show(value: float | None, form: str) -> str:
    """Format a number that may be absent."""
    return "-" if value is None else format(value, form)


def measure(wanted: Map, shared: list[str], rounds: int) -> tuple[str, ...]:
    """Run one map several times and format its row; seconds are medians."""
    options = [*wanted.options, *shared]
    alone, whole, files = [], [], []
    answer: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(rounds):
            text, seconds = run([*options, "--json"], folder)
            answer = json.loads(text)
            alone.append(float(answer["seconds"]))
            whole.append(seconds)
            files.append(run(options, folder)[1])
    return (
        " ".join(wanted.options),
        f"{statistics.median(alone):.2f}",
        f"{statistics.median(whole):.2f}",
        f"{statistics.median(files):.2f}",
        show(answer.get("mean_periods"), ".1f"),
        str(len(answer["attractors"])),
        show(answer.get("undecided"), ".2e"),
        show(answer.get("unreliable"), ".3f"),
        show(answer.get("reached_error"), ".1e"),
        wanted.wanted,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--grid", type=int, default=1000, help="cells a side")
    parser.add_argument("--tol", default="1e-6")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, help="all cores where it is left out")
    opts = parser.parse_args()
    shared = ["--grid", str(opts.grid), "--tol", opts.tol]
    if opts.threads:
        shared += ["--threads", str(opts.threads)]
    rows = []
    for one in MAPS:
        note(f"basins {' '.join(one.options)}")
        rows.append(measure(one, shared, opts.rounds))
    threads = f"{opts.threads} threads" if opts.threads else "all cores"
    say(f"Basin maps, {opts.grid} x {opts.grid} cells, tol {opts.tol}, {threads}; medians")
    say(machine(("pendmap", "numpy", "xarray"), ours.simd()))
    say(table(HEADERS, rows))


if __name__ == "__main__":
    main()
