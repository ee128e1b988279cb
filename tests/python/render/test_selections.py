"""Selections of a result are drawn at their coordinates, with their own shares."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from matplotlib.colors import to_hex, to_rgb

import pendmap
from drawn import made
from pendmap import InputError, Pendulum, render, viewer
from pendmap.charts import bifurcation, legend, palette, parameter_map
from pendmap.charts.selection import shown
from pendmap.charts.trajectory import resting
from recordings import recorded

if TYPE_CHECKING:
    from pathlib import Path

    import numpy.typing as npt
    import xarray as xr
    from matplotlib.lines import Line2D

FEW = (Phase.explicit, Phase.generate)
"""Settings for few examples without shrinking: a figure takes half a second."""

SIDE = 9
MAP = pendmap.basins(Pendulum(p=0.6), pendmap.Grid.square(SIDE))
PLANE = pendmap.parameter_map(
    Pendulum(), {"p": (0.5, 2.0, SIDE), "omega": (1.5, 2.5, SIDE - 2)}, starts=4
)
DIAGRAM = pendmap.bifurcation(Pendulum(), {"p": (0.6, 1.8, 24)}, starts=4)

parts = st.one_of(
    st.tuples(st.integers(0, 3), st.integers(4, SIDE), st.integers(1, 3), st.booleans()).map(
        lambda s: list(range(*s[:3]))[:: -1 if s[3] else 1]
    ),
    st.lists(st.integers(0, 6), min_size=1, max_size=5, unique=True),
)
"""Selections along an axis: a slice, every k-th, reversed, or any."""


def selected(result: xr.Dataset, *, turned: bool, **places: list[int]) -> xr.Dataset:
    """Return a part of a result, transposed where ``turned``."""
    part = result.isel(dict(places))
    return part.transpose() if turned else part


def ends(low: float, high: float, count: int, kept: list[int]) -> tuple[float, float]:
    """Return the outer edges of the selected cells, of ``count`` between low and high."""
    edge = np.linspace(low, high, count + 1)
    return edge[min(kept)], edge[max(kept) + 1]


def at(image: npt.NDArray[Any], extent: list[float], x: float, y: float) -> Any:  # noqa: ANN401
    """Return an image's value at a position, row 0 lowest."""
    rows, columns = image.shape[:2]
    left, right, bottom, top = extent
    return image[
        int((y - bottom) / (top - bottom) * rows), int((x - left) / (right - left) * columns)
    ]


def colour(part: xr.Dataset, theta: float, velocity: float) -> tuple[int, int, int]:
    """Return the colour of the attractor that a start of a basin map ends on."""
    label = int(part["label"].sel(theta=theta, velocity=velocity))
    shades = dict(zip(part["id"].values, legend.colours_of(part), strict=True))
    return palette.parts(shades.get(label, palette.UNDECIDED))


@settings(max_examples=5, phases=FEW)
@given(theta=parts, velocity=parts, turned=st.booleans())
def test_a_selection_of_a_basin_map_is_drawn(
    *, theta: list[int], velocity: list[int], turned: bool
) -> None:
    part = selected(MAP, turned=turned, theta=theta, velocity=velocity)
    figure = made(part)
    wide, high = ends(-math.pi, math.pi, SIDE, theta), ends(-3, 3, SIDE, velocity)
    for axes in figure.axes[:2]:
        assert (*axes.get_xlim(), *axes.get_ylim()) == pytest.approx((*wide, *high))
        assert axes.images[0].get_extent() == pytest.approx([*wide, *high])
    labels, settle = (axes.images[-1] for axes in figure.axes[:2])
    settles = int(part["settle_periods"].max()) >= 0
    for x in part["theta"].values:
        for y in part["velocity"].values:
            own = colour(part, x, y)
            assert tuple(at(np.asarray(labels.get_array()), labels.get_extent(), x, y)) == own
            periods = int(part["settle_periods"].sel(theta=x, velocity=y))
            if not settles:
                continue
            drawn = at(np.ma.filled(settle.get_array(), np.nan), settle.get_extent(), x, y)
            assert np.isnan(drawn) if periods < 0 else drawn == max(periods, 1)
    for entry in legend.entries(shown(part)):
        if entry.id < 1:
            continue
        place = list(MAP["attractor"].values).index(entry.name) + 1
        share = np.mean(part["label"].values == place)
        assert float(entry.share.split()[0]) == pytest.approx(100 * share, abs=0.51)


