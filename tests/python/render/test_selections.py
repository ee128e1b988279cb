"""Selections of a result are drawn at their coordinates, with their own shares."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.colors import to_hex

import pendmap
from drawn import made
from pendmap import InputError, Pendulum, render, viewer
from pendmap.charts import bifurcation, legend, palette, parameter_map
from pendmap.charts.registry import ready
from pendmap.charts.trajectory import resting
from recordings import recorded

if TYPE_CHECKING:
    from pathlib import Path

    import numpy.typing as npt
    import xarray as xr

pytestmark = pytest.mark.usefixtures("strict_recordings")

SIDE = 9
MAP = pendmap.basins(Pendulum(p=0.6), pendmap.Grid.square(SIDE))
PLANE = pendmap.parameter_map(
    Pendulum(), {"p": (0.5, 2.0, SIDE), "omega": (1.5, 2.5, SIDE - 2)}, starts=4
)
DIAGRAM = pendmap.bifurcation(Pendulum(), {"p": (0.6, 1.8, 24)}, starts=4)
RUN = pendmap.simulate(Pendulum(p=1.5, omega=0.87, theta_r=0.2), 1.0, 0.0, 120)
PARTS = [
    ([2, 5, 3], [4], False),
    ([8, 6, 4, 2], [0, 1, 2, 6], True),
    (list(range(9)), [5, 3], True),
]
"""Places along both axes: in any order, every second reversed; and whether the part is turned."""


def selected(result: xr.Dataset, *, turned: bool, **places: list[int]) -> xr.Dataset:
    """Return a part of a result, transposed where ``turned``."""
    part = result.isel(dict(places))
    return part.transpose() if turned else part


def ends(low: float, high: float, count: int, kept: list[int]) -> tuple[float, float]:
    """Return the outer edges of the selected cells, of ``count`` between low and high."""
    edge = np.linspace(low, high, count + 1)
    return edge[min(kept)], edge[max(kept) + 1]


def at(image: npt.NDArray[Any], extent: Any, x: float, y: float) -> Any:  # noqa: ANN401
    """Return an image's value at a position, row 0 lowest."""
    rows, columns = image.shape[:2]
    left, right, bottom, top = extent
    row, column = (y - bottom) / (top - bottom) * rows, (x - left) / (right - left) * columns
    return image[int(row), int(column)]


def extent_of(back: Any, entity: str, shape: tuple[int, ...]) -> list[float]:  # noqa: ANN401
    """Return left, right, bottom, top of an image in a recording, in physical units."""
    matrix = np.reshape(back.one(entity, "Transform3D:mat3x3"), (3, 3)).T
    corners = np.array([[0.0, 0.0, 0.0], [shape[1], shape[0], 0.0]]) @ matrix.T
    corners = corners + back.one(entity, "Transform3D:translation")
    return [corners[0, 0], corners[1, 0], corners[0, 1], corners[1, 1]]


@pytest.mark.parametrize(("theta", "velocity", "turned"), PARTS)
def test_a_selection_of_a_basin_map_is_drawn_and_recorded(
    *, theta: list[int], velocity: list[int], turned: bool, tmp_path: Path
) -> None:
    part = selected(MAP, turned=turned, theta=theta, velocity=velocity)
    axes, back = made(part).axes, recorded(part, tmp_path)
    whole = [*ends(-math.pi, math.pi, SIDE, theta), *ends(-3, 3, SIDE, velocity)]
    recorded_labels = back.image("/basin/data/labels", "SegmentationImage", np.uint8)
    extent = extent_of(back, "/basin/data/labels", recorded_labels.shape)
    assert extent == pytest.approx(whole, abs=1e-5)
    labels, settle = (one.images[-1] for one in axes[:2])
    assert labels.get_extent() == settle.get_extent() == pytest.approx(whole)
    assert [*axes[0].get_xlim(), *axes[0].get_ylim()] == pytest.approx(whole)
    shades = dict(zip(part["id"].values.tolist(), legend.colours_of(part), strict=True))
    for x in part["theta"].values:
        for y in part["velocity"].values:
            cell = part.sel(theta=x, velocity=y)
            label, periods = int(cell["label"]), int(cell["settle_periods"])
            own = palette.parts(shades.get(label, palette.UNDECIDED))
            assert tuple(at(np.asarray(labels.get_array()), whole, x, y)) == own
            assert at(recorded_labels, whole, x, y) == label + 1
            shown = at(np.ma.filled(settle.get_array(), np.nan), whole, x, y)
            assert np.isnan(shown) if periods < 0 else shown == max(periods, 1)
    for entry in legend.entries(ready(part)):
        share = np.mean(part["label"].values == entry.id)
        percent = float(entry.text.split(", ")[1].split()[0])
        assert percent == pytest.approx(100 * share, abs=0.51)


