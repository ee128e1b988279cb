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

MODEL = Pendulum(gamma=0.2, p=0.6)


BASINS = partial(pendmap.basins, MODEL, Grid.square(20), check=False)


def kept(**keep: Any) -> xr.Dataset:  # noqa: ANN401 (of a run)
    return BASINS(run=RunOptions(**keep))


def deleted(file: Path, _: random.Random) -> None:
    file.unlink()


def emptied(file: Path, _: random.Random) -> None:
    file.write_bytes(b"")


def truncated(file: Path, draw: random.Random) -> None:
    file.write_bytes(file.read_bytes()[: draw.randrange(file.stat().st_size)])


def flipped(file: Path, draw: random.Random) -> None:
    data = bytearray(file.read_bytes())
    data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
    file.write_bytes(bytes(data))


DAMAGES = (deleted, emptied, truncated, flipped)


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
def test_a_damaged_result_is_refused(damage: Callable[..., None], tmp_path: Path) -> None:
    truth, draw = kept(store=tmp_path / "whole.zarr").load(), random.Random(damage.__name__)  # noqa: S311
    files = sorted(file for file in (tmp_path / "whole.zarr").rglob("*") if file.is_file())
    for file in draw.sample(files, 12):
        store = tmp_path / "map.zarr"
        shutil.copytree(tmp_path / "whole.zarr", store)
        damage(store / file.relative_to(tmp_path / "whole.zarr"), draw)
        loaded = same_or_refused(lambda: pendmap.load(store), truth)  # noqa: B023
        resumed = same_or_refused(lambda: kept(store=store, resume=True), truth)  # noqa: B023
        assert loaded == resumed, file
        assert not loaded or file.suffix == ".json", file
        shutil.rmtree(store)


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_run_goes_on_or_is_refused(damage: Callable[..., None], tmp_path: Path) -> None:
    truth, draw = kept(), random.Random(damage.__name__)  # noqa: S311
    tiled.begun(BASINS, tmp_path / "begun.zarr", 0.6)
    begun = tmp_path / "begun.zarr.part"
    files = sorted(file for file in begun.rglob("*") if file.is_file())
    for file in draw.sample(files, 5):
        store = tmp_path / "map.zarr"
        shutil.copytree(begun, f"{store}.part")
        damage(tmp_path / "map.zarr.part" / file.relative_to(begun), draw)
        whole = same_or_refused(lambda: kept(store=store, resume=True), truth)  # noqa: B023
        assert whole or file.parent == begun, file
        for left in tmp_path.glob("map.zarr*"):
            shutil.rmtree(left)


def test_a_file_of_another_is_kept(tmp_path: Path) -> None:
    store, truth = tmp_path / "map.zarr", kept()
    tiled.begun(BASINS, store, 0.6)
    files = [tmp_path / "map.zarr.part" / name for name in ("notes.txt", "mine.partial")]
    for file in files:
        file.write_text("mine")
    tiled.assert_same(kept(store=store, resume=True), truth)
    assert [store.joinpath(file.name).read_text() for file in files] == ["mine"] * 2
    tiled.assert_same(pendmap.load(store), truth)
    with pytest.raises(InputError, match=r"it contains '.*', no part of a result"):
        kept(store=store)


def test_chunks_in_the_place_of_others_are_noticed(tmp_path: Path) -> None:
    truth = kept(store=tmp_path / "whole.zarr").load()
    shutil.copytree(tmp_path / "whole.zarr", tmp_path / "map.zarr")
    chunks = tmp_path / "map.zarr" / "settle_periods" / "c"
    shutil.copy(chunks / "1" / "0", chunks / "0" / "0")
    with pytest.raises(InputError, match="its chunks were changed after they were written"):
        pendmap.load(tmp_path / "map.zarr")
    with pytest.raises(InputError, match="its chunks were changed after they were written"):
        kept(store=tmp_path / "map.zarr", resume=True)
    tiled.begun(BASINS, tmp_path / "begun.zarr", 0.6)
    chunks = tmp_path / "begun.zarr.part" / "work" / "settle_periods" / "c"
    shutil.copy(chunks / "1" / "0", chunks / "0" / "0")
    tiled.assert_same(kept(store=tmp_path / "begun.zarr", resume=True), truth)


@pytest.mark.parametrize("name", ["zarr.json", "label/zarr.json", "label/c/0/0"])
def test_a_pipe_in_a_store_is_refused(name: str, tmp_path: Path) -> None:
    kept(store=tmp_path / "map.zarr")
    (tmp_path / "map.zarr" / name).unlink()
    os.mkfifo(tmp_path / "map.zarr" / name)
    with pytest.raises(InputError, match="must be a file, it is a pipe or a device"):
        pendmap.load(tmp_path / "map.zarr")
