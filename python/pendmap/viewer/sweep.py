"""Basins of the models of a sweep on the timeline of its parameter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pendmap.analysis.sweep_table import varied_names
from pendmap.charts import basin_sweep
from pendmap.charts.marks import Level
from pendmap.viewer import marks
from pendmap.viewer.chart import CELLS
from pendmap.viewer.place import Place

if TYPE_CHECKING:
    from collections.abc import Sequence

    import rerun as rr
    import rerun.blueprint as rrb
    import xarray as xr

MODELS: Final = "map"  # Timeline over two parameters: models row by row


def timeline(dataset: xr.Dataset) -> str:
    """Return the name of the timeline: the parameter that varies, its value in seconds."""
    dims = varied_names(dataset)
    return dims[0] if len(dims) == 1 else MODELS


def view(dataset: xr.Dataset) -> rrb.View:
    """Return the view of the basins."""
    _, panel, ratio = next(basin_sweep.models(dataset, CELLS))
    return Place.of(panel, ratio).view()


def log(stream: rr.RecordingStream, dataset: xr.Dataset, others: Sequence[Place]) -> None:
    """Log the basins of each model, and a line at its parameter in the other panels."""
    line = timeline(dataset)
    for number, (at, panel, ratio) in enumerate(basin_sweep.models(dataset, CELLS)):
        place = Place.of(panel, ratio)
        if number == 0:
            place.log_frame(stream)
        if line == MODELS:
            stream.set_time(line, sequence=number)
        else:
            stream.set_time(line, duration=at[0][1])
            now = Level(at[0][1], axis="x", path="now")
            for other in others:
                marks.log(stream, other, now, 0, static=False)
        for order, mark in enumerate(panel.marks):
            marks.log(stream, place, mark, order, static=False)
    stream.reset_time()