@pytest.mark.parametrize(("p", "omega", "turned"), PARTS)
def test_a_selection_of_a_parameter_map_is_drawn_and_recorded(
    *, p: list[int], omega: list[int], turned: bool, tmp_path: Path
) -> None:
    part = selected(PLANE, turned=turned, p=p, omega=omega)
    half = 1.5 / (SIDE - 1) / 2, 1.0 / (SIDE - 3) / 2
    whole = [*ends(0.5 - half[0], 2 + half[0], SIDE, p)]
    whole += ends(1.5 - half[1], 2.5 + half[1], SIDE - 2, omega)
    back = recorded(part, tmp_path)
    listed = {kind.colour: kind for kind in parameter_map.kinds(ready(part))}
    kinds, exponent = (axes.images[0] for axes in made(part).axes[:2])
    assert kinds.get_extent() == exponent.get_extent() == pytest.approx(whole)
    image = back.image("/kinds/data/kinds", "SegmentationImage", np.uint8)
    extent = extent_of(back, "/kinds/data/kinds", image.shape)
    assert extent == pytest.approx(whole, abs=1e-5)
    names = back.names("/kinds/data/kinds")
    sets = parameter_map.sets(PLANE)
    for x in part["p"].values:
        for y in part["omega"].values:
            cell = part.sel(p=x, omega=y)
            own = sets[int(cell["regime"])]
            shade = to_hex(at(np.asarray(kinds.get_array()), whole, x, y) / 255)
            assert set(listed[shade].members) & set(own)
            assert names[int(at(image, whole, x, y))].rpartition(", ")[0] in {
                kind.name for kind in listed.values() if set(kind.members) & set(own)
            }
            value = at(np.ma.filled(exponent.get_array(), np.nan), whole, x, y)
            assert value == pytest.approx(float(cell["exponent"]), nan_ok=True)
    cells = [sets[k] for k in part["regime"].values.ravel()]
    for kind in listed.values():
        has = [not set(kind.members).isdisjoint(one) for one in cells]
        assert kind.presence == pytest.approx(np.mean(has))


@pytest.mark.parametrize("p", [[3, 20, 11], list(range(24))])
def test_a_selection_of_a_bifurcation_diagram_is_drawn_and_recorded(
    p: list[int], tmp_path: Path
) -> None:
    part = DIAGRAM.isel(p=p).transpose()
    values, half = part["p"].values, 1.2 / 23 / 2
    points, strips, exponents = made(part).axes
    assert points.get_xlim() == pytest.approx(ends(0.6 - half, 1.8 + half, 24, p))
    drawn = {tuple(row) for line in points.lines for row in np.asarray(line.get_xydata())}
    whole = zip(DIAGRAM["point_value"].values, DIAGRAM["point_theta"].values, strict=True)
    loose = zip(*(DIAGRAM.get(f"loose_{name}", []) for name in ("value", "theta")), strict=True)
    assert drawn == {pair for pair in (*whole, *loose) if pair[0] in values}
    lines = [np.asarray(line.get_xydata()) for line in exponents.lines[1:]]
    assert {x for line in lines for x in line[:, 0]} <= set(values)
    for x in values:
        for row, sweep in ((0.5, "up"), (-0.5, "down")):
            image = strips.images[0]
            colours = at(np.asarray(image.get_array()), image.get_extent(), x, row)
            assert np.allclose(colours, 255) == (int(DIAGRAM[sweep].sel(p=x)) < 0)
    count = sum(
        len(rows["Points2D:positions"][0])
        for entity, rows in recorded(part, tmp_path).columns.items()
        if entity.startswith("/bifurcation/data/") and entity.endswith("/points")
    )
    assert count == np.isin(DIAGRAM["point_value"].values, values).sum()


def test_sweeps_over_uneven_values_are_drawn_where_these_are() -> None:
    values = np.r_[np.linspace(0.1, 0.3, 5), 0.6, 1.0]
    result = pendmap.bifurcation(Pendulum(), {"p": values}, starts=4)
    strip = pendmap.plot(result, layer="sweeps").images[0]
    families = bifurcation.families(result)
    for k, x in enumerate(values):
        for row, sweep in ((0.5, "up"), (-0.5, "down")):
            colour = next((one.colour for one in families if getattr(one, sweep)[k]), "#ffffff")
            shade = at(np.asarray(strip.get_array()), strip.get_extent(), x, row)
            assert to_hex(np.asarray(shade) / 255) == colour


