"""Whole columns of a recording: points and line strips that move with time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import rerun as rr

from pendmap.viewer import frame

Floats = npt.NDArray[np.float64]

FASTEST, LATEST = 1e30, 9e9
"""Largest velocity and time in a recording: positions are single precision, times ns."""

_POINT = pa.list_(pa.field("item", pa.float32(), nullable=False), 2)
_STRIP = pa.list_(pa.field("item", _POINT, nullable=False))


@dataclass(frozen=True)
class Look:
    """Colour, radius in screen points, and drawing order (greater is on top)."""

    colour: tuple[int, int, int]
    size: float
    order: float | None = None


def at(time: Floats) -> rr.TimeColumn:
    """Return the time column of these instants."""
    return rr.TimeColumn(frame.TIMELINE, duration=time)


def points(
    stream: rr.RecordingStream,
    path: str,
    time: Floats,
    places: Floats,
    look: Look,
    *further: rr.TimeColumn,
) -> None:
    """Log one point per instant, shape (n, 2)."""
    style = rr.Points2D.from_fields(
        colors=[look.colour], radii=rr.Radius.ui_points(look.size), draw_order=look.order
    )
    stream.log(path, style, static=True)
    if time.size:
        columns = rr.Points2D.columns(positions=places.astype(np.float32))
        stream.send_columns(path, [at(time), *further], columns)


def strips(
    stream: rr.RecordingStream,
    path: str,
    time: Floats,
    lines: Floats,
    look: Look,
) -> None:
    """Log one strip per instant, shape (n, m, 2), as Arrow arrays: lists are 50 times slower."""
    style = rr.LineStrips2D.from_fields(
        colors=[look.colour], radii=rr.Radius.ui_points(look.size), draw_order=look.order
    )
    stream.log(path, style, static=True)
    if not time.size:
        return
    count, length, _ = lines.shape
    flat = pa.array(lines.astype(np.float32).reshape(-1))
    places = pa.FixedSizeListArray.from_arrays(flat, type=_POINT)
    offsets = pa.array(np.arange(count + 1, dtype=np.int32) * length)
    arrow = pa.ListArray.from_arrays(offsets, places, type=_STRIP)
    stream.send_columns(path, [at(time)], rr.LineStrips2D.columns(strips=arrow))
