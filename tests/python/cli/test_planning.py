"""What a request will take, from samples of it."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import xarray as xr

import pendmap
from pendmap import Grid, Pendulum, _core
from pendmap.cli.planning import Places, Request, cost
from pendmap.engine import Work

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
OTHERS = [kind for kind in REQUESTS if kind != "basin_sweep"]  # sampled alike
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


@pytest.mark.parametrize("kind", OTHERS)
@pytest.mark.parametrize("cells", [100, 1000, 50_000])
def test_a_sample_has_about_as_many_cells_as_asked_for(kind: str, cells: int) -> None:
    request = REQUESTS[kind]
    sample = request.fewer(cells)
    assert min(cells, request.cells) <= sample.cells <= 2.0 * cells
    assert sample.arguments.get("draws") is None


def test_values_of_a_sample_lie_in_the_middle_of_equal_parts() -> None:
    own = {"ranges": {"p": (*SPAN, 200), "omega": (*SPAN, 3)}}
    ranges = Request("parameter_map", own).fewer(12).arguments["ranges"]
    assert ranges["p"] == pytest.approx((0.6875, 1.8125, 4))
    assert ranges["omega"] == (*SPAN, 3)


@pytest.mark.parametrize("kind", OTHERS)
def test_a_sample_as_large_as_the_request_is_the_request(kind: str) -> None:
    request = REQUESTS[kind]
    sample = request.fewer(request.cells)
    own = {**request.arguments, "draws": None, "check": False}
    assert all(own[name] == value for name, value in sample.arguments.items())


def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return the time that samples see, to be set."""
    now = [0.0]
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(time, "process_time", lambda: 0.0)
    return now


