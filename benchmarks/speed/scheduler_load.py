"""Tiles that compute nothing through a Dask scheduler: rate, CPU and memory of each process.

The driver keeps a window of tiles in flight and drops each future when its tile ends. CPU a tile
bounds the rate: a scheduler that spends 500 us on a tile passes at most 2000 tiles a second,
however many workers there are. Memory is resident size; growth is the slope from 20 % of the tiles
on, and means something from 1e5 tiles on: caches fill first.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import itertools
import json
import os
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import psutil
from distributed import Client, LocalCluster, as_completed

from benchmarks.peers.report import machine, note, say, table

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

MIB = 2.0**20
ALL_AT_ONCE = 100_000  # most tiles that are in flight together
SAMPLES = 50
SETTLED = 0.2  # share of the tiles after which growth is measured
SECONDS = 60  # to start or to stop a process
HEADERS = (
    "cluster",
    "driver",
    "window",
    "tiles",
    "tiles/s",
    "last tenth",
    "us CPU a tile: scheduler",
    "driver",
    "workers",
    "peak MiB: scheduler",
    "driver",
    "largest worker",
    "growth, MiB per 1e6 tiles: scheduler",
    "driver",
    "largest worker",
)


def tile(number: int) -> int:
    """Compute nothing."""
    return number


@dataclass
class Load:
    """Processes of a cluster by role, and samples of them while tiles pass."""

    address: str
    scheduler: psutil.Process
    workers: list[psutil.Process]
    driver: psutil.Process = field(default_factory=psutil.Process)
    samples: list[list[float]] = field(default_factory=list)

    def sample(self, done: int) -> None:
        """Append tiles done, time, CPU seconds and MiB of scheduler, driver and workers."""
        cpu = [sum(p.cpu_times()[:2]) for p in (self.scheduler, self.driver, *self.workers)]
        rss = [p.memory_info().rss / MIB for p in (self.scheduler, self.driver, *self.workers)]
        used = [cpu[0], cpu[1], sum(cpu[2:]), rss[0], rss[1], max(rss[2:])]
        self.samples.append([done, time.perf_counter(), *used])

    def row(self) -> list[str]:
        """Format the samples."""
        table_of = np.array(self.samples)
        done, clock, cpu, rss = table_of[:, 0], table_of[:, 1], table_of[:, 2:5], table_of[:, 5:8]
        tenth = np.searchsorted(done, 0.9 * done[-1])
        late = done >= SETTLED * done[-1]
        growth = [np.polyfit(done[late] / 1e6, column, 1)[0] for column in rss[late].T]
        return [
            f"{done[-1]:.0f}",
            f"{done[-1] / (clock[-1] - clock[0]):.0f}",
            f"{(done[-1] - done[tenth]) / (clock[-1] - clock[tenth]):.0f}",
            *(f"{1e6 * value / done[-1]:.0f}" for value in cpu[-1] - cpu[0]),
            *(f"{value:.0f}" for value in rss.max(axis=0)),
            *(f"{value:.1f}" for value in growth),
        ]


@contextmanager
def processes(workers: int, folder: Path) -> Iterator[Load]:
    """Start `dask scheduler` and `dask worker` processes of one thread each."""
    file = folder / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    scheduler_call = [*dask, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-show"]
    scheduler_call += ["--dashboard-address", "127.0.0.1:0", "--scheduler-file", str(file)]
    worker_call = [*dask, "worker", "--scheduler-file", str(file), "--nthreads", "1"]
    worker_call += ["--no-nanny", "--no-dashboard", "--local-directory", str(folder)]
    started = [subprocess.Popen(scheduler_call, **quiet)]  # noqa: S603 (dask itself)
    try:
        deadline = time.monotonic() + SECONDS
        while not file.exists() and time.monotonic() < deadline:
            time.sleep(0.1)
        started += [subprocess.Popen(worker_call, **quiet) for _ in range(workers)]  # noqa: S603
        seen = [psutil.Process(process.pid) for process in started]
        yield Load(json.loads(file.read_text(encoding="utf-8"))["address"], seen[0], seen[1:])
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait(SECONDS)


@contextmanager
def local(workers: int, folder: Path) -> Iterator[Load]:
    """Start a LocalCluster: its scheduler is a thread of this process."""
    with LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        dashboard_address="127.0.0.1:0",
        local_directory=str(folder),
    ) as cluster:
        with Client(cluster) as client:
            pids = client.run(os.getpid).values()
        yield Load(cluster.scheduler_address, psutil.Process(), [psutil.Process(p) for p in pids])


def by_submit(client: Client, tiles: int, window: int) -> Iterator[int]:
    """Submit and release futures of dask; results remain with the workers."""
    numbers = iter(range(tiles))
    first = [client.submit(tile, n, pure=False) for n in itertools.islice(numbers, window)]
    ended = as_completed(first)
    del first
    for count, _ in enumerate(ended, 1):
        for number in itertools.islice(numbers, 1):
            ended.add(client.submit(tile, number, pure=False))
        yield count


def by_executor(client: Client, tiles: int, window: int) -> Iterator[int]:
    """Submit and drop `concurrent.futures` futures of the client; results come to the driver."""
    executor = client.get_executor(pure=False)
    numbers = iter(range(tiles))
    waiting = {executor.submit(tile, n) for n in itertools.islice(numbers, window)}
    count = 0
    while waiting:
        ended, waiting = concurrent.futures.wait(waiting, return_when="FIRST_COMPLETED")
        count += len(ended)
        waiting |= {executor.submit(tile, n) for n in itertools.islice(numbers, len(ended))}
        yield count


CLUSTERS = {"processes": processes, "local": local}
DRIVERS: dict[str, Callable[[Client, int, int], Iterator[int]]] = {
    "submit": by_submit,
    "executor": by_executor,
}


def measure(cluster: str, driver: str, workers: int, tiles: int, window: int) -> tuple[str, ...]:
    """Pass the tiles through a new cluster and format its row."""
    every = max(1, tiles // SAMPLES)
    with tempfile.TemporaryDirectory() as folder:  # noqa: SIM117 (the folder outlives the cluster)
        with CLUSTERS[cluster](workers, Path(folder)) as load, Client(load.address) as client:
            client.wait_for_workers(workers, timeout=SECONDS)
            list(DRIVERS[driver](client, 10 * workers, workers))
            load.sample(0)
            wanted = every
            for done in DRIVERS[driver](client, tiles, window):
                if done >= wanted:
                    load.sample(done)
                    wanted = done + every
            load.sample(tiles)
    return (cluster, driver, str(window), *load.row())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tiles", type=int, default=20_000)
    parser.add_argument("--workers", type=int, default=2, help="processes of one thread")
    parser.add_argument("--window", type=int, nargs="+", default=[8, 64, 512], help="in flight")
    parser.add_argument("--cluster", nargs="+", choices=CLUSTERS, default=list(CLUSTERS))
    parser.add_argument("--driver", nargs="+", choices=DRIVERS, default=list(DRIVERS))
    opts = parser.parse_args()
    if max(opts.window) > ALL_AT_ONCE:
        parser.error(f"--window must be at most {ALL_AT_ONCE}, got {max(opts.window)}")
    rows = []
    for cluster, driver, window in itertools.product(opts.cluster, opts.driver, opts.window):
        note(f"{cluster}, {driver}, window {window}")
        rows.append(measure(cluster, driver, opts.workers, opts.tiles, window))
    say(f"Tiles without work, {opts.workers} workers; the driver of `local` is also the scheduler")
    say(machine(("distributed", "dask", "numpy")))
    say(table(HEADERS, rows))


if __name__ == "__main__":
    main()
