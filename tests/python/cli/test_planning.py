"""What a request will take, from samples of it."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
import xarray as xr

import pendmap
from pendmap import Grid, Pendulum
from pendmap.cli import dry_run
from pendmap.cli.dry_run import Request, Sample

if TYPE_CHECKING:
    from pathlib import Path

SPAN = (0.5, 2.0)
REQUESTS = {
    "basins": Request("basins", {"grid": Grid((-3, 3, 400), (-2, 2, 300)), "draws": None}),
    "parameter_map": Request(
        "parameter_map", {"ranges": {"p": (*SPAN, 200), "omega": (*SPAN, 50)}, "starts": 9}
    ),
    "bifurcation": Request("bifurcation", {"ranges": {"p": (*SPAN, 5000)}, "starts": 4}),
    "basin_sweep": Request("basin_sweep", {"ranges": {"p": (*SPAN, 90)}, "grid": Grid.square(100)}),
    "lifetime": Request("lifetime", {"starts": 400_000, "draws": 4}),
}
SIZES = {
    "basins": (120_000, 120_000),
    "parameter_map": (10_000, 90_000),
    "bifurcation": (5000, 20_000),
    "basin_sweep": (900_000, 900_000),
    "lifetime": (400_000, 2_000_000),
}


@pytest.mark.parametrize("kind", REQUESTS)
def test_cells_and_starts_are_those_of_the_result(kind: str) -> None:
    request = REQUESTS[kind]
    assert (request.cells, request.starts) == SIZES[kind]


@pytest.mark.parametrize("kind", REQUESTS)
@pytest.mark.parametrize("cells", [100, 1000, 50_000])
def test_a_sample_has_about_as_many_cells_as_asked_for(kind: str, cells: int) -> None:
    request = REQUESTS[kind]
    least = min(request.models, 16)
    sample = request.fewer(cells, least)
    assert min(cells, request.cells) <= sample.cells <= max(2.0 * cells, least)
    assert sample.models >= least or request.models > least
    assert sample.arguments.get("draws") is None


def test_values_of_a_sample_lie_in_the_middle_of_equal_parts() -> None:
    own = {"ranges": {"p": (*SPAN, 200), "omega": (*SPAN, 3)}}
    ranges = Request("parameter_map", own).fewer(12, 1).arguments["ranges"]
    assert ranges["p"] == pytest.approx((0.6875, 1.8125, 4))
    assert ranges["omega"] == (*SPAN, 3)


@pytest.mark.parametrize("kind", REQUESTS)
def test_a_sample_as_large_as_the_request_is_the_request(kind: str) -> None:
    request = REQUESTS[kind]
    sample = request.fewer(request.cells, request.models)
    own = {**request.arguments, "draws": None, "check": False}
    assert all(own[name] == value for name, value in sample.arguments.items())


@pytest.mark.parametrize("kind", REQUESTS)
def test_a_fixed_part_and_a_part_for_each_cell_are_told(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    request, now = REQUESTS[kind], [0.0]
    searched = kind in {"basins", "basin_sweep", "lifetime"}
    fixed, each = 0.7 if searched else 0.0, 4000 / request.cells

    def run(arguments: dict[str, Any]) -> xr.Dataset:
        one = Request(kind, arguments)
        now[0] += fixed * one.models
        arguments["progress"](0, 1000)
        now[0] += each * one.cells
        arguments["progress"](1000, 1000)
        return xr.Dataset()

    clock = SimpleNamespace(perf_counter=lambda: now[0], process_time=lambda: 0.0)
    monkeypatch.setattr(dry_run, "time", clock)
    arguments = {**request.arguments, "threads": 2}
    of_two = Request(kind, arguments)
    sizes = iter(range(100, 10_000, 100))
    found = dry_run.cost(
        of_two, run, lambda _: next(sizes), lambda _: 7, workers=None, stored=False
    )
    drawn = 1 + (request.arguments.get("draws") or 0)
    whole = fixed * request.models + each * (request.cells + request.checks)
    if kind == "basin_sweep":  # six blocks, two at once
        whole /= 2
    assert found.seconds == pytest.approx(drawn * whole, rel=1e-6)
    assert found.sample_cells < request.cells
    assert now[0] < 0.1 * whole or kind == "basin_sweep"  # whole maps
    assert found.threads == 2
    assert found.worker_memory_bytes is None
    assert found.disk_bytes > 107


def test_models_of_a_sweep_have_the_fixed_part() -> None:
    request = REQUESTS["basin_sweep"]
    samples = [Sample(16, 16 * 100, 0.0), Sample(32, 32 * 400, 0.0)]
    values = [sample.models * (2.0 + 0.01 * sample.cells / sample.models) for sample in samples]
    assert request.extended(samples, values) == pytest.approx(90 * (2.0 + 0.01 * 10_000))


@pytest.mark.parametrize(("cells", "checks"), [(100, 300), (9000, 6000), (10**6, 131_000)])
def test_starts_of_checks(cells: int, checks: int) -> None:
    grid = Grid((-3, 3, cells // 10), (-3, 3, 10))
    assert Request("basins", {"grid": grid}).checks == checks


@pytest.mark.parametrize("name", ["parameter_map", "bifurcation", "basin_sweep", "basins"])
def test_tiles_are_those_of_a_store(name: str, tmp_path: Path) -> None:
    one, two = {"p": (0.2, 0.4, 33)}, {"p": (0.2, 0.4, 18), "omega": (2.0, 2.1, 2)}
    arguments: dict[str, Any] = {
        "parameter_map": {"ranges": two, "starts": 1},
        "bifurcation": {"ranges": one, "starts": 1},
        "basin_sweep": {"ranges": one, "grid": Grid.square(4)},
        "basins": {"grid": Grid((-3, 3, 20), (-2, 2, 10))},
    }[name]
    run = pendmap.sweep if name == "basin_sweep" else getattr(pendmap, name)
    part = run(Pendulum(), **arguments, store=tmp_path / "m.zarr", part=(1, 2))
    assert Request(name, arguments).tiles == part.attrs["tiles"]


def test_tiles_of_a_large_map() -> None:
    rows = 5 * math.ceil(2**20 / 500_000)
    assert Request("basins", {"grid": Grid.square(100_000)}).tiles == math.ceil(1e5 / rows)
    assert REQUESTS["lifetime"].tiles == 1
