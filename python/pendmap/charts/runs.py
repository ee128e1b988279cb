"""Chart of the records of several runs: one panel per run, measured angle against time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.charts import names, plane
from pendmap.charts.chart import Axis, Chart, Panel
from pendmap.charts.marks import Line
from pendmap.errors import InputError
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.charts.marks import Floats

COLUMNS: Final = 20  # Number of runs above which there are three columns instead of two
BINS: Final = 10_000
"""Bins of a panel, drawn by their least and greatest angle if there are more samples."""
LOST: Final = 1.5
"""Distance of two samples, over the median, above which the line between them is broken."""
_COLOUR: Final = "#1d3557"


@dataclass(frozen=True)
class RunPanel:
    """Measured angle of one run.

    Attributes
    ----------
    title : str
        Title of the panel.
    time, angle : ndarray, shape (n,)
        Time since the run began in s, measured angle in rad, not wrapped.
    """

    title: str
    time: Floats
    angle: Floats


def of_runs(runs: Sequence[RunPanel], *, title: str, subtitle: str) -> Chart:
    """Return one panel per run, measured angle against time; InputError without any."""
    if not runs:
        raise InputError("runs must hold one record or more, got []")
    columns = min(len(runs), 2 if len(runs) <= COLUMNS else 3)
    panels = []
    for run in runs:
        begin, end = float(run.time[0]), float(run.time[-1])
        clock = Axis(names.clock(Units(si=True)), (begin, max(end, begin + 1e-3)))
        up = Axis(names.ANGLE, plane.padded(run.angle), "angle")
        line = Line(*_curve(run), colour=_COLOUR, width=0.7)
        panels.append(Panel("run", run.title, clock, up, [line]))
    grid = [panels[k : k + columns] for k in range(0, len(runs), columns)]
    size = (8.6, 3.4) if columns == 1 else (0.3 + 4.65 * columns, 0.9 + 1.85 * len(grid))
    return Chart(title, subtitle, grid, columns=columns, size=size, letters=False)


def _curve(run: RunPanel) -> tuple[Floats, Floats]:
    """Return the line of a record: broken at lost samples, thinned if it has many."""
    time, theta = run.time, run.angle
    if time.size > 2 * BINS:
        return plane.envelope(time, theta, BINS)
    steps = np.diff(time)
    usual = float(np.median(steps)) if steps.size else math.inf
    lost = np.flatnonzero(steps > LOST * usual) + 1
    return np.insert(time, lost, np.nan), np.insert(theta, lost, np.nan)
