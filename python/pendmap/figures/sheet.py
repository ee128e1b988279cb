"""Sheets: figures whose panels, colour bars and legends are placed by the inch."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

from pendmap.errors import InputError
from pendmap.figures.style import QUIET, RC

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

__all__ = ["Panel", "Sheet", "headed", "place"]

LEFT, RIGHT, TOP, BOTTOM = 0.72, 0.22, 0.98, 0.55
GAP, BAR, BAR_WIDTH, BAR_PAD = 0.62, 0.78, 0.13, 0.09
STACK_GAP = 0.85
ROW, LEGEND_PAD = 0.19, 0.14
WIDTH = 4.1
FLAT = 0.55  # height over width under which panels stand below one another
LEAST = 0.5  # inches a panel needs


@dataclass(frozen=True)
class Panel:
    """One panel: its size relative to the leading ones, and whether a colour bar follows."""

    share: float = 1.0
    bar: bool = False


class Sheet:
    """A figure whose panels are placed by the inch, so that nothing overlaps and nothing is cut.

    Parameters
    ----------
    panels : sequence of Panel
        From left to right; from top to bottom where they are much wider than high.
    ratio : float
        Height of a panel over its width.
    handles, texts
        The legend below the panels: an artist or a tuple of artists, and a line of text, each.
    size : (float, float) or None
        Width and height in inches; None: as large as the panels need.
    dpi : float
        Pixels per inch.

    Raises
    ------
    InputError
        If ``size`` leaves no room for the panels.
    """

    def __init__(  # noqa: PLR0913 (panels, words and size)
        self,
        panels: Sequence[Panel],
        *,
        ratio: float,
        title: str,
        subtitle: str,
        handles: Sequence[Any] = (),
        texts: Sequence[str] = (),
        size: tuple[float, float] | None = None,
        dpi: float = 200.0,
    ) -> None:
        self.stacked = stacked = ratio < FLAT
        shares = [panel.share for panel in panels]
        bars = [BAR if panel.bar else 0.0 for panel in panels]
        aside = LEFT + RIGHT + (max(bars) if stacked else sum(bars) + GAP * (len(panels) - 1))
        across = max(shares) if stacked else sum(shares)
        base = 7.0 if stacked else 5.2 if len(panels) == 1 else WIDTH
        width = size[0] if size else aside + across * base
        columns = _columns(texts, width - LEFT)
        rows = -(-len(texts) // columns)
        below = BOTTOM + (LEGEND_PAD + ROW * rows if rows else 0.0)
        down = sum(shares) if stacked else max(shares)
        between = STACK_GAP * (len(panels) - 1) if stacked else 0.0
        wide = (width - aside) / across
        high = (size[1] - TOP - below - between) / down if size else wide * ratio
        if not (math.isfinite(wide) and math.isfinite(high) and min(wide, high) >= LEAST):
            least_width = aside + LEAST * across
            least_height = TOP + below + between + LEAST * down
            raise InputError(
                f"size {size} leaves no room for the panels;"
                f" it must be at least {least_width:.1f} x {least_height:.1f} inches"
            )
        height = TOP + high * down + between + below
        self._room = ((wide * (1 - min(shares)), high), (wide, high * (1 - min(shares)) + BOTTOM))
        self.figure = headed((width, height), dpi, title, subtitle)
        self.axes: list[Axes] = []
        self.bars: list[Axes | None] = []
        x, y = LEFT, height - TOP
        for panel in panels:
            w, h = wide * panel.share, high * panel.share
            self.axes.append(place(self.figure, x, y - h, w, h))
            beside = (x + w + BAR_PAD, y - h, BAR_WIDTH, h)
            self.bars.append(place(self.figure, *beside) if panel.bar else None)
            if stacked:
                y -= h + STACK_GAP
            else:
                x += w + GAP + (BAR if panel.bar else 0.0)
        if rows:
            self.figure.legend(
                list(handles),
                list(texts),
                loc="upper left",
                bbox_to_anchor=(LEFT / width, (below - BOTTOM) / height),
                ncols=columns,
                borderpad=0.0,
                borderaxespad=0.0,
                labelspacing=0.45,
                handlelength=1.5,
                handleheight=1.1,
                handletextpad=0.6,
                columnspacing=2.0,
            )

    @property
    def pixels(self) -> int:
        """Width or height of the largest panel in pixels."""
        return math.ceil(max(max(self.inches(axes)) for axes in self.axes) * self.figure.dpi)

    def inches(self, axes: Axes) -> tuple[float, float]:
        """Return width and height of a panel in inches."""
        box = axes.get_window_extent()
        return float(box.width) / self.figure.dpi, float(box.height) / self.figure.dpi

    def note(self, axes: Axes, parts: Sequence[tuple[str, str, str]]) -> None:
        """Write paragraphs into the room a small panel leaves beneath it, or beside it if stacked.

        Parameters
        ----------
        axes : Axes
            The small panel.
        parts : sequence of (str, str, str)
            Text, colour and weight; paragraphs after the first are left out for want of room.
        """
        beside, beneath = self._room
        width = beside[0] - 0.25 if self.stacked else self.inches(axes)[0]
        room = self.inches(axes)[1] if self.stacked else beneath[1] - BOTTOM
        line = RC["font.size"] * 1.5 / 72
        used = 0.0
        for k, (text, colour, weight) in enumerate(parts):
            lines = textwrap.wrap(
                text, max(12, int(width / (0.081 if weight == "bold" else 0.067)))
            )
            if k and used + line * len(lines) > room:
                break
            axes.annotate(
                "\n".join(lines),
                (1.0, 1.0) if self.stacked else (0.0, 0.0),
                (18.0, -72 * used) if self.stacked else (0.0, -72 * (BOTTOM + used)),
                xycoords="axes fraction",
                textcoords="offset points",
                va="top",
                color=colour,
                weight=weight,
                linespacing=1.25,
            )
            used += line * len(lines) + 0.05


def headed(size: tuple[float, float], dpi: float, title: str, subtitle: str) -> Figure:
    """Return an empty figure of ``size`` inches with its title and subtitle."""
    width, height = size
    figure = Figure(figsize=size, dpi=dpi)
    FigureCanvasAgg(figure)
    left = LEFT / width
    figure.text(left, 1 - 0.27 / height, title, fontsize=12, weight="bold", va="center")
    figure.text(left, 1 - 0.50 / height, subtitle, color=QUIET, va="center")
    return figure


def place(figure: Figure, x: float, y: float, width: float, height: float) -> Axes:
    """Add axes by the inch, from the figure's lower left corner."""
    whole = figure.get_size_inches()
    return figure.add_axes((x / whole[0], y / whole[1], width / whole[0], height / whole[1]))


def _columns(texts: Sequence[str], room: float) -> int:
    """Return how many columns the legend's lines allow in ``room`` inches."""
    if not texts:
        return 1
    font = FontProperties(family=RC["font.sans-serif"])
    inches = [
        TextPath((0, 0), t, size=RC["legend.fontsize"], prop=font).get_extents().width
        for t in texts
    ]
    widest = max(inches) / 72 + 0.55
    fit = max(1, int(room // widest))
    rows = -(-len(texts) // min(fit, len(texts)))
    return -(-len(texts) // rows)