@settings(max_examples=5, phases=FEW)
@given(theta=parts, velocity=parts, turned=st.booleans())
@pytest.mark.usefixtures("strict_recordings")
def test_the_recording_of_a_basin_map(
    *, theta: list[int], velocity: list[int], turned: bool, tmp_path: Path
) -> None:
    part = selected(MAP, turned=turned, theta=theta, velocity=velocity)
    back = recorded(part, tmp_path)
    labels = back.image("/basin/data/labels", "SegmentationImage", np.uint8)
    extent = _extent(back, "/basin/data/labels", labels.shape)
    wide, high = ends(-math.pi, math.pi, SIDE, theta), ends(-3, 3, SIDE, velocity)
    assert extent == pytest.approx([*wide, *high], abs=1e-5)
    for x in part["theta"].values:
        for y in part["velocity"].values:
            label = int(part["label"].sel(theta=x, velocity=y))
            assert at(labels, extent, x, y) == label + 1


def _extent(back: Any, entity: str, shape: tuple[int, ...]) -> list[float]:  # noqa: ANN401
    """Return left, right, bottom, top of an image in a recording, in physical units."""
    matrix = np.reshape(back.one(entity, "Transform3D:mat3x3"), (3, 3)).T
    corners = np.array([[0.0, 0.0, 0.0], [shape[1], shape[0], 0.0]]) @ matrix.T
    corners = corners + back.one(entity, "Transform3D:translation")
    return [corners[0, 0], corners[1, 0], corners[0, 1], corners[1, 1]]


@settings(max_examples=3, phases=FEW)
@given(
    p=parts,
    omega=st.lists(st.integers(0, 6), min_size=1, max_size=7, unique=True),
    turned=st.booleans(),
)
@pytest.mark.usefixtures("strict_recordings")
def test_a_selection_of_a_parameter_map_is_drawn(
    *, p: list[int], omega: list[int], turned: bool, tmp_path: Path
) -> None:
    part = selected(PLANE, turned=turned, p=p, omega=omega)
    half = 1.5 / (SIDE - 1) / 2, 1.0 / (SIDE - 3) / 2
    wide = ends(0.5 - half[0], 2 + half[0], SIDE, p)
    high = ends(1.5 - half[1], 2.5 + half[1], SIDE - 2, omega)
    figure = made(part)
    for axes in figure.axes[:2]:
        assert (*axes.get_xlim(), *axes.get_ylim()) == pytest.approx((*wide, *high))
    kinds, exponent = (axes.images[0] for axes in figure.axes[:2])
    listed = {kind.colour: kind for kind in parameter_map.kinds(shown(part))}
    back = recorded(part, tmp_path)
    image = back.image("/kinds/data/kinds", "SegmentationImage", np.uint8)
    extent = _extent(back, "/kinds/data/kinds", image.shape)
    assert extent == pytest.approx([*wide, *high], abs=1e-5)
    names = back.names("/kinds/data/kinds")
    for x in part["p"].values:
        for y in part["omega"].values:
            cell = part.sel(p=x, omega=y)
            own = parameter_map.sets(PLANE)[int(cell["regime"])]
            drawn = at(np.asarray(kinds.get_array()), kinds.get_extent(), x, y)
            (kind,) = (k for c, k in listed.items() if np.allclose(to_rgb(c), drawn / 255))
            assert any(member in own for member in kind.members)
            assert names[int(at(image, extent, x, y))].rpartition(", ")[0] in {
                k.name for k in listed.values() if any(m in own for m in k.members)
            }
            value = at(np.ma.filled(exponent.get_array(), np.nan), exponent.get_extent(), x, y)
            assert value == pytest.approx(float(cell["exponent"]), nan_ok=True)
    cells = [parameter_map.sets(PLANE)[k] for k in part["regime"].values.ravel()]
    for kind in listed.values():
        has = [any(member in one for member in kind.members) for one in cells]
        assert kind.presence == pytest.approx(np.mean(has))


