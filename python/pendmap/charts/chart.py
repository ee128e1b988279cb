"""Charts: contents of a figure as arrays and plain values; every renderer draws any chart.

A chart consists of panels, a panel of two axes and marks (:mod:`pendmap.charts.marks`), a sheet
of several charts. No drawing library is imported here.
"""

from __future__ import annotations

import dataclasses
import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from pendmap.charts.marks import QUIET, Text
from pendmap.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from pendmap.charts.marks import Ends, Mark

NARROWEST: Final = 2.6  # Width of a panel with its labels below which a row is broken, inches


@dataclass(frozen=True)
class Axis:
    """One side of a panel.

    ``name`` is symbol and unit, separated by a blank. Without ``ends`` the axis contains the marks.
    With the ``scale`` ``angle`` labels are multiples of pi; ``signed`` is logarithmic beyond
    ``straight`` on both sides of 0. The places of ``ticks``, if given, have their texts.
    """

    name: str = ""
    ends: Ends | None = None
    scale: Literal["plain", "angle", "log", "signed"] = "plain"
    straight: float = 0.0
    ticks: Sequence[tuple[float, str]] | None = None


@dataclass(frozen=True, eq=False)
class Panel:
    """Two axes with the marks between them.

    ``name`` is the name a user types; ``root`` is the path in a recording, by default the name. A
    ``warning`` is written into the panel. ``bare`` panels have no frame.
    """

    name: str
    title: str
    x: Axis
    y: Axis
    marks: Sequence[Mark]
    _: dataclasses.KW_ONLY
    root: str = ""
    warning: str = ""
    bare: bool = False

    @property
    def where(self) -> str:
        """Return the path of the panel in a recording."""
        return self.root or self.name


@dataclass(frozen=True, eq=False)
class Chart:
    """Panels with a title.

    ``rows`` are the rows of panels of a figure, from the top; ``heights`` are their relative
    heights, ``ratio`` the height of a panel over its width, and ``size`` the size of the figure in
    inches, if fixed. A recording shows the panels ``recorded``, by default those of the figure, as
    ``tabs`` or below one another; with a ``timeline``, name and values of a parameter, it steps
    through these, and the last panel is below the tabs. ``notes`` are below the panels.
    """

    title: str
    subtitle: str
    rows: Sequence[Sequence[Panel]]
    _: dataclasses.KW_ONLY
    recorded: Sequence[Panel] = ()
    heights: Sequence[float] = ()
    ratio: float = 0.8
    size: Ends | None = None
    letters: bool = True
    tabs: bool = False
    timeline: tuple[str, npt.NDArray[np.float64]] | None = None
    notes: Sequence[str] = ()

    @property
    def panels(self) -> list[Panel]:
        """Return the panels of a figure, row by row."""
        return [panel for row in self.rows for panel in row]

    def whole(self, panel: Panel) -> Panel:
        """Return a panel with its own labels where it shares those of a panel below it."""
        below = [one.x for one in self.panels if one.x.name and one.x.ends == panel.x.ends]
        return dataclasses.replace(panel, x=below[-1]) if below and not panel.x.name else panel

    def only(self, layer: str | None, size: Ends | None = None) -> Chart:
        """Return the chart with one of its panels alone; unchanged without a name."""
        if layer is None:
            return self
        panel = self.whole(_named([*self.panels, *self.recorded], layer))
        return dataclasses.replace(self, rows=[[panel]], heights=(), notes=(), size=size)

    def in_width(self, width: float) -> Chart:
        """Return the chart with its rows broken where ``width``, inches, is too narrow for them.

        Heights are in inches: those of the figure, smaller by at most 40 percent.
        """
        fit = max(1, int(width // NARROWEST))
        parts = self.heights or [1.0] * len(self.rows)
        if self.size is None:
            high = [self.ratio * (width / min(fit, len(row)) - 0.75) for row in self.rows]
            inches = [part * one + 0.75 for part, one in zip(parts, high, strict=True)]
        else:
            scale = self.size[1] / sum(parts) * min(1.0, max(width / self.size[0], 0.6))
            inches = [scale * part for part in parts]
        rows, heights = [], []
        for row, tall in zip(self.rows, inches, strict=True):
            for k in range(0, len(row), fit):
                rows.append(row[k : k + fit])
                heights.append(tall)
        return dataclasses.replace(self, rows=rows, heights=heights, size=None)


@dataclass(frozen=True, eq=False)
class Sheet:
    """Charts in columns under one title; the title of each chart is its heading.

    One ``legend`` at the top names the marks of all charts; otherwise each chart has its own.
    """

    title: str
    subtitle: str
    columns: Sequence[Sequence[Chart]]
    _: dataclasses.KW_ONLY
    legend: bool = False

    @property
    def charts(self) -> list[Chart]:
        """Return the charts of all columns."""
        return [chart for column in self.columns for chart in column]

    @property
    def panels(self) -> list[Panel]:
        """Return the panels of all charts."""
        return [chart.whole(panel) for chart in self.charts for panel in chart.panels]

    def only(self, layer: str | None) -> Sheet | Chart:
        """Return a chart of the first panel of a name, below its heading; the sheet without one."""
        if layer is None:
            return self
        panel = _named(self.panels, layer)
        mine = next(one for one in self.charts if layer in {item.name for item in one.panels})
        return Chart(self.title, mine.title or self.subtitle, [[panel]])


def _named(panels: Sequence[Panel], layer: str) -> Panel:
    """Return the first panel of a name."""
    for panel in panels:
        if panel.name == layer:
            return panel
    known = dict.fromkeys(panel.name for panel in panels)
    has = f"it has {', '.join(known)}" if len(known) > 1 else "it has one part"
    raise InputError(f"no layer {layer!r} in this figure; {has}")


def bare(name: str, *marks: Mark, high: float = 1.0) -> Panel:
    """Return a panel without a frame, 1 wide and ``high`` from the top down."""
    return Panel(name, "", Axis("", (0.0, 1.0)), Axis("", (high, 0.0)), marks, bare=True)


def nothing(title: str, why: str, letters: int = 90) -> Chart:
    """Return a chart with the reason for an empty figure, in lines of at most ``letters``."""
    why = textwrap.fill(f"{why[:1].upper()}{why[1:].rstrip('.')}.", letters)
    words = Text(0.0, 0.0, why, colour=QUIET, align=("left", "top"))
    return Chart(title, "", [[bare("nothing", words)]], size=(8.6, 0.9))


def holding(*values: npt.ArrayLike, margin: float = 0.06) -> Ends:
    """Return the limits of an axis that contains all finite values, with a margin."""
    every = np.concatenate([np.ravel(np.asarray(one, dtype=float)) for one in values])
    known = every[np.isfinite(every)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    pad = margin * (high - low) or (0.0 if high > low else 0.06 * max(abs(low), 1.0))
    return low - pad, high + pad
