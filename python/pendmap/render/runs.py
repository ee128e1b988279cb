"""The figure of an experiment's records: a panel a run, measured angle against time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pendmap.charts import names, plane
from pendmap.render import sheet as sheets
from pendmap.render import style
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = npt.NDArray[np.float64]

PANEL = (3.9, 1.05)
"""Width and height of a panel in inches."""

GAP = (0.75, 0.82)
"""Inches between panels, beside and below one another."""

FEW = 20
"""Runs up to which two columns are enough."""

BINS = 10_000
"""Pieces of a panel of which least and greatest angle are drawn, where there are more samples."""

LOST = 1.5
"""Samples apart, in the usual distance, from which on nothing is drawn between two."""

_COLOUR = "#1d3557"


@dataclass(frozen=True)
class RunPanel:
    """One run as it was measured.

    Attributes
    ----------
    title : str
        What stands above its panel.
    time, angle : ndarray, shape (n,)
        Time since the run began in s, measured angle in rad, not wrapped.
    """

    title: str
    time: Floats
    angle: Floats


def figure(records: Sequence[RunPanel], *, title: str, subtitle: str, dpi: float) -> Figure:
    """Return the figure of one record or more; see :func:`pendmap.render.draw_runs`."""
    columns = min(len(records), 2 if len(records) <= FEW else 3)
    rows = -(-len(records) // columns)
    wide = PANEL[0] * (2 if columns == 1 else 1)
    high = PANEL[1] * (2 if rows == 1 else 1)
    left = sheets.LEFT + 0.05
    across = left + columns * wide + (columns - 1) * GAP[0] + sheets.RIGHT
    down = sheets.TOP + rows * high + (rows - 1) * GAP[1] + sheets.BOTTOM
    made = sheets.headed((across, down), dpi, title, subtitle, left=left)
    for k, record in enumerate(records):
        row, column = divmod(k, columns)
        x = left + column * (wide + GAP[0])
        y = down - sheets.TOP - (row + 1) * high - row * GAP[1]
        _draw(sheets.place(made, x, y, wide, high), record)
    return made


def _draw(axes: Axes, record: RunPanel) -> None:
    axes.plot(*_curve(record), color=_COLOUR, lw=0.7)
    begin, end = float(record.time[0]), float(record.time[-1])
    axes.set_xlim(begin, max(end, begin + 1e-3))
    axes.set_ylim(*plane.padded(record.angle))
    style.scale(axes, "x", axes.get_xlim(), names.clock(Units(si=True)))
    style.scale(axes, "y", axes.get_ylim(), names.ANGLE, angle=True)
    size = style.RC["xtick.labelsize"]
    room = axes.get_window_extent().width / axes.figure.dpi
    axes.set_title(record.title, fontsize=size * min(1.0, room / style.inches(record.title, size)))


def _curve(record: RunPanel) -> tuple[Floats, Floats]:
    """Return the line of a record: broken where samples are lost, thinned where there are many."""
    time, angle = record.time, record.angle
    if time.size > 2 * BINS:
        begins = np.linspace(0, time.size, BINS, endpoint=False).astype(int)
        ends = (np.minimum.reduceat(angle, begins), np.maximum.reduceat(angle, begins))
        return np.repeat(time[begins], 2), np.stack(ends, axis=1).ravel()
    steps = np.diff(time)
    usual = float(np.median(steps)) if steps.size else math.inf
    lost = np.flatnonzero(steps > LOST * usual) + 1
    return np.insert(time, lost, np.nan), np.insert(angle, lost, np.nan)
