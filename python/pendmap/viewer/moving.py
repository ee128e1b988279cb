"""Whole columns of a recording: points, line strips and numbers that change with time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pyarrow as pa
import rerun as rr

from pendmap.errors import InputError
from pendmap.viewer.recording import TIMELINE

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pendmap.charts.marks import Floats

FASTEST, LATEST = 1e30, 9e9
"""Largest velocity and time in a recording: positions are single precision, times ns."""
UPWARD: Final = rr.Transform3D(mat3x3=np.diag([1.0, -1.0, 1.0]))  # The y axis of a pendulum

_POINT = pa.list_(pa.field("item", pa.float32(), nullable=False), 2)
_STRIP = pa.list_(pa.field("item", _POINT, nullable=False))


@dataclass(frozen=True)
class Look:
    """Colour, radius or width in screen points, drawing order (greater is on top), and name."""

    colour: tuple[int, int, int]
    size: float
    order: float | None = None
    name: str = ""

    @property
    def style(self) -> dict[str, Any]:
        """Fields of points and line strips."""
        radii = rr.Radius.ui_points(self.size)
        return {"colors": [self.colour], "radii": radii, "draw_order": self.order}


def refuse_late(name: object, times: Iterable[Floats]) -> None:
    """Raise InputError for times that a recording cannot hold."""
    latest = max((float(np.max(np.abs(time), initial=0.0)) for time in times), default=0.0)
    if latest > LATEST:
        raise InputError(f"{name}: time is {latest:g} s: a recording holds up to {LATEST:g} s")


def at(time: Floats) -> rr.TimeColumn:
    """Return the time column of these instants."""
    return rr.TimeColumn(TIMELINE, duration=time)


def points(
    stream: rr.RecordingStream,
    path: str,
    time: Floats,
    places: Floats,
    look: Look,
    *further: rr.TimeColumn,
) -> None:
    """Log one point per instant, shape (n, 2)."""
    stream.log(path, rr.Points2D.from_fields(**look.style), static=True)
    if time.size:
        columns = rr.Points2D.columns(positions=places.astype(np.float32))
        stream.send_columns(path, [at(time), *further], columns)


def strips(stream: rr.RecordingStream, path: str, time: Floats, lines: Floats, look: Look) -> None:
    """Log one strip per instant, shape (n, m, 2), as Arrow arrays: lists are 50 times slower."""
    stream.log(path, rr.LineStrips2D.from_fields(**look.style), static=True)
    if not time.size:
        return
    count, length, _ = lines.shape
    flat = pa.array(lines.astype(np.float32).reshape(-1))
    places = pa.FixedSizeListArray.from_arrays(flat, type=_POINT)
    offsets = pa.array(np.arange(count + 1, dtype=np.int32) * length)
    arrow = pa.ListArray.from_arrays(offsets, places, type=_STRIP)
    stream.send_columns(path, [at(time)], rr.LineStrips2D.columns(strips=arrow))


def series(stream: rr.RecordingStream, path: str, time: Floats, values: Floats, look: Look) -> None:
    """Log numbers against time, if there are any; the viewer thins a line to its extremes."""
    if not time.size:
        return
    style = rr.SeriesLines(
        colors=[look.colour],
        names=[look.name],
        widths=[look.size],
        aggregation_policy=rr.components.AggregationPolicy.MinMax,
    )
    stream.log(path, style, static=True)
    stream.send_columns(path, [at(time)], rr.Scalars.columns(scalars=values))
