"""Charts as matplotlib figures, and several charts on one sheet."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pendmap.charts.chart import Chart, Sheet
from pendmap.charts.marks import ALARM, QUIET, Image
from pendmap.errors import InputError
from pendmap.render import marks, style, ticks

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import FigureBase

    from pendmap.charts.chart import Panel
    from pendmap.charts.marks import Colours, Ends, Mark

CELLS: Final = 1200
"""Most rows and columns of a drawn map, unless the figure has more pixels."""
WIDE, ALONE, STACKED = 4.1, 5.2, 7.0
"""Panel width in inches: several side by side, a single one, several stacked."""
BESIDE, BAR, BELOW, HEAD, ROW = 0.75, 0.75, 0.75, 0.7, 0.19
"""Inches for labels beside a panel, a colour bar, labels below, a title, a row of a legend."""
LEFT: Final = 0.1  # Left margin of titles, inches
SMALL: Final = 0.7  # Share of the usual size below which texts are smaller
LETTERS: Final = "abcdefghijklmnopqrstuvwxyz"


def draw(
    chart: Chart | Sheet,
    *,
    size: Ends | None = None,
    dpi: float = 200.0,
    width: float | None = None,
    title: bool = True,
) -> Figure:
    """Return the figure of a chart or sheet, of any ``size`` or ``width`` in inches.

    Texts are smaller in a figure much smaller than usual.
    """
    if not title:
        chart = replace(chart, title="", subtitle="")
    if width is not None:
        chart = _in_width(chart, width)
    usual = _size(chart)
    size = size or usual
    if not all(1 <= side * dpi <= style.PIXELS for side in size):
        raise InputError(f"size {size} at {dpi:g} dpi: sides must be 1 to {style.PIXELS} pixels")
    share = min(size[0] / usual[0], size[1] / usual[1]) / SMALL
    with mpl.rc_context(style.smaller(share) if share < 1 else {}):
        figure = _made(chart, size, dpi)
    for axes in figure.axes:
        ticks.turn(axes)
        shrink(axes)
    return figure


def _made(chart: Chart | Sheet, size: Ends, dpi: float) -> Figure:
    """Return the figure of a chart, laid out."""
    figure = Figure(size, dpi=dpi, layout="constrained")
    FigureCanvasAgg(figure)
    body: Any = figure.subfigures()
    font = style.points("font.size")
    _head(figure, chart.title, fontsize=1.33 * font, weight="bold")
    _head(body, chart.subtitle, color=QUIET, fontsize=font)
    if isinstance(chart, Sheet):
        _fill_sheet(body, chart)
    else:
        if chart.notes:
            look: dict[str, Any] = {"fontsize": style.points("legend.fontsize"), "wrap": True}
            text = style.typeset("\n".join(chart.notes))
            figure.supxlabel(text, x=LEFT / _wide(figure), ha="left", **look)
        _fill(body, chart, iter(LETTERS if len(chart.panels) > 1 else ()))
        _legend(body, chart)
    with style.quiet():
        figure.draw_without_rendering()
    return figure


def _head(figure: FigureBase, text: str, **look: Any) -> None:  # noqa: ANN401 (of any text)
    """Write a title over a figure or a part of it, in as many lines as it needs."""
    if text:
        figure.suptitle(style.typeset(text), x=LEFT / _wide(figure), ha="left", wrap=True, **look)


def _in_width(chart: Chart | Sheet, width: float) -> Chart | Sheet:
    """Return a chart of a width in inches, a sheet with all its charts in one column."""
    if isinstance(chart, Sheet):
        column: list[Any] = [_in_width(one, width) for one in chart.charts]
        return replace(chart, columns=[column])
    narrow = chart.in_width(width)
    return replace(narrow, size=(width, sum(narrow.heights) + _around(narrow, width)))


def _size(chart: Chart | Sheet) -> Ends:
    """Return the size of a chart in inches: its own, or one from its panels' proportions."""
    if isinstance(chart, Sheet):
        sizes = [[_size(one) for one in column] for column in chart.columns]
        across = sum(max(wide for wide, _ in column) for column in sizes)
        down = max(sum(high for _, high in column) for column in sizes)
        return across, down + _around(chart, across, legend=chart.legend)
    if chart.size is not None:
        return chart.size
    rows = chart.rows
    stacked = len(rows) > 1 and all(len(row) == 1 for row in rows)
    wide = STACKED if stacked else ALONE if len(rows[0]) == 1 else WIDE
    bars = [sum(bool(_scales(panel)) for panel in row) for row in rows]
    row_widths = [len(row) * (wide + BESIDE) + BAR * n for row, n in zip(rows, bars, strict=True)]
    width = max(row_widths) + 0.15
    down = sum(chart.heights or [1.0] * len(rows)) * wide * chart.ratio
    return width, down + BELOW * len(rows) + _around(chart, width)


