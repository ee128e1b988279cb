"""Runs that are killed or run out of disk, and go on: equal to those that were not stopped."""

from __future__ import annotations

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


def run(name: str, store: Path, fault: str = "none", at: int = 0) -> tuple[int, str]:
    """Return the exit code and the last line of a run that is stopped at its write ``at``."""
    words = [sys.executable, "tiled.py", name, str(store), fault, str(at)]
    pipe = subprocess.PIPE
    ended = subprocess.run(words, cwd=HERE, stdout=pipe, stderr=subprocess.STDOUT, text=True)  # noqa: PLW1510
    return ended.returncode, "".join(ended.stdout.splitlines()[-1:])


THOROUGH = dict.fromkeys(("chaos", "slow", "bifurcation", "lifetime", "sweep"), 5) | {"map": 50}
KILLED = [
    ("basins", 4),
    *(pytest.param(name, n, marks=pytest.mark.thorough) for name, n in THOROUGH.items()),
]


@pytest.mark.parametrize(("name", "kills"), KILLED)
def test_a_run_that_is_killed_again_and_again_goes_on(
    tmp_path: Path, name: str, kills: int
) -> None:
    draw = random.Random(name)  # noqa: S311 (no secret)
    store = tmp_path / "killed.zarr"
    every = int(run(name, tmp_path / "whole.zarr")[1])  # writes of an uninterrupted run
    for _ in range(kills):  # most writes are those of the result: the first ones are tried as often
        code, line = run(name, store, "killed", round(every ** draw.random()))
        assert code in {0, -signal.SIGKILL}, line
    assert run(name, store)[0] == 0
    tiled.assert_same(pendmap.load(store), tiled.plain(name))
    assert {path.name for path in tmp_path.iterdir()} == {"whole.zarr", "killed.zarr"}


def test_a_full_disk_keeps_what_is_done(tmp_path: Path) -> None:
    store = tmp_path / "full.zarr"
    code, line = run("basins", store, "full", 14)
    assert code == 1
    assert re.search(r"No space left on device; [1-9]\d* of \d+ tiles are kept, --resume", line)
    tiled.assert_same(tiled.case("basins", store=store, resume=True), tiled.plain("basins"))


def test_an_interrupted_run_says_one_line(tmp_path: Path) -> None:
    words = [str(COMMAND), "basins", "--grid", "2500", "--quiet"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with started([*words, "--out", "m.zarr"], cwd=tmp_path, **pipes) as process:
        until(process, lambda: any_file(tmp_path, "m.zarr.part/records/label"))
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=120)
    assert (process.returncode, out) == (130, "")
    kept = r"\d+ of \d+ tiles are kept, --resume goes on"
    assert re.fullmatch(rf"pendmap: interrupted, m\.zarr\.part \({kept}\) written\n", err)
