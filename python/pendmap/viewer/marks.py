"""Marks of charts as components of a recording."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import rerun as rr

from pendmap.charts import marks as charts
from pendmap.charts import palette, plane
from pendmap.formatting import typographic
from pendmap.viewer import recording
from pendmap.viewer.place import SIDE, Place, plain
from pendmap.viewer.recording import INK

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import numpy.typing as npt

    from pendmap.charts.marks import Floats, Mark

    Part = tuple[str, Any, bool]  # leaf of the path, components, whether always static

PALE: Final = (charts.INK, charts.QUIET)  # Colours that are invisible on a dark background
IMAGES, AREAS, LINES, POINTS = 0.0, 10.0, 20.0, 30.0  # Drawing order, the lowest first
BYTE, CLASSES = 256, 20_000  # Classes that one byte holds; most values of an image of numbers


def log(
    stream: rr.RecordingStream, place: Place, mark: Mark, number: int, *, static: bool = True
) -> None:
    """Log a mark under its path, or else its number and name; it covers those before it."""
    leaf = re.sub(r"\W+", "_", f"{number}_{mark.name}").strip("_")
    path = f"{place.root}/data/{mark.path or leaf}"
    order = 0.01 * number if mark.order is None else mark.order
    for end, part, still in _PARTS[type(mark)](mark, place, order):
        stream.log(f"{path}{end}", part, static=static or still)
    if isinstance(mark, charts.Image) and mark.colours is not None:
        _log_bar(stream, place, mark.colours)


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


def _strips(mark: Mark, lines: Sequence[Floats], width: float, order: float) -> Part:
    """Return lines of a colour, with the name of the mark when one points at them."""
    look: dict[str, Any] = {"colors": [_shade(mark.colour)], "radii": rr.Radius.ui_points(width)}
    if mark.name and lines:
        look |= {"labels": [mark.name] * len(lines), "show_labels": False}
    strips = [line.astype(np.float32) for line in lines]
    return "", rr.LineStrips2D(strips, draw_order=order, **look), False


def _line(mark: charts.Line, place: Place, order: float) -> Iterator[Part]:
    x, y = np.asarray(mark.x, dtype=float), np.asarray(mark.y, dtype=float)
    if mark.step:
        x, y = np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]
        if y.size > 1 and y[-1] == y[-2]:
            x, y = x[:-1], y[:-1]  # the last value extends to its edge only
    if x.size or mark.path:
        yield _strips(mark, place.lines(place.points(x, y)), mark.width, LINES + order)


def _points(mark: charts.Points, place: Place, order: float) -> Iterator[Part]:
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
            look: dict[str, Any] = {
                "colors": [_shade(colour)],
                "radii": rr.Radius.ui_points(radius),
            }
            if mark.name and not leaf:  # shown where one points
                look |= {"labels": [mark.name], "show_labels": False}
            yield leaf, rr.Points2D(at, draw_order=POINTS + order + 0.001 * k, **look), False


def _band(mark: charts.Band, place: Place, order: float) -> Iterator[Part]:
    there = np.asarray(mark.low) < np.asarray(mark.high)
    edges = (np.where(there, edge, np.nan) for edge in (mark.low, mark.high))
    lines = place.lines(*(place.points(mark.x, edge) for edge in edges))
    yield _strips(mark, lines, 0.7, AREAS + order)


def _steps(mark: charts.Steps, place: Place, order: float) -> Iterator[Part]:
    heights = np.concatenate([[0.0], np.repeat(mark.values, 2), [0.0]])
    outline = place.points(np.repeat(mark.edges, 2), heights)
    yield _strips(mark, place.lines(outline), mark.width, LINES + order)


def _areas(mark: charts.Areas, place: Place, order: float) -> Iterator[Part]:
    closed = (np.concatenate([shape, shape[:1]]) for shape in mark.shapes)
    lines = place.lines(*(place.points(*shape.T) for shape in closed))
    yield _strips(mark, lines, 0.7, AREAS + order)


def _across(place: Place, axis: str, value: float) -> Floats:
    """Return the line across the frame at a value of an axis."""
    at = place.points(*((value, 1.0) if axis == "x" else (1.0, value)))
    ends = np.repeat(at[None], 2, axis=0)
    if axis == "x":
        ends[:, 1] = place.y
    else:
        ends[:, 0] = place.x
    return ends


def _level(mark: charts.Level, place: Place, order: float) -> Iterator[Part]:
    lines = place.lines(_across(place, mark.axis, mark.value))
    yield _strips(mark, lines, mark.width, LINES + order)


def _span(mark: charts.Span, place: Place, order: float) -> Iterator[Part]:
    ends = np.ravel(np.asarray(mark.ends, dtype=float))
    lines = place.lines(*(_across(place, mark.axis, end) for end in ends))
    yield _strips(mark, lines, 0.7, AREAS + order)


def _text(mark: charts.Text, place: Place, _: float) -> Iterator[Part]:
    yield (
        "",
        recording.labels(place.points([mark.x], mark.y), [mark.text], _shade(mark.colour)),
        False,
    )


def _image(mark: charts.Image, place: Place, order: float) -> Iterator[Part]:
    """Yield an image of classes; where one points, the viewer shows the name of the class."""
    shown, classes = mark.values, list(mark.classes)
    if mark.colours is not None:
        shown, classes = _in_classes(mark.values, mark.colours)
    context: list[Any] = [(k, n, palette.parts(colour)) for k, (n, colour) in enumerate(classes)]
    first = next(one for one in place.panel.marks if isinstance(one, charts.Image))
    if mark.colours is not None and mark is not first:
        context[0] = (0, "", (0, 0, 0, 0))  # cells without a value show the image below
    kind = np.uint8 if len(context) <= BYTE else np.uint16
    image: Any = shown.astype(kind)
    image = rr.SegmentationImage(image, opacity=1.0, draw_order=IMAGES + order)
    yield "", place.of_pixels(shown.shape, mark.x, mark.y), True
    yield "", rr.AnnotationContext(context), True
    yield "", image, False


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


_PARTS: Final[dict[type[Mark], Callable[[Any, Place, float], Iterator[Part]]]] = {
    charts.Line: _line,
    charts.Points: _points,
    charts.Band: _band,
    charts.Steps: _steps,
    charts.Areas: _areas,
    charts.Level: _level,
    charts.Span: _span,
    charts.Text: _text,
    charts.Image: _image,
}
