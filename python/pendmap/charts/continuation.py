"""Chart of branches of orbits: points against the parameter, and what happens on them."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.result import rows
from pendmap.charts import names, plane
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.marks import DASHED, DOTTED, INK, QUIET, Line, Mark, Points
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
    if name in {"omega", "frequency_hz"} and np.isfinite(dataset["orbit_amplitude"]).any():
        side = Axis("amplitude (rad)", (0.0, 1.05 * float(dataset["orbit_amplitude"].max())))
        curves = [*_backbones(dataset), *_marks(dataset, "amplitude")]
        panels.append(Panel("resonance", "", below, side, curves))
    title = f"Branches of orbits {a['n']}:{a['w']} over {names.over([name])}"
    chosen = names.parameters(a, [name])
    return Chart(title, chosen, [[panel] for panel in panels], size=(7.4, 6.8)).only(layer)


def _marks(dataset: xr.Dataset, which: str) -> list[Mark]:
    """Return the branches as lines, one for each of their points, and the events."""
    branch, value = dataset["orbit_branch"].values, dataset["orbit_value"].values
    stable, of = dataset["orbit_stable"].values.astype(bool), dataset["point_orbit"].values
    whole = which == "amplitude"  # one number of an orbit, not of each of its points
    y = dataset["orbit_amplitude" if whole else f"point_{which}"].values
    marks: list[Mark] = []
    types = [*rows(dataset, "branch_n", "branch_w")]
    colours = dict(zip(dict.fromkeys(types), itertools.cycle(_COLOURS), strict=False))
    for number, (n, w) in enumerate(types):
        mine = branch == number
        points = y[mine][:, None] if whole else y[mine[of]].reshape(-1, n)
        x, full = value[mine], stable[mine]
        for way, (dash, shown) in enumerate((("-", full), (DASHED, ~full))):
            # A piece belongs to both looks at the orbit where it changes.
            near = shown | np.roll(shown, 1) & (np.arange(shown.size) > 0)
            for k in range(points.shape[1]):
                line = np.where(near, points[:, k], np.nan)
                wraps = np.abs(np.diff(line, prepend=line[:1])) > np.pi
                line[wraps if which == "theta" else np.zeros_like(wraps)] = np.nan
                text = f"{n}:{w}" if not way and not k else ""
                look: dict[str, Any] = {"colour": colours[n, w], "dash": dash, "name": text}
                marks.append(Line(x, line, path=f"{number}/{way}/{k}", **look))
    kinds = dataset["event_kind"].values
    heights = y[dataset["event_orbit"].values] if whole else dataset[f"event_{which}"].values
    for kind in dict.fromkeys(kinds.tolist()):
        at = kinds == kind
        place = dataset["event_value"].values[at], heights[at]
        look = {"marker": _MARKERS[kind], "fill": "#ffffff", "edge": INK, "edge_width": 1.0}
        marks.append(Points(*place, size=5.0, order=4.0, name=kind.replace("_", " "), **look))
    return marks


def _backbones(dataset: xr.Dataset) -> list[Mark]:
    """Return the amplitude of free swings, for each period and number of swings of the orbits."""
    if "backbone_value" not in dataset:
        return []
    n, swings = dataset["branch_n"].values[dataset["orbit_branch"].values], dataset["orbit_swings"]
    types = sorted(
        {
            (a // g, b // g)
            for a, b in zip(n, swings.values, strict=True)
            if b
            for g in [math.gcd(a, b)]
        }
    )
    rate, height = (dataset[f"backbone_{key}"].values for key in ("value", "amplitude"))
    look: dict[str, Any] = {"colour": QUIET, "dash": DOTTED}
    return [
        Line(rate * n / k, height, path=f"backbone/{n}/{k}", name="" if i else "backbone", **look)
        for i, (n, k) in enumerate(types)
    ]
