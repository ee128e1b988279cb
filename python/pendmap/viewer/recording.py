"""Files of recordings, equal for equal results; points, strips and numbers against time."""

from __future__ import annotations

import contextlib
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb

from pendmap.errors import InputError
from pendmap.files import whole_file

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    import numpy.typing as npt

    from pendmap.charts.marks import Floats

SUFFIXES: Final = (".rrd",)
INK: Final = (150, 150, 150)  # Lines and labels; the background may be light or dark
TIMELINE: Final = "sim_time"
FASTEST, LATEST = 1e30, 9e9
"""Largest velocity and time in a recording: positions are single precision, times ns."""
UPWARD: Final = rr.Transform3D(mat3x3=np.diag([1.0, -1.0, 1.0]))  # The y axis of a pendulum

_POINT = pa.list_(pa.field("item", pa.float32(), nullable=False), 2)
_STRIP = pa.list_(pa.field("item", _POINT, nullable=False))


def content_of(parts: Iterable[object]) -> str:
    """Return an identifier of arrays and other values."""
    digest = hashlib.blake2b(digest_size=12)
    for part in parts:
        if isinstance(part, np.ndarray) and part.dtype.kind in "biuf":
            digest.update(np.ascontiguousarray(part).data)
        else:
            digest.update(repr(part.tolist() if isinstance(part, np.ndarray) else part).encode())
    return digest.hexdigest()


def identified(name: str, application: str = "pendmap") -> rr.RecordingStream:
    """Return an empty recording with an identifier, without the time of day."""
    stream = rr.RecordingStream(application, recording_id=name, send_properties=False)
    stream.set_log_time_enabled(False)
    return stream


@contextlib.contextmanager
def strict() -> Iterator[None]:
    """Make the recording library raise errors instead of warning and dropping data."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)


def save(  # noqa: PLR0913 (what it is, and how it is shown)
    path: str | os.PathLike[str],
    layout: rrb.BlueprintLike,
    log: Callable[[rr.RecordingStream], None],
    *,
    name: str,
    content: str,
    known: Mapping[str, object],
) -> Path:
    """Write a recording that ``log`` fills, with its name, identifier and known properties."""
    application = f"pendmap {known['kind']} {content[:6]}"
    with whole_file(path, SUFFIXES) as part, strict():
        stream = identified(content, application)
        try:
            with stream:
                # The library's own file output blocks forever when the disk is full.
                memory = stream.memory_recording()
                stream.send_blueprint(layout, make_active=False, make_default=True)
                stream.send_recording_name(name)
                stream.send_property("pendmap", rr.AnyValues(drop_untyped_nones=True, **known))
                log(stream)
                stream.flush()
                part.write_bytes(memory.drain_as_bytes())
        finally:
            stream.disconnect()
    return Path(path)


def text(stream: rr.RecordingStream, path: str, markdown: str) -> None:
    """Log a page of text."""
    stream.log(path, rr.TextDocument(markdown, media_type="text/markdown"), static=True)


def screen(
    *views: rrb.View | rrb.Container,
    shares: Sequence[float],
    steps: tuple[str, Floats] | None = None,
) -> rrb.Blueprint:
    """Return the layout of a window: these views side by side, without automatic ones.

    The time panel shows ``steps``, the values of a parameter, and plays them in 20 s.
    """
    timeline, speed = (steps[0], float(np.ptp(steps[1])) / 20) if steps else (TIMELINE, 1.0)
    return rrb.Blueprint(
        rrb.Horizontal(*views, column_shares=list(shares)),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=timeline, playback_speed=speed),
        auto_layout=False,
        auto_views=False,
    )


def labels(
    places: npt.ArrayLike, names: Sequence[str], colour: tuple[int, int, int] = INK
) -> rr.Points2D:
    """Return labels, each centred below its place."""
    points = np.asarray(places, dtype=np.float32).reshape(-1, 2)
    return rr.Points2D(points, labels=list(names), colors=[colour], radii=[0.0], show_labels=True)


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