@settings(max_examples=4, phases=FEW)
@given(p=st.lists(st.integers(0, 23), min_size=1, max_size=24, unique=True), turned=st.booleans())
@pytest.mark.usefixtures("strict_recordings")
def test_a_selection_of_a_bifurcation_diagram_is_drawn(
    *, p: list[int], turned: bool, tmp_path: Path
) -> None:
    part = selected(DIAGRAM, turned=turned, p=p)
    values = part["p"].values
    half = 1.2 / 23 / 2
    figure = made(part)
    wide = ends(0.6 - half, 1.8 + half, 24, p)
    assert figure.axes[0].get_xlim() == pytest.approx(wide)
    lines = [np.asarray(line.get_xydata()) for line in figure.axes[0].lines]
    top = figure.axes[0].get_ylim()[1]  # recordings clip above it
    drawn = {tuple(row) for line in lines for row in line if len(row) and row[1] <= top}
    whole = zip(DIAGRAM["point_value"].values, DIAGRAM["point_theta"].values, strict=True)
    loose = zip(*(DIAGRAM.get(f"loose_{name}", []) for name in ("value", "theta")), strict=True)
    assert drawn == {pair for pair in (*whole, *loose) if pair[0] in values}
    exponents = [np.asarray(line.get_xydata()) for line in figure.axes[2].lines[1:]]
    assert {x for line in exponents for x in line[:, 0]} <= set(values)
    strip = figure.axes[1].images[0]
    for x in values:
        for row, sweep in ((0.5, "up"), (-0.5, "down")):
            number = int(DIAGRAM[sweep].sel(p=x))
            colours = at(np.asarray(strip.get_array()), strip.get_extent(), x, row)
            assert np.allclose(colours, 1.0) == (number < 0)
    back = recorded(part, tmp_path)
    points = [
        np.array(rows["Points2D:positions"][0])
        for entity, rows in back.columns.items()
        if entity.startswith("/bifurcation/data/") and entity.endswith("/points")
    ]
    assert sum(map(len, points)) == np.isin(DIAGRAM["point_value"].values, values).sum()
    assert ("A part is shown" in back.one("/summary", "TextDocument:text")) == (len(p) < 24)


def test_sweeps_over_uneven_values_are_drawn_where_these_are() -> None:
    values = np.r_[np.linspace(0.1, 0.3, 9), 0.6, 1.0]
    found = pendmap.bifurcation(Pendulum(), {"p": values})
    strip = pendmap.plot(found, layer="sweeps").images[0]
    families = bifurcation.families(found)
    for k, x in enumerate(values):
        for row, sweep in ((0.5, "up"), (-0.5, "down")):
            colour = next((one.colour for one in families if getattr(one, sweep)[k]), "#ffffff")
            shade = at(np.asarray(strip.get_array()), strip.get_extent(), x, row)
            assert to_hex(np.asarray(shade) / 255) == colour


def test_curves_of_lifetimes_and_exponents(tmp_path: Path) -> None:
    lives = pendmap.lifetime(Pendulum(p=1.2), starts=2000)
    rate = pendmap.lyapunov(Pendulum(p=0.6), max_periods=600)
    drawn_lives, drawn_rate = made(lives), made(rate)
    for every in (1, 3):
        cut = {"elapsed": slice(240, 20, -every), "tail_begin": slice(None, None, -1)}
        part = lives.isel(cut).transpose()
        figure = made(part)
        for k in range(3):
            assert_on(figure.axes[0].lines[k], drawn_lives.axes[0].lines[k])
        kept = part["elapsed"].values
        assert figure.axes[0].get_xlim() == pytest.approx((kept.min(), kept.max()))
        viewer.record(part, tmp_path / "a.rrd")
        part = rate.isel(elapsed=slice(None, 3, -every))
        figure = made(part)
        assert figure.axes[0].get_xlim()[0] == float(part["elapsed"].min())
        assert len(figure.axes[0].lines[1].get_xydata()) == part.sizes["elapsed"]
        for k in (0, 1):
            assert_on(figure.axes[k].lines[1], drawn_rate.axes[k].lines[1])
        viewer.record(part, tmp_path / "a.rrd")


def assert_on(part: Line2D, whole: Line2D) -> None:
    """Assert that every point of a curve lies on the other."""
    own = dict(np.asarray(whole.get_xydata()).tolist())
    shown = np.asarray(part.get_xydata())
    for x, y in shown:
        assert y == pytest.approx(own[x], nan_ok=True)


def test_critical_curves_of_some_frequencies() -> None:
    found = pendmap.tongues(Pendulum(), np.linspace(0.6, 2.4, 10), 2.0)
    part = found.isel(omega=slice(None, 3, -1))
    places = zip(found["critical_omega"].values, found["p"].values, strict=True)
    kept = shown(part)
    own = kept["omega"].values[kept["index"].values]
    assert list(zip(own, kept["p"].values, strict=True)) == [
        pair for pair in places if pair[0] in part["omega"].values
    ]
    made(part)


