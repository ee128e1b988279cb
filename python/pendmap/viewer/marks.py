"""Panels of charts in 2D views: frame, ticks and units, and marks as components of a recording."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap.charts import marks as charts
from pendmap.charts import palette, plane
from pendmap.charts.chart import holding
from pendmap.formatting import typographic
from pendmap.viewer import recording
from pendmap.viewer.recording import INK

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import numpy.typing as npt

    from pendmap.charts.chart import Axis, Panel
    from pendmap.charts.marks import Ends, Floats, Mark

SIDE: Final = 1000.0  # Width of a frame, units of the view
_POWER: Final = re.compile(r"\$(-?)10\^\{(-?\d+)\}\$")
PALE: Final = (charts.INK, charts.QUIET)  # Colours that are invisible on a dark background
AREAS, LINES, POINTS = 10.0, 20.0, 30.0  # Drawing order above images, the lowest first
THIN: Final = 0.7  # Width of the outline of an area
BYTE, CLASSES = 256, 20_000  # Classes that one byte holds; most values of an image of numbers


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


def unscaled(axis: Axis, values: npt.ArrayLike) -> Floats:
    """Return values of an axis from those that a linear axis shows."""
    x: Floats = np.asarray(values, dtype=float)
    if axis.scale == "log":
        x = 10.0**x
    elif axis.scale == "signed":
        beyond = np.sign(x) * 10.0 ** (np.abs(x) - 1.0)
        x = axis.straight * np.where(np.abs(x) > 1.0, beyond, x)
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

    def across(self, axis: str, value: float) -> Floats:
        """Return the line across the frame at a value of an axis."""
        at = self.points(value, 1.0) if axis == "x" else self.points(1.0, value)
        ends = np.repeat(at[None], 2, axis=0)
        ends[:, int(axis == "x")] = self.y if axis == "x" else self.x
        return ends

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
        # Beside the ticks a name would cover one where the view is small.
        places += [[w / 2, h + 75], [0, -85]]
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
    low, high = sorted(unscaled(axis, ends).tolist())
    name, ticks = plane.ticks(axis, low, high)
    return plain(name), [(float(scaled(axis, at)), plain(text)) for at, text in ticks]


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


def log(
    stream: rr.RecordingStream,
    place: Place,
    mark: Mark,
    number: int,
    steps: tuple[str, Floats] | None = None,
) -> None:
    """Log a mark under its path, or else its number and name; it covers those before it.

    Points with values ``when`` are logged at each of the ``steps``, the values of a timeline.
    """
    leaf = re.sub(r"\W+", "_", f"{number}_{mark.name}").strip("_")
    path = f"{place.root}/data/{mark.path or leaf}"
    order = 0.01 * number if mark.order is None else mark.order
    if isinstance(mark, charts.Image):
        _log_image(stream, place, mark, path)
    elif isinstance(mark, charts.Points) and mark.when is not None and steps is not None:
        look: dict[str, Any] = {"colors": [_shade(mark.colour)], "draw_order": POINTS + order}
        look["radii"] = rr.Radius.ui_points(0.7 * mark.size)
        stream.log(path, rr.Points2D.from_fields(**look), static=True)
        at, number_of = place.points(mark.x, mark.y), np.searchsorted(steps[1], mark.when)
        shown = np.argsort(number_of, kind="stable")
        shown = shown[place.inside(at[shown])]
        counts = np.bincount(number_of[shown], minlength=steps[1].size)
        columns = rr.Points2D.columns(positions=at[shown].astype(np.float32)).partition(counts)
        stream.send_columns(path, [rr.TimeColumn(steps[0], duration=steps[1])], columns)
    elif isinstance(mark, charts.Points):
        for leaf, points in _points(mark, place, POINTS + order):
            stream.log(f"{path}{leaf}", points, static=True)
    elif isinstance(mark, charts.Text):
        at = place.points([mark.x], mark.y)
        stream.log(path, recording.labels(at, [mark.text], _shade(mark.colour)), static=True)
    elif not isinstance(mark, charts.Line) or np.size(mark.x) or mark.path:
        above = LINES if isinstance(mark, charts.Line | charts.Steps | charts.Level) else AREAS
        lines = place.lines(*_outlines(mark, place))
        look = {"colors": [_shade(mark.colour)], "draw_order": above + order}
        look["radii"] = rr.Radius.ui_points(getattr(mark, "width", THIN))
        if mark.name and lines:  # shown where one points
            look |= {"labels": [mark.name] * len(lines), "show_labels": False}
        strips = [line.astype(np.float32) for line in lines]
        stream.log(path, rr.LineStrips2D(strips, **look), static=True)


def legend(every: Sequence[Mark]) -> dict[str, str]:
    """Return the names of marks and classes with their colours."""
    names: dict[str, str] = {}
    for mark in every:
        if isinstance(mark, charts.Image):
            names |= {name: colour for name, colour in mark.classes if name}
        elif mark.name:
            names[mark.name] = mark.colour
    return names


def _shade(colour: str) -> tuple[int, int, int]:
    return INK if colour in PALE else palette.parts(colour)


def _outlines(mark: Mark, place: Place) -> Iterator[Floats]:
    """Yield the lines of a mark, whether in the frame or not, in the units of linear axes."""
    if isinstance(mark, charts.Line):
        line = place.points(mark.x, mark.y)
        if mark.step:
            line = np.stack([np.repeat(line[:, 0], 2)[1:], np.repeat(line[:, 1], 2)[:-1]], axis=1)
            # A last value that is repeated extends to its edge only.
            line = line[: len(line) - (len(line) > 1 and line[-1, 1] == line[-2, 1])]
        yield line
    elif isinstance(mark, charts.Band):
        there = np.asarray(mark.low) < np.asarray(mark.high)
        for edge in (mark.low, mark.high):
            yield place.points(mark.x, np.where(there, edge, np.nan))
    elif isinstance(mark, charts.Steps):
        heights = np.concatenate([[0.0], np.repeat(mark.values, 2), [0.0]])
        yield place.points(np.repeat(mark.edges, 2), heights)
    elif isinstance(mark, charts.Areas):
        for shape in mark.shapes:
            yield place.points(*np.concatenate([shape, shape[:1]]).T)
    elif isinstance(mark, charts.Level | charts.Span):
        ends = mark.value if isinstance(mark, charts.Level) else mark.ends
        for end in np.ravel(np.asarray(ends, dtype=float)):
            yield place.across(mark.axis, end)


def _points(mark: charts.Points, place: Place, order: float) -> Iterator[tuple[str, rr.Points2D]]:
    """Yield the points, on a larger ring in the colour of their edge and one in that of a halo."""
    at = place.points(mark.x, mark.y)
    at = at[place.inside(at) if mark.clip else np.isfinite(at).all(axis=1)].astype(np.float32)
    if not (len(at) or mark.path):
        return
    size = max(0.7 * mark.size, 0.7)
    hollow = mark.fill not in {"", "none"}
    edge = mark.edge or (mark.colour if hollow else "")
    discs = [("/halo", mark.halo, size + 2.0), ("/edge", edge, size + 1.0)]
    discs.append(("", mark.fill if hollow else mark.colour, size))
    for k, (leaf, colour, radius) in enumerate(discs):
        if colour:
            look: dict[str, Any] = {"colors": [_shade(colour)], "draw_order": order + 0.001 * k}
            if mark.name and not leaf:  # shown where one points
                look |= {"labels": [mark.name], "show_labels": False}
            yield leaf, rr.Points2D(at, radii=rr.Radius.ui_points(radius), **look)


def _log_image(stream: rr.RecordingStream, place: Place, mark: charts.Image, path: str) -> None:
    """Log an image of classes; where one points, the viewer shows the name of the class."""
    shown, classes, look = mark.values, list(mark.classes), mark.colours
    if look is not None:
        shown, classes = _in_classes(mark.values, look)
        _log_bar(stream, place, look)
    context: list[Any] = [(k, n, palette.parts(colour)) for k, (n, colour) in enumerate(classes)]
    images = [one for one in place.panel.marks if isinstance(one, charts.Image)]
    if look is not None and mark is not images[0]:
        context[0] = (0, "", (0, 0, 0, 0))  # cells without a value show the image below
    kind = np.uint8 if len(context) <= BYTE else np.uint16
    stream.log(path, place.of_pixels(shown.shape, mark.x, mark.y), static=True)
    stream.log(path, rr.AnnotationContext(context), static=True)
    order = images.index(mark) * 0.01
    image: Any = shown.astype(kind)
    image = rr.SegmentationImage(image, opacity=1.0, draw_order=order)
    stream.log(path, image, static=True)


def _in_classes(
    numbers: npt.NDArray[Any], look: charts.Colours
) -> tuple[npt.NDArray[np.int64], list[tuple[str, str]]]:
    """Return an image of numbers in classes, one for each value to 4 digits; 0 without a value."""
    known = np.isfinite(numbers)
    size = np.abs(numbers[known], dtype=float)
    values, place = np.empty(0), np.empty(0, dtype=int)
    for digits in (4, 3, 2):
        step = 10.0 ** (np.floor(np.log10(np.where(size > 0, size, 1.0))) + 1 - digits)
        rounded = step * np.round(numbers[known] / step)
        values, place = np.unique(rounded.astype(np.float32), return_inverse=True)
        if values.size < CLASSES:
            break
    image = np.zeros(numbers.shape, dtype=np.int64)
    image[known] = 1 + place
    colours = palette.shades(look.map, position(look, values.astype(float)))
    classes = [("no value", palette.UNDECIDED)]
    for value, colour in zip(values, colours, strict=True):
        text = typographic(f"{value:.4g}")
        classes.append((text, "#{:02x}{:02x}{:02x}".format(*colour)))
    return image, classes


def position(look: charts.Colours, numbers: npt.NDArray[Any]) -> Floats:
    """Return the places of values on a colour scale, 0 to 1."""
    low, high = look.low, look.high
    if look.scale == "log":
        at = np.log(numbers / low) / np.log(high / low)
    elif look.scale == "centred":
        at = 0.5 + 0.5 * numbers / np.where(numbers < 0, -low, high)
    elif look.scale == "counts":
        at = np.floor(numbers - low) / max(round(high - low) - 1, 1)
    else:
        at = (numbers - low) / (high - low)
    return np.asarray(np.clip(at, 0.0, 1.0), dtype=float)


def _log_bar(stream: rr.RecordingStream, place: Place, look: charts.Colours) -> None:
    """Log the colour bar: an image one pixel wide, lowest value first, with ticks beside it."""
    path, rows = f"{place.root}/axes/bar", 256
    transform = rr.Transform3D(
        translation=[SIDE + 35.0, place.height, 0.0],
        mat3x3=np.diag([35.0, -place.height / rows, 1.0]),
    )
    column = palette.shades(look.map, np.linspace(0.0, 1.0, rows))
    stream.log(f"{path}/colours", transform, static=True)
    stream.log(f"{path}/colours", rr.Image(column.reshape(rows, 1, 3)), static=True)
    ticks = [at for at, _ in plane.plain_ticks(look.low, look.high)]
    ticks = ticks if look.ticks is None else list(look.ticks)
    down = place.height * (1.0 - position(look, np.array(ticks, dtype=float)))
    places = [[SIDE + 120.0, y - 22] for y in down]
    texts = [typographic(f"{tick:.6g}") for tick in ticks]
    named = recording.labels([*places, [SIDE - 20, -55]], [*texts, plain(look.name)])
    stream.log(f"{path}/ticks", named, static=True)
