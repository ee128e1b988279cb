"""The recording of closed orbits: paths and points in the phase plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap.charts import orbits as drawn
from pendmap.charts import palette, plane
from pendmap.units import Units
from pendmap.viewer import frame

if TYPE_CHECKING:
    import numpy.typing as npt
    import xarray as xr


def blueprint(dataset: xr.Dataset) -> rrb.Blueprint:
    """Return the layout: the phase plane, legend and summary beside it."""
    aside = rrb.Vertical(
        rrb.TextDocumentView(origin="/legend", name="Legend"),
        rrb.TextDocumentView(origin="/summary", name="Summary"),
    )
    return frame.screen(_frame(dataset).view("phase", "Phase plane"), aside, shares=[5, 3])


def log(stream: rr.RecordingStream, dataset: xr.Dataset) -> None:
    """Log each orbit's path, pieces between two wraps, and its points."""
    frame.summary(stream, dataset)
    around = _frame(dataset)
    around.log(stream, "phase")
    orbits = drawn.closed(dataset)
    for one in orbits:
        colour = palette.rgb(one.name, one.kind)
        thick = rr.Radius.ui_points(1.6 if one.stable else 0.8)
        strips = _pieces(one.path)
        if strips:
            path = rr.LineStrips2D(strips, colors=[colour], radii=thick)
            stream.log(f"phase/data/{one.id}/path", path, static=True)
        at = plane.copies(dataset, one.points, *around.x).astype(np.float32)
        size = rr.Radius.ui_points(5.0 if one.stable else 3.0)
        points = rr.Points2D(at, colors=[colour], radii=size)
        stream.log(f"phase/data/{one.id}/points", points, static=True)
    listed = sorted(orbits, key=lambda one: one.id)
    lines = [
        f"- `{one.id}` {one.text}: {palette.describe(one.name, one.kind)}, "
        f"{'thick' if one.stable else 'thin'}"
        for one in listed
    ]
    frame.text(stream, "legend", "\n".join(lines) or "No orbit was found.")


def _frame(dataset: xr.Dataset) -> frame.Frame:
    orbits = drawn.closed(dataset)
    angles, speeds = drawn.angles(orbits, dataset), drawn.speeds(orbits, dataset)
    return frame.Frame(angles, speeds, Units.of(dataset.attrs))


def _pieces(path: npt.NDArray[np.float64]) -> list[npt.NDArray[np.float32]]:
    gaps = np.flatnonzero(np.isnan(path[:, 0]))
    parts = np.split(path, gaps)
    cut = [part[~np.isnan(part[:, 0])].astype(np.float32) for part in parts]
    return [part for part in cut if len(part) > 1]
