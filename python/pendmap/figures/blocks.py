"""Blocks of a sheet: places by the inch, headings with legends, axes over many powers of ten."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.ticker import NullFormatter, NullLocator

from pendmap.figures import sheet as sheets
from pendmap.figures import style

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from pendmap.identification import IdentificationReport

__all__ = ["Block", "Box", "log_axis", "named", "say", "signed_log_axis", "wide_axis"]

HEADING: Final = 0.30
"""Inches of a heading."""
ROW: Final = 0.19
"""Inches of a row of a legend."""
TITLE: Final = 0.27
"""Inches that a panel's title takes above it."""
BELOW: Final = 0.46
"""Inches that ticks and the name of an axis take beneath a panel."""
MOST_POWERS: Final = 6
"""Powers of ten that are labelled on one side of an axis."""


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
    """A part of a sheet.

    Parameters
    ----------
    name : str
        As a user types it.
    title : str
        What stands above it.
    height : callable
        Inches that it wants, of a report.
    draw : callable
        Draws a report into a rectangle of a figure; takes letters for its panels.
    """

    name: str
    title: str
    height: Callable[[IdentificationReport], float]
    draw: Callable[[Figure, Box, IdentificationReport, Iterator[str]], None]


def named(
    figure: Figure, box: Box, title: str, handles: Sequence[Any] = (), texts: Sequence[str] = ()
) -> Box:
    """Write a heading with its legend, and return the room that panels have beneath it.

    The margins for ticks and names, and for the titles of the first panels, are taken off too.
    """
    whole = figure.get_size_inches()
    top = box.bottom + box.height
    figure.text(
        (box.left + 0.1) / whole[0], (top - 0.13) / whole[1], title, fontsize=10.5, weight="bold",
        va="center",
    )  # fmt: skip
    used = HEADING
    if texts:
        # A row each for as many columns as fit.
        widest = max(style.inches(text, style.RC["legend.fontsize"]) for text in texts) + 0.55
        columns = max(1, min(len(texts), int((box.width - 0.2) // widest)))
        rows = -(-len(texts) // columns)
        figure.legend(
            list(handles),
            list(texts),
            loc="upper left",
            bbox_to_anchor=((box.left + 0.1) / whole[0], (top - HEADING) / whole[1]),
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


def say(figure: Figure, box: Box, text: str) -> None:
    """Write a line where there is nothing to draw."""
    whole = figure.get_size_inches()
    at = (box.left / whole[0], (box.bottom + box.height) / whole[1])
    figure.text(*at, text, color=style.QUIET, va="top")


def wide_axis(axes: Axes, which: str, values: NDArray[np.float64], name: str) -> None:
    """Give a side the range of values with a margin, ticks and name."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    pad = 0.06 * (high - low) or max(abs(low), 1.0) * 0.05
    (axes.set_xlim if which == "x" else axes.set_ylim)(low - pad, high + pad)
    style.scale(axes, which, (low - pad, high + pad), name)


def log_axis(axes: Axes, which: str, ends: tuple[float, float], name: str) -> None:
    """Give a side powers of ten between its ends, and more ticks where these are close."""
    set_scale, set_ends, axis = (
        (axes.set_xscale, axes.set_xlim, axes.xaxis)
        if which == "x"
        else (axes.set_yscale, axes.set_ylim, axes.yaxis)
    )
    set_scale("log")
    set_ends(*ends)
    first, last = math.ceil(math.log10(ends[0])), math.floor(math.log10(ends[1]))
    if last - first >= 2:  # noqa: PLR2004 (fewer powers than three say little)
        every = (last - first) // MOST_POWERS + 1
        ticks = [10.0**k for k in range(first, last + 1, every)]
    else:
        ticks = style.log_ticks(*ends)
    axis.set_ticks(ticks, [_power(tick) for tick in ticks])
    axis.set_minor_formatter(NullFormatter())
    axes.set_xlabel(name) if which == "x" else axes.set_ylabel(name, labelpad=2)


def signed_log_axis(
    axes: Axes, values: Sequence[NDArray[np.float64]], name: str, *, least: float = 1e-12
) -> None:
    """Give the height powers of ten on both sides of 0, straight around it.

    The straight part holds what is smaller than most of the smallest curve.
    """
    sizes = [np.abs(each[np.isfinite(each) & (each != 0)]) for each in values]
    sizes = [each for each in sizes if each.size]
    if not sizes:
        axes.set_ylim(-1, 1)
        style.scale(axes, "y", (-1, 1), name)
        return
    inner = min(float(np.percentile(each, 50)) for each in sizes)
    outer = max(float(each.max()) for each in sizes)
    first = math.floor(math.log10(max(inner, least)))
    last = max(math.ceil(math.log10(outer * 1.2)), first + 1)
    axes.set_yscale("symlog", linthresh=10.0**first, linscale=0.7)
    below = any(np.any(each < 0) for each in values)
    above = any(np.any(each > 0) for each in values)
    high = outer * 1.6
    low_end = max((float(-np.nanmin(each)) for each in values if each.size), default=0.0)
    high_end = max((float(np.nanmax(each)) for each in values if each.size), default=0.0)
    down = -max(1.6 * low_end, 10.0**first) if below else -0.3 * 10.0**first
    up = min(high, max(1.6 * high_end, 10.0**first)) if above else 0.3 * 10.0**first
    axes.set_ylim(down, up)
    room = axes.get_window_extent().height / axes.figure.dpi
    powers = range(first, last + 1)
    sides = below + above
    every = max(1, math.ceil(len(powers) * sides * 0.26 / max(room, 0.3)))
    chosen = [10.0**k for k in powers if (k - first) % every == 0]
    ticks = [*(-tick for tick in reversed(chosen)), 0.0, *chosen]
    ticks = [tick for tick in ticks if down <= tick <= up]
    axes.yaxis.set_ticks(ticks, [_power(tick) for tick in ticks])
    axes.yaxis.set_minor_locator(NullLocator())
    axes.axhline(0.0, color=style.QUIET, lw=0.6, zorder=0)
    axes.set_ylabel(name, labelpad=2)


def _power(value: float) -> str:
    """Return a tick's label, short for any power of ten."""
    if value == 0:
        return "0"
    sign = "\N{MINUS SIGN}" if value < 0 else ""
    size = abs(value)
    power = math.log10(size)
    if abs(power - round(power)) < 1e-9 and not -3 <= power <= 3:  # noqa: PLR2004
        return f"${sign.replace(chr(0x2212), '-')}10^{{{round(power)}}}$"
    return f"{sign}{size:g}"
