"""Chart of motions without losses: amplitude and energy against their rate."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts import names
from pendmap.charts.chart import Axis, Chart, Panel
from pendmap.charts.marks import Line, Mark
from pendmap.files import facts

if TYPE_CHECKING:
    import xarray as xr

_COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 0) -> Chart:
    """Return amplitudes of oscillations, and energies of all motions, over their rate."""
    del cells
    family, rate = dataset["motion_family"].values, dataset["motion_rate"].values
    si = dataset["motion_rate"].attrs["units"] != "1"
    below = Axis("rate (rad/s)" if si else "rate over w0", (0.0, 1.05 * float(rate.max())))
    panels = []
    for which, text in (("amplitude", "amplitude (rad)"), ("energy", "energy over m g l")):
        y = dataset[f"motion_{which}"].values
        marks: list[Mark] = []
        for number, kind in enumerate(dataset["family_kind"].values.tolist()):
            mine = (family == number) & np.isfinite(y)
            if mine.any():
                rest = f"{kind} about {float(dataset['family_theta'][number]):.3g} rad"
                name = kind if kind == "rotation" else rest
                look: dict[str, Any] = {"colour": _COLOURS[number % len(_COLOURS)], "name": name}
                marks.append(Line(rate[mine], y[mine], path=f"{which}/{number}", **look))
        side = Axis(text, (0.0, 1.05 * float(np.nanmax(y))))
        panels.append(Panel(which, "", below, side, marks))
    title = "Motions without losses and drive"
    subtitle = names.parameters(facts(dataset), ["gamma", "p", "omega", "phase", "theta_r"])
    return Chart(title, subtitle, [[panel] for panel in panels], size=(7.4, 6.8)).only(layer)