def test_curves_of_lifetimes_exponents_and_critical_amplitudes() -> None:
    lives = pendmap.lifetime(Pendulum(p=1.2), starts=500)
    part = lives.isel(elapsed=slice(240, 20, -3), tail_begin=slice(None, None, -1)).transpose()
    axes, kept = made(part).axes[0], part["elapsed"].values
    assert axes.get_xlim() == pytest.approx((kept.min(), kept.max()))
    for drawn, whole in zip(axes.lines[:3], made(lives).axes[0].lines[:3], strict=True):
        own = dict(np.asarray(whole.get_xydata()).tolist())
        for x, y in np.asarray(drawn.get_xydata()):
            assert y == pytest.approx(own[x], nan_ok=True)
    rate = pendmap.lyapunov(Pendulum(p=0.6), max_periods=300).isel(elapsed=slice(None, 3, -3))
    axes = made(rate).axes[0]
    assert axes.get_xlim()[0] == float(rate["elapsed"].min())
    assert len(axes.lines[1].get_xydata()) == rate.sizes["elapsed"]
    critical = pendmap.tongues(Pendulum(), np.linspace(0.6, 2.4, 10), 2.0)
    part = critical.isel(omega=slice(None, 3, -1))
    pairs = zip(critical["critical_omega"].values, critical["p"].values, strict=True)
    shown = {pair for line in made(part).axes[0].lines for pair in map(tuple, line.get_xydata())}
    assert {pair for pair in pairs if pair[0] in part["omega"].values} <= shown
    low, high = made(critical.isel(omega=slice(9, 10))).axes[0].get_xlim()
    assert low < float(critical["omega"][9]) < high


@pytest.mark.parametrize(("first", "count", "step"), [(0, 900, 1), (300, 500, -3)])
def test_a_part_of_a_trajectory_is_drawn(first: int, count: int, step: int) -> None:
    part = RUN.isel(time=slice(first, first + count)).isel(time=slice(None, None, step))
    low, high = float(part["time"].min()), float(part["time"].max())
    figure = made(part)
    for axes in figure.axes[:2]:
        assert axes.get_xlim() == pytest.approx((low, high))
    inside = (low <= RUN["section_time"]) & (RUN["section_time"] <= high)
    assert sum(len(line.get_xydata()) for line in figure.axes[3].lines) == int(inside.sum())
    # Rest means no motion at all: friction holds the pendulum from one event to the next.
    held, times = resting(ready(part)), RUN["time"].values
    middle = 0.5 * (times[:-1] + times[1:])
    still = np.diff(RUN["theta"].values) == 0.0
    within = np.any([(begin < middle) & (middle < end) for begin, end in held], axis=0)
    seen = (low < middle) & (middle < high)
    # In the samples in which a stick begins or ends the pendulum also moves.
    assert np.count_nonzero((within != still)[seen]) <= 2 * max(len(held), 1)


@pytest.mark.parametrize(
    ("part", "says"),
    [
        (MAP.isel(theta=3), "theta must be a range here, got a single value"),
        (MAP.sel(theta=slice(7, 8)), "theta must have one value at least in a selection, got none"),
        (DIAGRAM.isel(entry=slice(1, None)), "entry: a selection of it cannot be drawn"),
        (DIAGRAM.isel(kind=slice(1)), "kind: a selection of it cannot be drawn"),
        (PLANE.isel(set=slice(1, None)), "set: a selection of it cannot be drawn"),
        (PLANE.isel(set=0), "set: a selection of it cannot be drawn"),
        (MAP.isel(attractor=[0]), "attractor: a selection of it cannot be drawn"),
        (MAP.isel(attractor=0), "attractor: a selection of it cannot be drawn"),
        (MAP.where(MAP["theta"] > 0, drop=True), "attractor: a selection of it cannot be drawn"),
        (MAP[["label"]], "attractor: a selection of it cannot be drawn"),
    ],
)
def test_a_selection_that_cannot_be_drawn_is_refused_in_one_line(
    part: xr.Dataset, says: str, tmp_path: Path
) -> None:
    for write, name in ((render.draw, "a.png"), (viewer.record, "a.rrd")):
        with pytest.raises(InputError, match=says):
            write(part, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_selection_states_that_its_summary_is_of_the_whole(tmp_path: Path) -> None:
    part = MAP.isel(theta=slice(0, 4))
    text = recorded(part, tmp_path).one("/summary", "TextDocument:text")
    part_of = "A part is shown: theta = -3.14159 to -0.349066, velocity = -3 to 3, 36 cells of 81"
    assert part_of in text
    assert "81 starts" in text
    pendmap.save(part, tmp_path / "part.nc")
    again = pendmap.load(tmp_path / "part.nc")
    assert made(again).axes[0].get_xlim() == pytest.approx((-math.pi, -math.pi / 9))
