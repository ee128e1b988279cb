"""Runs that are killed or run out of disk, and go on: equal to those that were not stopped."""

from __future__ import annotations

import itertools
import random
import re
import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

import pendmap
import tiled
from conftest import COMMAND, HERE
from interrupted import any_file, started, until

if TYPE_CHECKING:
    from pathlib import Path


def run(
    name: str, store: Path, fault: str = "none", at: int = 0
) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "tiled.py", name, str(store), fault, str(at)]
    return subprocess.run(words, cwd=HERE, capture_output=True, text=True, check=False, timeout=300)


def writes(name: str, folder: Path) -> int:
    """Return the number of writes of an uninterrupted run."""
    return int(run(name, folder / "whole.zarr").stdout)


def killed_often(name: str, folder: Path, kills: int) -> None:
    """Assert that a run that was killed again and again is equal to one that was not."""
    draw = random.Random(name)  # noqa: S311 (no secret)
    store = folder / "killed.zarr"
    every = writes(name, folder)
    for kill in itertools.count():
        most = every if kill >= kills else 2 * every // kills
        ended = run(name, store, "killed", draw.randint(1, most))
        if ended.returncode == 0:
            break
        assert ended.returncode == -signal.SIGKILL, ended.stderr
    assert kill > kills // 2
    tiled.assert_same(pendmap.load(store), tiled.plain(name))
    assert {path.name for path in folder.iterdir()} == {"whole.zarr", "killed.zarr"}


def test_a_killed_run_goes_on(tmp_path: Path) -> None:
    killed_often("basins", tmp_path, 3)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["chaos", "slow", "bifurcation", "lifetime", "list", "sweep"])
def test_every_killed_analysis_goes_on(tmp_path: Path, name: str) -> None:
    killed_often(name, tmp_path, 5)


@pytest.mark.thorough
def test_a_map_that_is_killed_50_times_goes_on(tmp_path: Path) -> None:
    killed_often("map", tmp_path, 50)


@pytest.mark.thorough
def test_an_interrupted_run_with_workers_says_one_line(tmp_path: Path) -> None:
    words = [str(COMMAND), "basins", "--grid", "2500", "--workers", "2", "--quiet"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with started([*words, "--out", "m.zarr"], cwd=tmp_path, **pipes) as process:
        until(process, lambda: any_file(tmp_path, "m.zarr.part/**/zarr.json"))
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=120)
    assert process.returncode == 130
    assert said[0] == ""
    kept = r"\d+ of \d+ tiles are kept, --resume goes on"
    assert re.fullmatch(rf"pendmap: interrupted, m\.zarr\.part \({kept}\) written\n", said[1])


@pytest.mark.parametrize("name", ["basins", "bifurcation"])
def test_a_full_disk_keeps_what_is_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    store = tmp_path / "full.zarr"
    half = writes(name, tmp_path) // 2
    full = run(name, store, "full", half)
    assert full.returncode == 1
    assert "No space left on device; " in full.stderr.splitlines()[-1]
    assert "tiles are kept, --resume goes on" in full.stderr.splitlines()[-1]
    with pytest.raises(pendmap.InputError, match=r"full\.zarr: is an unfinished run: its command"):
        pendmap.load(store)
    if name == "basins":
        with monkeypatch.context() as patch:
            patch.setattr("pendmap.analysis.basin_tiles.TILE", 2 * tiled.TILE)
            with pytest.raises(pendmap.InputError, match="was begun with tiles of"):
                tiled.case(name, store=store, resume=True)
    tiled.assert_same(tiled.case(name, store=store, resume=True), tiled.plain(name))
