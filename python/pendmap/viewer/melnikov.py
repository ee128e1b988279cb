"""The recording of Melnikov's threshold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap.charts.melnikov import highest
from pendmap.viewer import frame
from pendmap.viewer.panel import Panel

if TYPE_CHECKING:
    import xarray as xr

_COLOURS = {"loop": (40, 40, 40), "forward": (213, 94, 0), "backward": (0, 114, 178)}
_OWN = (204, 121, 167)


def blueprint(dataset: xr.Dataset) -> rrb.Blueprint:
    """Return the layout: the threshold, the summary beside it."""
    panel = _panel(dataset).view("melnikov", "Threshold")
    summary = rrb.TextDocumentView(origin="/summary", name="Summary")
    return frame.screen(panel, summary, shares=[5, 3])


def log(stream: rr.RecordingStream, dataset: xr.Dataset) -> None:
    """Log the threshold of each branch and the pendulum's point."""
    frame.summary(stream, dataset)
    panel = _panel(dataset)
    panel.log(stream, "melnikov")
    omega = dataset["omega"].values
    for name in dataset["branch"].values:
        colour = _COLOURS[str(name)]
        curve = np.stack([omega, dataset["p_melnikov"].sel(branch=name).values], axis=-1)
        panel.strips(stream, f"melnikov/data/{name}", panel.within([curve]), colour, 1.6)
    own = [float(dataset.attrs["own_omega"]), abs(float(dataset.attrs["own_p"]))]
    points = rr.Points2D([own], colors=[_OWN], radii=rr.Radius.ui_points(5.0))
    stream.log("melnikov/data/own", points, static=True)


def _panel(dataset: xr.Dataset) -> Panel:
    x = np.append(dataset["omega"].values, float(dataset.attrs["own_omega"]))
    return Panel.holding(x, np.array([0.0, highest(dataset)]), "omega", "p")
