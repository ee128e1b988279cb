"""Charts as matplotlib figures, and several charts on one sheet."""

from __future__ import annotations

import itertools
import math
import textwrap
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts.chart import Chart, Sheet
from pendmap.charts.marks import ALARM, Image
from pendmap.errors import InputError
from pendmap.render import marks, regions, style, ticks
from pendmap.render.head import LEFT, LINE, head_of, headed

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure, FigureBase, SubFigure

    from pendmap.charts.chart import Panel
    from pendmap.charts.marks import Colours, Ends, Mark

    Drawn = tuple[Axes, Panel]

CELLS: Final = 1200
"""Most rows and columns of a drawn map, unless the figure has more pixels."""
WIDE, ALONE, STACKED = 4.1, 5.2, 7.0
"""Panel width in inches: several side by side, a single one, several stacked."""
BESIDE, BAR, BELOW, ROW = 0.75, 0.75, 0.75, 0.19
"""Inches for labels beside a panel, a colour bar, labels below, a row of a legend."""
HANDLE: Final = 0.55  # Room for the handle of a legend's entry, inches
LEAST_SHEET: Final = 5.9  # Least width of a sheet whose charts are in one column, inches
LEAST: Final = 0.5  # Least side of a panel, inches
HEADING: Final = 0.32  # Height of the heading of a chart on a sheet, inches
SMALLEST: Final = (0.88, 0.72)
"""Least width and height of a readable sheet, as shares of its default size."""
LETTERS: Final = "abcdefghijklmnopqrstuvwxyz"


def save(
    chart: Chart | Sheet,
    path: str | os.PathLike[str],
    *,
    size: Ends | None = None,
    dpi: float | None = None,
) -> Path:
    """Write the figure of a chart, or of a sheet of charts, into a file; return its path."""
    return style.written(path, lambda dpi: draw(chart, size=size, dpi=dpi), size=size, dpi=dpi)


def draw(
    chart: Chart | Sheet,
    *,
    size: Ends | None = None,
    dpi: float = 200.0,
    width: float | None = None,
    title: bool = True,
) -> Figure:
    """Return the figure of a chart or sheet; raise InputError if ``size``, inches, is too small.

    A figure of a ``width``, inches, is as high as its panels need, row for row.
    """
    if not title:
        chart = replace(chart, title="", subtitle="")
    if isinstance(chart, Sheet):
        if width is not None and width < LEAST_SHEET:
            raise InputError(
                f"width of a sheet of several charts must be {round(25.4 * LEAST_SHEET)} mm or "
                f"more, got {round(25.4 * width)}; its layers have any width, as "
                f"layer={chart.panels[0].name!r}"
            )
        if width is not None:
            column = [_in_width(one, width) for column in chart.columns for one in column]
            chart = replace(chart, columns=[column])
        return _sheet(chart, size, dpi)
    if width is not None:
        chart = _in_width(chart, width)
        return _made(chart, _size(chart), dpi)[0]
    chart = _labelled(chart, size or _size(chart))
    figure, needed = _made(chart, size or _size(chart), dpi)
    if size is not None and _lacks(size, needed):
        _refuse(size, _least(chart, dpi))
    return figure


def _in_width(chart: Chart, width: float) -> Chart:
    """Return a chart of a width in inches, as high as its panels and its legend need."""
    narrow = chart.in_width(width)
    below = BELOW * len(narrow.rows) if chart.size is None else 0.0
    high = sum(narrow.heights) + below + head_of(chart) + LINE * len(chart.notes)
    narrow = _labelled(narrow, (width, high))
    return replace(narrow, size=(width, high + _rows(_all_marks(narrow), width)))


