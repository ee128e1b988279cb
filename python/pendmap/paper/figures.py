"""The figures and table 1 of the paper by their numbers, on a virtual rig like the paper's."""

from __future__ import annotations

import csv
import functools
import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError
from pendmap.files import whole_file

if TYPE_CHECKING:
    import os

    import xarray as xr

    from pendmap.identification import IdentificationReport

TABLE: Final = "table1"
FIGURES: Final = {
    "1": "Critical curves; strange attractors a, b and c",
    "2": "Tumbling chaos",
    "3": "The parametric pendulum",
    "4": "A decay, its velocity and half cycles",
    "5": "The decrement of each three peaks",
    "6": "The decay by each model",
    "7": "The errors of each model",
    "8": "Steady states after 2500 s",
    "9": "Transient tumbling",
    TABLE: "Damping by each method, and the errors of its simulation (%)",
}
"""Titles of the figures, by the names a user types."""
_TRANSIENT: Final = 500  # Forcing periods before figure 2 begins
_RIG: Final = "virtual rig like the paper's: w0 6.2 rad/s, c/m 0.0496 1/s, Tr 0.08 rad/s²"
_PARTS: Final = {"4": "record", "5": "decrement", "6": "decay", "7": "errors", TABLE: "table"}

PRINTED: Final = {
    "combined": (7.31, 7.18, 0.0, 1.58),
    "log_decrement": (16.95, 17.46, 4.35, 6.04),
    "de_paula": (64.81, 41.58, 9.17, 13.29),
}
"""The paper's table 1, percent: periods of 0.26 s and 1.54 s, peaks of 1.2 rad and 2.53 rad."""
_PRINTED_HEAD: Final = ("period 0.26 s", "period 1.54 s", "peak 1.2 rad", "peak 2.53 rad")

_SQUARES: Final = (0.05, 1.6)  # Range of alpha^2 of figure 1
_HIGHEST: Final = 2.6  # Largest e of figure 1
_COLUMNS: Final = 120  # Number of frequencies of figure 1


def wanted(name: str) -> list[str]:
    """Return the keys of :data:`FIGURES` for a name like ``4``, ``figure 4`` or ``all``."""
    text = re.sub(r"[\s_.-]+", "", name.lower())
    text = re.sub(r"^(figure|fig)(?=\d)", "", text)
    if text == "all":
        return list(FIGURES)
    if text in FIGURES:
        return [text]
    there = f"{', '.join(key for key in FIGURES if key != TABLE)}, {TABLE} and all"
    raise InputError(f"figure must be one of the paper's ({there}), got {name!r}")


@functools.lru_cache(maxsize=1)
def report(seed: int = 0) -> IdentificationReport:
    """Return the damping identified from the virtual rig's record, written and read as a file."""
    import numpy as np  # noqa: PLC0415 (names are checked without it)

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


def draw(key: str, path: str | os.PathLike[str], *, seed: int = 0) -> Path:
    """Draw a figure, or the table, into a .png, .svg or .pdf.

    Parameters
    ----------
    seed : int
        Draws the rig's noise.
    """
    from pendmap import render  # noqa: PLC0415
    from pendmap.charts import comparison, identification, tongues  # noqa: PLC0415
    from pendmap.model import PRESETS  # noqa: PLC0415
    from pendmap.paper import motions, pendulum  # noqa: PLC0415
    from pendmap.paper import tumbling as chaos  # noqa: PLC0415

    (key,) = wanted(key) if key != "all" else ("all",)
    if key not in FIGURES:
        raise InputError(f"key must be one figure, got {key!r}")
    number = "Table 1" if key == TABLE else f"Figure {key}"
    title = f"{number}: {FIGURES[key][0].lower()}{FIGURES[key][1:]}"
    if key == "1":
        marks = [(one.p, one.omega, name[-1]) for name, one in sorted(PRESETS.items())]
        return render.draw(tongues.chart(_critical(), title=title, marks=marks), path)
    if key == "2":
        return render.draw(chaos.chart(tumbling(), title), path)
    if key == "3":
        return render.draw(pendulum.chart(title=title), path)
    if key in ("8", "9"):
        make = motions.steady_states if key == "8" else motions.tumbling
        runs = make(report(seed).methods["combined_repaired"].rig, seed)
        subtitle = f"{_RIG};   model by the combined method, repaired; seed {seed}"
        chart = comparison.steady if key == "8" else comparison.tumbling
        return render.draw(chart(runs, title, subtitle), path)
    subtitle = (
        f"{_RIG}, release at 3.0 rad, 100 Hz;   4096 counts, noise 0.1°, zero off by 0.05°, "
        f"seed {seed}"
    )
    parts = (_PARTS[key],)
    sheet = identification.sheet(report(seed), parts=parts, title=title, subtitle=subtitle)
    return render.draw(sheet, path)


def _critical() -> xr.Dataset:
    """Return the critical curves of figure 1: alpha^2 up to 1.6, e up to 2.6."""
    import numpy as np  # noqa: PLC0415

    from pendmap.analysis.tongues import tongues  # noqa: PLC0415
    from pendmap.model import Pendulum  # noqa: PLC0415

    omega = 1 / np.sqrt(np.linspace(*_SQUARES, _COLUMNS)[::-1])
    p_max, plane = _HIGHEST / _SQUARES[0], "e-alpha2"
    return tongues(Pendulum(gamma=0.1), omega, p_max, plane=plane, inverted=False, refine=True)


def printed_table() -> tuple[list[str], list[list[str]]]:
    """Return table 1 as printed in the paper, header and rows."""
    rows = [[name, *(f"{x:g} %" for x in row)] for name, row in PRINTED.items()]
    return ["the paper's own", *_PRINTED_HEAD], rows


def write_table(found: IdentificationReport, path: str | os.PathLike[str]) -> Path:
    """Write table 1 as CSV, in percent; a cell is empty if the simulation is at rest by then."""
    names = [name for name, each in found.methods.items() if each.applicable]
    with (
        whole_file(path, [".csv"]) as part,
        part.open("w", encoding="utf-8", newline="") as file,
    ):
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["what", "measured", "unit", *(f"{name}_percent" for name in names)])
        for row in found.table.rows:
            errors = [row.errors.get(name, float("nan")) for name in names]
            cells = ["" if error != error else repr(float(error)) for error in errors]  # noqa: PLR0124
            unit = "s" if row.what == "period" else "rad"
            out.writerow([row.what, repr(float(row.measured)), unit, *cells])
    return Path(path)
