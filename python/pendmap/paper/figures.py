"""The figures and table 1 of the paper by their numbers, on a virtual rig like the paper's."""

from __future__ import annotations

import functools
import math
import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from pendmap.charts import names, plane
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.marks import Line, Points
from pendmap.errors import InputError
from pendmap.files import facts, whole_file
from pendmap.files.toml import packaged
from pendmap.units import Units

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    import xarray as xr

    from pendmap.identification import IdentificationReport

TABLE: Final = "table1"
_TABLES: Final = packaged("paper/figures.toml")
FIGURES: Final[dict[str, str]] = _TABLES["titles"]
"""Titles of the figures, by the names a user types."""
HISTORY, CURVE = 60, 100  # Periods of time history and phase curve of figure 2, the first ones
_INK = "#1d3557"
_TRANSIENT: Final = 500  # Forcing periods before figure 2 begins
_RIG: Final = "virtual rig like the paper's: w0 6.2 rad/s, c/m 0.0496 1/s, Tr 0.08 rad/s²"
_PARTS: Final = {"4": "record", "5": "decrement", "6": "decay", "7": "errors", TABLE: "table"}

_PRINTED_HEAD: Final = ("period 0.26 s", "period 1.54 s", "peak 1.2 rad", "peak 2.53 rad")
_SQUARES: Final = (0.05, 1.6)  # Range of alpha^2 of figure 1
_HIGHEST: Final = 18.0  # Largest p of figure 1; no curve of its plane lies above
_COLUMNS: Final = 120  # Number of frequencies of figure 1


def wanted(name: str) -> list[str]:
    """Return the keys of :data:`FIGURES` for a name like ``4``, ``figure 4`` or ``all``."""
    key = re.sub(r"[\s_.-]+|^fig(ure)?(?=[\s_.-]*\d)", "", name.lower())
    if key in FIGURES or key == "all":
        return list(FIGURES) if key == "all" else [key]
    there = f"{', '.join(key for key in FIGURES if key != TABLE)}, {TABLE} and all"
    raise InputError(f"figure must be one of the paper's ({there}), got {name!r}")


@functools.lru_cache(maxsize=1)
def report(seed: int = 0) -> IdentificationReport:
    """Return the damping identified from the virtual rig's record, written and read as a file."""
    from pendmap.identification import identify  # noqa: PLC0415
    from pendmap.records import read_experiment  # noqa: PLC0415
    from pendmap.virtual_rig import paper_decay  # noqa: PLC0415

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "virtual_rig.csv"
        columns = np.column_stack(paper_decay(seed))
        np.savetxt(path, columns, "%.12g", ",", header="t_s,theta_rad", comments="")
        return identify(read_experiment(path))


def tumbling(periods: int = 6000) -> list[xr.Dataset]:
    """Return trajectories from 1 rad at rest at the paper's three points of tumbling chaos."""
    from pendmap.analysis.trajectory import simulate  # noqa: PLC0415
    from pendmap.model import PRESETS  # noqa: PLC0415 (likewise)

    runs = []
    for name in ("fig2a", "fig2b", "fig2c"):
        pendulum, samples = PRESETS[name], 48
        run = simulate(pendulum, 1.0, 0.0, periods * pendulum.period, tol=1e-7, samples=samples)
        after = {"time": slice(_TRANSIENT * samples, None), "period": slice(_TRANSIENT, None)}
        runs.append(run.isel(after))
    return runs