@pytest.mark.parametrize("kind", OTHERS)
def test_a_fixed_part_and_a_part_for_each_cell_are_told(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    request, now = REQUESTS[kind], clock(monkeypatch)
    fixed, each = 0.7 if kind in {"basins", "lifetime"} else 0.0, 4000 / request.cells

    def run(arguments: dict[str, Any]) -> xr.Dataset:
        now[0] += fixed
        arguments["progress"](0, 1000)
        now[0] += each * Request(kind, arguments).cells
        arguments["progress"](1000, 1000)
        return xr.Dataset()

    of_two = Request(kind, {**request.arguments, "threads": 2})
    sizes = iter(range(100, 10_000, 100))
    found = cost(of_two, run, lambda _: next(sizes), lambda _: 7, workers=None, stored=False)
    drawn = 1 + (request.arguments.get("draws") or 0)
    whole = fixed + each * (request.cells + request.checks)
    assert found.seconds == pytest.approx(drawn * whole, rel=1e-6)
    assert found.sample_cells < request.cells
    assert now[0] < 0.1 * whole
    assert found.threads == 2
    assert found.worker_memory_bytes is None
    assert found.disk_bytes > 107


SWEEPS = {
    "one": {"ranges": {"p": (*SPAN, 90)}, "grid": Grid.square(100)},
    "fine": {"ranges": {"p": (*SPAN, 90)}, "grid": Grid.square(1000)},
    "two": {"ranges": {"p": (*SPAN, 40), "omega": (*SPAN, 20)}, "grid": Grid.square(50)},
    "models": {"ranges": {"p": (1.0, 1.0, 1), "omega": (*SPAN, 2)}, "grid": Grid.square(200)},
}


@pytest.mark.parametrize("name", SWEEPS)
def test_a_sweep_is_told_from_its_searches_models_and_cells(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    request, now = Request("basin_sweep", {**SWEEPS[name], "threads": 2}), clock(monkeypatch)
    monkeypatch.setattr(_core, "default_threads", lambda: 1)  # samples one after another
    first, later, each = 3.0, 0.4, 2e-5

    def took(blocks: int, one: Request) -> float:
        models = math.prod(one.counts.values())
        return blocks * first + (models - blocks) * later + each * one.cells

    def run(arguments: dict[str, Any]) -> xr.Dataset:
        one, begun = Request("basin_sweep", arguments), now[0]
        assert arguments["threads"] == 1
        models = math.prod(one.counts.values())
        arguments["progress"](0, 1000)
        now[0] = begun + first + each * one.cells / models
        arguments["progress"](1000 // models, 1000)
        now[0] = begun + took(1, one)
        arguments["progress"](1000, 1000)
        dims = tuple(one.counts)
        shape = tuple(one.counts.values())
        exists = np.ones((*shape, 1), dtype=np.int8)
        points = {f"point_{dim}": ("point", np.zeros(1)) for dim in dims}
        coordinates = {dim: np.arange(n) for dim, n in one.counts.items()}
        return xr.Dataset({"exists": ((*dims, "attractor"), exists), **points}, coordinates)

    def save(dataset: xr.Dataset) -> int:
        return 5000 + 30 * dataset["exists"].size

    found = cost(request, run, save, lambda _: 7, workers=None, stored=False)
    models = math.prod(request.counts.values())
    whole = took(request.tiles, request)
    shape = [*request.counts.values()]
    sides = [min(n, 8 if shape[1:] else 16) for n in shape]
    full = Request(
        "basin_sweep",
        {
            **SWEEPS[name],
            "ranges": {dim: (1.0, 2.0, n) for dim, n in zip(request.counts, sides, strict=True)},
        },
    )
    assert 0.5 * whole <= found.seconds * 1.000001
    assert found.seconds <= 0.5 * whole + 0.5 * took(1, full)
    assert found.disk_bytes == 5000 + 30 * models + 7


@pytest.mark.parametrize("name", SWEEPS)
def test_places_of_a_sweep_are_neighbours(name: str) -> None:
    request = Request("basin_sweep", SWEEPS[name])
    places = Places(request)
    every = [*places]
    assert len({tuple(place.values()) for place in every}) == len(every)
    line = request.counts[places.along] - places.neighbours + 1
    others = math.prod(n for dim, n in request.counts.items() if dim != places.along)
    assert len(every) == line * others
    for place in every[:20]:
        ranges = places.at(place, 100).arguments["ranges"]
        for dim, span in request.arguments["ranges"].items():
            known = np.linspace(*span)
            gaps = np.abs(np.subtract.outer(np.linspace(*ranges[dim]), known)).min(axis=1)
            assert gaps.max() < 1e-12
    low = [place[places.along] for place in every[:8]]
    assert np.ptp(low) >= 0.6 * (line - 1)  # spread from the beginning


@pytest.mark.parametrize(("cells", "checks"), [(100, 300), (9000, 6000), (10**6, 131_000)])
def test_starts_of_checks(cells: int, checks: int) -> None:
    grid = Grid((-3, 3, cells // 10), (-3, 3, 10))
    assert Request("basins", {"grid": grid}).checks == checks


@pytest.mark.parametrize("name", ["parameter_map", "bifurcation", "basin_sweep", "basins"])
def test_tiles_are_those_of_a_store(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, two = {"p": (0.2, 0.4, 33)}, {"p": (0.2, 0.4, 18), "omega": (2.0, 2.1, 2)}
    arguments: dict[str, Any] = {
        "parameter_map": {"ranges": two, "starts": 1},
        "bifurcation": {"ranges": one, "starts": 1},
        "basin_sweep": {"ranges": one, "grid": Grid.square(4)},
        "basins": {"grid": Grid((-3, 3, 20), (-2, 2, 10))},
    }[name]
    run = pendmap.sweep if name == "basin_sweep" else getattr(pendmap, name)
    tiles, each = [], Work.each

    def counted(work: Work, step: str, state: str, wanted: range) -> Any:  # noqa: ANN401
        tiles.append(len(wanted))
        return each(work, step, state, wanted)

    monkeypatch.setattr(Work, "each", counted)
    run(Pendulum(), **arguments, store=tmp_path / "m.zarr")
    assert Request(name, arguments).tiles == tiles[0]


def test_tiles_of_a_large_map() -> None:
    rows = 5 * math.ceil(2**20 / 500_000)
    assert Request("basins", {"grid": Grid.square(100_000)}).tiles == math.ceil(1e5 / rows)
    assert REQUESTS["lifetime"].tiles == math.ceil(400_000 / 2**18)
