"""Chart of tumbling trajectories, one a column (figure 2)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pendmap.charts import names, plane
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.marks import Line, Points
from pendmap.files import facts
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr


HISTORY, CURVE = 60, 100  # Periods of the time history and of the phase curve, the first ones

_INK = "#1d3557"


def chart(runs: Sequence[xr.Dataset], title: str | None = None) -> Chart:
    """Return time history, phase plane and Poincare section, from the first instant."""
    gammas = sorted({float(run["gamma"]) for run in runs})
    damping = ", ".join(f"{gamma:g}" for gamma in gammas)
    periods, points = (min(run.sizes["period"] for run in runs), CURVE), runs[0].sizes["period"]
    shared = (
        f"γ = {damping};   time history, phase plane ({min(periods)} "
        f"periods), Poincaré section ({points} points)"
    )
    rows = list(zip(*(_column(run, k) for k, run in enumerate(runs)), strict=True))
    size = (0.6 + 3.1 * len(runs), 9.0)
    return Chart(title or "Trajectories", shared, rows, heights=(0.7, 1.0, 1.0), size=size)


def _column(run: xr.Dataset, k: int) -> list[Panel]:
    """Return time history, phase plane and section of a trajectory."""
    attrs = facts(run)
    units = Units.of(attrs)
    point = f"p = {attrs['p']:g}, ω = {attrs['omega']:g}"
    part, whole = _first(run, HISTORY), _first(run, CURVE)
    time, theta = part["time"].values, part["theta"].values
    clock = Axis(names.clock(units), (float(time[0]), float(time[-1])))
    history = Line(time, theta, colour=_INK, width=0.8)
    curve = plane.broken_at_wrap(whole["theta"].values, whole["velocity"].values)
    sides = names.phase_plane((-math.pi, math.pi), holding(run["velocity"].values), units)
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
