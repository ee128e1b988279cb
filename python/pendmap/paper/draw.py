"""Figures of the paper that are of no dataset: 1, 2, 3, 8 and 9."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pendmap.charts import names, plane, tongues
from pendmap.charts.chart import Axis, Chart, Line, Panel, Points, holding
from pendmap.render import drawing
from pendmap.render.written import written
from pendmap.units import Units

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence
    from pathlib import Path

    import xarray as xr

    from pendmap.comparison import ForcedComparison


def draw_tongues(
    dataset: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    title: str,
    marks: Sequence[tuple[float, float, str]] = (),
) -> Path:
    """Draw critical curves with points marked, ``(p, omega, name)``, into a file: figure 1."""
    chart = tongues.chart(dataset, title=title, marks=marks)
    return written(path, lambda dpi: drawing.draw(chart, dpi=dpi))


def draw_tumbling(
    runs: Sequence[xr.Dataset],
    path: str | os.PathLike[str],
    *,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
    title: str | None = None,
) -> Path:
    """Draw time history, phase plane and Poincare section of trajectories, a column each: figure 2.

    Trajectories are shown from their first instant.
    """
    chart = tumbling_chart(runs, title)
    return written(path, lambda dpi: drawing.draw(chart, size=size, dpi=dpi), size=size, dpi=dpi)


def draw_pendulum(
    path: str | os.PathLike[str],
    *,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
    title: str | None = None,
) -> Path:
    """Draw the pendulum with its moving pivot and its equation (eq. 2.1) into a file: figure 3.

    Parameters, result and errors are those of :func:`pendmap.render.draw_record`; ``title`` stands
    above, by default what is drawn.
    """
    from pendmap.paper import drawings  # noqa: PLC0415 (likewise)

    return written(
        path, lambda dpi: drawings.figure(size=size, dpi=dpi, title=title), size=size, dpi=dpi
    )


def draw_motions(  # noqa: PLR0913 (what, where, and how)
    runs: Sequence[ForcedComparison],
    path: str | os.PathLike[str],
    *,
    steady: bool,
    title: str,
    subtitle: str,
    dpi: float | None = None,
) -> Path:
    """Draw forced runs beside a model: the paper's figures 8 (steady states) and 9 (tumbling).

    Steady states have a phase plane each; runs that tumble have a row each: histories and phase
    planes of the record and of a member of the ensemble, and the statistics.
    """
    from pendmap.paper import drawings  # noqa: PLC0415 (likewise)

    make = drawings.steady_figure if steady else drawings.tumbling_figure
    return written(path, lambda dpi: make(runs, dpi=dpi, title=title, subtitle=subtitle), dpi=dpi)


HISTORY, CURVE = 60, 100
"""Periods of the time history and of the phase curve, the first ones."""

_INK = "#1d3557"


def tumbling_chart(runs: Sequence[xr.Dataset], title: str | None) -> Chart:
    """Return the chart of figure 2."""
    gammas = sorted({float(run.attrs["gamma"]) for run in runs})
    damping = ", ".join(f"{gamma:g}" for gamma in gammas)
    periods, points = (min(run.sizes["period"] for run in runs), CURVE), runs[0].sizes["period"]
    shared = (
        f"\N{GREEK SMALL LETTER GAMMA} = {damping};   time history, phase plane ({min(periods)} "
        f"periods), Poincar\N{LATIN SMALL LETTER E WITH ACUTE} section ({points} points)"
    )
    columns = [_column(run, k) for k, run in enumerate(runs)]
    return Chart(
        title or "Trajectories",
        shared,
        [panel for column in columns for panel in column],
        rows=[[column[row].name for column in columns] for row in range(3)],
        heights=(0.7, 1.0, 1.0),
        size=(0.6 + 3.1 * len(runs), 9.0),
    )


def _column(run: xr.Dataset, k: int) -> list[Panel]:
    """Return time history, phase plane and section of a trajectory."""
    attrs, units = run.attrs, Units.of(run.attrs)
    point = f"p = {attrs['p']:g}, \N{GREEK SMALL LETTER OMEGA} = {attrs['omega']:g}"
    part, whole = _first(run, HISTORY), _first(run, CURVE)
    time, theta = part["time"].values, part["theta"].values
    clock = Axis(names.clock(units), (float(time[0]), float(time[-1])))
    history = Line(time, theta, colour=_INK, width=0.8)
    curve = plane.broken_at_wrap(whole["theta"].values, whole["velocity"].values)
    sides = names.phase_plane((-math.pi, math.pi), plane.padded(run["velocity"].values), units)
    section = run["section_theta"].values, run["section_velocity"].values
    up = Axis(names.ANGLE, holding(theta), "angle")
    return [
        Panel(f"history {k}", point, clock, up, [history]),
        Panel(f"phase {k}", "", *sides, [Line(*curve.T, colour=_INK, width=0.35)]),
        Panel(f"section {k}", "", *sides, [Points(*section, colour=_INK, size=0.8)]),
    ]


def _first(run: xr.Dataset, periods: int) -> xr.Dataset:
    """Return the first periods of a trajectory."""
    last = run["section_time"].values[min(periods, run.sizes["period"] - 1)]
    return run.sel(time=slice(None, last))