def tumbling_chart(runs: Sequence[xr.Dataset], title: str | None = None) -> Chart:
    """Return time history, phase plane and Poincare section of trajectories, one a column."""
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
    time, theta = part["time"].to_numpy(), part["theta"].to_numpy()
    clock = Axis(names.clock(units), (float(time[0]), float(time[-1])))
    history = Line(time, theta, colour=_INK, width=0.8)
    curve = plane.broken_at_wrap(whole["theta"].to_numpy(), whole["velocity"].to_numpy())
    sides = names.phase_plane((-math.pi, math.pi), holding(run["velocity"].to_numpy()), units)
    section = run["section_theta"].to_numpy(), run["section_velocity"].to_numpy()
    up = Axis(names.ANGLE, holding(theta), "angle")
    return [
        Panel(f"history {k}", point, clock, up, [history]),
        Panel(f"phase {k}", "", *sides, [Line(*curve.T, colour=_INK, width=0.35)]),
        Panel(f"section {k}", "", *sides, [Points(*section, colour=_INK, size=0.8)]),
    ]


def _first(run: xr.Dataset, periods: int) -> xr.Dataset:
    """Return the first periods of a trajectory."""
    last = run["section_time"].to_numpy()[min(periods, run.sizes["period"] - 1)]
    return run.sel(time=slice(None, last))


def draw(key: str, path: str | os.PathLike[str], *, seed: int = 0) -> Path:
    """Draw a figure, or the table, into a .png, .svg or .pdf.

    Parameters
    ----------
    seed : int
        Draws the rig's noise.
    """
    import pendmap  # noqa: PLC0415
    from pendmap import render  # noqa: PLC0415
    from pendmap.charts import comparison, identification, tongues  # noqa: PLC0415
    from pendmap.model import PRESETS  # noqa: PLC0415
    from pendmap.paper import motions, pendulum  # noqa: PLC0415

    if key == "all":
        raise InputError("key must be one figure, got 'all'")
    (key,) = wanted(key)
    number = "Table 1" if key == TABLE else f"Figure {key}"
    title = f"{number}: {FIGURES[key][0].lower()}{FIGURES[key][1:]}"
    if key == "1":
        marks = [(one.p, one.omega, name[-1]) for name, one in sorted(PRESETS.items())]
        omega = 1 / np.sqrt(np.linspace(*_SQUARES, _COLUMNS)[::-1])
        rests = pendmap.tongues(PRESETS["fig2a"], omega, _HIGHEST)
        return render.draw(tongues.chart(rests, layer="e-alpha2", title=title, marks=marks), path)
    if key == "2":
        return render.draw(tumbling_chart(tumbling(), title), path)
    if key == "3":
        return render.draw(pendulum.chart(title), path)
    if key in ("8", "9"):
        make = motions.steady_states if key == "8" else motions.tumbling
        runs = make(report(seed).methods["combined_repaired"].rig, seed)
        subtitle = f"{_RIG};   model by the combined method, repaired; seed {seed}"
        chart = comparison.steady if key == "8" else comparison.tumbling
        return render.draw(chart(runs, title, subtitle), path)
    subtitle = f"{_RIG}, release at 3.0 rad, 100 Hz;   4096 counts, noise 0.1°, zero off by 0.05°"
    words = {"title": title, "subtitle": f"{subtitle}, seed {seed}"}
    return render.draw(identification.whole(report(seed), parts=(_PARTS[key],), **words), path)


def printed_table() -> tuple[list[str], list[list[str]]]:
    """Return table 1 as printed in the paper, header and rows."""
    rows = [[name, *(f"{x:g} %" for x in row)] for name, row in _TABLES["printed"].items()]
    return ["the paper's own", *_PRINTED_HEAD], rows


def write_table(report: IdentificationReport, path: str | os.PathLike[str]) -> Path:
    """Write table 1 as CSV, in percent; a cell is empty if the simulation is at rest by then."""
    methods = [name for name, method in report.methods.items() if method.applicable]
    table = pd.DataFrame(
        {"what": row.what, "measured": row.measured, "unit": "s" if row.what == "period" else "rad"}
        | {f"{name}_percent": row.errors.get(name) for name in methods}
        for row in report.table.rows
    )
    with whole_file(path, [".csv"]) as part:
        table.to_csv(part, index=False, lineterminator="\n")
    return Path(path)
