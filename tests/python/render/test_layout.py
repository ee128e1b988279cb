"""Figures at several sizes and windows: ticks, titles, texts."""

from __future__ import annotations

import itertools
import math
from typing import Any

import pytest
import xarray as xr
from matplotlib import rc_context
from matplotlib.text import Text

import motions
import pendmap
import synthetic
from pendmap.charts import basins as layers
from pendmap.charts import plane, registry
from pendmap.render import drawing, style

MAPS = {
    "usual": synthetic.painted(),
    "unreliable": synthetic.painted(**synthetic.UNRELIABLE),
    "torque": synthetic.painted(velocity=(-10.0, 10.0), p=0.0, torque=0.5),
    "thin": synthetic.painted(theta=(0.0, 1e-12), velocity=(-1.0, 1.0), **synthetic.UNRELIABLE),
    "far": synthetic.painted(theta=(1e6, 1e6 + 1.0), velocity=(-1.0, 1.0)),
    "huge": synthetic.painted(theta=(1e300, 2e300), velocity=(-1.0, 1.0)),
    "flat": synthetic.painted(theta=(-10.0, 10.0), velocity=(-2.0, 2.0), **synthetic.UNRELIABLE),
    "chaos": motions.chaotic(cells=16, periods=3),
}


def figure_of(dataset: Any, share: float) -> Any:  # noqa: ANN401
    with rc_context(style.RC):
        chart = registry.build(dataset)
        wide, high = drawing.draw(chart).get_size_inches()
        figure = drawing.draw(chart, size=(share * wide, share * high), dpi=100.0)
        figure.canvas.draw()
    return figure


@pytest.mark.parametrize("share", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("name", MAPS)
def test_no_text_is_cut_or_covered(name: str, share: float) -> None:
    figure = figure_of(MAPS[name], share)
    whole = figure.bbox
    panels = [axes.get_window_extent() for axes in figure.axes]
    boxes = []
    beyond = {
        label  # matplotlib does not draw it
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        for label, at in zip(axis.get_ticklabels(), axis.get_ticklocs(), strict=True)
        if not min(axis.get_view_interval()) <= at <= max(axis.get_view_interval())
    }
    for text in figure.findobj(Text):
        if not text.get_visible() or not text.get_text().strip() or text in beyond:
            continue
        box = text.get_window_extent()
        # Within half a pixel, to which texts are placed.
        assert whole.x0 - 0.5 <= box.x0, text.get_text()
        assert box.x1 <= whole.x1 + 0.5, text.get_text()
        assert whole.y0 - 0.5 <= box.y0, text.get_text()
        assert box.y1 <= whole.y1 + 0.5, text.get_text()
        boxes += [(text.get_text(), box)]
        if not any(text in axes.texts for axes in figure.axes):  # a warning
            assert not any(meet(box, panel) for panel in panels), text.get_text()
    for (one, a), (other, b) in itertools.combinations(boxes, 2):
        assert not meet(a, b), (one, other)


def meet(one: Any, other: Any) -> bool:  # noqa: ANN401
    wide = min(one.x1, other.x1) - max(one.x0, other.x0)
    high = min(one.y1, other.y1) - max(one.y0, other.y0)
    return bool(wide > 1 and high > 1)


@pytest.mark.parametrize(
    ("low", "high"),
    [
        (0.0, 1e-12),
        (1e300, 2e300),
        (-1e307, 1e307),
        (1e6, 1e6 + 1),
        (1e17, 1e17 + 64),
        (0.0, 1e-322),
        (-3e5, 3e5),
        (-math.pi, math.pi),
    ],
)
def test_there_is_a_handful_of_ticks_whatever_the_window(low: float, high: float) -> None:
    shift, ticks = plane.short_ticks(low, high, angle=True)
    assert 1 <= len(ticks) <= 8
    assert len({label for _, label in ticks}) == len(ticks)
    assert all(len(label) <= 8 for _, label in ticks)
    slack = 1e-6 * (high - low)
    assert all(low - slack <= shift + at <= high + slack for at, _ in ticks)


def test_indistinguishable_copies_are_left_out() -> None:
    circle = xr.Dataset()
    points = synthetic.USUAL[1].points
    assert len(plane.copies(circle, points, -10 * math.pi, 10 * math.pi)) == 10
    assert len(plane.copies(circle, points, 1e300, 2e300)) == 0


def test_the_title_names_no_settling_without_attractors() -> None:
    result = pendmap.basins(pendmap.Pendulum(), pendmap.Grid.square(8), max_periods=1)
    assert layers.what(result, "turns") == "net turns after 1 period"
    assert result.net_turns.attrs["long_name"] == "net turns after 1 period"
