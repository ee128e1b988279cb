"""Chart of branches of orbits: points against the parameter, and what happens on them."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.result import rows
from pendmap.charts import names, plane
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.marks import DASHED, INK, Line, Mark, Points
from pendmap.files import facts
from pendmap.units import Units

if TYPE_CHECKING:
    import xarray as xr

_COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
_MARKERS: Final = {
    "fold": "s",
    "period_doubling": "o",
    "symmetry_breaking": "^",
    "neimark_sacker": "D",
    **dict.fromkeys(("stick_onset", "grazing", "rest_boundary"), "v"),
}


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 0) -> Chart:
    """Return angles and velocities of the orbits: full lines if stable, broken ones if not."""
    del cells
    a, name = facts(dataset), str(dataset.attrs["varied"])
    units = Units.of(a)
    theta = plane.angles(dataset, dataset["point_theta"].values)
    sides = names.phase_plane(theta, holding(dataset["point_velocity"].values), units)
    label = names.symbol(name, str(dataset["orbit_value"].attrs.get("units", "1")))
    below = Axis(label, (float(a["low"]), float(a["high"])))
    panels = [
        Panel(which, "", below, side, _marks(dataset, which))
        for which, side in zip(("theta", "velocity"), sides, strict=True)
    ]
    title = f"Branches of orbits {a['n']}:{a['w']} over {names.over([name])}"
    chosen = names.parameters(a, [name])
    return Chart(title, chosen, [[panel] for panel in panels], size=(7.4, 6.8)).only(layer)


def _marks(dataset: xr.Dataset, which: str) -> list[Mark]:
    """Return the branches as lines, one for each of their points, and the events."""
    branch, value = dataset["orbit_branch"].values, dataset["orbit_value"].values
    stable, of = dataset["orbit_stable"].values.astype(bool), dataset["point_orbit"].values
    y = dataset[f"point_{which}"].values
    marks: list[Mark] = []
    types = [*rows(dataset, "branch_n", "branch_w")]
    colours = dict(zip(dict.fromkeys(types), itertools.cycle(_COLOURS), strict=False))
    for number, (n, w) in enumerate(types):
        mine = branch == number
        points, x, full = y[mine[of]].reshape(-1, n), value[mine], stable[mine]
        for way, (dash, shown) in enumerate((("-", full), (DASHED, ~full))):
            # A piece belongs to both looks at the orbit where it changes.
            near = shown | np.roll(shown, 1) & (np.arange(shown.size) > 0)
            for k in range(n):
                line = np.where(near, points[:, k], np.nan)
                wraps = np.abs(np.diff(line, prepend=line[:1])) > np.pi
                line[wraps if which == "theta" else np.zeros_like(wraps)] = np.nan
                text = f"{n}:{w}" if not way and not k else ""
                look: dict[str, Any] = {"colour": colours[n, w], "dash": dash, "name": text}
                marks.append(Line(x, line, path=f"{number}/{way}/{k}", **look))
    kinds = dataset["event_kind"].values
    for kind in dict.fromkeys(kinds.tolist()):
        at = kinds == kind
        place = dataset["event_value"].values[at], dataset[f"event_{which}"].values[at]
        look = {"marker": _MARKERS[kind], "fill": "#ffffff", "edge": INK, "edge_width": 1.0}
        marks.append(Points(*place, size=5.0, order=4.0, name=kind.replace("_", " "), **look))
    return marks
