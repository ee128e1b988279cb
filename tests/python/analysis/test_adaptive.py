"""Adaptive maps: against full grids, and against planes whose labels are known."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import xarray as xr

import pendmap
from pendmap import Grid, InputError, Pendulum
from pendmap.analysis.adaptive import HOW, SIDE, Tally, refined, tried

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from conftest import Run

FILLED, COMPUTED, RIGHT, WRONG = HOW
SMOOTH = {"gamma": 0.1, "p": 0.6, "omega": 2.0}
FRACTAL = {"gamma": 0.1, "p": 1.7, "omega": 2.0}


class Plane:
    """A plan whose labels are those of an image."""

    plane = "basins"

    def __init__(self, image: NDArray[np.int16]) -> None:
        self.image = image
        self.times = np.zeros(image.size, int)

    def label_again(self, cells: NDArray[np.intp], _: object = None) -> SimpleNamespace:
        """Return the labels of cells, and their indices as turns."""
        label = self.image.reshape(-1)[cells]
        self.times[cells] += 1
        return SimpleNamespace(label=label, settle=cells + 1, turns=cells, work=cells.size)

    def refined(self, rows: int = 0, seed: int = 0) -> dict[str, NDArray[Any]]:
        """Return the cells, in bands of ``rows``."""
        height, width = shape = self.image.shape
        bands = []
        for first in range(0, height, rows or height):
            last = min(first + (rows or height), height)
            plan: Any = self
            bands.append(refined(plan, first * width, last * width, shape, seed, None)[0])
        names = bands[0]
        return {n: np.concatenate([band[n] for band in bands]).reshape(shape) for n in names}


def painted(shape: tuple[int, int], where: Callable[..., Any]) -> Plane:
    """Return a plane with the label 2 where a function of row and column is true, else 1."""
    return Plane(np.where(where(*np.indices(shape)), 2, 1).astype(np.int16))


def disc(y: Any, x: Any) -> Any:  # noqa: ANN401 (arrays)
    return (y - 170) ** 2 + (x - 140) ** 2 < 9000


def stripes(y: Any, x: Any) -> Any:  # noqa: ANN401 (arrays)
    return (y + x) % 9 < 4


@pytest.mark.parametrize(
    "shape", [(1, 1), (1, 90), (90, 1), (3, 50), (41, 41), (80, 81), (330, 290)]
)
@pytest.mark.parametrize("where", [disc, stripes])
def test_a_smooth_boundary_is_filled_without_error(
    shape: tuple[int, int], where: Callable[..., Any]
) -> None:
    plane = painted(shape, where)
    cells = plane.refined()
    assert (cells["label"] == plane.image).all()
    assert plane.times.max() == 1, "no cell is computed twice"
    computed = plane.times.reshape(shape) > 0
    assert ((cells["computed"] != FILLED) == computed).all()
    assert (cells["settle_periods"].reshape(-1)[plane.times == 0] == -1).all()
    assert (cells["net_turns"].reshape(-1) == np.arange(plane.times.size))[plane.times > 0].all()


def test_few_cells_of_a_smooth_map_are_computed() -> None:
    plane = painted((1000, 1000), lambda y, x: y > 500 + 300 * np.sin(x / 160))
    plane.refined()
    # Rims 40 apart, of the blocks on 1000 to 2000 cells of boundary half the cells, the audit.
    assert plane.times.mean() < 0.05 + 0.03 + 0.5 * 2000 / SIDE / 625 + 0.01


@pytest.mark.parametrize("rows", [40, 80, 200])
def test_bands_are_refined_as_the_whole(rows: int) -> None:
    dust = np.random.default_rng(5).random((330, 290)) < 0.001
    plane = painted((330, 290), lambda y, x: disc(y, x) ^ dust)
    one, other = plane.refined(), plane.refined(rows)
    for name, values in one.items():
        assert (values == other[name]).all(), name


def test_an_island_inside_a_block_is_missed_and_its_cells_are_found_by_the_audit() -> None:
    plane = painted((400, 400), lambda y, x: (abs(y - 60) < 17) & (abs(x - 60) < 17))
    cells = plane.refined()
    missed = cells["label"] != plane.image
    assert missed.sum() > 1000
    assert (cells["computed"][missed] == FILLED).all()
    assert (cells["computed"] == WRONG).sum() > 10
    assert (plane.image[cells["computed"] == WRONG] == 2).all()


def test_the_interval_of_the_audit_covers_the_error() -> None:
    """The exact interval covers with 95 % or more: 200 planes, 17 or more misses have 2 %."""
    outside = 0
    for seed in range(200):
        dust = np.random.default_rng(seed).random((120, 120)) < 0.002 * (1 + seed % 3)
        plane = painted((120, 120), lambda y, x: dust & (y % SIDE > 0) & (x % SIDE > 0))  # noqa: B023
        cells = plane.refined(seed=seed)
        tally = Tally()
        tally.add(cells)
        found = tally.facts({})
        wrong = (cells["label"] != plane.image).mean()
        outside += not found["label_error_low"] <= wrong <= found["label_error_high"]
        assert found["computed_share"] == (plane.times > 0).mean()
    assert outside <= 16


def test_blocks_with_several_labels_in_each_quarter_are_computed_whole() -> None:
    image = np.ones((330, 290), np.int16)
    image[80:161, 40:201] = np.random.default_rng(0).integers(1, 4, (81, 161))
    plane = Plane(image)
    cells = plane.refined()
    assert (cells["computed"][80:161, 40:201] == COMPUTED).all()
    assert (cells["label"] == image).all()


def test_what_is_fractal_everywhere_is_not_refined() -> None:
    draw = np.random.default_rng(0)
    for image, refine in (
        (draw.integers(1, 3, (400, 400)), False),
        (np.where(np.indices((400, 400))[0] > 150, 1, 2), True),
        (draw.integers(1, 3, (20, 400)), True),  # no block has four quarters
    ):
        plan: Any = Plane(image.astype(np.int16))
        assert tried(plan, image.shape, 0)["refined"] == refine


@pytest.fixture(scope="module")
def maps() -> tuple[xr.Dataset, xr.Dataset]:
    """The full grid and the adaptive map of a smooth plane."""
    model = Pendulum(**SMOOTH)
    return pendmap.basins(model, 700), pendmap.basins(model, 700, adaptive=True)


def test_an_adaptive_map_agrees_with_the_full_grid(maps: tuple[xr.Dataset, xr.Dataset]) -> None:
    full, own = maps
    wrong = own.label != full.label
    assert wrong.mean() <= 1e-3
    assert float(own.label_error_low) <= wrong.mean() <= float(own.label_error_high)
    assert float(own.computed_share) < 0.25
    computed = own.computed != FILLED
    assert not (wrong & computed).any()
    for name, none in (("settle_periods", -1), ("net_turns", np.iinfo(np.int32).min)):
        assert (own[name] == full[name].where(computed, none)).all()
    assert float(own.unreliable) == float(full.unreliable)
    assert own.attractor.equals(full.attractor)


def test_the_mean_settling_time_is_that_of_the_map(maps: tuple[xr.Dataset, xr.Dataset]) -> None:
    full, own = maps
    drawn = own.settle_periods.values[own.computed >= RIGHT]
    error = drawn.std() / np.sqrt(drawn.size)
    assert abs(float(own.mean_settle) - float(full.mean_settle)) < 4 * error
    known = own.settle_periods.values[own.settle_periods >= 0]
    assert abs(known.mean() - float(full.mean_settle)) > 10 * error, "cells at boundaries are slow"


def test_the_summary_says_what_was_computed(maps: tuple[xr.Dataset, xr.Dataset]) -> None:
    said = maps[1].attrs["summary"]
    assert f"{100 * float(maps[1].computed_share):.3g} % of the cells were computed" in said
    assert (
        f"Of {int(maps[1].audited)} of these, drawn at random and computed, 0 had another" in said
    )
    assert "computed" not in maps[0].attrs["summary"]
    assert "computed" not in maps[0]


def test_where_the_boundary_is_fractal_everywhere_all_cells_are_computed() -> None:
    full, own = (pendmap.basins(Pendulum(**FRACTAL), 200, adaptive=on) for on in (False, True))
    assert (own.computed == COMPUTED).all()
    assert "The boundary is fractal everywhere at this resolution, and all" in own.attrs["summary"]
    assert float(own.fractal_blocks) > 0.5
    assert (float(own.label_error), float(own.label_error_high)) == (0, 0)
    for name in full.variables:
        assert (own[name].values == full[name].values).all() or full[name].isnull().any(), name


def test_planes_without_labels_are_computed_whole() -> None:
    own = pendmap.basins(Pendulum(p=2.0), 60, adaptive=True)
    assert own.attrs["plane"] == "only_chaos"
    assert (own.computed == COMPUTED).all()
    assert "All cells were computed: without labels" in own.attrs["summary"]


@pytest.mark.parametrize("label", [0, -1])
def test_starts_without_an_attractor_are_never_filled(label: int) -> None:
    image = np.where(disc(*np.indices((330, 290))), label, 1).astype(np.int16)
    cells = Plane(image).refined()
    assert (cells["computed"][image == label] == COMPUTED).all()
    assert (cells["computed"] == FILLED).mean() > 0.5


def test_files_keep_what_was_computed(maps: tuple[xr.Dataset, xr.Dataset], tmp_path: Path) -> None:
    for name in ("a.nc", "a.zarr"):
        pendmap.save(maps[1], tmp_path / name)
        back = pendmap.load(tmp_path / name)
        xr.testing.assert_identical(
            back.load(), maps[1].assign_attrs(history=back.attrs["history"])
        )
    raw = xr.open_dataset(tmp_path / "a.nc")
    assert np.isnan(raw.net_turns.values[maps[1].computed == FILLED]).all()
    assert raw.computed.attrs["flag_meanings"].split() == list(HOW.values())


def test_the_command_tells_computed_cells_and_errors(pendmap_command: Run) -> None:
    words = ("basins", "--p", "0.6", "--grid", "300", "--json")
    told = json.loads(pendmap_command(*words, "--adaptive").stdout)
    assert told["adaptive"].keys() == {
        "computed",
        "fractal_blocks",
        "audited",
        "audited_wrong",
        "label_error",
    }
    assert 0 < told["adaptive"]["computed"] < 0.5
    assert told["adaptive"]["label_error"]["ci95"][0] == 0
    assert json.loads(pendmap_command(*words).stdout)["adaptive"] is None


def test_adaptive_is_true_or_false() -> None:
    with pytest.raises(InputError, match="adaptive must be True or False, got 'yes'"):
        pendmap.basins(Pendulum(), Grid.square(10), adaptive="yes")  # type: ignore[arg-type]
