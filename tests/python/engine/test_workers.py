"""Tiles computed by processes and clusters: the bits of the plain call."""

from __future__ import annotations

import concurrent.futures
import multiprocessing
from typing import TYPE_CHECKING, Any

import distributed
import pytest

import pendmap
import tiled

if TYPE_CHECKING:
    from collections.abc import Iterator
    from concurrent.futures import Executor
    from pathlib import Path


@pytest.fixture(scope="module")
def two_processes() -> Iterator[Executor]:
    fresh = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(2, mp_context=fresh) as executor:
        yield executor


@pytest.mark.parametrize("name", [*tiled.CASES])
def test_processes_compute_the_same_bits(
    tmp_path: Path, name: str, two_processes: Executor
) -> None:
    result = tiled.case(name, executor=two_processes, store=tmp_path / "map.zarr")
    tiled.assert_same(result, tiled.plain(name))


def test_a_dask_client_computes_the_same_bits() -> None:
    # The scheduler's status page listens even when it shows nothing: 8787 may be taken.
    local = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": "127.0.0.1:0"}
    with (
        distributed.LocalCluster(**local) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        tiled.assert_same(tiled.case("map", executor=client), tiled.plain("map"))


def test_workers_that_are_gone_are_an_error_that_keeps_the_tiles(
    tmp_path: Path, two_processes: Executor
) -> None:
    store, left = tmp_path / "map.zarr", iter(range(3))

    class Fewer:  # its processes are lost after three tiles
        def submit(self, *call: Any) -> object:  # noqa: ANN401
            future = concurrent.futures.Future[object]()
            if next(left, None) is None:
                future.set_exception(concurrent.futures.BrokenExecutor("one was killed"))
            else:
                future.set_result(two_processes.submit(*call).result())
            return future

    gone = r"the workers are gone \(one was killed\).* tiles are kept, --resume goes on"
    with pytest.raises(OSError, match=gone):
        tiled.case("basins", executor=Fewer(), store=store)
    tiled.assert_same(tiled.case("basins", store=store, resume=True), tiled.plain("basins"))


def test_an_error_of_a_tile_is_that_of_the_call(
    two_processes: Executor, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pendmap.engine.work.rounding", lambda: "as nowhere")
    with pytest.raises(pendmap.InputError, match=r"worker must round like .* \(as nowhere\), got"):
        tiled.case("basins", executor=two_processes)


@pytest.mark.parametrize(
    ("keep", "text"),
    [
        ({"executor": 3}, "executor must have submit"),
        ({"resume": True}, "resume must be given with a store"),
        ({"store": "no/folder/x.zarr"}, "the folder does not exist"),
        ({"store": "map.nc"}, r"store must be a folder NAME\.zarr, got"),
        ({"store": "s3://maps/map.zarr"}, "the folder does not exist: 's3:/maps'"),
    ],
)
def test_bad_input_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, keep: dict[str, object], text: str
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("basins", "bifurcation"):
        with pytest.raises((pendmap.InputError, OSError), match=text):
            tiled.case(name, **keep)
    assert not [*tmp_path.iterdir()]
