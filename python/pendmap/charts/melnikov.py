"""Chart of Melnikov's threshold against the drive frequency."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts import names
from pendmap.charts.chart import Axis, Chart, Panel
from pendmap.charts.marks import INK, Band, Dash, Line, Mark, this_pendulum
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
    own_omega, own_p = float(a["own_omega"]), abs(float(a["own_p"]))
    known = p[np.isfinite(p)]
    high = min(float(known.max()), _HIGH * float(known.min())) if known.size else 1.0
    top = max(high, 1.15 * own_p, 1e-3)
    at = {str(name): p[:, k] for k, name in enumerate(dataset["branch"].values)}
    kind = "heteroclinic" if "loop" in at else "threshold"
    texts = {name: f"{kind}, {name}" for name in ("forward", "backward")}
    if kind == "threshold" and np.allclose(at["forward"], at["backward"], 0, 1e-9, equal_nan=True):
        texts = {"forward": "threshold, both branches", "backward": ""}
    texts["loop"] = "homoclinic, loop of upright rest"
    marks: list[Mark] = []
    for name, (colour, dash) in _LOOKS.items():
        if name not in at or not texts[name] or not (at[name] <= top).any():
            continue
        look: dict[str, Any] = {"colour": colour, "dash": dash, "name": texts[name], "path": name}
        marks.append(Line(omega, at[name], width=1.6, **look))
        marks.append(Band(omega, at[name], np.full_like(omega, top), colour=colour, alpha=0.10))
    damped = np.nanmax(at.get("loop", p), initial=0.0) > 0
    follows = "fractal boundaries of basins" if damped else "chaos, no basins without damping"
    marks.append(this_pendulum(own_omega, own_p, clip=False))
    x = (min(float(omega[0]), own_omega), max(float(omega[-1]), own_omega))
    sides = Axis("ω = Ω/w0", x), Axis("p = YΩ²/g", (0.0, top))
    panel = Panel("melnikov", f"above: manifolds cross, {follows}", *sides, marks)
    title = "Homoclinic threshold, Melnikov, first order"
    subtitle = names.parameters(a | {"omega": own_omega})
    return Chart(title, subtitle, [[panel]], ratio=0.68).only(layer)
