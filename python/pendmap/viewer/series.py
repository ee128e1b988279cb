"""Time series of a recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import rerun as rr

from pendmap.viewer import columns

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Series:
    """Name and colour of a time series; lines have a width, points a size."""

    name: str
    colour: tuple[int, int, int]
    width: float = 0.0
    size: float = 3.0


def log(stream: rr.RecordingStream, path: str, time: Floats, values: Floats, look: Series) -> None:
    """Log a time series, if it has any instant; a line is thinned to its lowest and highest."""
    if not time.size:
        return
    style: rr.SeriesLines | rr.SeriesPoints = (
        rr.SeriesLines(
            colors=[look.colour],
            names=[look.name],
            widths=[look.width],
            aggregation_policy=rr.components.AggregationPolicy.MinMax,
        )
        if look.width
        else rr.SeriesPoints(colors=[look.colour], names=[look.name], marker_sizes=[look.size])
    )
    stream.log(path, style, static=True)
    stream.send_columns(path, [columns.at(time)], rr.Scalars.columns(scalars=values))