def _around(chart: Chart | Sheet, width: float, *, legend: bool = True) -> float:
    """Return the height of title, legend and notes in inches."""
    down = (HEAD if chart.title else 0.05) + ROW * len(getattr(chart, "notes", ()))
    texts, columns = marks.shape([*marks.legend(_all_marks(chart))], width)
    rows = sum(text.count("\n") + 1 for text in texts[::columns]) if legend else 0
    return down + (ROW * rows + 0.1 if rows else 0.0)


def _all_marks(chart: Chart | Sheet) -> list[Mark]:
    return [mark for panel in chart.panels for mark in panel.marks]


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


def _fill_sheet(figure: FigureBase, sheet: Sheet) -> None:
    """Draw the charts of a sheet in columns, each below its heading."""
    letters, font = iter(LETTERS), style.points("font.size")
    wide = [max(_size(chart)[0] for chart in column) for column in sheet.columns]
    parts = figure.subfigures(1, len(wide), squeeze=False, width_ratios=wide)[0]
    for part, column in zip(parts, sheet.columns, strict=True):
        shares = [_size(chart)[1] for chart in column]
        blocks = part.subfigures(len(column), 1, squeeze=False, height_ratios=shares)[:, 0]
        for block, chart in zip(blocks, column, strict=True):
            _head(block, chart.title, fontsize=1.15 * font, weight="bold")
            _fill(block, chart, letters)
            if not sheet.legend:
                _legend(block, chart)
    if sheet.legend:
        _legend(figure, sheet)


def _fill(figure: FigureBase, chart: Chart, letters: Iterator[str]) -> None:
    """Draw the panels of a chart into a figure or a part of it, with letters from ``letters``."""
    count = math.lcm(*(len(row) for row in chart.rows))
    grid = figure.add_gridspec(len(chart.rows), count, height_ratios=chart.heights or None)
    for down, row in enumerate(chart.rows):
        wide = count // len(row)
        for k, panel in enumerate(row):
            axes = figure.add_subplot(grid[down, k * wide : (k + 1) * wide])
            panel_into(axes, panel)
            letter = next(letters, "") if panel.title and chart.letters else ""
            title = f"({letter}) {panel.title}" if letter else panel.title
            write_title(axes, style.typeset(title))


def _legend(figure: FigureBase, chart: Chart | Sheet) -> None:
    """Write the legend of a chart below its panels."""
    named = marks.legend(_all_marks(chart))
    if named:
        texts, count = marks.shape([*named], _wide(figure))
        look = {"loc": "outside lower left", **marks.LEGEND}
        figure.legend([*named.values()], texts, ncols=count, **look)


def write_title(axes: Axes, title: str) -> None:
    """Write the title of a panel, in lines as wide as the panel."""
    style.wrap([axes.set_title(title)], axes)


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
        ticks.scale(axes, which, replace(side, ticks=()) if panel.bare else side)
    names = [image.colorbar.ax.yaxis.label for image in axes.images if image.colorbar]
    style.wrap([axes.yaxis.label, *names], axes, "height")
    style.wrap([axes.xaxis.label], axes)
    if panel.bare:
        axes.set_axis_off()


def _warn(axes: Axes, warning: str) -> None:
    """Write a warning into the upper left corner of a panel."""
    look: dict[str, Any] = {"color": ALARM, "weight": "bold", "zorder": 9.0}
    look["size"] = style.points("legend.fontsize")
    look["bbox"] = {"boxstyle": "square,pad=0.25", "fc": "white", "ec": ALARM, "alpha": 0.85}
    where: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points"}
    words = axes.annotate(warning, (0.0, 1.0), (4.0, -4.0), va="top", **where, **look)
    style.wrap([words], axes, share=0.9)
    words.set_in_layout(False)


def shrink(axes: Axes) -> None:
    """Make words of a panel without a frame so small that they fit in its width."""
    for text in () if axes.axison else axes.texts:
        for _ in range(9):  # letters have whole pixels: widths are not in proportion to sizes
            share = axes.bbox.width / max(text.get_window_extent().width, 1.0)
            text.set_fontsize(float(text.get_fontsize()) * min(share, 1.0))


def _wide(part: Any) -> float:  # noqa: ANN401 (a figure, or a part of one)
    """Return the width of a figure, or of a part of one, in inches."""
    return float(part.bbox.width / part.get_figure(root=True).dpi)
