"""Sheets: figures whose panels, colour bars and legends are placed by the inch."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pendmap.errors import InputError
from pendmap.render import style
from pendmap.render.style import QUIET, RC

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

LEFT, RIGHT, TOP, BOTTOM = 0.72, 0.22, 0.98, 0.55
GAP, BAR, BAR_WIDTH, BAR_PAD = 0.62, 0.78, 0.13, 0.09
STACK_GAP = 0.85
ROW, LEGEND_PAD = 0.19, 0.14
WIDTH = 4.1
FLAT = 0.55  # height over width under which panels stand below one another
LEAST = 0.5  # inches a panel needs
FEWEST, BOLD = 12, 0.081  # characters of a note's line at least, inches of a bold one
LINE = RC["font.size"] * 1.5 / 72
_SMALLEST = 0.9  # of a subtitle's letters before it takes a third line


@dataclass(frozen=True)
class Panel:
    """One panel.

    Attributes
    ----------
    share : float
        Its size relative to the leading ones.
    bar : str
        Name of the colour bar beside it; empty where there is none.
    title : str
        What stands above it, on two lines where one is too long.
    least : float
        Width that it needs, in inches.
    """

    share: float = 1.0
    bar: str = ""
    title: str = ""
    least: float = LEAST


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
    labels : (float, float)
        Inches that the longest tick labels need beside and below a panel.
    note : str
        What :meth:`note` will write first; empty where nothing.
    size : (float, float) or None
        Width and height in inches; None: as large as the panels need.
    dpi : float
        Pixels per inch.

    Raises
    ------
    InputError
        If ``size`` leaves no room for the panels.
    """

    def __init__(  # noqa: PLR0913, PLR0915 (panels, words and size; all places at once)
        self,
        panels: Sequence[Panel],
        *,
        ratio: float,
        title: str,
        subtitle: str,
        handles: Sequence[Any] = (),
        texts: Sequence[str] = (),
        labels: tuple[float, float] = (0.0, 0.0),
        note: str = "",
        size: tuple[float, float] | None = None,
        dpi: float = 200.0,
    ) -> None:
        self.stacked = stacked = ratio < FLAT
        self.left = left = max(LEFT, labels[0] + 0.44)
        gap, right = max(GAP, labels[0] + 0.36), max(RIGHT, labels[1] / 2 + 0.05)
        shares = [panel.share for panel in panels]
        bars = [BAR if panel.bar else 0.0 for panel in panels]
        aside = left + right + (max(bars) if stacked else sum(bars) + gap * (len(panels) - 1))
        across = max(shares) if stacked else sum(shares)
        # Narrowest: a title ends before the labels of a bar, or the next one, or the edge.
        after = [max(bars) + right] * len(panels)
        if not stacked:
            after = [gap] * (len(panels) - 1) + [right]
        after = [BAR_PAD + BAR_WIDTH if p.bar else b for p, b in zip(panels, after, strict=True)]
        narrow = [max(LEAST, panel.least) / panel.share for panel in panels]
        for panel, behind in zip(panels, after, strict=True):
            room = _long(_folded(panel.title)) + 0.12 - behind
            narrow.append(room / (across if stacked else panel.share))
        if note:
            column = FEWEST * BOLD + 0.05
            narrow.append(
                (column + 0.25 - after[-1]) / (1.0 - min(shares))
                if stacked
                else (column - right) / min(shares)
            )
        words = [style.inches(title, 12, bold=True), _longest(_halves(subtitle))]
        least_width = max(aside + across * max(narrow), left + max([*words, _widest(texts)]) + 0.1)
        base = 7.0 if stacked else 5.2 if len(panels) == 1 else WIDTH
        width = max(size[0], least_width) if size else aside + across * base
        columns = _columns(texts, width - left)
        rows = -(-len(texts) // columns)
        below = BOTTOM + (LEGEND_PAD + ROW * rows if rows else 0.0)
        down = sum(shares) if stacked else max(shares)
        between = STACK_GAP * (len(panels) - 1) if stacked else 0.0
        wide = (width - aside) / across
        # Lowest: names of colour bars do not reach the titles, the note not the legend.
        low = [LEAST / min(shares)]
        low += [style.inches(p.bar, RC["font.size"]) / p.share for p in panels]
        if note:
            small = wide * min(shares)
            lines = len(_wrapped(note, wide - small - 0.25 if stacked else small, bold=True))
            low.append(
                LINE * lines / min(shares)
                if stacked
                else (LINE * lines - BOTTOM + 0.15) / (1.0 - min(shares))
            )
        least_height = TOP + below + between + max(low) * down
        high = (size[1] - TOP - below - between) / down if size else wide * ratio
        if size and not (size[0] >= least_width and size[1] >= least_height):
            raise InputError(
                f"size {size} leaves no room for the panels; it must be at least"
                f" {_up(least_width):.1f} x {_up(least_height):.1f} inches"
            )
        height = TOP + high * down + between + below
        self._room = ((wide * (1 - min(shares)), high), (wide, high * (1 - min(shares)) + BOTTOM))
        self.figure = headed((width, height), dpi, title, subtitle, left=left)
        self.axes: list[Axes] = []
        self.bars: list[Axes | None] = []
        x, y = left, height - TOP
        for panel, behind in zip(panels, after, strict=True):
            w, h = wide * panel.share, high * panel.share
            self.axes.append(place(self.figure, x, y - h, w, h))
            fits = _long(panel.title) + 0.12 <= (wide * across if stacked else w) + behind
            self.axes[-1].set_title(panel.title if fits else _folded(panel.title))
            beside = (x + w + BAR_PAD, y - h, BAR_WIDTH, h)
            self.bars.append(place(self.figure, *beside) if panel.bar else None)
            if stacked:
                y -= h + STACK_GAP
            else:
                x += w + gap + (BAR if panel.bar else 0.0)
        if rows:
            self.figure.legend(
                list(handles),
                list(texts),
                loc="upper left",
                bbox_to_anchor=(left / width, (below - BOTTOM) / height),
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
        used = 0.0
        for k, (text, colour, weight) in enumerate(parts):
            lines = _wrapped(text, width, bold=weight == "bold")
            if k and used + LINE * len(lines) > room:
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
            used += LINE * len(lines) + 0.05


def headed(
    size: tuple[float, float], dpi: float, title: str, subtitle: str, *, left: float = LEFT
) -> Figure:
    """Return an empty figure of ``size`` inches with its title and subtitle.

    A subtitle that is too long for one line becomes two, at a semicolon, where these need not be
    much smaller, and else has a line for each part; a title becomes smaller.
    """
    width, height = size
    figure = Figure(figsize=size, dpi=dpi)
    FigureCanvasAgg(figure)
    room = width - left - 0.1
    lines = [subtitle] if style.inches(subtitle, RC["font.size"]) <= room else _halves(subtitle)
    if _SMALLEST * _longest(lines) > room:
        lines = subtitle.split(";   ")
    shrunk = room / max(_longest(lines), 1e-3)
    # Letters of few pixels are set wider than in proportion.
    font = RC["font.size"] * (1.0 if shrunk >= 1 else 0.9 * shrunk)
    left /= width
    bold = 12 * min(1.0, room / max(style.inches(title, 12, bold=True), 1e-3))
    figure.text(left, 1 - 0.27 / height, title, fontsize=bold, weight="bold", va="center")
    for k, line in enumerate(lines):
        down = 0.50 + LINE * (k - 0.2 * (len(lines) - 1))
        figure.text(left, 1 - down / height, line, color=QUIET, va="center", fontsize=font)
    return figure


def _halves(text: str) -> list[str]:
    """Return a text on two lines as equal as can be, broken at one of its semicolons."""
    parts = text.split(";   ")
    both = [[";   ".join(parts[:k]), ";   ".join(parts[k:])] for k in range(1, len(parts))]
    return min(both, key=_longest, default=[text])


def _longest(lines: Sequence[str]) -> float:
    """Return the inches of the longest line."""
    return max(style.inches(line, RC["font.size"]) for line in lines)


def place(figure: Figure, x: float, y: float, width: float, height: float) -> Axes:
    """Add axes by the inch, from the figure's lower left corner."""
    whole = figure.get_size_inches()
    return figure.add_axes((x / whole[0], y / whole[1], width / whole[0], height / whole[1]))


def _long(title: str) -> float:
    """Return how wide the longest line of a panel's title is, in inches."""
    return max(style.inches(line, RC["axes.titlesize"]) for line in title.split("\n"))


def _folded(title: str) -> str:
    """Return a panel's title on two lines of nearly equal length."""
    blanks = [k for k, letter in enumerate(title) if letter == " "]
    if not blanks:
        return title
    k = min(blanks, key=lambda k: max(k, len(title) - k))
    return f"{title[:k]}\n{title[k + 1 :]}"


def _widest(texts: Sequence[str]) -> float:
    """Return how wide the legend's longest line is with its handle, in inches."""
    return max((style.inches(text, RC["legend.fontsize"]) + 0.55 for text in texts), default=0.0)


def _wrapped(text: str, width: float, *, bold: bool) -> list[str]:
    return textwrap.wrap(text, max(FEWEST, int(width / (BOLD if bold else 0.067))))


def _up(inches: float) -> float:
    return math.ceil(inches * 10 - 1e-9) / 10


def _columns(texts: Sequence[str], room: float) -> int:
    """Return how many columns the legend's lines allow in ``room`` inches."""
    if not texts:
        return 1
    fit = max(1, int(room // _widest(texts)))
    rows = -(-len(texts) // min(fit, len(texts)))
    return -(-len(texts) // rows)
