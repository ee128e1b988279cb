"""Files of recordings: written whole or not at all, equal for equal results."""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap.files import whole_file

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    import numpy.typing as npt

SUFFIXES: Final = (".rrd",)
INK: Final = (150, 150, 150)  # Lines and labels; the background may be light or dark
TIMELINE: Final = "sim_time"


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
    *views: rrb.View | rrb.Container, shares: Sequence[float], timeline: str = TIMELINE
) -> rrb.Blueprint:
    """Return the layout of a window: these views side by side, without automatic ones."""
    moves = timeline != TIMELINE
    return rrb.Blueprint(
        rrb.Horizontal(*views, column_shares=list(shares)),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="expanded" if moves else "collapsed", timeline=timeline),
        auto_layout=False,
        auto_views=False,
    )


def labels(
    places: npt.ArrayLike, names: Sequence[str], colour: tuple[int, int, int] = INK
) -> rr.Points2D:
    """Return labels, each centred below its place."""
    points = np.asarray(places, dtype=np.float32).reshape(-1, 2)
    return rr.Points2D(points, labels=list(names), colors=[colour], radii=[0.0], show_labels=True)
