"""Charts: one builder per result, and both renderers draw any chart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import xarray as xr

from drawn import assert_room, made, named, written
from pendmap import InputError, render
from pendmap.charts import chart as charts
from pendmap.charts import marks, plane, registry
from pendmap.viewer.marks import Place, scaled, unscaled
from recordings import recorded

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.usefixtures("strict_recordings")

X = np.linspace(1.0, 100.0, 50)
CELLS = marks.Colours("height", "viridis", 0.0, 1.0)


def example(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 0) -> charts.Chart:
    """Return every kind of mark, over linear and logarithmic axes."""
    y = dataset["p"].values
    size = min(cells, 4)
    across, up = charts.Axis("x (s)", (1.0, 100.0), "log"), charts.Axis("y (rad)", (-2.0, 2.0))
    curves = (
        marks.Line(X, y, name="a line", path="line", colour="#d55e00"),
        marks.Points(X[::9], y[::9], name="points", path="points", colour="#0072b2"),
        marks.Band(X, y - 0.1, y + 0.1, name="a band", path="band", alpha=0.3),
        marks.Level(0.5, path="level", dash=marks.DASHED),
        marks.Span((2.0, 3.0), colour="#eeeeee", name="a span"),
        marks.Areas([np.array([(1, -1), (2, -1), (2, 0)])], colour="#cccccc", name="an area"),
        marks.Text(50.0, 0.9, "words"),
    )
    bins = marks.Steps(np.array([1.0, 10.0, 100.0]), np.array([0.5, 1.0]), path="bins")
    classes = marks.Image(
        np.eye(size, dtype=np.uint8), (1, 5), (0, 1), path="cells",
        classes=[("no", "#ffffff"), ("yes", "#000000")],
    )  # fmt: skip
    heights = marks.Image(np.eye(size), (1, 5), (0, 1), colours=CELLS, path="heights")
    plain = charts.Axis("a"), charts.Axis("b", (0.0, 1.0))
    return charts.Chart(
        "An example",
        "of every mark",
        [
            [
                charts.Panel("curves", "curves", across, up, curves),
                charts.Panel("bins", "bins", charts.Axis("x"), charts.Axis("n", (0, 2)), [bins]),
            ],
            [
                charts.Panel("classes", "classes", *plain, [classes]),
                charts.Panel("heights", "heights", *plain, [heights]),
            ],
        ],
    ).only(layer)


@pytest.fixture
def dataset(monkeypatch: pytest.MonkeyPatch) -> xr.Dataset:
    monkeypatch.setitem(registry.BUILDERS, "example", example)
    return xr.Dataset({"p": ("x", np.sin(X))}, attrs={"kind": "example", "summary": "An example."})


def test_a_builder_is_enough_for_a_figure(dataset: xr.Dataset, tmp_path: Path) -> None:
    figure = made(dataset)
    assert_room(figure)
    assert named(figure) == ["a line", "points", "a band", "a span", "an area", "no", "yes"]
    for text in ("An example", "of every mark", "words", "height", "x (s)", "(a) curves"):
        assert text in written(figure)
    for suffix in render.SUFFIXES:
        assert render.draw(dataset, tmp_path / f"a{suffix}").stat().st_size > 5000
    with pytest.raises(InputError, match=r"no layer 'other'.*curves, bins, classes, heights"):
        render.draw(dataset, tmp_path / "b.png", layer="other")


def test_a_builder_is_enough_for_a_recording(dataset: xr.Dataset, tmp_path: Path) -> None:
    back = recorded(dataset, tmp_path)
    drawn = {f"/curves/data/{name}" for name in ("line", "points", "band", "level")}
    images = {"/classes/data/cells", "/heights/data/heights"}
    assert drawn | images | {"/bins/data/bins", "/legend", "/summary"} <= set(back.columns)
    # Views have no logarithmic axes: they show powers of ten.
    at = np.array(back.one("/curves/data/points", "Points2D:positions"))
    assert np.allclose(at, np.stack([np.log10(X[::9]), np.sin(X)[::9]], axis=1), atol=1e-6)
    cells = back.image("/classes/data/cells", "SegmentationImage", np.uint8)
    assert (cells == np.eye(4)).all()
    assert "- a line: vermillion" in back.one("/legend", "TextDocument:text")
    assert back.views["/curves"] == "Curves"
    assert {f"/curves/data/{k}" for k in ("4_a_span", "5_an_area", "6")} <= set(back.columns)
    assert back.one("/curves/data/line", "LineStrips2D:labels") == "a line"
    assert back.one("/curves/data/line", "LineStrips2D:colors") == 0xD55E00FF
    assert back.one("/curves/data/6", "Points2D:labels") == "words"
    names = back.names("/heights/data/heights")
    heights = back.image("/heights/data/heights", "SegmentationImage", np.uint8)
    assert [names[number] for number in heights[0, :2]] == ["1", "0"]


def test_axes_that_are_logarithmic_on_both_sides_of_0_have_ticks() -> None:
    axis = charts.Axis("error\nlog beyond $10^{-2}$", (-1.0, 10.0), "signed", straight=0.01)
    panel = charts.Panel("errors", "", axis, charts.Axis("y", (0.0, 1.0)), ())
    assert Place.of(panel, 1.0).x == pytest.approx((-3.0, 4.0))
    at = scaled(axis, [-1.0, -0.01, -0.005, 0.0, 0.1])
    assert at == pytest.approx([-3.0, -1.0, -0.5, 0.0, 2.0])
    assert unscaled(axis, at) == pytest.approx([-1.0, -0.01, -0.005, 0.0, 0.1])
    name, ticks = plane.ticks(axis, -1.0, 10.0)
    assert name == axis.name
    assert [text for _, text in ticks].count("0") == 1
