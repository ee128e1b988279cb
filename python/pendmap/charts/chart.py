"""Charts: contents of a figure as arrays and plain values; every renderer draws any chart.

A chart consists of panels, a panel of two axes and marks (:mod:`pendmap.charts.marks`), a sheet
of several charts. No drawing library is imported here.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from pendmap.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from pendmap.charts.marks import Ends, Mark


@dataclass(frozen=True)
class Axis:
    """One side of a panel.

    ``name`` is symbol and unit, separated by a blank. Without ``ends`` the axis contains the marks.
    With the ``scale`` ``angle`` labels are multiples of pi; ``signed`` is logarithmic beyond
    ``straight`` on both sides of 0. Labels are values times ``factor``, or else ``ticks``.
    """

    name: str = ""
    ends: Ends | None = None
    scale: Literal["plain", "angle", "log", "signed"] = "plain"
    straight: float = 0.0
    factor: float = 1.0
    ticks: Sequence[tuple[float, str]] | None = None


@dataclass(frozen=True, eq=False)
class Panel:
    """Two axes with the marks between them.

    ``name`` is the name a user types; ``root`` is the path in a recording, by default the name.
    ``share`` is the size relative to the others of its row; a ``note``, pairs of text and colour,
    is written below a smaller one. ``bare`` panels have no frame.
    """

    name: str
    title: str
    x: Axis
    y: Axis
    marks: Sequence[Mark]
    _: dataclasses.KW_ONLY
    root: str = ""
    share: float = 1.0
    note: Sequence[tuple[str, str]] = ()
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
    inches, if fixed. Rows of fewer panels than ``columns`` are not filled. A recording shows the
    panels ``recorded``, by default those of the figure, as ``tabs`` or below one another;
    ``remark`` ends its legend.
    """

    title: str
    subtitle: str
    rows: Sequence[Sequence[Panel]]
    _: dataclasses.KW_ONLY
    recorded: Sequence[Panel] = ()
    heights: Sequence[float] = ()
    ratio: float = 0.8
    size: Ends | None = None
    columns: int = 0
    letters: bool = True
    tabs: bool = False
    remark: str = ""
    notes: Sequence[str] = ()

    @property
    def panels(self) -> list[Panel]:
        """Return the panels of a figure, row by row."""
        return [panel for row in self.rows for panel in row]

    def only(self, layer: str | None, size: Ends | None = None) -> Chart:
        """Return the chart with one of its panels alone; unchanged without a name."""
        if layer is None:
            return self
        known = {panel.name: panel for panel in self.panels}
        if layer not in known:
            if len(known) == 1:
                raise InputError(f"no layer {layer!r}: this figure has one part")
            raise InputError(f"no layer {layer!r} in this figure; it has {', '.join(known)}")
        return dataclasses.replace(self, rows=[[known[layer]]], heights=(), size=size)


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


def bare(name: str, *marks: Mark, high: float = 1.0) -> Panel:
    """Return a panel without a frame, 1 wide and ``high`` from the top down."""
    return Panel(name, "", Axis("", (0.0, 1.0)), Axis("", (high, 0.0)), marks, bare=True)


def holding(*values: npt.ArrayLike, margin: float = 0.06) -> Ends:
    """Return the limits of an axis that contains all finite values, with a margin."""
    every = np.concatenate([np.ravel(np.asarray(each, dtype=float)) for each in values])
    known = every[np.isfinite(every)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    pad = margin * (high - low) or (0.0 if high > low else 0.06 * max(abs(low), 1.0))
    return low - pad, high + pad
