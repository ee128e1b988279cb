"""Chart of Melnikov's threshold against the drive frequency."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts import names
from pendmap.charts.chart import Axis, Chart, Panel
from pendmap.charts.marks import INK, Band, Dash, Line, Mark, Points
from pendmap.files import facts

if TYPE_CHECKING:
    import xarray as xr

_HIGH: Final = 12.0
"""Largest threshold shown, over the least: that of a loop diverges between frequencies."""

_LOOKS: Final[dict[str, tuple[str, Dash]]] = {
    "loop": (INK, "-"),
    "backward": ("#0072b2", (5.0, 2.0)),
    "forward": ("#d55e00", "-"),
}


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 0) -> Chart:
    """Return the threshold of each branch and the pendulum's own parameters as a point."""
    del cells
    a = facts(dataset)
    omega, p = dataset["omega"].values, dataset["p_melnikov"].values
    own = (float(a["own_omega"]), abs(float(a["own_p"])))
    top = _highest(p, own[1])
    at = {str(name): p[:, k] for k, name in enumerate(dataset["branch"].values)}
    apart = np.abs(at["forward"] - at["backward"]) if {"forward", "backward"} <= set(at) else p[:0]
    alike = bool(np.isfinite(apart).any()) and bool(np.nanmax(apart) < 1e-9 * top)
    said = {"forward": "threshold, forward", "backward": "threshold, backward"}
    if "loop" in at:
        said = {name: f"heteroclinic, {name}" for name in said}
    elif alike:
        said = {"forward": "threshold, both branches", "backward": ""}
    said["loop"] = "homoclinic, loop of upright rest"
    marks: list[Mark] = []
    for name, (colour, dash) in _LOOKS.items():
        if name not in at or not said[name] or not (at[name] <= top).any():
            continue
        look: dict[str, Any] = {"colour": colour, "dash": dash, "name": said[name], "path": name}
        marks.append(Line(omega, at[name], width=1.6, **look))
        high = np.full_like(omega, top)
        marks.append(Band(omega, at[name], high, colour=colour, alpha=0.10))
    damped = np.nanmax(at.get("loop", p), initial=0.0) > 0
    follows = "fractal boundaries of basins" if damped else "chaos, no basins without damping"
    star: dict[str, Any] = {"marker": "*", "size": 9.0, "clip": False, "order": 4.0}
    marks.append(Points(*np.array(own).reshape(2, 1), name="this pendulum", path="own", **star))
    x = (min(float(omega[0]), own[0]), max(float(omega[-1]), own[0]))
    across = Axis("ω = Ω/w0", x)
    up = Axis("p = YΩ²/g", (0.0, top))
    panel = Panel("melnikov", f"above: manifolds cross, {follows}", across, up, marks)
    title = "Homoclinic threshold, Melnikov, first order"
    return Chart(
        title, names.parameters(a | {"omega": a["own_omega"]}), [[panel]], ratio=0.68
    ).only(layer)


def _highest(p: np.ndarray, own: float) -> float:
    """Return the largest ``p`` of the chart, which includes the pendulum's own."""
    known = p[np.isfinite(p)]
    shown = min(float(known.max()), _HIGH * float(known.min())) if known.size else 1.0
    return max(shown, 1.15 * own, 1e-3)
