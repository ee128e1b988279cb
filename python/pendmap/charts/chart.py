"""Charts: what a picture shows, as arrays and plain values; every renderer draws any chart.

A chart has panels, a panel two axes and marks (:mod:`pendmap.charts.marks`), a sheet several
charts. No drawing library is imported here.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from pendmap.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from pendmap.charts.marks import Ends, Mark


@dataclass(frozen=True)
class Axis:
    """One side of a panel.

    ``name`` is symbol and unit, a blank between them. Without ``ends`` a side holds the marks.
    ``scale`` ``angle`` has multiples of pi as labels, ``signed`` is logarithmic beyond
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
    """Two axes and what stands between them.

    ``name`` is what a user types for it; ``root`` is where a recording has it, by default the name.
    ``share`` is its size beside the others of its row; a ``note``, pairs of text and colour, stands
    beneath one that is smaller. ``bare`` panels have no frame.
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
        """Return where a recording has it."""
        return self.root or self.name


@dataclass(frozen=True, eq=False)
class Chart:
    """Panels with a title.

    ``rows`` are the names of the panels that a figure shows, from the top, by default all in one;
    ``heights`` are the shares of the rows, ``ratio`` the height of a panel over its width, and
    ``size`` the inches of the figure where it has a size. Rows of fewer panels than ``columns``
    are not filled. A recording shows all panels: one at a time as ``tabs``, or below one another;
    ``remark`` ends its legend.
    """

    title: str
    subtitle: str
    panels: Sequence[Panel]
    _: dataclasses.KW_ONLY
    rows: Sequence[Sequence[str]] = ()
    heights: Sequence[float] = ()
    ratio: float = 0.8
    size: Ends | None = None
    columns: int = 0
    letters: bool = True
    tabs: bool = False
    remark: str = ""
    notes: Sequence[str] = ()

    @classmethod
    def of(
        cls,
        title: str,
        subtitle: str,
        rows: Sequence[Sequence[Panel]],
        **look: Any,  # noqa: ANN401 (fields of a chart)
    ) -> Chart:
        """Return a chart of which a figure shows these rows of panels."""
        names = [[panel.name for panel in row] for row in rows]
        return cls(title, subtitle, [panel for row in rows for panel in row], rows=names, **look)

    def panel(self, name: str) -> Panel:
        """Return the panel of a name."""
        return next(panel for panel in self.panels if panel.name == name)

    @property
    def shown(self) -> list[list[Panel]]:
        """Return the rows of a figure."""
        if not self.rows:
            return [list(self.panels)]
        return [[self.panel(name) for name in row] for row in self.rows]

    def only(self, layer: str | None, size: Ends | None = None) -> Chart:
        """Return the chart with one of its panels alone, all of it without a name."""
        if layer is None:
            return self
        known = [panel.name for row in self.shown for panel in row]
        if layer not in known:
            if len(known) == 1:
                raise InputError(f"no layer {layer!r}: this figure has one part")
            raise InputError(f"no layer {layer!r} in this figure; it has {', '.join(known)}")
        return dataclasses.replace(self, rows=((layer,),), heights=(), size=size)


@dataclass(frozen=True, eq=False)
class Sheet:
    """Charts in columns under one title: the title of each is a heading, its size in inches.

    One ``legend`` at the top names the marks of all charts; else each chart has its own.
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
    """Return the ends of an axis that holds the values that are numbers, with a margin."""
    every = np.concatenate([np.ravel(np.asarray(each, dtype=float)) for each in values])
    known = every[np.isfinite(every)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    pad = margin * (high - low) or (0.0 if high > low else 0.06 * max(abs(low), 1.0))
    return low - pad, high + pad
