"""Tiles computed by processes and clusters: the bits of the plain call."""

from __future__ import annotations

import concurrent.futures
import contextlib
import json
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import threading
from typing import TYPE_CHECKING

import distributed
import pytest
from joblib.externals.loky import get_reusable_executor

import pendmap
import tiled
from interrupted import started, until
from pendmap.engine import executor_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from concurrent.futures import Executor
    from contextlib import AbstractContextManager
    from pathlib import Path


# The scheduler's status page listens even when it shows nothing: 8787 may be taken.
ANY_PORT = "127.0.0.1:0"


@contextlib.contextmanager
def pool() -> Iterator[Executor]:
    fresh = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(2, mp_context=fresh) as executor:
        yield executor


@contextlib.contextmanager
def local_cluster() -> Iterator[Executor]:
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=ANY_PORT
        ) as own,
        distributed.Client(own, set_as_default=False) as client,
    ):
        yield client


@contextlib.contextmanager
def separate_processes(folder: Path) -> Iterator[Executor]:
    """A cluster of a ``dask scheduler`` and two ``dask worker``, as on several machines."""
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--nthreads", "1"]
    file = folder / "scheduler.json"
    local = ["--host", "127.0.0.1", "--port", "0", "--dashboard-address", ANY_PORT]
    with contextlib.ExitStack() as stack:
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        own = stack.enter_context(started([*dask, *local, "--scheduler-file", str(file)], **quiet))
        until(own, lambda: file.exists() and file.read_text().endswith("}"))
        for _ in range(2):
            to = ["--no-dashboard", "--no-nanny", "--scheduler-file", str(file)]
            stack.enter_context(started([*worker, *to], **quiet))
        address = json.loads(file.read_text())["address"]
        with distributed.Client(address, set_as_default=False) as client:
            yield client


@contextlib.contextmanager
def joblib() -> Iterator[Executor]:
    executor = get_reusable_executor(max_workers=2)
    yield executor
    executor.shutdown(wait=True, kill_workers=True)


@pytest.fixture(scope="module")
def two_processes() -> Iterator[Executor]:
    """Two processes for all analyses: each imports pendmap once."""
    with pool() as executor:
        yield executor


@pytest.mark.parametrize("name", [*tiled.CASES])
def test_processes_compute_the_same_bits(
    tmp_path: Path, name: str, two_processes: Executor
) -> None:
    tiled.assert_same(tiled.case(name, executor=two_processes), tiled.plain(name))
    kept = tiled.case(name, executor=two_processes, store=tmp_path / "map.zarr")
    tiled.assert_same(kept, tiled.plain(name))


@pytest.mark.parametrize("executors", [local_cluster, joblib])
def test_executors_compute_the_same_bits(
    tmp_path: Path,
    executors: Callable[[], AbstractContextManager[Executor]],
) -> None:
    with executors() as executor:
        kept = tiled.case("map", executor=executor, store=tmp_path / "map.zarr")
        tiled.assert_same(kept, tiled.plain("map"))
        tiled.assert_same(tiled.case("chaos", executor=executor), tiled.plain("chaos"))


def test_workers_start_where_the_port_of_dask_is_taken() -> None:
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # it is taken already
            stack.enter_context(socket.create_server(("", 8787)))
        executor = stack.enter_context(executor_of(workers=1))
        assert executor.submit(sum, (1, 2)).result() == 3
        assert len(executor.nthreads()) == 1


@pytest.mark.thorough
def test_separate_processes_compute_the_same_bits(tmp_path: Path) -> None:
    with separate_processes(tmp_path) as client:
        for name in tiled.CASES:
            kept = tiled.case(name, executor=client, store=tmp_path / f"{name}.zarr")
            tiled.assert_same(kept, tiled.plain(name))


@pytest.mark.thorough
def test_workers_that_are_killed_cost_only_their_tiles(tmp_path: Path) -> None:
    over, killed = threading.Event(), []
    with local_cluster() as client:

        def kill() -> None:
            while len(killed) < 5 and not over.wait(2.0):  # five: a slow start is no dead end
                alive = [own.pid for own in client.cluster.workers.values() if own.pid is not None]
                killed.extend(alive[:1])
                for pid in alive[:1]:
                    os.kill(pid, signal.SIGKILL)

        thread = threading.Thread(target=kill)
        thread.start()
        try:
            for name in ("basins", "map", "chaos"):
                kept = tiled.case(name, executor=client, store=tmp_path / f"{name}.zarr")
                tiled.assert_same(kept, tiled.plain(name))
        finally:
            over.set()
            thread.join()
    assert killed


def test_workers_that_are_gone_are_an_error_that_keeps_the_tiles(tmp_path: Path) -> None:
    store = tmp_path / "map.zarr"

    class Fewer:
        """An executor that takes three tiles."""

        def __init__(self, executor: Executor) -> None:
            self.left, self.executor = 3, executor

        def submit(self, *call: object) -> object:
            self.left -= 1
            if self.left < 0:
                raise RuntimeError("cannot schedule new futures after shutdown")
            return self.executor.submit(*call)  # type: ignore[arg-type]

    with pool() as executor, pytest.raises(OSError, match="the workers are gone") as gone:
        tiled.case("basins", executor=Fewer(executor), store=store)
    assert "--resume goes on" in str(gone.value)
    tiled.assert_same(tiled.case("basins", store=store, resume=True), tiled.plain("basins"))


def test_an_error_of_a_worker_is_that_of_the_call() -> None:
    with pool() as executor, pytest.raises(pendmap.InputError, match="tol must be"):
        pendmap.basins(
            pendmap.Pendulum(),
            pendmap.Grid.square(50),
            tol=1.0,
            run=pendmap.RunOptions(executor=executor),
        )


@pytest.mark.parametrize(
    ("keep", "said"),
    [
        ({"executor": 3}, "executor must have submit"),
        ({"resume": True}, "resume must be given with a store"),
        ({"chunks": {}}, "chunks must be given with a store"),
        ({"store": "no/folder/x.zarr"}, "the folder does not exist"),
    ],
)
def test_bad_input_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, keep: dict[str, object], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises((pendmap.InputError, OSError), match=said):
        tiled.case("basins", **keep)
    assert not [*tmp_path.iterdir()]


def test_lazy_results_are_arrays_of_dask(tmp_path: Path) -> None:
    lazy = tiled.case("basins", store=tmp_path / "map.zarr", chunks={})
    assert lazy.label.chunks[0][:2] == (20, 20)
    tiled.assert_same(lazy, tiled.plain("basins"))
