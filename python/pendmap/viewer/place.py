"""Panels of charts in 2D views: frame, ticks and units."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap.charts import marks as charts
from pendmap.charts import plane
from pendmap.charts.chart import holding
from pendmap.viewer import recording
from pendmap.viewer.recording import INK

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from pendmap.charts.chart import Axis, Panel
    from pendmap.charts.marks import Ends, Floats, Mark

SIDE: Final = 1000.0  # Width of a frame, units of the view
SHORT: Final = 8  # Greatest number of letters of an axis name beside the ticks
MANY: Final = 8  # Number of ticks of a logarithmic axis above which every k-th is shown
_POWER: Final = re.compile(r"\$(-?)10\^\{(-?\d+)\}\$")


def plain(text: str) -> str:
    """Return a text of a chart in one line, without mathtext."""
    return _POWER.sub(r"\g<1>10^\2", text).replace("\n", " ").strip()


def scaled(axis: Axis, values: npt.ArrayLike) -> Floats:
    """Return values as a linear axis shows them: powers of ten of a logarithmic one."""
    x: Floats = np.asarray(values, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        if axis.scale == "log":
            x = np.log10(x)
        elif axis.scale == "signed":
            part = x / axis.straight
            beyond = np.sign(part) * (1.0 + np.log10(np.abs(part)))
            x = np.where(np.abs(part) > 1.0, beyond, part)
    return x


@dataclass(frozen=True, eq=False)
class Place:
    """Position of a panel in a recording and in its view.

    A 2D view has y downward, linear axes and one scale for both. So all under ``root/data`` is
    logged in the units of linear axes, one static transform maps it to the screen, and the frame
    with its ticks is drawn under ``root/axes``, ``SIDE`` wide and ``height`` high.
    """

    panel: Panel
    root: str
    height: float
    x: Ends
    y: Ends

    @classmethod
    def of(cls, panel: Panel, ratio: float, root: str = "") -> Place:
        """Return the place of a panel with this ratio of height to width."""
        return cls(panel, root or panel.where, SIDE * ratio, _ends(panel, "x"), _ends(panel, "y"))

    @property
    def title(self) -> str:
        """Title of the view."""
        text = plain(self.panel.title or self.panel.name)
        return text[:1].upper() + text[1:]

    def points(self, x: npt.ArrayLike, y: npt.ArrayLike) -> Floats:
        """Return points, shape (n, 2), in the units of linear axes."""
        both = scaled(self.panel.x, x), scaled(self.panel.y, y)
        return np.stack(np.broadcast_arrays(*both), axis=-1)

    def inside(self, points: Floats) -> npt.NDArray[np.bool_]:
        """Return which points lie within the frame, because a view does not clip."""
        low, high = np.sort([self.x, self.y]).T
        slack = 1e-9 * (high - low)
        there = (low - slack <= points) & (points <= high + slack)
        return np.asarray(there.all(axis=1), dtype=bool)

    def lines(self, *lines: Floats) -> list[Floats]:
        """Return the parts of lines within the frame, each of two or more points."""
        parts: list[Floats] = []
        for line in lines:
            there = self.inside(line)
            cuts = np.flatnonzero(np.diff(there.astype(np.int8))) + 1
            pieces = zip(np.split(line, cuts), np.split(there, cuts), strict=True)
            parts += [part for part, seen in pieces if len(part) > 1 and seen.all()]
        return parts

    def of_pixels(self, shape: tuple[int, ...], x: Ends, y: Ends) -> rr.Transform3D:
        """Return the transform from an image's pixels, row 0 lowest, to the axes' units."""
        (left, low), (right, high) = self.points(x, y)
        scale = np.diag([(right - left) / shape[1], (high - low) / shape[0], 1.0])
        return rr.Transform3D(translation=[left, low, 0.0], mat3x3=scale)

    def view(self, time_ranges: Sequence[rrb.VisibleTimeRange] | None = None) -> rrb.View:
        """Return the view of this panel, with room for ticks and a colour bar."""
        origin = f"/{self.root}"
        if self.panel.bare:
            return rrb.TextDocumentView(origin=origin, name=self.title)
        bounds = rrb.VisualBounds2D(
            x_range=[-210.0, SIDE + 190.0], y_range=[-110.0, self.height + 150.0]
        )
        return rrb.Spatial2DView(
            origin=origin, name=self.title, visual_bounds=bounds, time_ranges=time_ranges
        )

    def log_frame(self, stream: rr.RecordingStream) -> None:
        """Log the transform, the frame, its ticks and the names of its axes."""
        w, h = SIDE, self.height
        sx, sy = w / (self.x[1] - self.x[0]), h / (self.y[1] - self.y[0])
        to_screen = rr.Transform3D(
            translation=[-sx * self.x[0], sy * self.y[1], 0.0], mat3x3=np.diag([sx, -sy, 1.0])
        )
        stream.log(f"{self.root}/data", to_screen, static=True)
        below, along = _ticks(self.panel.x, self.x)
        beside, up = _ticks(self.panel.y, self.y)
        columns = [(sx * (at - self.x[0]), text) for at, text in along]
        rows = [(sy * (self.y[1] - at), text) for at, text in up]
        lines: list[list[list[float]]] = [[[0, 0], [w, 0], [w, h], [0, h], [0, 0]]]
        lines += [[[at, h], [at, h + 12]] for at, _ in columns]
        lines += [[[-12, at], [0, at]] for at, _ in rows]
        thin = rr.LineStrips2D(lines, colors=[INK], radii=rr.Radius.ui_points(0.75))
        stream.log(f"{self.root}/axes/frame", thin, static=True)
        places = [[at, h + 20] for at, _ in columns] + [[-70, at - 22] for at, _ in rows]
        # A long name does not fit beside the ticks.
        places += [[w / 2, h + 75], [0, -85] if len(beside) > SHORT else [-135, h / 2 - 22]]
        texts = [*(text for _, text in [*columns, *rows]), below, beside]
        stream.log(f"{self.root}/axes/ticks", recording.labels(places, texts), static=True)


def _ends(panel: Panel, which: str) -> Ends:
    """Return the limits of an axis; those of its marks if it has none."""
    axis: Axis = getattr(panel, which)
    if axis.ends is not None and axis.ends[0] != axis.ends[1]:
        low, high = (float(end) for end in scaled(axis, axis.ends))
        return low, high
    every = [axis.ends] if axis.ends else [_values(mark, which) for mark in panel.marks]
    return holding(*(scaled(axis, some) for some in every))


def _ticks(axis: Axis, ends: Ends) -> tuple[str, list[tuple[float, str]]]:
    """Return the name of an axis and its ticks, in the units of a linear axis."""
    low, high = sorted(ends)
    name, ticks = axis.name, list(axis.ticks or ())
    if axis.ticks is None and axis.scale == "log":
        whole = plane.log_ticks(10.0**low, 10.0**high)
        ticks = [(at, plane.power(at)) for at in whole[:: 1 + len(whole) // MANY]]
    elif axis.ticks is None and axis.scale == "signed":
        powers = (axis.straight * 10.0**k for k in range(int(max(-low, high))))
        ticks = [(at, plane.power(at)) for p in powers for at in (-p, p)] + [(0.0, "0")]
    elif axis.ticks is None:
        size, angle = axis.factor, axis.scale == "angle"
        shift, short = plane.short_ticks(low * size, high * size, angle=angle)
        name = plane.shifted(name, shift)
        ticks = [((shift + at) / size, text) for at, text in short]
    placed = [(float(scaled(axis, at)), plain(text)) for at, text in ticks]
    return plain(name), [(at, text) for at, text in placed if low <= at <= high]


def _values(mark: Mark, which: str) -> Floats:
    """Return the coordinates of a mark that an axis must contain."""
    arrays: list[npt.ArrayLike] = []
    if isinstance(mark, charts.Band):
        arrays = [mark.x] if which == "x" else [mark.low, mark.high]
    elif isinstance(mark, charts.Steps):
        arrays = [mark.edges] if which == "x" else [mark.values, 0.0]
    elif isinstance(mark, charts.Line | charts.Points | charts.Image):
        arrays = [getattr(mark, which)]
    return np.concatenate([np.empty(0), *(np.ravel(array) for array in arrays)])
