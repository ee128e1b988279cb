"""Two runs of one store: the second is refused, and one that was killed holds nothing."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
from typing import TYPE_CHECKING

import pytest

import pendmap
import tiled
from conftest import HERE
from interrupted import any_file, started, until
from pendmap import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@contextlib.contextmanager
def running(store: Path) -> Iterator[subprocess.Popen[str]]:
    """A run of the map of basins that has begun its tiles."""
    words = [sys.executable, "tiled.py", "basins", str(store), "none", "0"]
    with started(words, cwd=HERE, stdout=subprocess.PIPE) as process:
        until(process, lambda: any_file(store.parent, "map.zarr.part/records/label"), 0.01)
        yield process


def test_a_second_run_is_refused_until_the_first_is_killed(tmp_path: Path) -> None:
    store = tmp_path / "map.zarr"
    with running(store) as first:
        first.send_signal(signal.SIGSTOP)
        for keep in ({}, {"resume": True}):
            with pytest.raises(InputError, match="is held by another run"):
                tiled.case("basins", store=store, **keep)
        first.kill()
        first.wait(60)
        tiled.assert_same(tiled.case("basins", store=store, resume=True), tiled.plain("basins"))
    assert [path.name for path in tmp_path.iterdir()] == ["map.zarr"]


def test_threads_are_runs_too(tmp_path: Path) -> None:
    refused, truth = [], tiled.plain("sweep")

    def run() -> None:
        try:
            tiled.case("sweep", store=tmp_path / "s.zarr", resume=True)
        except InputError as error:
            refused.append(str(error))

    threads = [threading.Thread(target=run) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all("is held by another run" in line for line in refused)
    tiled.assert_same(pendmap.load(tmp_path / "s.zarr"), truth)


HOLDER = """
import os, sys, time
from pendmap.engine import FileStore
with FileStore(sys.argv[1]).held():
    if child := os.fork():
        print(child, flush=True)
    time.sleep(60)
"""


def test_a_child_that_outlives_its_run_holds_nothing(tmp_path: Path) -> None:
    words = [sys.executable, "-c", HOLDER, str(tmp_path / "map.zarr")]
    with started(words, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        child = int(process.stdout.readline())
        with pytest.raises(InputError, match="is held by another run"):
            tiled.case("basins", store=words[-1])
        process.kill()
        process.wait(60)
        tiled.case("basins", store=words[-1])
        os.kill(child, signal.SIGKILL)
