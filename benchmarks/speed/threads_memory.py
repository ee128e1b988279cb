"""Two threads against two simultaneous one-thread processes; peak memory of a large map.

The first ratio is (time of two simultaneous one-thread processes that each do the job) / (twice the
time of one process that does it on two threads): 1 is ideal, the target is 0.93. Memory is the peak
resident size of the whole command with its figure and files.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.peers import ours
from benchmarks.peers.common import CASES, grid
from benchmarks.peers.report import machine, note, say, table

STEPS, PERIODS, SIDE = 33, 200, 320
WANTED, LIMIT_GIB = 0.93, 1.5
GIB = 2.0**30


def work(threads: int) -> None:
    """Print ready, wait for a line, integrate a grid of starts, print the seconds taken."""
    method = ours.Pendmap(CASES[0], STEPS, threads=threads)
    theta, velocity = grid(SIDE)
    method.advance(theta, velocity, 1)
    say("ready")
    sys.stdin.readline()
    begin = time.perf_counter()
    method.advance(theta, velocity, PERIODS)
    say(f"{time.perf_counter() - begin}")


def kernel_seconds(processes: int, threads: int) -> float:
    """Return the longest time of simultaneous workers."""
    call = [sys.executable, "-m", "benchmarks.speed.threads_memory", "--worker", str(threads)]
    workers = [
        subprocess.Popen(call, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)  # noqa: S603 (this file)
        for _ in range(processes)
    ]
    for worker in workers:
        assert worker.stdin is not None  # noqa: S101 (both are pipes)
        assert worker.stdout is not None  # noqa: S101
        worker.stdout.readline()
    for worker in workers:
        worker.stdin.write("go\n")  # type: ignore[union-attr]
        worker.stdin.flush()  # type: ignore[union-attr]
    return max(float(worker.communicate()[0]) for worker in workers)


def map_seconds(processes: int, threads: int, side: int) -> float:
    """Return the longest time reported by simultaneous maps."""
    call = [ours.command(), "basins", "--p", "1", "--grid", str(side), "--json"]
    call += ["--threads", str(threads), "--quiet"]
    running = [
        subprocess.Popen(call, stdout=subprocess.PIPE, text=True)  # noqa: S603 (our command)
        for _ in range(processes)
    ]
    return max(float(json.loads(run.communicate()[0])["seconds"]) for run in running)


def ratio_row(what: str, apart: list[float], together: list[float]) -> tuple[str, ...]:
    """Format the comparison of two processes (apart) with two threads (together)."""
    ratios = [a / (2.0 * b) for a, b in zip(apart, together, strict=True)]
    return (
        what,
        f"{statistics.median(apart):.3f} s",
        f"{statistics.median(together):.3f} s",
        f"{statistics.median(ratios):.3f}",
        f"{min(ratios):.3f} .. {max(ratios):.3f}",
        f">= {WANTED}",
    )


def peak_memory(side: int) -> tuple[float, float]:
    """Run a map with all its files; return peak resident GiB and seconds.

    Raises
    ------
    RuntimeError
        If the command fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        call = [ours.command(), "basins", "--p", "0.6", "--grid", str(side), "--quiet"]
        for option, suffix in (("--out", "nc"), ("--plot", "png"), ("--rerun", "rrd")):
            call += [option, str(Path(folder) / f"map.{suffix}")]
        begin = time.perf_counter()
        child = os.posix_spawn(call[0], call, os.environ)
        _, status, usage = os.wait4(child, 0)
        seconds = time.perf_counter() - begin
    if os.waitstatus_to_exitcode(status) != 0:
        msg = f"failed: {' '.join(call)}"
        raise RuntimeError(msg)
    unit = 1 if sys.platform == "darwin" else 1024
    return usage.ru_maxrss * unit / GIB, seconds


def main() -> None:
    """Print both tables, or be a worker of the first."""
    parser = argparse.ArgumentParser(description="two threads against two processes; peak memory")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--map-grid", type=int, default=1000, help="cells a side, for the threads")
    parser.add_argument("--grid", type=int, default=4000, help="cells a side, for the memory")
    parser.add_argument("--worker", type=int, help=argparse.SUPPRESS)
    opts = parser.parse_args()
    if opts.worker:
        work(opts.worker)
        return
    say("Two threads against two one-thread processes at once; median of the rounds")
    say(machine(("pendmap", "numpy"), ours.simd()))
    apart, together, apart_map, together_map = [], [], [], []
    for count in range(opts.rounds):
        note(f"round {count + 1} of {opts.rounds}")
        apart.append(kernel_seconds(2, 1))
        together.append(kernel_seconds(1, 2))
        apart_map.append(map_seconds(2, 1, opts.map_grid))
        together_map.append(map_seconds(1, 2, opts.map_grid))
    rows = [
        ratio_row(f"kernel, {SIDE} x {SIDE} starts, {PERIODS} periods", apart, together),
        ratio_row(f"basins --p 1 --grid {opts.map_grid}", apart_map, together_map),
    ]
    headers = ("job", "two processes", "two threads", "ratio", "least .. most", "wanted")
    say(table(headers, rows) + "\n")
    note("memory")
    gib, seconds = peak_memory(opts.grid)
    what = f"basins --p 0.6 --grid {opts.grid} --out .nc --plot .png --rerun .rrd"
    columns = ("command", "peak GiB", "seconds", "wanted")
    say(table(columns, [(what, f"{gib:.2f}", f"{seconds:.1f}", f"< {LIMIT_GIB} GiB")]))


if __name__ == "__main__":
    main()
