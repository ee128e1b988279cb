"""Figures drawn without a file, their texts, and the room for these."""

from __future__ import annotations

import itertools
import re
from typing import TYPE_CHECKING, Any

from matplotlib import pyplot as plt
from matplotlib import rc_context
from matplotlib.legend import Legend
from matplotlib.text import Text

import pendmap
from pendmap import render
from pendmap.charts import registry
from pendmap.render import style

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox


def made(dataset: xr.Dataset, layer: str | None = None) -> Figure:
    figure = render.figure_of(dataset, layer=layer, dpi=100.0)
    with rc_context(style.RC):
        figure.canvas.draw()
    return figure


def plain(text: str) -> str:
    """Return a text of a figure without mathtext."""
    for symbol, math in style.SYMBOLS.items():
        text = text.replace(math, symbol)
    return text


def titles(figure: Figure) -> list[str]:
    every = (axes.get_title(loc="left") for axes in figure.axes)
    return [re.sub(r"\s+", " ", text).removeprefix(f"({text[1:2]}) ") for text in every if text]


def named(figure: Figure) -> list[str]:
    """Return the texts of the legends, each on one line."""
    boxes = [box for box in figure.findobj(Legend) if isinstance(box, Legend)]
    return [plain(text.get_text()).replace("\n", " ") for box in boxes for text in box.get_texts()]


def written(figure: Figure) -> str:
    texts = (text.get_text() for text in figure.findobj(Text) if isinstance(text, Text))
    return plain(" ".join(" ".join(texts).split()))


def overlap(one: Bbox, other: Bbox) -> bool:
    """Return whether two boxes overlap by more than 1.5 pixels in both directions."""
    wide = min(one.x1, other.x1) - max(one.x0, other.x0)
    high = min(one.y1, other.y1) - max(one.y0, other.y0)
    return bool(wide > 1.5 and high > 1.5)


def assert_inside(figure: Figure, box: Bbox, name: str) -> None:
    assert -1.5 < box.x0 <= box.x1 < figure.bbox.width + 1.5, name
    assert -1.5 < box.y0 <= box.y1 < figure.bbox.height + 1.5, name


def assert_room(figure: Figure) -> None:
    """Assert that no text is cut, covers another, or extends into another's panel."""
    boxes = []
    panels = [axes.get_window_extent() for axes in figure.axes if axes.axison]
    beyond = {
        label  # matplotlib does not draw it
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        for label, at in zip(axis.get_ticklabels(), axis.get_ticklocs(), strict=True)
        if not min(axis.get_view_interval()) <= at <= max(axis.get_view_interval())
    }
    for text in figure.findobj(Text):
        if not isinstance(text, Text) or text in beyond or not text.get_visible():
            continue
        name, box = text.get_text(), text.get_window_extent()
        if not name.strip() or box.width == 0:
            continue
        assert_inside(figure, box, name)
        if not text.get_rotation() % 90:  # the box of turned text is larger than the text
            boxes.append((name, box))
        if not any(text in axes.texts for axes in figure.axes):  # a warning
            assert not [panel for panel in panels if overlap(box, panel)], name
    for (one, a), (other, b) in itertools.combinations(boxes, 2):
        assert not overlap(a, b), (one, other)


def assert_drawn(result: Any, *, parts: bool) -> None:  # noqa: ANN401 (of any analysis)
    """Assert that a result is drawn whole, in 86 mm and by its parts, named and with room."""
    chart = registry.of_result(result)
    panels = [getattr(chart, "whole", lambda panel: panel)(panel) for panel in chart.panels]
    for panel in panels:
        sides = () if panel.bare else (panel.x, panel.y)
        assert all(side.name or side.ticks for side in sides), panel.name
    for look in ({}, {"width": 86.0, "title": False}):
        figure = render.figure_of(result, dpi=100.0, **look)
        with rc_context(style.RC):
            figure.draw_without_rendering()
        assert_room(figure)
        names = {mark.name for panel in panels for mark in panel.marks} - {""}
        assert {plain(name) for name in names} <= set(named(figure))
    for k, panel in enumerate(panels if parts else ()):
        size = [(6.4, 4.8), (4.0, 3.0), (9.0, 5.0), (3.4, 2.8)][k % 4]
        figure, every = plt.subplots(1, 2 - k % 2, figsize=size, squeeze=False)
        axes = every[0, -1]
        assert pendmap.plot(result, axes, layer=panel.name) is axes
        figure.draw_without_rendering()
        assert axes.has_data() or not axes.axison
        assert k % 2 or not every[0, 0].has_data()
        legend = axes.get_legend()
        boxes = [one.get_window_extent() for one in (*axes.texts, legend) if one is not None]
        for box in (*boxes, *([axes.get_tightbbox()] if axes.axison else ())):
            assert_inside(figure, box, panel.name)
        plt.close(figure)