def _labelled(chart: Chart, size: Ends) -> Chart:
    """Return a chart of this size in inches with texts in its large regions."""
    rows = {id(panel): row for row in chart.rows for panel in row}
    heights = chart.heights or [max(panel.share for panel in row) for row in chart.rows]
    highest = dict(zip(map(id, chart.rows), heights, strict=True))
    down = size[1] - head_of(chart) - BELOW * len(heights)

    def room(panel: Panel) -> Ends:
        row = rows[id(panel)]
        wide = (size[0] - _aside(row)) * panel.share / sum(one.share for one in row)
        high = down * highest[id(row)] / sum(heights)
        return max(wide, LEAST), max(high * panel.share / max(one.share for one in row), LEAST)

    return regions.labelled(chart, room)


def _refuse(size: Ends, least: Ends) -> None:
    """Raise InputError for a size in inches below the least one."""
    if _lacks(size, least):
        raise InputError(
            f"size {size} leaves no room for the panels; it must be at least"
            f" {least[0]:.1f} x {least[1]:.1f} inches"
        )


def in_colours(chart: Chart | Sheet, colormap: str | Colormap) -> Chart:
    """Return a chart with another colour map in its images of numbers."""
    style.colour_map(colormap)
    if isinstance(chart, Sheet) or not any(_scales(panel) for panel in chart.panels):
        raise InputError(
            f"colormap {colormap!r}: this figure has none; its colours identify attractors"
        )

    def recoloured(mark: Mark) -> Mark:
        if not isinstance(mark, Image) or mark.colours is None:
            return mark
        return replace(mark, colours=replace(mark.colours, map=colormap))

    rows = [
        [replace(panel, marks=[recoloured(mark) for mark in panel.marks]) for panel in row]
        for row in chart.rows
    ]
    return replace(chart, rows=rows)


def _scales(panel: Panel) -> list[Colours]:
    """Return the colour scales of the images of a panel."""
    images = [mark for mark in panel.marks if isinstance(mark, Image)]
    return [image.colours for image in images if image.colours is not None]


def _least(chart: Chart, dpi: float) -> Ends:
    """Return the least size with room for every panel and its text, in tenths of an inch."""
    size = _size(chart)
    least = _made(chart, size, dpi)[1]
    for _ in range(9):
        least = (math.ceil(10 * least[0] - 1e-6) / 10, math.ceil(10 * least[1] - 1e-6) / 10)
        needed = _made(chart, least, dpi)[1]
        if not _lacks(least, needed):
            break
        least = (max(least[0], needed[0]), max(least[1], needed[1]))
    return least


def _lacks(size: Ends, needed: Ends) -> bool:
    return needed[0] > size[0] + 1e-6 or needed[1] > size[1] + 1e-6


def _size(chart: Chart) -> Ends:
    """Return the size of a chart in inches: its own, or one from its panels' proportions."""
    if chart.size is not None:
        return chart.size
    rows = chart.rows
    stacked = len(rows) > 1 and all(len(row) == 1 for row in rows)
    wide = STACKED if stacked else ALONE if len(rows[0]) == 1 else WIDE
    across = [sum(panel.share for panel in row) * wide + _aside(row) for row in rows]
    heights = chart.heights or [max(panel.share for panel in row) for row in rows]
    width = max(across) + 0.15
    down = sum(heights) * wide * chart.ratio + BELOW * len(rows)
    return width, down + head_of(chart) + _rows(_all_marks(chart), width) + LINE * len(chart.notes)


def _aside(row: Sequence[Panel]) -> float:
    return BESIDE * len(row) + BAR * sum(bool(_scales(panel)) for panel in row)


