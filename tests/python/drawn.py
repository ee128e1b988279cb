"""Figures drawn without a file, and their texts."""

from __future__ import annotations

import itertools
import re
from typing import TYPE_CHECKING

from matplotlib import rc_context
from matplotlib.legend import Legend
from matplotlib.text import Text

from pendmap import render
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
    found = (axes.get_title(loc="left") for axes in figure.axes)
    return [re.sub(r"\s+", " ", text).removeprefix(f"({text[1:2]}) ") for text in found if text]


def named(figure: Figure) -> list[str]:
    """Return the texts of the legends, each on one line."""
    boxes = [box for box in figure.findobj(Legend) if isinstance(box, Legend)]
    return [plain(text.get_text()).replace("\n", " ") for box in boxes for text in box.get_texts()]


def subtitle(figure: Figure) -> str:
    return plain(figure.subfigs[0].get_suptitle())


def written(figure: Figure) -> str:
    texts = (found.get_text() for found in figure.findobj(Text) if isinstance(found, Text))
    return plain(" ".join(" ".join(texts).split()))


def shown(text: object) -> bool:
    """Return whether a text is visible and not empty."""
    return isinstance(text, Text) and text.get_visible() and bool(text.get_text().strip())


def overlap(one: Bbox, other: Bbox) -> bool:
    """Return whether two boxes overlap by more than 1.5 pixels in both directions."""
    wide = min(one.x1, other.x1) - max(one.x0, other.x0)
    high = min(one.y1, other.y1) - max(one.y0, other.y0)
    return bool(wide > 1.5 and high > 1.5)


def assert_room(figure: Figure) -> None:
    """Assert that no text is cut, covers another, or extends into another's panel."""
    whole, boxes = figure.bbox, []
    panels = [("a panel", axes.get_window_extent()) for axes in figure.axes if axes.axison]
    beyond = {
        label  # matplotlib does not draw it
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        for label, at in zip(axis.get_ticklabels(), axis.get_ticklocs(), strict=True)
        if not min(axis.get_view_interval()) <= at <= max(axis.get_view_interval())
    }
    for text in figure.findobj(Text):
        if not shown(text) or text in beyond:
            continue
        name, box = text.get_text(), text.get_window_extent()
        if box.width == 0:
            continue
        assert whole.x0 - 1 <= box.x0 <= box.x1 <= whole.x1 + 1, name
        assert whole.y0 - 1 <= box.y0 <= box.y1 <= whole.y1 + 1, name
        boxes.append((name, box))
        if not any(text in axes.texts for axes in figure.axes):  # a warning
            assert not [panel for _, panel in panels if overlap(box, panel)], name
    for (one, a), (other, b) in itertools.combinations(boxes, 2):
        assert not overlap(a, b), (one, other)
