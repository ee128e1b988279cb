"""Names of classes written into the large regions of an image, in place of a legend."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from pendmap.charts import palette
from pendmap.charts.marks import INK, Image, Level, Mark, Points, Text
from pendmap.render import style

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pendmap.charts.chart import Chart, Panel
    from pendmap.charts.marks import Ends

_PIXELS: Final = 300  # Number of rows and columns in which room is sought
_MARGIN: Final = 0.06  # Free space around a text, inches
_LINE: Final = 1.5  # Height of a line of text over its font size
_BRIGHT: Final = 0.2  # Luminance of a region above which dark text has more contrast than white
_MARKERS: Final = 200  # Number of points up to which a text keeps clear of them


def labelled(chart: Chart, room: Callable[[Panel], Ends]) -> Chart:
    """Return a chart with texts in its large regions; what they name is no longer in the legend.

    ``room(panel)`` is the width and height of a panel in inches.
    """
    named: set[str] = set()
    rows: list[list[Panel]] = []
    for row in chart.rows:
        rows.append([])
        for panel in row:
            texts: list[Mark] = []
            for mark in panel.marks:
                if isinstance(mark, Image) and mark.labels:
                    found = _texts(mark, panel.marks, room(panel))
                    texts += found.values()
                    named |= {mark.labels[k][1] for k in found}
            rows[-1].append(replace(panel, marks=[*panel.marks, *texts]) if texts else panel)
    if not named:
        return chart
    rows = [
        [replace(one, marks=[_unnamed(m, named) for m in one.marks]) for one in row] for row in rows
    ]
    return replace(chart, rows=rows)


def _unnamed(mark: Mark, named: set[str]) -> Mark:
    if isinstance(mark, Image) and any(name in named for name, _ in mark.classes):
        classes = [("" if name in named else name, colour) for name, colour in mark.classes]
        return replace(mark, classes=classes)
    return replace(mark, name="") if mark.name in named else mark


def _texts(image: Image, marks: Sequence[Mark], room: Ends) -> dict[int, Text]:
    """Return the text of each class that has a region with room for it."""
    rows = columns = _PIXELS
    down, across = (
        ((np.arange(_PIXELS) + 0.5) * (count / _PIXELS)).astype(int) for count in image.values.shape
    )
    values = image.values[np.ix_(down, across)].astype(int)
    step = (image.x[1] - image.x[0]) / columns, (image.y[1] - image.y[0]) / rows
    free = np.ones(values.shape, dtype=bool)
    for mark in marks:
        if isinstance(mark, Level) and mark.axis == "y":
            free[min(max(int((mark.value - image.y[0]) / step[1]), 0), rows - 1)] = False
        if isinstance(mark, Points) and 0 < np.size(mark.x) <= _MARKERS:
            reach = [
                mark.size / 72 / side * count
                for side, count in zip(room, (columns, rows), strict=True)
            ]
            for x, y in zip(mark.x, mark.y, strict=True):
                at = (x - image.x[0]) / step[0], (y - image.y[0]) / step[1]
                j, i = (
                    slice(max(int(c - r), 0), max(int(c + r) + 1, 0))
                    for c, r in zip(at, reach, strict=True)
                )
                free[i, j] = False
    size = style.points("font.size")
    found = {}
    for k, (text, _) in enumerate(image.labels):
        if not text:
            continue
        lines = text.split("\n")
        wide = max(style.inches(line, size) for line in lines) + _MARGIN
        high = len(lines) * size * _LINE / 72 + _MARGIN
        box = wide / room[0] * columns, high / room[1] * rows
        place = _place((values == k) & free, box)
        if place is not None:
            x, y = image.x[0] + place[0] * step[0], image.y[0] + place[1] * step[1]
            colour = INK if palette.luminance(image.classes[k][1]) > _BRIGHT else "#ffffff"
            found[k] = Text(x, y, text, colour=colour, size=size, order=4.5)
    return found


def _place(mask: npt.NDArray[np.bool_], box: Ends) -> Ends | None:
    """Return the centre of the largest box of these proportions within the mask: column, row."""
    total = np.zeros((mask.shape[0] + 1, mask.shape[1] + 1), dtype=np.int64)
    total[1:, 1:] = mask.cumsum(axis=0).cumsum(axis=1)

    def fitting(scale: float) -> npt.NDArray[np.intp] | None:
        wide, high = (int(np.ceil(scale * side)) for side in box)
        if high > mask.shape[0] or wide > mask.shape[1]:
            return None
        inside = (
            total[high:, wide:]
            - total[:-high, wide:]
            - total[high:, :-wide]
            + total[:-high, :-wide]
        )
        corners = np.argwhere(inside == wide * high)
        return corners + np.array([high / 2, wide / 2]) if len(corners) else None

    best, low, high = fitting(1.0), 1.0, float(max(mask.shape))
    if best is None:
        return None
    for _ in range(12):
        scale = (low * high) ** 0.5
        larger = fitting(scale)
        best, low, high = (best, low, scale) if larger is None else (larger, scale, high)
    row, column = best[len(best) // 2]
    return float(column), float(row)
