"""Parts shared by all recordings: the recording itself, and the axes of a panel."""

from __future__ import annotations

import contextlib
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap.charts import names, plane
from pendmap.files import facts, whole_file
from pendmap.units import VELOCITY, Units

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    import numpy.typing as npt
    import xarray as xr

SUFFIXES = (".rrd",)  # File suffix of a recording

INK = (150, 150, 150)  # Mid grey of lines and labels: the background may be light or dark

SIDE = 1000.0  # Width of a frame, units of the view

SHORT = 8  # Greatest number of letters of an axis name beside the ticks

TIMELINE = "sim_time"

_OF_A_RUN = ("seconds", "summary", "history")  # Facts that differ between equal results


def identifier(dataset: xr.Dataset) -> str:
    """Return an identifier of a dataset's content."""
    attrs = {str(k): v for k, v in facts(dataset).items() if k not in _OF_A_RUN}
    content = hashlib.blake2b(repr(sorted(attrs.items())).encode(), digest_size=12)
    known = ("label", "regime", "entry_theta", "theta", "theta_point", "p_melnikov", "p")
    telling = next(name for name in (*known, *dataset.data_vars) if name in dataset)
    content.update(np.ascontiguousarray(dataset[telling].values).data)
    for name in sorted(map(str, dataset.indexes)):  # identifies the selected part of a result
        content.update(repr((name, dataset[name].values.tolist())).encode())
    return content.hexdigest()


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
    own_layout: bool = False,
) -> Path:
    """Write a recording that ``log`` fills, with its name, identifier and known properties.

    A layout holds for all recordings of an application: with ``own_layout`` this recording has its
    own application. Data are collected in memory, because the library's own file output blocks
    indefinitely when the disk is full.
    """
    application = f"pendmap {known['kind']} {content[:6]}" if own_layout else "pendmap"
    with whole_file(path, SUFFIXES) as part, strict():
        stream = identified(content, application)
        try:
            with stream:
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


def properties(dataset: xr.Dataset) -> dict[str, float | str]:
    """Return the facts of a dataset that are text or numbers, without summary and history.

    A property keeps one type in all recordings of a process, so whole numbers become floats.
    """
    return {
        str(name): value if isinstance(value, str) else float(value)
        for name, value in facts(dataset).items()
        if name not in ("summary", "history")
        and isinstance(value, (str, bool, int, float, np.generic))
    }


def summary(stream: rr.RecordingStream, dataset: xr.Dataset, *further: str) -> None:
    """Log the dataset's summary, line for line, and further paragraphs."""
    lines = [*str(dataset.attrs.get("summary", "")).splitlines(), *further]
    text(stream, "summary", "\n\n".join(lines))


def text(stream: rr.RecordingStream, path: str, markdown: str) -> None:
    """Log a page of text."""
    stream.log(path, rr.TextDocument(markdown, media_type="text/markdown"), static=True)


def screen(*views: rrb.View | rrb.Container, shares: Sequence[float]) -> rrb.Blueprint:
    """Return the layout of a window: these views side by side, without automatic ones."""
    return rrb.Blueprint(
        rrb.Horizontal(*views, column_shares=list(shares)),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        auto_layout=False,
        auto_views=False,
    )