def test_a_selection_that_cannot_be_drawn_is_refused_in_one_line(tmp_path: Path) -> None:
    for part, says in (
        (MAP.isel(theta=3), "theta must be a range here, got a single value"),
        (MAP.sel(theta=slice(7, 8)), "theta must have one value at least in a selection, got none"),
        (DIAGRAM.isel(entry=slice(1, None)), "entry: a selection of it cannot be drawn"),
        (DIAGRAM.isel(kind=slice(1, None)), "kind: a selection of kinds cannot be drawn"),
        (PLANE.isel(kind=slice(1, None)), "kind: a selection of kinds cannot be drawn"),
        (PLANE.isel(set=slice(1, None)), "set: a selection of it cannot be drawn"),
        (PLANE.isel(set=0), "regime_has must be over set, kind here, .*, but is over kind"),
        (MAP.isel(attractor=[0]), "attractor: a selection of it cannot be drawn"),
        (MAP.isel(attractor=[2], theta=slice(0, 4)), "attractor: a selection of it cannot be"),
        (MAP.isel(attractor=0), "fraction must be over attractor here, .*, but is over nothing"),
        (
            MAP.where(MAP["theta"] > 0, drop=True),
            "fraction must be over attractor here, .*, but is over attractor, theta",
        ),
        (MAP[["label"]], "fraction must be over attractor here, .*, but is missing"),
    ):
        for write, name in ((render.draw, "a.png"), (viewer.record, "a.rrd")):
            with pytest.raises(InputError, match=says):
                write(part, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_selection_states_that_its_summary_is_of_the_whole(tmp_path: Path) -> None:
    part = MAP.isel(theta=slice(0, 4))
    assert part.attrs["summary"].startswith(
        "theta = -3.14159 to 3.14159 rad, velocity = -3 to 3: 81 starts."
    )
    told = recorded(part, tmp_path).one("/summary", "TextDocument:text")
    assert "A part is shown: theta = -3.14159 to -0.349066, velocity = -3 to 3, 36 cells of 81" in (
        told
    )
    pendmap.save(part, tmp_path / "part.nc")
    again = pendmap.load(tmp_path / "part.nc")
    assert made(again).axes[0].get_xlim() == pytest.approx((-math.pi, -math.pi / 9))


RUN = pendmap.simulate(Pendulum(p=1.5, omega=0.87, theta_r=0.2), 1.0, 0.0, 120)
TIMES = RUN["time"].values


@settings(max_examples=6, phases=FEW)
@given(
    first=st.integers(0, TIMES.size // 2),
    count=st.integers(4, TIMES.size // 2),
    step=st.integers(-3, 3).filter(bool),
)
def test_a_part_of_a_trajectory_is_drawn(first: int, count: int, step: int) -> None:
    part = RUN.isel(time=slice(first, first + count)).isel(time=slice(None, None, step))
    low, high = float(part["time"].min()), float(part["time"].max())
    figure = made(part)
    for axes in figure.axes[:2]:
        assert axes.get_xlim() == pytest.approx((low, high))
    points = [line.get_xydata() for line in figure.axes[3].lines]
    inside = (low <= RUN["section_time"]) & (RUN["section_time"] <= high)
    assert sum(map(len, points)) == int(inside.sum())
    # Rest means no motion at all: friction holds the pendulum from one event to the next.
    held = resting(shown(part))
    middle = 0.5 * (TIMES[:-1] + TIMES[1:])
    still = np.diff(RUN["theta"].values) == 0.0
    within = np.any([(begin < middle) & (middle < end) for begin, end in held], axis=0)
    seen = (low < middle) & (middle < high)
    # In the samples in which a stick begins or ends the pendulum also moves.
    assert np.count_nonzero((within != still)[seen]) <= 2 * max(len(held), 1)


@pytest.mark.usefixtures("strict_recordings")
def test_inverted_rest_is_stable_at_the_selected_frequencies(tmp_path: Path) -> None:
    found = pendmap.tongues(Pendulum(), np.linspace(4.0, 9.0, 11), 20.0)
    part = shown(found.isel(omega=slice(None, 3, -2)))
    own = part["omega"].values[part["inverted_index"].values]
    assert own.size
    assert list(zip(own, part["inverted_p"].values, strict=True)) == [
        (omega, p)
        for omega, p in zip(found["inverted_omega"].values, found["inverted_p"].values, strict=True)
        if omega in part["omega"].values
    ]
    alone = found.isel(omega=slice(10, 11))
    low, high = made(alone).axes[0].get_xlim()
    assert low < 9.0 < high
    viewer.record(alone, tmp_path / "a.rrd")
