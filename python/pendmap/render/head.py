"""Empty figures with title and subtitle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pendmap.charts.marks import QUIET
from pendmap.render import style

if TYPE_CHECKING:
    from pendmap.charts.chart import Chart, Sheet
    from pendmap.charts.marks import Ends

LEFT: Final = 0.1
HEAD: Final = 0.72
LINE: Final = style.RC["font.size"] * 1.5 / 72
"""Inches: left margin of the title; title with subtitle; one line of text."""
_SMALLEST: Final = 0.9
"""Least font size of a two-line subtitle, over the normal one; below it a third line is used."""


def head_of(chart: Chart | Sheet) -> float:
    """Return the height of title and subtitle in inches."""
    return HEAD if chart.title else 0.05


def headed(  # noqa: PLR0913 (size, words, and room around)
    size: Ends, dpi: float, title: str, subtitle: str, *, foot: float = 0.0, below: float = 0.0
) -> Figure:
    """Return an empty figure with its head, and free inches below the head and at the foot."""
    figure = Figure(figsize=size, dpi=dpi, layout="constrained")
    FigureCanvasAgg(figure)
    top, height = write_head(figure, title, subtitle) + below, size[1]
    rect = (0.0, foot / height, 1.0, max(1 - (top + foot) / height, 1e-3))
    engine: Any = figure.get_layout_engine()
    engine.set(w_pad=0.06, h_pad=0.05, wspace=0.02, hspace=0.02, rect=rect)
    return figure


def write_head(figure: Figure, title: str, subtitle: str) -> float:
    """Write title and subtitle; return their height in inches.

    A subtitle too long for one line becomes two, broken at a semicolon; if these would need a much
    smaller font, it becomes one line per part. A long title becomes smaller.
    """
    if not title:
        return 0.05
    width, height = (float(side) for side in figure.get_size_inches())
    title, subtitle = style.typeset(title), style.typeset(subtitle)
    room = width - 2 * LEFT
    whole = style.inches(subtitle, style.points("font.size"))
    lines = [subtitle] if whole <= room else style.halves(subtitle)
    if _SMALLEST * style.longest(lines) > room:
        lines = subtitle.split(";   ")
    shrunk = room / max(style.longest(lines), 1e-3)
    # Small fonts are set wider than in proportion.
    font = style.points("font.size") * (1.0 if shrunk >= 1 else 0.9 * shrunk)
    bold = 12 * min(1.0, room / max(style.inches(title, 12, bold=True), 1e-3))
    left = LEFT / width
    figure.text(left, 1 - 0.22 / height, title, fontsize=bold, weight="bold", va="center")
    for k, line in enumerate(lines):
        down = 0.45 + LINE * k
        figure.text(left, 1 - down / height, line, color=QUIET, va="center", fontsize=font)
    return float(HEAD + LINE * (len(lines) - 1) - (0.0 if subtitle else LINE))
