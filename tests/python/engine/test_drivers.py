"""Two runs of one store: the second is refused, and one that was stopped replaces nothing."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from typing import TYPE_CHECKING

import fsspec
import pytest

import pendmap
import tiled
from conftest import HERE
from interrupted import any_file, started, until
from pendmap import InputError
from pendmap.engine import held

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@contextlib.contextmanager
def running(store: Path) -> Iterator[subprocess.Popen[str]]:
    """A run of the map of basins that has begun its tiles."""
    words = [sys.executable, "tiled.py", "basins", str(store), "none", "0"]
    with started(words, cwd=HERE, stdout=subprocess.PIPE) as process:
        until(process, lambda: any_file(store.parent, "map.zarr.part/*/label/zarr.json"), 0.01)
        yield process


def test_a_second_run_is_refused(tmp_path: Path) -> None:
    store = tmp_path / "map.zarr"
    with running(store) as first:
        first.send_signal(signal.SIGSTOP)
        for keep in ({}, {"resume": True}):
            with pytest.raises(InputError) as refused:
                tiled.CASES["basins"](store=store, **keep)
            assert f"is held by a run, process {first.pid} on " in str(refused.value)
        first.send_signal(signal.SIGCONT)
        assert first.wait(120) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["map.zarr"]
    tiled.assert_same(pendmap.load(store), tiled.plain("basins"))


def test_a_killed_run_holds_nothing(tmp_path: Path) -> None:
    store = tmp_path / "map.zarr"
    with running(store) as first:
        first.kill()
        first.wait(60)
        tiled.assert_same(tiled.CASES["basins"](store=store, resume=True), tiled.plain("basins"))
    assert [path.name for path in tmp_path.iterdir()] == ["map.zarr"]


def test_threads_are_runs_too(tmp_path: Path) -> None:
    refused, truth = [], tiled.plain("sweep")

    def run() -> None:
        try:
            tiled.CASES["sweep"](store=tmp_path / "s.zarr", resume=True)
        except InputError as error:
            refused.append(str(error))

    threads = [threading.Thread(target=run) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all("is held by a run" in line for line in refused)
    tiled.assert_same(pendmap.load(tmp_path / "s.zarr"), truth)


HOLDER = """
import os, sys, time, fsspec
from pendmap.engine import held
with held("a", fsspec.filesystem("file"), sys.argv[1], local=True):
    if child := os.fork():
        print(child, flush=True)
    time.sleep(60)
"""


def test_a_child_that_outlives_its_run_holds_nothing(tmp_path: Path) -> None:
    words = [sys.executable, "-c", HOLDER, str(tmp_path / "a.lock")]
    with started(words, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        child = int(process.stdout.readline())
        process.kill()
        process.wait(60)
        with held("a", fsspec.filesystem("file"), words[-1], local=True):
            os.kill(child, signal.SIGKILL)


def test_a_lease_ends_with_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that was stopped for long holds the store no more, and removes nothing."""
    monkeypatch.setattr("pendmap.engine.lock._EXPIRES", 0.4)
    system, path = fsspec.filesystem("memory"), "/m.zarr.lock"
    with held("memory://m.zarr", system, path, local=False) as check:
        time.sleep(1.0)
        check()  # it has been renewed
        with (
            pytest.raises(InputError, match="is held by a run, process"),
            held("memory://m.zarr", system, path, local=False),
        ):
            pass
        with monkeypatch.context() as patch:
            patch.setattr("pendmap.engine.lock._Lease._mine", lambda _: False)  # as if stopped
            time.sleep(1.0)
        with held("memory://m.zarr", system, path, local=False) as other:
            with pytest.raises(OSError, match="this run was stopped for long"):
                check()
            other()
    assert not system.exists(path)
