"""Blocks of a sheet: places by the inch, headings with legends."""

from __future__ import annotations

import dataclasses
import textwrap
from typing import TYPE_CHECKING, Any, Final

from pendmap.render import sheet as sheets
from pendmap.render import style

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pendmap.identification import IdentificationReport

HEADING: Final = 0.30
"""Inches of a heading."""
ROW: Final = 0.19
"""Inches of a row of a legend."""
TITLE: Final = 0.27
"""Inches that a panel's title takes above it."""
BELOW: Final = 0.46
"""Inches that ticks and the name of an axis take beneath a panel."""
NOISE_SAID: Final = "95 % of the readings' noise"


@dataclasses.dataclass(frozen=True)
class Box:
    """A rectangle of a sheet, inches from its lower left corner."""

    left: float
    bottom: float
    width: float
    height: float

    def less(
        self, *, left: float = 0.0, right: float = 0.0, top: float = 0.0, bottom: float = 0.0
    ) -> Box:
        """Return the rectangle without margins."""
        width, height = self.width - left - right, self.height - top - bottom
        return Box(self.left + left, self.bottom + bottom, width, height)

    def rows(self, shares: Sequence[float], gaps: Sequence[float]) -> list[Box]:
        """Return rows from the top: gaps in inches between them, the rest by shares."""
        unit = (self.height - sum(gaps)) / sum(shares)
        result, top = [], self.bottom + self.height
        for share, gap in zip(shares, [*gaps, 0.0], strict=True):
            high = share * unit
            result.append(Box(self.left, top - high, self.width, high))
            top -= high + gap
        return result

    def columns(self, count: int, gap: float) -> list[Box]:
        """Return columns of equal width from the left."""
        wide = (self.width - gap * (count - 1)) / count
        return [
            Box(self.left + k * (wide + gap), self.bottom, wide, self.height) for k in range(count)
        ]

    def panel(self, figure: Figure) -> Axes:
        """Return axes that fill the rectangle."""
        return sheets.place(figure, self.left, self.bottom, self.width, self.height)


@dataclasses.dataclass(frozen=True)
class Block:
    """A part of a sheet: its name as a user types it, its title, the inches that it wants.

    ``draw`` draws a report into a rectangle of a figure; it takes letters for its panels, and the
    title or nothing.
    """

    name: str
    title: str
    height: Callable[[IdentificationReport], float]
    draw: Callable[[Figure, Box, IdentificationReport, Iterator[str], str], None]


def named(
    figure: Figure, box: Box, title: str, handles: Sequence[Any] = (), texts: Sequence[str] = ()
) -> Box:
    """Write a heading with its legend, and return the room that panels have beneath it.

    The margins for ticks and names, and for the titles of the first panels, are taken off too.
    """
    whole = figure.get_size_inches()
    top = box.bottom + box.height
    figure.text(
        (box.left + 0.1) / whole[0],
        (top - 0.13) / whole[1],
        title,
        fontsize=10.5,
        weight="bold",
        va="center",
    )
    used = HEADING if title else 0.08
    if texts:
        # A row each for as many columns as fit.
        widest = max(style.inches(text, style.RC["legend.fontsize"]) for text in texts) + 0.55
        columns = max(1, min(len(texts), int((box.width - 0.2) // widest)))
        rows = -(-len(texts) // columns)
        figure.legend(
            list(handles),
            list(texts),
            loc="upper left",
            bbox_to_anchor=((box.left + 0.1) / whole[0], (top - used) / whole[1]),
            ncols=-(-len(texts) // rows),
            borderpad=0.0,
            borderaxespad=0.0,
            handlelength=1.9,
            handletextpad=0.5,
            columnspacing=1.3,
            labelspacing=0.35,
        )
        used += ROW * rows + 0.05
    return box.less(left=sheets.LEFT + 0.06, right=0.16, top=used + TITLE, bottom=BELOW)


def sentence(text: str, width: int = 90) -> str:
    """Return words as a sentence, on lines of at most ``width`` characters."""
    return textwrap.fill(f"{text[:1].upper()}{text[1:]}.", width)


def say(figure: Figure, box: Box, text: str) -> None:
    """Write a line where there is nothing to draw."""
    whole = figure.get_size_inches()
    at = (box.left / whole[0], (box.bottom + box.height) / whole[1])
    figure.text(*at, text, color=style.QUIET, va="top")
