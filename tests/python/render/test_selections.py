"""Selections of a result are drawn at their coordinates, with their own shares."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from drawn import made
from pendmap import InputError, Pendulum, render, viewer
from pendmap.charts import legend, palette, parameter_map
from pendmap.charts.registry import ready
from pendmap.charts.trajectory import resting
from recordings import recorded

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr

SIDE = 9
MAP = pendmap.basins(Pendulum(p=0.6), pendmap.Grid.square(SIDE))
PLANE = pendmap.parameter_map(
    Pendulum(), {"p": (0.5, 2.0, SIDE), "omega": (1.5, 2.5, SIDE - 2)}, starts=4
)
DIAGRAM = pendmap.bifurcation(Pendulum(), {"p": (0.6, 1.8, 24)}, starts=4)
LIVES = pendmap.lifetime(Pendulum(p=1.2), starts=500)
RUN = pendmap.simulate(Pendulum(p=1.5, omega=0.87, theta_r=0.2), 1.0, 0.0, 120)
SELECTIONS: dict[str, tuple[xr.Dataset, dict[str, list[int]], tuple[float, float]]] = {
    "basins": (MAP, {"theta": [8, 6, 4, 2], "velocity": [0, 6, 1]}, (-5 * math.pi / 9, math.pi)),
    "map": (PLANE, {"p": [8, 6, 3], "omega": [0, 5, 3]}, (0.96875, 2.09375)),
    "diagram": (DIAGRAM, {"p": [3, 20, 11]}, (0.6 + 2.5 * 1.2 / 23, 0.6 + 20.5 * 1.2 / 23)),
    "lifetime": (LIVES, {"elapsed": [*range(240, 20, -3)]}, (21, 240)),
    "trajectory": (RUN, {"time": [*range(800, 300, -4)]}, tuple(RUN.time.values[[304, 800]])),
}
"""Results, places in any order along their axes, and the limits of what is drawn of them."""


@pytest.mark.parametrize("name", SELECTIONS)
def test_neither_order_nor_orientation_of_a_selection_matter(name: str) -> None:
    result, places, ends = SELECTIONS[name]
    ordered = result.isel({dim: sorted(at) for dim, at in places.items()})
    figures: list[Any] = [made(part) for part in (ordered, result.isel(places).transpose())]
    pictures = [np.asarray(figure.canvas.buffer_rgba()) for figure in figures]
    assert np.array_equal(*pictures)
    assert figures[0].axes[0].get_xlim() == pytest.approx(ends)


def at(image: Any, x: float, y: float) -> Any:  # noqa: ANN401
    """Return the value of an image of matplotlib at a position."""
    values = np.ma.filled(image.get_array(), np.nan)
    rows, columns = values.shape[:2]
    left, right, bottom, top = image.get_extent()
    row, column = (y - bottom) / (top - bottom) * rows, (x - left) / (right - left) * columns
    return values[int(row), int(column)]


def test_a_selection_of_a_map_has_its_own_cells_and_shares() -> None:
    part = MAP.isel(theta=[8, 6, 4, 2], velocity=[0, 1, 2, 6]).transpose()
    labels, settle = (axes.images[-1] for axes in made(part).axes[:2])
    shades = dict(zip(part["id"].values.tolist(), legend.colours_of(part), strict=True))
    for x in part["theta"].values:
        for y in part["velocity"].values:
            cell = part.sel(theta=x, velocity=y)
            label, periods = int(cell["label"]), int(cell["settle_periods"])
            mine = palette.parts(shades.get(label, palette.UNDECIDED))
            assert tuple(at(labels, x, y)) == mine
            shown = at(settle, x, y)
            assert np.isnan(shown) if periods < 0 else shown == max(periods, 1)
    for entry in legend.entries(ready(part)):
        percent = float(entry.text.split(", ")[1].split()[0])
        share = np.mean(part["label"].values == entry.id)
        assert percent == pytest.approx(100 * share, abs=0.51)
    plane = PLANE.isel(p=[2, 5, 3], omega=[4])
    sets = parameter_map.sets(PLANE)
    cells = [set(sets[k]) for k in plane["regime"].values.ravel()]
    for kind in parameter_map.kinds(ready(plane)):
        has = [not cell.isdisjoint(kind.members) for cell in cells]
        assert kind.presence == pytest.approx(np.mean(has))
    exponent = made(plane).axes[1].images[0]
    for cell in plane.stack(cell=("p", "omega")).transpose("cell", ...).exponent:
        value = at(exponent, float(cell.p), float(cell.omega))
        assert value == pytest.approx(float(cell), nan_ok=True)


def test_a_selection_of_a_diagram_has_the_points_at_its_values() -> None:
    part = DIAGRAM.isel(p=[3, 20, 11])
    points = made(part).axes[0]
    drawn = {tuple(row) for line in points.lines for row in np.asarray(line.get_xydata())}
    whole = zip(DIAGRAM["point_value"].values, DIAGRAM["point_theta"].values, strict=True)
    loose = zip(*(DIAGRAM.get(f"loose_{name}", []) for name in ("value", "theta")), strict=True)
    assert drawn == {pair for pair in (*whole, *loose) if pair[0] in part["p"].values}


def test_rest_is_shaded_where_nothing_moves() -> None:
    """Friction holds the pendulum from one event to the next."""
    part = RUN.isel(time=slice(300, 800))
    low, high = float(part["time"].min()), float(part["time"].max())
    spans, times = resting(ready(part)), RUN["time"].values
    middle = 0.5 * (times[:-1] + times[1:])
    still = np.diff(RUN["theta"].values) == 0.0
    within = np.any([(begin < middle) & (middle < end) for begin, end in spans], axis=0)
    seen = (low < middle) & (middle < high)
    # In the samples in which a stick begins or ends the pendulum also moves.
    assert np.count_nonzero((within != still)[seen]) <= 2 * max(len(spans), 1)


@pytest.mark.parametrize(
    ("part", "says"),
    [
        (MAP.isel(theta=0, drop=True), "a list of starts is no map"),
        (MAP.assign_attrs(kind="other"), "kind 'other'; kinds .*: .*basins, .*trajectory"),
        (MAP.isel(theta=3), "theta must be a range here, got a single value"),
        (MAP.sel(theta=slice(7, 8)), "theta must have one value at least in a selection, got none"),
        (DIAGRAM.isel(entry=slice(1, None)), "entry: a selection of it cannot be drawn"),
        (DIAGRAM.isel(kind=slice(1)), "kind: a selection of it cannot be drawn"),
        (PLANE.isel(set=slice(1, None)), "set: a selection of it cannot be drawn"),
        (MAP.isel(attractor=[0]), "attractor: a selection of it cannot be drawn"),
        (MAP.where(MAP["theta"] > 0, drop=True), "attractor: a selection of it cannot be drawn"),
    ],
)
def test_a_selection_that_cannot_be_drawn_is_refused_in_one_line(
    part: xr.Dataset, says: str, tmp_path: Path
) -> None:
    for write, name in ((render.draw, "a.png"), (viewer.record, "a.rrd")):
        with pytest.raises(InputError, match=says):
            write(part, tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("strict_recordings")
def test_a_selection_states_that_its_summary_is_of_the_whole(tmp_path: Path) -> None:
    part = MAP.isel(theta=slice(0, 4))
    text = recorded(part, tmp_path).one("/summary", "TextDocument:text")
    part_of = "A part is shown: theta = -3.14159 to -0.349066, velocity = -3 to 3, 36 cells of 81"
    assert part_of in text
    assert "81 starts" in text
    pendmap.save(part, tmp_path / "part.nc")
    again = pendmap.load(tmp_path / "part.nc")
    assert made(again).axes[0].get_xlim() == pytest.approx((-math.pi, -math.pi / 9))
