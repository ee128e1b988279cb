"""Tiles computed by processes and clusters: the bits of the plain call."""

from __future__ import annotations

import concurrent.futures
import contextlib
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
from typing import TYPE_CHECKING, Any

import dask
import distributed
import pytest
from joblib.externals.loky import get_reusable_executor

import pendmap
import tiled
from interrupted import started, until

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from concurrent.futures import Executor
    from contextlib import AbstractContextManager
    from pathlib import Path

# The scheduler's status page listens even when it shows nothing: 8787 may be taken.
ANY_PORT = "127.0.0.1:0"


@contextlib.contextmanager
def local_cluster() -> Iterator[Executor]:
    local = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": ANY_PORT}
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 20}),
        distributed.LocalCluster(**local) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client


@contextlib.contextmanager
def separate_processes(folder: Path) -> Iterator[str]:
    """The address of a ``dask scheduler`` with two ``dask worker``, as on several machines."""
    dask, file = [sys.executable, "-m"], folder / "scheduler.json"
    words = [*dask, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
    more = ["--dashboard-address", ANY_PORT, "--scheduler-file", str(file)]
    worker = [*dask, "distributed.cli.dask_worker", "--nthreads", "1", "--no-dashboard"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with contextlib.ExitStack() as stack:
        process = stack.enter_context(started([*words, *more], **quiet))
        until(process, lambda: file.exists() and file.read_text().endswith("}"))
        for _ in range(2):
            to = ["--no-nanny", "--scheduler-file", str(file)]
            stack.enter_context(started([*worker, *to], **quiet))
        yield json.loads(file.read_text())["address"]


@contextlib.contextmanager
def joblib() -> Iterator[Executor]:
    executor = get_reusable_executor(max_workers=2)
    yield executor
    executor.shutdown(wait=True, kill_workers=True)


@pytest.fixture(scope="module")
def two_processes() -> Iterator[Executor]:
    """Two processes for all analyses: each imports pendmap once."""
    fresh = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(2, mp_context=fresh) as executor:
        yield executor


@pytest.mark.parametrize("name", [*tiled.CASES])
def test_processes_compute_the_same_bits(
    tmp_path: Path, name: str, two_processes: Executor
) -> None:
    tiled.assert_same(tiled.case(name, executor=two_processes), tiled.plain(name))
    if name in {"basins", "map"}:
        kept = tiled.case(name, executor=two_processes, store=tmp_path / "map.zarr")
        tiled.assert_same(kept, tiled.plain(name))


@pytest.mark.parametrize("executors", [local_cluster, joblib])
def test_executors_compute_the_same_bits(
    tmp_path: Path, executors: Callable[[], AbstractContextManager[Executor]]
) -> None:
    with executors() as executor:
        kept = tiled.case("map", executor=executor, store=tmp_path / "map.zarr")
        tiled.assert_same(kept, tiled.plain("map"))


@pytest.mark.thorough
def test_separate_processes_compute_the_same_bits(tmp_path: Path) -> None:
    with (
        separate_processes(tmp_path) as address,
        distributed.Client(address, set_as_default=False) as client,
    ):
        for name in tiled.CASES:
            kept = tiled.case(name, executor=client, store=tmp_path / f"{name}.zarr")
            tiled.assert_same(kept, tiled.plain(name))


@pytest.mark.thorough
def test_workers_that_are_killed_cost_only_their_tiles(tmp_path: Path) -> None:
    over, killed = threading.Event(), []
    with local_cluster() as client:

        def kill() -> None:
            while len(killed) < 5 and not over.wait(2.0):  # five: a slow start is no dead end
                workers = client.cluster.workers.values()
                alive = [worker.pid for worker in workers if worker.pid is not None]
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


def test_workers_that_are_gone_are_an_error_that_keeps_the_tiles(
    tmp_path: Path, two_processes: Executor
) -> None:
    store, left = tmp_path / "map.zarr", iter(range(3))

    class Fewer:
        """An executor whose processes are lost after three tiles."""

        def submit(self, *call: Any) -> object:  # noqa: ANN401
            future = concurrent.futures.Future[object]()
            if next(left, None) is None:
                future.set_exception(concurrent.futures.BrokenExecutor("one was killed"))
            else:
                future.set_result(two_processes.submit(*call).result())
            return future

    with pytest.raises(OSError, match=r"the workers are gone \(one was killed\)") as gone:
        tiled.case("basins", executor=Fewer(), store=store)
    assert "tiles are kept, --resume goes on" in str(gone.value)
    tiled.assert_same(tiled.case("basins", store=store, resume=True), tiled.plain("basins"))


def test_an_error_of_a_tile_is_that_of_the_call(
    two_processes: Executor, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pendmap.engine.work.rounding", lambda: "as nowhere")
    with pytest.raises(pendmap.InputError, match=r"worker must round like .* \(as nowhere\), got"):
        tiled.case("basins", executor=two_processes)


@pytest.mark.parametrize(
    ("keep", "said"),
    [
        ({"executor": 3}, "executor must have submit"),
        ({"resume": True}, "resume must be given with a store"),
        ({"store": "no/folder/x.zarr"}, "the folder does not exist"),
        ({"store": "map.nc"}, r"store must be a folder NAME\.zarr, or an address"),
        ({"store": 3}, r"store must be a folder NAME\.zarr, or an address"),
        ({"store": ""}, r"store must be a folder NAME\.zarr, or an address"),
        ({"store": "s4://maps/map.zarr"}, r"s4://maps/map\.zarr: Protocol not known: s4"),
    ],
)
def test_bad_input_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, keep: dict[str, object], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("basins", "bifurcation"):
        with pytest.raises((pendmap.InputError, OSError), match=said):
            tiled.case(name, **keep)
    assert not [*tmp_path.iterdir()]