def _rows(named: list[Mark], width: float) -> float:
    """Return the height of a legend of these marks in inches."""
    texts = marks.legend(named)[1]
    return ROW * -(-len(texts) // columns(texts, width)) + 0.1 if texts else 0.0


def _all_marks(chart: Chart) -> list[Mark]:
    return [mark for panel in chart.panels for mark in panel.marks]


def _made(chart: Chart, size: Ends, dpi: float) -> tuple[Figure, Ends]:
    """Return the figure of a chart, and the size in inches that it needs."""
    # The layout reserves room for a legend at the edge alone, not for one above notes.
    foot = LINE * len(chart.notes) + _rows(_all_marks(chart) if chart.notes else [], size[0])
    figure = headed(size, dpi, chart.title, chart.subtitle, foot=foot)
    for k, line in enumerate(chart.notes):
        at = (0.06 + LINE * (len(chart.notes) - k)) / size[1]
        figure.text(LEFT / size[0], at, style.typeset(line), fontsize=8.5, va="top")
    drawn = fill(figure, chart)
    above = (LINE * len(chart.notes) + 0.08) / size[1] if chart.notes else 0.0
    where: dict[str, Any] = {"bbox_to_anchor": (0.0, above, 1.0, 1.0)} if above else {}
    _legend(figure, _all_marks(chart), size[0], loc="outside lower left", borderpad=0.1, **where)
    fits = settle(figure, [*itertools.chain(*drawn)])
    return figure, _needed(figure, chart, drawn) if fits else (1.15 * size[0], 1.15 * size[1])


def fill(
    figure: Figure | SubFigure, chart: Chart, letters: Iterator[str] | None = None
) -> list[list[Drawn]]:
    """Draw the panels of a chart into a figure; return them with their axes, row by row.

    ``letters`` label the panels; without them several panels are labelled from (a).
    """
    rows = chart.rows
    heights = chart.heights or [max(panel.share for panel in row) for row in rows]
    shares = [panel.share for panel in rows[0]] if len(rows) == 1 else []
    columns = chart.columns or math.lcm(*(len(row) for row in rows))
    grid = figure.add_gridspec(
        len(rows), columns, height_ratios=list(heights), width_ratios=shares or None
    )
    several = chart.letters and (letters is not None or len(chart.panels) > 1)
    letters = letters or iter(LETTERS)
    drawn: list[list[Drawn]] = []
    for down, row in enumerate(rows):
        wide = 1 if chart.columns else columns // len(row)
        drawn.append([])
        for k, panel in enumerate(row):
            place: Any = grid[down, k * wide : (k + 1) * wide]
            if panel.note and panel.share < 1:
                parts = [panel.share, 1 - panel.share]
                if len(row) > 1:
                    place = place.subgridspec(2, 1, height_ratios=parts)[0, 0]
                else:
                    place = place.subgridspec(1, 2, width_ratios=parts)[0, 0]
            axes = figure.add_subplot(place)
            if panel.title:
                mark = f"({next(letters)}) " if several else ""
                axes.set_title(style.typeset(f"{mark}{panel.title}"))
            drawn[-1].append((axes, panel))
    for axes, panel in itertools.chain(*drawn):
        panel_into(axes, panel)
    return drawn


def _legend(
    figure: Figure | SubFigure,
    named: list[Mark],
    width: float,
    **where: Any,  # noqa: ANN401 (as matplotlib takes it)
) -> None:
    handles, texts = marks.legend(named)
    if texts:
        figure.legend(
            handles,
            texts,
            ncols=columns(texts, width),
            labelspacing=0.45,
            handlelength=1.7,
            handleheight=1.0,
            handletextpad=0.6,
            columnspacing=1.6,
            **where,
        )


def _sheet(sheet: Sheet, size: Ends | None, dpi: float) -> Figure:
    """Return the figure of a sheet, its charts in columns."""
    every = [chart for column in sheet.columns for chart in column]
    named = [mark for chart in every for mark in _all_marks(chart)] if sheet.legend else []
    wide = [max(_size(chart)[0] for chart in column) for column in sheet.columns]
    high = [sum(_size(chart)[1] for chart in column) for column in sheet.columns]
    foot = _rows(named, sum(wide))
    head = head_of(sheet)
    given = size or (sum(wide), max(high) + head + foot)
    _refuse(given, (SMALLEST[0] * sum(wide), SMALLEST[1] * max(high) + head + foot))
    figure = headed(given, dpi, sheet.title, sheet.subtitle, below=foot)
    engine: Any = figure.get_layout_engine()
    _, low, _, tall = engine.get()["rect"]
    below_head = (0.0, low + tall + foot / given[1])
    _legend(figure, named, given[0], loc="upper left", bbox_to_anchor=below_head)
    letters = iter(LETTERS)
    panels: list[Drawn] = []
    columns = figure.subfigures(1, len(wide), squeeze=False, width_ratios=wide)[0]
    for part, column in zip(columns, sheet.columns, strict=True):
        shares = [_size(chart)[1] for chart in column]
        room = (given[1] - head - foot) / sum(shares)
        blocks = part.subfigures(len(column), 1, squeeze=False, height_ratios=shares)[:, 0]
        for block, chart in zip(blocks, column, strict=True):
            drawn = _block(block, chart, room * _size(chart)[1], letters, own=not sheet.legend)
            panels += itertools.chain(*drawn)
    settle(figure, panels)
    return figure


def _block(
    figure: SubFigure, chart: Chart, high: float, letters: Iterator[str], *, own: bool
) -> list[list[Drawn]]:
    """Draw one chart of a sheet with its heading and its own legend below it."""
    wide = figure.bbox.width / _dpi(figure)
    named = _all_marks(chart) if own else []
    title = style.broken(chart.title, wide - 2 * LEFT, 10.5, bold=True)
    more = LINE * title.count("\n")
    heading = HEADING + more if title else 0.05
    above = heading + _rows(named, wide)
    parts: Any = figure.subfigures(2, 1, height_ratios=(above, max(high - above, 0.1)))
    head, body = parts
    words: dict[str, Any] = {"fontsize": 10.5, "weight": "bold", "va": "center"}
    head.text(LEFT / wide, 1 - (0.17 + more / 2) / above, style.typeset(title), **words)
    _legend(head, named, wide, loc="upper left", bbox_to_anchor=(0.0, 1 - heading / above))
    return fill(body, chart, letters)


def panel_into(axes: Axes, panel: Panel) -> None:
    """Draw the marks of a panel into axes, and set their limits, ticks and names."""
    for mark in panel.marks:
        marks.draw(axes, mark)
    if panel.warning:
        _warn(axes, panel.warning)
    words = axes.texts if panel.bare else []
    for artist in (*axes.lines, *axes.collections, *axes.images, *words):
        artist.set_in_layout(False)
    for which, side in (("x", panel.x), ("y", panel.y)):
        bare = replace(side, ticks=()) if panel.bare else side
        ticks.scale(axes, which, bare)
    if panel.bare:
        axes.set_axis_off()


def _warn(axes: Axes, warning: str) -> None:
    """Write a warning into the upper left corner of a panel."""
    size = style.points("legend.fontsize")
    text = style.broken(warning, inches_of(axes)[0] - 0.4, size, bold=True)
    look: dict[str, Any] = {"color": ALARM, "size": size, "weight": "bold", "zorder": 9.0}
    look["bbox"] = {"boxstyle": "square,pad=0.25", "fc": "white", "ec": ALARM, "alpha": 0.85}
    where: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points"}
    words = axes.annotate(text, (0.0, 1.0), (4.0, -4.0), va="top", **where, **look)
    words.set_in_layout(False)


def settle(figure: Figure, panels: Sequence[Drawn]) -> bool:
    """Lay out the panels, fold long titles, write notes; return whether there is room."""
    engine: Any = figure.get_layout_engine()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        engine.execute(figure)
        for axes, panel in panels:
            turned(axes, panel)
            title, room = axes.get_title(loc="left"), inches_of(axes)[0]
            if title and style.width_of(title) > room + 0.15:
                axes.set_title(style.folded(title, room))
            if panel.note:
                _note(axes, panel)
        engine.execute(figure)
    return not any("collapsed" in str(one.message) for one in said)


def turned(axes: Axes, panel: Panel) -> None:
    """Turn long names below a panel; make the words of a panel without a frame narrow enough."""
    ticks.turn(axes)
    needed = max((marks.across(mark) for mark in panel.marks), default=0.0)
    if panel.bare and needed > inches_of(axes)[0]:
        for text in axes.texts:
            text.set_fontsize(float(text.get_fontsize()) * inches_of(axes)[0] / needed)


def _note(axes: Axes, panel: Panel) -> None:
    """Write paragraphs below a small panel, or beside one that is alone in its row."""
    wide, high = inches_of(axes)
    beside = wide > high * 2
    free = wide * (1 - panel.share) / panel.share
    used, room = 0.0, high if beside else high * (1 - panel.share) / panel.share
    for k, (text, colour) in enumerate(panel.note):
        bold = colour == ALARM
        width = (free - 0.35 if beside else wide) / (0.081 if bold else 0.067)
        lines = textwrap.wrap(text, max(12, int(width)))
        if k and used + LINE * len(lines) > room:
            return
        words = axes.annotate(
            style.typeset("\n".join(lines)),
            (1.0, 1.0) if beside else (0.0, 0.0),
            (18.0, -72 * used) if beside else (0.0, -72 * (0.5 + used)),
            xycoords="axes fraction",
            textcoords="offset points",
            va="top",
            color=colour,
            weight="bold" if bold else "normal",
            linespacing=1.25,
        )
        words.set_in_layout(False)
        used += LINE * len(lines) + 0.05


def _needed(figure: Figure, chart: Chart, drawn: list[list[Drawn]]) -> Ends:
    """Return the size in inches at which every panel has room for its text."""
    width, height = figure.get_size_inches()
    across, down = [], 0.0
    for row in drawn:
        lacks = [np.subtract(_room(axes, panel), inches_of(axes)) for axes, panel in row]
        unit = max(lack[0] / panel.share for lack, (_, panel) in zip(lacks, row, strict=True))
        across.append(unit * sum(panel.share for _, panel in row))
        down += max(lack[1] for lack in lacks)
    texts = marks.legend(_all_marks(chart))[1]
    words = [style.inches(chart.title, 12, bold=True), style.longest(style.halves(chart.subtitle))]
    words.append(max((_entry(text) for text in texts), default=0.0))
    return max(width + max(across), max(words) + 2 * LEFT), height + down


def _room(axes: Axes, panel: Panel) -> Ends:
    """Return the width and height that a panel needs, in inches."""
    words = [*panel.y.name.split("\n"), *(look.name for look in _scales(panel))]
    high = max([LEAST, *(style.inches(text, style.points("font.size")) for text in words)])
    title = axes.get_title(loc="left").replace("\n", " ")
    wide = max(LEAST, style.width_of(style.folded(title, 0.0)) - 0.15)
    return (max(wide, 1.2), max(high, 0.9)) if panel.note else (wide, high)


def inches_of(axes: Axes) -> Ends:
    """Return width and height of axes in inches."""
    box, dpi = axes.get_window_extent(), _dpi(axes.figure)
    return float(box.width) / dpi, float(box.height) / dpi


def _dpi(part: FigureBase) -> float:
    """Return the pixels per inch of the figure that contains a part."""
    whole: Any = part.get_figure(root=True)
    return float(whole.dpi)


def _entry(text: str) -> float:
    """Return the width of a legend entry with its handle, in inches."""
    return style.inches(text, style.points("legend.fontsize")) + HANDLE


def columns(texts: Sequence[str], room: float) -> int:
    """Return the number of columns of a legend in ``room`` inches, with nearly full rows."""
    if not texts:
        return 1
    fit = max(1, int((room - 0.2) // max(map(_entry, texts))))
    rows = -(-len(texts) // min(fit, len(texts)))
    return -(-len(texts) // rows)
