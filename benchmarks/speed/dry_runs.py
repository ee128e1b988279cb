"""What --dry-run predicts, over what the command takes: wall time, memory at the peak, disk.

Dry run and command alternate; a ratio is the median of the rounds. Nothing else should run on the
machine.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import tempfile
from pathlib import Path

from benchmarks.peers import ours
from benchmarks.peers.report import machine, say, table
from benchmarks.speed.stores import timed

CASES: tuple[str, ...] = (
    "basins --p 1.7 --grid 1400",
    "basins --p 0.6 --grid 4000",
    "basins --p 0.6 --grid 4000 --adaptive",
    "basins --p 1 --theta-r 0.05 --grid 1500",
    "basins --p 0.6 --gamma 0.005 --grid 600",
    "basins --p 2 --grid 1000",
    "map --p 0.05:2.5:60 --omega 0.5:3:60",
    "map --p 1:3:64 --omega 1.5:2.5:64",
    "sweep --p 0.5:2:61 --grid 200",
    "sweep --p 0.5:2:24 --omega 1.6:2.2:24 --grid 50",
    "bifurcation --p 0.9:2:2000",
    "lifetime --p 1.7 --starts 1000000",
)
KEPT: tuple[str, ...] = (
    "basins --p 1.7 --grid 1400 --workers 2 --out a.zarr",
    "map --p 0.05:2.5:60 --omega 0.5:3:60 --out a.zarr",
)
PEAK = 2.0**20


def predicted(folder: Path, words: list[str]) -> dict[str, float]:
    """Return what the dry run of a command tells."""
    call = [ours.command(), *words, "--dry-run", "--json"]
    done = subprocess.run(call, cwd=folder, check=True, capture_output=True)  # noqa: S603 (ours)
    told: dict[str, float] = json.loads(done.stdout)
    return told


def measure(case: str, rounds: int) -> tuple[str, ...]:
    """Measure one command and format its row."""
    words = case.split()
    if "--out" not in words:
        words += ["--out", "a.nc", "--plot", "a.png"]
    runs = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for _ in range(rounds):
            told = predicted(folder, words)
            wall, _, peak = timed(folder, *words)
            disk = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
            runs.append((told, wall, peak, disk))
    ratios = [
        statistics.median(run[0][key] / (run[k] * unit) for run in runs)
        for k, (key, unit) in enumerate(
            (("seconds", 1.0), ("memory_bytes", PEAK), ("disk_bytes", 1.0)), 1
        )
    ]
    took = statistics.median(run[1] for run in runs)
    return case, f"{took:.1f}", *(f"{ratio:.2f}" for ratio in ratios)


def main() -> None:
    """Print a table of ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--cases", type=int, nargs="+", help="numbers from 1")
    given = parser.parse_args()
    every = (*CASES, *KEPT)
    cases = every if given.cases is None else [every[k - 1] for k in given.cases]
    rows = [measure(case, given.rounds) for case in cases]
    head = ("command", "took, s", "time", "memory", "disk: predicted over taken")
    say(f"{machine(['numpy', 'xarray'])}\n\n{table(head, rows)}")


if __name__ == "__main__":
    main()
