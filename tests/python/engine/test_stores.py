"""Stores: what they refuse and leave, one run at a time, and damage: never a wrong number."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
from functools import partial
from typing import TYPE_CHECKING, Any

import pytest

import pendmap
import tiled
from interrupted import started
from pendmap import Grid, InputError, Pendulum
from pendmap.engine import FileStore

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import xarray as xr

    from conftest import Run

MODEL = Pendulum(p=0.6)
SMALL = ("basins", "--p", "0.6", "--grid", "30")
BASINS = partial(pendmap.basins, Pendulum(gamma=0.2, p=0.6), Grid.square(60), check=False)
DAMAGES: dict[str, Callable[[bytes, random.Random], bytes | None]] = {
    "deleted": lambda _data, _draw: None,
    "truncated": lambda data, draw: data[: draw.randrange(len(data))],
    "flipped": lambda data, draw: flipped(data, draw.randrange(len(data)), draw.randrange(8)),
}


def flipped(data: bytes, place: int, bit: int) -> bytes:
    return data[:place] + bytes([data[place] ^ 1 << bit]) + data[place + 1 :]


def same_or_refused(call: Callable[[], xr.Dataset], truth: xr.Dataset) -> bool:
    """Assert that a call returns a result or refuses it; return whether it does."""
    try:
        result = call()
    except InputError:
        return False
    tiled.assert_same(result, truth)
    return True


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("state", ["begun", "complete"])
def test_what_is_damaged_is_refused_or_computed_again(
    damage: str, state: str, tmp_path: Path
) -> None:
    truth, draw = BASINS(), random.Random(damage)  # noqa: S311
    begun = state == "begun"
    if begun:
        tiled.begun(BASINS, tmp_path / "whole.zarr", 0.6)
    else:
        BASINS(store=tmp_path / "whole.zarr")
    (whole,) = tmp_path.iterdir()
    files = sorted(file for file in whole.rglob("*") if file.is_file())
    for file in draw.sample(files, min(6, len(files))):
        store = tmp_path / "map.zarr"
        copy = shutil.copytree(whole, tmp_path / whole.name.replace("whole", "map"))
        data = DAMAGES[damage](file.read_bytes(), draw)
        (copy / file.relative_to(whole)).unlink()
        if data is not None:
            (copy / file.relative_to(whole)).write_bytes(data)
        loaded = begun or same_or_refused(lambda: pendmap.load(store), truth)  # noqa: B023
        resumed = same_or_refused(lambda: BASINS(store=store, resume=True), truth)  # noqa: B023
        assert resumed == loaded or file.name == "request", file
        assert not loaded or begun or file.suffix == ".json", file
        for left in tmp_path.glob("map.zarr*"):
            shutil.rmtree(left)


def piped(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (
            lambda s: shutil.copy(s / "net_turns/c/0/0", s / "label/c/0/0"),
            "label/c/0/0 was changed",
        ),
        (lambda s: shutil.rmtree(s / "label" / "c"), "lacks label/c/0/0"),
        (lambda s: piped(s / "zarr.json"), "must be a file, it is a pipe or a device"),
        (lambda s: piped(s / "label/c/0/0"), "must be a file, it is a pipe or a device"),
        (lambda s: piped(s / "pendmap.json"), "must be a file, it is a pipe or a device"),
    ],
)
def test_a_part_that_is_lost_or_another_is_named(
    change: Callable[[Path], None], text: str, tmp_path: Path
) -> None:
    store = tmp_path / "map.zarr"
    BASINS(store=store)
    change(store)
    for call in (partial(pendmap.load, store), partial(BASINS, store=store, resume=True)):
        with pytest.raises(InputError, match=text):
            call()


def test_a_file_of_another_is_kept(tmp_path: Path) -> None:
    store, truth = tmp_path / "map.zarr", BASINS()
    tiled.begun(BASINS, store, 0.6)
    notes = [tmp_path / "map.zarr.part" / "notes.txt", store / "notes.txt"]
    notes[0].write_text("mine")
    tiled.assert_same(BASINS(store=store, resume=True), truth)
    assert notes[0].read_text() == "mine"
    notes[1].write_text("mine")
    tiled.assert_same(pendmap.load(store), truth)
    with pytest.raises(InputError, match=r"it contains 'notes.txt', no part of a result"):
        BASINS(store=store)


@pytest.mark.parametrize("folder", ["map.zarr", "map.zarr.part/records"])
def test_what_is_no_store_is_kept(tmp_path: Path, folder: str) -> None:
    (tmp_path / folder).mkdir(parents=True)
    (tmp_path / folder / "thesis.tex").write_text("mine")
    before = sorted(tmp_path.rglob("*"))
    for keep in ({}, {"resume": True}):
        with pytest.raises(InputError, match=r"must be a new folder, or a result of|is no run"):
            tiled.case("basins", store=tmp_path / "map.zarr", **keep)
    assert sorted(tmp_path.rglob("*")) == before


def test_other_requests_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store, grid = tmp_path / "map.zarr", Grid.square(60)
    tiled.begun(partial(pendmap.basins, MODEL, grid), store)

    def refused(text: str, model: Pendulum, grid: Grid, **other: float) -> None:
        with pytest.raises(InputError, match=text):
            pendmap.basins(model, grid, store=store, resume=True, **other)

    refused(r"was begun with model: p = '0.6', not '0.7'", Pendulum(p=0.7), grid)
    refused("was begun with grid = ", MODEL, Grid.square(61))
    refused("was begun with tol = 1e-06, not 1e-07", MODEL, grid, tol=1e-7)
    with pytest.raises(InputError, match="was begun with analysis = 'basins', not 'lifetime'"):
        pendmap.lifetime(MODEL, store=store, resume=True)
    with pytest.raises(InputError, match=r"is an unfinished run: --resume \(resume=True\) goes on"):
        pendmap.basins(MODEL, grid, store=store)
    with pytest.raises(InputError, match=r"map\.zarr: is an unfinished run: its command"):
        pendmap.load(store)
    with monkeypatch.context() as patch:
        patch.setenv("PENDMAP_SIMD", "portable")
        refused("was begun with rounding of the processor = ", MODEL, grid)
    monkeypatch.setattr("pendmap._core.__version__", "0.0.1")
    refused(r"was begun with version of pendmap = '.*', not '0\.0\.1'", MODEL, grid)


def test_an_older_result_is_there_until_the_new_one_is(tmp_path: Path) -> None:
    store = tmp_path / "map.zarr"
    pendmap.basins(MODEL, Grid.square(40), store=store)
    tiled.begun(partial(pendmap.basins, MODEL, Grid.square(60)), store)
    assert pendmap.load(store).sizes["theta"] == 40
    assert pendmap.basins(MODEL, Grid.square(60), store=store, resume=True).sizes["theta"] == 60
    assert pendmap.load(store).sizes["theta"] == 60
    with pytest.raises(InputError, match="was begun with grid = "):  # a complete one neither
        pendmap.basins(MODEL, Grid.square(40), store=store, resume=True)
    assert pendmap.basins(MODEL, Grid.square(40), store=store).sizes["theta"] == 40
    assert [path.name for path in tmp_path.iterdir()] == ["map.zarr"]


def test_bad_input_leaves_no_store(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the smallest error that steps can reach"):
        pendmap.basins(Pendulum(p=1e6), Grid.square(30), store=tmp_path / "map.zarr")
    assert not [*tmp_path.iterdir()]


def test_the_command_keeps_and_resumes(tmp_path: Path, pendmap_command: Run) -> None:
    tiled.begun(partial(pendmap.basins, MODEL, 30), tmp_path / "a.zarr", 0.0)
    again = pendmap_command(*SMALL, "--out", "a.zarr", "--resume", "--plot", "a.png")
    assert again.stdout.splitlines()[-1] == "Written: a.zarr, a.png"
    plain = pendmap_command(*SMALL, "--out", "b.nc")
    assert plain.stdout.splitlines()[:5] == again.stdout.splitlines()[:5]
    one, other = (pendmap.load(tmp_path / name) for name in ("a.zarr", "b.nc"))
    tiled.assert_same(one, other)
    assert "--resume --plot a.png" in one.attrs["history"]
    refused = pendmap_command(*SMALL, "--out", f"file://{tmp_path}/a.zarr")
    assert refused.returncode == 2
    assert "a.zarr': must be a new file, got one that exists" in refused.stderr
    for option in ("--resume", "--overwrite"):
        run = pendmap_command(*SMALL, "--out", "a.zarr", option)
        assert run.returncode == 0, run.stderr


HOLDER = """
import os, pathlib, sys, time
from pendmap.engine import FileStore
with FileStore(pathlib.Path(sys.argv[1])).held():
    if child := os.fork():
        print(child, flush=True)
    time.sleep(60)
"""


def test_a_second_run_is_refused_until_the_first_is_killed_though_its_child_lives(
    tmp_path: Path,
) -> None:
    words: list[Any] = [sys.executable, "-c", HOLDER, tmp_path / "map.zarr"]
    with started(words, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        child = int(process.stdout.readline())
        for keep in ({}, {"resume": True}):
            with pytest.raises(InputError, match="is held by another run"):
                BASINS(store=words[-1], **keep)
        process.kill()
        process.wait(60)
        with (
            FileStore(words[-1]).held(),  # by a thread
            pytest.raises(InputError, match="is held by another run"),
        ):
            BASINS(store=words[-1])
        BASINS(store=words[-1])
        os.kill(child, signal.SIGKILL)
    assert [path.name for path in tmp_path.iterdir()] == ["map.zarr"]
