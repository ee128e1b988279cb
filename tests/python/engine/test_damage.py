"""Stores that were damaged: never a wrong number, never a traceback."""

from __future__ import annotations

import os
import random
import shutil
from functools import partial
from typing import TYPE_CHECKING, Any

import pytest

import pendmap
import tiled
from pendmap import Grid, InputError, Pendulum, RunOptions

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import xarray as xr

BASINS = partial(pendmap.basins, Pendulum(gamma=0.2, p=0.6), Grid.square(20), check=False)
DAMAGES: dict[str, Callable[[bytes, random.Random], bytes | None]] = {
    "deleted": lambda _data, _draw: None,
    "emptied": lambda _data, _draw: b"",
    "truncated": lambda data, draw: data[: draw.randrange(len(data))],
    "flipped": lambda data, draw: flipped(data, draw.randrange(len(data)), draw.randrange(8)),
}


def flipped(data: bytes, place: int, bit: int) -> bytes:
    return data[:place] + bytes([data[place] ^ 1 << bit]) + data[place + 1 :]


def kept(**keep: Any) -> xr.Dataset:  # noqa: ANN401 (of a run)
    return BASINS(run=RunOptions(**keep))


@pytest.fixture(autouse=True)
def _tiny_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pendmap.analysis.basin_tiles.TILE", 100)


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
    truth, draw = kept(), random.Random(damage)  # noqa: S311
    begun = state == "begun"
    if begun:
        tiled.begun(BASINS, tmp_path / "whole.zarr", 0.6)
    else:
        kept(store=tmp_path / "whole.zarr")
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
        resumed = same_or_refused(lambda: kept(store=store, resume=True), truth)  # noqa: B023
        assert resumed == loaded or file.name == "request", file
        assert not loaded or begun or file.suffix == ".json", file
        for left in tmp_path.glob("map.zarr*"):
            shutil.rmtree(left)


def test_a_file_of_another_is_kept(tmp_path: Path) -> None:
    store, truth = tmp_path / "map.zarr", kept()
    tiled.begun(BASINS, store, 0.6)
    notes = [tmp_path / "map.zarr.part" / "notes.txt", store / "notes.txt"]
    notes[0].write_text("mine")
    tiled.assert_same(kept(store=store, resume=True), truth)
    assert notes[0].read_text() == "mine"
    notes[1].write_text("mine")
    tiled.assert_same(pendmap.load(store), truth)
    with pytest.raises(InputError, match=r"it contains 'notes.txt', no part of a result"):
        kept(store=store)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda store: shutil.copy(store / "net_turns/c/0/0", store / "label/c/0/0"),
            "was changed",
        ),
        (lambda store: shutil.rmtree(store / "label" / "c"), "lacks label/c/0/0"),
        (lambda store: (store / "label/c/0/0").unlink(), "lacks label/c/0/0"),
    ],
)
def test_a_chunk_that_is_lost_or_another_is_named(
    change: Callable[[Path], None], said: str, tmp_path: Path
) -> None:
    kept(store=tmp_path / "map.zarr")
    change(tmp_path / "map.zarr")
    for call in (partial(pendmap.load, tmp_path / "map.zarr"), partial(kept, resume=True)):
        more = {} if call.func is pendmap.load else {"store": tmp_path / "map.zarr"}
        with pytest.raises(InputError, match=rf"label/c/0/0.*{said}|{said}"):
            call(**more)


@pytest.mark.parametrize("name", ["zarr.json", "label/zarr.json", "label/c/0/0"])
def test_a_pipe_in_a_store_is_refused(name: str, tmp_path: Path) -> None:
    kept(store=tmp_path / "map.zarr")
    (tmp_path / "map.zarr" / name).unlink()
    os.mkfifo(tmp_path / "map.zarr" / name)
    with pytest.raises(InputError, match="must be a file, it is a pipe or a device"):
        pendmap.load(tmp_path / "map.zarr")
