"""Chart of branches of orbits: points against the parameter, and what happens on them."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.result import rows
from pendmap.charts import names, plane
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.marks import DASHED, INK, Dash, Line, Mark, Points
from pendmap.files import facts
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import xarray as xr

_COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
_UNSTABLE: Final = {"colour": "#555555", "width": 0.7, "name": "unstable"}
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
    types = dict.fromkeys((n, abs(w)) for n, w in rows(dataset, "branch_n", "branch_w"))
    colours = dict(zip(types, itertools.cycle(_COLOURS), strict=False))
    panels = [
        Panel(which, "", below, side, [*lines(dataset, which, colours), *events(dataset, which)])
        for which, side in zip(("theta", "velocity"), sides, strict=True)
    ]
    which = f"{a['n']}:{a['w']}" if "n" in a else f"up to period {a['up_to']}"
    title = f"Branches of orbits {which} over {names.over([name])}"
    chosen = names.parameters(a, [name])
    return Chart(title, chosen, [[panel] for panel in panels], size=(7.4, 6.8)).only(layer)


def lines(
    dataset: xr.Dataset, which: str, colours: Mapping[tuple[int, int], str] | None
) -> Iterator[Mark]:
    """Yield the branches, one line for each of their points; without colours unstable ones."""
    branch, value = dataset["orbit_branch"].values, dataset["orbit_value"].values
    stable, of = dataset["orbit_stable"].values.astype(bool), dataset["point_orbit"].values
    # Pieces on both sides of an event end there.
    ends = np.isin(np.arange(value.size), dataset["event_orbit"].values)
    y = dataset[f"point_{which}"].values
    for number, (n, w) in enumerate(rows(dataset, "branch_n", "branch_w")):
        mine = branch == number
        points, x = y[mine[of]].reshape(-1, n), value[mine]
        for way in range(2):
            dash: Dash = DASHED if way else "-"
            shown = (stable != way) | ends
            for k in range(n if colours or way else 0):
                line = np.where(shown[mine], points[:, k], np.nan)
                wraps = np.abs(np.diff(line, prepend=line[:1])) > np.pi
                line[wraps if which == "theta" else np.zeros_like(wraps)] = np.nan
                look: dict[str, Any] = _UNSTABLE
                if colours:
                    name = f"{n}:{abs(w)}" if way + k == 0 else ""
                    look = {"colour": colours[n, abs(w)], "name": name}
                yield Line(x, line, dash=dash, path=f"branch/{number}/{way}/{k}", **look)


def events(dataset: xr.Dataset, which: str) -> Iterator[Mark]:
    """Yield what happens on the branches, the marks of each kind."""
    kinds = dataset["event_kind"].values
    for kind in dict.fromkeys(kinds.tolist()):
        at = kinds == kind
        place = dataset["event_value"].values[at], dataset[f"event_{which}"].values[at]
        look: dict[str, Any] = {"marker": _MARKERS[kind], "fill": "#ffffff", "edge": INK}
        text = kind.replace("_", " ")
        yield Points(*place, size=5.0, order=4.0, name=text, edge_width=1.0, **look)