@dataclass(frozen=True)
class Frame:
    """A rectangle with two axes, and its position in a 2D view.

    A 2D view has y downward and one scale for both directions. So everything under ``root/data`` is
    logged in physical units, one static transform maps it to the screen, and the frame with its
    ticks is drawn under ``root/axes``, ``SIDE`` wide. ``ratio`` is height over width; ``angles``
    tells which axes have multiples of pi as labels.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    axes: tuple[str, str]
    ratio: float
    angles: tuple[bool, bool] = (False, False)

    @classmethod
    def phase(cls, x: tuple[float, float], y: tuple[float, float], units: Units) -> Frame:
        """Return the frame of a phase plane, with a bounded ratio of its sides."""
        low, high = (units.bare(bound, VELOCITY) for bound in y)
        ratio = min(max((high - low) / (x[1] - x[0]), 0.3), 1.3)
        return cls(x, y, (names.ANGLE, names.speed(units)), ratio, (True, False))

    @property
    def height(self) -> float:
        """Height in units of the view."""
        return SIDE * self.ratio

    def to_screen(self) -> rr.Transform3D:
        """Return the transform from physical units to the screen."""
        sx = SIDE / (self.x[1] - self.x[0])
        sy = self.height / (self.y[1] - self.y[0])
        return rr.Transform3D(
            translation=[-sx * self.x[0], sy * self.y[1], 0.0], mat3x3=np.diag([sx, -sy, 1.0])
        )

    def of_pixels(self, shape: tuple[int, ...]) -> rr.Transform3D:
        """Return the transform from an image's pixels, row 0 lowest, to physical units."""
        sx = (self.x[1] - self.x[0]) / shape[1]
        sy = (self.y[1] - self.y[0]) / shape[0]
        return rr.Transform3D(
            translation=[self.x[0], self.y[0], 0.0], mat3x3=np.diag([sx, sy, 1.0])
        )

    def view(
        self,
        root: str,
        name: str,
        *,
        below: float = 0.0,
        time_ranges: Sequence[rrb.VisibleTimeRange] | None = None,
    ) -> rrb.Spatial2DView:
        """Return the view of this frame, with room for ticks, a bar and, ``below``, a legend."""
        return rrb.Spatial2DView(
            origin=f"/{root}",
            name=name,
            visual_bounds=rrb.VisualBounds2D(
                x_range=[-210.0, SIDE + 190.0],
                y_range=[-110.0, self.height + 150.0 + below],
            ),
            time_ranges=time_ranges,
        )

    def log(self, stream: rr.RecordingStream, root: str) -> None:
        """Log the transform, the frame, its ticks and the names of its axes."""
        stream.log(f"{root}/data", self.to_screen(), static=True)
        w, h = SIDE, self.height
        lines: list[list[list[float]]] = [[[0, 0], [w, 0], [w, h], [0, h], [0, 0]]]
        places: list[list[float]] = []
        labels: list[str] = []
        (across, along), (up, rising) = (
            plane.short_ticks(*self.x, angle=self.angles[0]),
            plane.short_ticks(*self.y, angle=self.angles[1]),
        )
        for value, label in along:
            at = w * (across + value - self.x[0]) / (self.x[1] - self.x[0])
            lines.append([[at, h], [at, h + 12]])
            places.append([at, h + 20])
            labels.append(label)
        for value, label in rising:
            at = h * (self.y[1] - up - value) / (self.y[1] - self.y[0])
            lines.append([[-12, at], [0, at]])
            places.append([-70, at - 22])
            labels.append(label)
        below, beside = self.axes
        # A long name does not fit beside the ticks.
        above = len(beside) > SHORT
        places += [[w / 2, h + 75], [0, -85] if above else [-135, h / 2 - 22]]
        labels += [plane.shifted(below, across), plane.shifted(beside, up)]
        thin = rr.Radius.ui_points(0.75)
        stream.log(
            f"{root}/axes/frame", rr.LineStrips2D(lines, colors=[INK], radii=thin), static=True
        )
        write(stream, f"{root}/axes/ticks", places, labels)

    def bar(
        self,
        stream: rr.RecordingStream,
        root: str,
        image: rr.SegmentationImage | rr.DepthImage | rr.Image,
        *,
        low: float,
        high: float,
    ) -> None:
        """Log a colour bar: an image one pixel wide, lowest value first, with ticks beside it."""
        path = f"{root}/axes/bar"
        rows = 256
        transform = rr.Transform3D(
            translation=[SIDE + 35.0, self.height, 0.0],
            mat3x3=np.diag([35.0, -self.height / rows, 1.0]),
        )
        stream.log(f"{path}/colours", transform, static=True)
        stream.log(f"{path}/colours", image, static=True)
        ticks = plane.plain_ticks(low, high)
        at = [self.height * (high - value) / (high - low) for value, _ in ticks]
        write(stream, f"{path}/ticks", [[SIDE + 120.0, y - 22] for y in at], [t for _, t in ticks])


def write(
    stream: rr.RecordingStream,
    path: str,
    places: Sequence[Sequence[float]],
    labels: Sequence[str],
    *,
    colours: Sequence[tuple[int, int, int]] = (INK,),
) -> None:
    """Log labels, each centred below its place."""
    points = rr.Points2D(
        np.asarray(places, dtype=np.float32).reshape(-1, 2),
        labels=list(labels),
        colors=list(colours),
        radii=[0.0],
        show_labels=True,
    )
    stream.log(path, points, static=True)


def legend(  # noqa: PLR0913 (where, what, how)
    stream: rr.RecordingStream,
    path: str,
    places: Sequence[tuple[float, float]],
    parts: Sequence[tuple[str, tuple[int, int, int]]],
    *,
    size: float | Sequence[float],
    below: float,
) -> None:
    """Log a spot of each colour, with its name at a distance below it."""
    names, colours = zip(*parts, strict=True)
    spots = rr.Points2D(places, colors=colours, radii=rr.Radius.ui_points(size))
    stream.log(path, spots, static=True)
    write(stream, f"{path}/names", [(x, y + below) for x, y in places], names)


def pieces(
    lines: Iterable[npt.NDArray[np.float64]],
    low: npt.ArrayLike = -np.inf,
    high: npt.ArrayLike = np.inf,
) -> list[npt.NDArray[np.float64]]:
    """Return the parts of lines, shape (n, 2) each, with finite values from ``low`` to ``high``.

    Each part has two or more points; between parts nothing is drawn.
    """
    low, high = np.asarray(low), np.asarray(high)
    found = []
    for line in lines:
        there = np.all(np.isfinite(line) & (low <= line) & (line <= high), axis=1)
        cuts = np.flatnonzero(np.diff(there.astype(np.int8))) + 1
        parts = zip(np.split(line, cuts), np.split(there, cuts), strict=True)
        found += [part for part, seen in parts if len(part) > 1 and seen.all()]
    return found
