"""What a store costs over the plain command; peak memory of large maps.

Pairs of commands alternate; the ratio of their times is the median of the pairs. ``--large SIDE``
maps SIDE x SIDE cells into a store and tells the peak memory of the command.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

from benchmarks.peers import ours
from benchmarks.peers.report import machine, say, table

MIB = 2.0**20


def timed(folder: Path, *words: str) -> tuple[float, float, float]:
    """Return wall time and CPU time in s, and the peak memory in MiB, of a command."""
    for old in folder.iterdir():
        shutil.rmtree(old) if old.is_dir() else old.unlink()
    begin = time.perf_counter()
    command = subprocess.Popen([ours.command(), *words, "--quiet"], cwd=folder)  # noqa: S603 (ours)
    _, status, used = os.wait4(command.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(words)} failed")
    return time.perf_counter() - begin, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def pairs(folder: Path, count: int, one: list[str], other: list[str]) -> list[str]:
    """Return the median ratio of wall and CPU times of two commands, and their peaks."""
    runs = [(timed(folder, *one), timed(folder, *other)) for _ in range(count)]
    ratios = [statistics.median(b[k] / a[k] for a, b in runs) for k in (0, 1)]
    return [
        *(f"{ratio:.3f}" for ratio in ratios),
        *(f"{max(r[k][2] for r in runs):.0f}" for k in (0, 1)),
    ]


def main() -> None:
    """Print a table of ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--side", type=int, default=4000)
    parser.add_argument("--pairs", type=int, default=3)
    parser.add_argument("--p", nargs="+", default=["1", "1.7"])
    parser.add_argument("--large", type=int)
    given = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if given.large:
            call = ["basins", "--p", "1", "--grid", str(given.large), "--out", "m.zarr"]
            wall, cpu, peak = timed(folder, *call)
            size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
            say(
                f"{given.large}^2 cells: {wall:.0f} s, {cpu:.0f} s of processors, {peak:.0f} MiB "
                f"at the peak, {size / MIB:.0f} MiB on disk"
            )
            return
        for p in given.p:
            plain = ["basins", "--p", p, "--grid", str(given.side)]
            nc, zarr = [*plain, "--out", "m.nc"], [*plain, "--out", "m.zarr"]
            rows.append([p, f"{given.side}^2", *pairs(folder, given.pairs, nc, zarr)])
    say(machine(["numpy", "zarr"]))
    say(table(["p", "cells", "wall, store / file", "CPU", "MiB of the file", "of the store"], rows))


if __name__ == "__main__":
    main()
