"""Stores: where they may be, what they refuse, what they leave."""

from __future__ import annotations

import socket
from functools import partial
from typing import TYPE_CHECKING

import fsspec
import numpy as np
import pytest
import xarray as xr
from moto.server import ThreadedMotoServer

import pendmap
import tiled
from pendmap import Grid, InputError, Pendulum

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from conftest import Run

SMALL = ("basins", "--p", "0.6", "--grid", "30")


@pytest.fixture(scope="module")
def bucket() -> Iterator[str]:
    """A bucket of a local S3 server, one for all: fsspec keeps the connection to the first."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = ThreadedMotoServer("127.0.0.1", port, verbose=False)
    server.start()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{port}")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
            patch.setenv(name, "any")
        fsspec.filesystem("s3").mkdir("maps")
        yield "s3://maps"
    server.stop()


def test_a_store_may_be_in_an_object_store(bucket: str) -> None:
    store, system = f"{bucket}/plane.zarr", fsspec.filesystem("s3")
    tiled.begun(tiled.CASES["plane"], store)
    with pytest.raises(InputError, match="is an unfinished run: --resume"):
        tiled.case("plane", store=store)
    with pytest.raises(InputError, match="is an unfinished run: its command"):
        pendmap.load(store)
    system.pipe_file("maps/plane.zarr/label/c/9", b"of a run that was killed when it wrote")
    tiled.assert_same(tiled.case("plane", store=store, resume=True), tiled.plain("plane"))
    tiled.assert_same(pendmap.load(store), tiled.plain("plane"))
    pendmap.save(tiled.plain("plane"), store)  # replaces it
    assert pendmap.load(store).identical(tiled.plain("plane"))
    assert {name.split("/")[1] for name in system.find("maps")} == {"plane.zarr"}
    system.pipe_file("maps/plane.zarr/notes.txt", b"mine")
    with pytest.raises(InputError, match=r"it contains 'notes.txt', no part of a result"):
        pendmap.save(tiled.plain("plane"), store)
    system.rm_file("maps/plane.zarr/fraction/c/0/0/0")
    with pytest.raises(InputError, match=r"s3://maps/plane\.zarr: lacks fraction/c/0/0/0"):
        pendmap.load(store)


def test_an_object_store_that_is_not_reached_is_told(
    bucket: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(*_: object, **__: object) -> None:
        raise RuntimeError("no connection")

    monkeypatch.setattr("s3fs.S3FileSystem.find", gone)
    with pytest.raises(OSError, match=r"s3://maps/x\.zarr: cannot be reached: no connection"):
        tiled.case("basins", store=f"{bucket}/x.zarr")


def test_a_complete_store_is_replaced_only_on_request(pendmap_command: Run, tmp_path: Path) -> None:
    words = (*SMALL, "--out", f"file://{tmp_path}/a.zarr", "--quiet")
    assert pendmap_command(*words).returncode == 0
    refused = pendmap_command(*words)
    assert refused.returncode == 2
    name = str(tmp_path / "a.zarr")
    assert [str(path) for path in tmp_path.iterdir()] == [name]
    assert f"{name!r}: must be a new file, got one that exists" in refused.stderr
    for option in ("--resume", "--overwrite"):
        run = pendmap_command(*words, option)
        assert run.returncode == 0, run.stderr


def test_other_requests_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store, grid = tmp_path / "map.zarr", Grid.square(60)
    tiled.begun(partial(pendmap.basins, Pendulum(p=0.6), grid), store)

    def refused(said: str, model: Pendulum, grid: Grid, **other: float) -> None:
        with pytest.raises(InputError, match=said):
            pendmap.basins(model, grid, store=store, resume=True, **other)

    refused(r"was begun with model: p = '0.6', not '0.7'", Pendulum(p=0.7), grid)
    refused("was begun with grid = ", Pendulum(p=0.6), Grid.square(61))
    refused("was begun with tol = 1e-06, not 1e-07", Pendulum(p=0.6), grid, tol=1e-7)
    with pytest.raises(InputError, match="was begun with analysis = 'basins', not 'lifetime'"):
        pendmap.lifetime(Pendulum(p=0.6), store=store, resume=True)
    with pytest.raises(InputError, match=r"is an unfinished run: --resume \(resume=True\) goes on"):
        pendmap.basins(Pendulum(p=0.6), grid, store=store)
    with monkeypatch.context() as patch:
        patch.setenv("PENDMAP_SIMD", "portable")
        refused("was begun with rounding of the processor = ", Pendulum(p=0.6), grid)
    monkeypatch.setattr("pendmap._core.__version__", "0.0.1")
    refused(r"was begun with version of pendmap = '.*', not '0\.0\.1'", Pendulum(p=0.6), grid)


def test_an_older_result_is_there_until_the_new_one_is(tmp_path: Path) -> None:
    store, model = tmp_path / "map.zarr", Pendulum(p=0.6)
    pendmap.basins(model, Grid.square(40), store=store)
    tiled.begun(partial(pendmap.basins, model, Grid.square(60)), store)
    assert pendmap.load(store).sizes["theta"] == 40
    assert pendmap.basins(model, Grid.square(60), store=store, resume=True).sizes["theta"] == 60
    assert pendmap.load(store).sizes["theta"] == 60
    with pytest.raises(InputError, match="was begun with grid = "):  # a complete one neither
        pendmap.basins(model, Grid.square(40), store=store, resume=True)
    assert pendmap.basins(model, Grid.square(40), store=store).sizes["theta"] == 40
    assert [path.name for path in tmp_path.iterdir()] == ["map.zarr"]


@pytest.mark.parametrize("kind", ["file", "folder", "group", "part"])
def test_what_is_no_store_is_kept(tmp_path: Path, kind: str) -> None:
    store = tmp_path / "map.zarr"
    match kind:
        case "file":
            store.write_text("mine")
        case "folder":
            store.mkdir()
            (store / "thesis.tex").write_text("mine")
        case "group":
            xr.Dataset({"x": ("t", [1.0])}).to_zarr(store, zarr_format=3, consolidated=False)
        case "part":
            (tmp_path / "map.zarr.part" / "records").mkdir(parents=True)
            (tmp_path / "map.zarr.part" / "records" / "thesis.tex").write_text("mine")
    before = sorted(tmp_path.rglob("*"))
    for keep in ({}, {"resume": True}):
        with pytest.raises(InputError, match=r"must be a new folder, or a result of|is no run"):
            tiled.case("basins", store=store, **keep)
    assert sorted(tmp_path.rglob("*")) == before


def test_bad_input_leaves_no_store(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the smallest error that steps can reach"):
        pendmap.basins(Pendulum(p=1e6), Grid.square(30), store=tmp_path / "map.zarr")
    assert not [*tmp_path.iterdir()]


def test_the_command_keeps_and_resumes(tmp_path: Path, pendmap_command: Run) -> None:
    tiled.begun(partial(pendmap.basins, Pendulum(p=0.6), 30), tmp_path / "a.zarr", 0.0)
    again = pendmap_command(*SMALL, "--out", "a.zarr", "--resume", "--plot", "a.png")
    assert again.stdout.splitlines()[-1] == "Written: a.zarr, a.png"
    plain = pendmap_command(*SMALL, "--out", "b.nc")
    assert plain.stdout.splitlines()[:5] == again.stdout.splitlines()[:5]
    one, other = (pendmap.load(tmp_path / name) for name in ("a.zarr", "b.nc"))
    tiled.assert_same(one, other)
    assert "--resume --plot a.png" in one.attrs["history"]
    assert np.array_equal(xr.open_zarr(tmp_path / "a.zarr").label, other.label)
