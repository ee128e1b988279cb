"""The recording of critical curves, in both planes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap.analysis.tongues import NEAR
from pendmap.charts import tongues as drawn
from pendmap.viewer import frame
from pendmap.viewer.panel import Panel

if TYPE_CHECKING:
    import xarray as xr

_ROOTS = {"omega-p": ("tongues", "Frequency and amplitude"), "e-alpha2": ("paper", "Eq. 1.4")}
_CURVES = {1: ("plus", (213, 94, 0)), -1: ("minus", (0, 114, 178))}
_INVERTED = {1: (230, 159, 0), -1: (86, 180, 233)}
_FOLD, _BARE, _OWN = (0, 158, 115), (150, 150, 150), (204, 121, 167)


def blueprint(dataset: xr.Dataset) -> rrb.Blueprint:
    """Return the layout: both planes behind one another, legend and summary beside them."""
    first = str(dataset.attrs.get("plane", "omega-p"))
    order = sorted(_ROOTS, key=lambda plane: plane != first)
    views = [_panel(dataset, plane)[0].view(*_ROOTS[plane]) for plane in order]
    aside = rrb.Vertical(
        rrb.TextDocumentView(origin="/legend", name="Legend"),
        rrb.TextDocumentView(origin="/summary", name="Summary"),
    )
    return frame.screen(rrb.Tabs(*views), aside, shares=[5, 3])


def log(stream: rr.RecordingStream, dataset: xr.Dataset) -> None:
    """Log the curves, the fold and the pendulum's point, in each plane."""
    frame.summary(stream, dataset)
    for plane, (root, _) in _ROOTS.items():
        panel, chart = _panel(dataset, plane)
        panel.log(stream, root)
        bare = panel.within(chart.undamped)
        panel.strips(stream, f"{root}/data/undamped", bare, _BARE, 0.6, order=10.0)
        for multiplier, (name, colour) in _CURVES.items():
            lines = panel.within(chart.lines[multiplier])
            panel.strips(stream, f"{root}/data/{name}", lines, colour, 1.5)
            upright = panel.within(chart.inverted_lines[multiplier])
            panel.strips(
                stream, f"{root}/data/inverted_{name}", upright, _INVERTED[multiplier], 1.5
            )
        panel.strips(stream, f"{root}/data/fold", panel.within([chart.fold]), _FOLD, 1.5)
        own = np.array([chart.own], dtype=np.float32)
        points = rr.Points2D(own, colors=[_OWN], radii=rr.Radius.ui_points(5.0))
        stream.log(f"{root}/data/own", points, static=True)
    legend = [
        "- blue: multiplier -1 of hanging rest, an oscillation of period 2 is born",
        "- vermillion: multiplier +1, one of period 1",
        "- sky blue and orange: the same of inverted rest, stable from orange up to sky blue",
        "- green: its fold, where it is born toward smaller p",
        "- grey: without damping",
        "- purple: this pendulum",
    ]
    frame.text(stream, "legend", "\n".join(legend))


def _panel(dataset: xr.Dataset, plane: str) -> tuple[Panel, drawn.Chart]:
    chart = drawn.chart(dataset, plane, NEAR)
    return Panel(chart.x, chart.y, *chart.names), chart
