"""Any chart as a recording: panels with frame and ticks in 2D views, marks in the axes' units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap.charts import marks as charts
from pendmap.charts import palette
from pendmap.charts.chart import Panel, holding
from pendmap.viewer import frame

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy.typing as npt
    import xarray as xr

    from pendmap.charts.chart import Axis, Chart
    from pendmap.charts.marks import Floats, Mark

    Log = Callable[[rr.RecordingStream, str, Any, "Place"], None]

PALE: Final = {charts.INK: frame.INK, charts.QUIET: frame.INK}
"""Colours that are invisible on a dark background, with their replacements."""


@dataclass(frozen=True)
class Place:
    """Position of a panel in a view; logarithmic axes show powers of ten."""

    panel: Panel
    frame: frame.Frame

    @classmethod
    def of(cls, panel: Panel, ratio: float) -> Place:
        """Return the place of a panel with this ratio of height to width."""
        sides = [_side(panel, which) for which in "xy"]
        (x, across), (y, up) = sides
        angles = (panel.x.scale == "angle", panel.y.scale == "angle")
        return cls(panel, frame.Frame(x, y, (across, up), ratio, angles))

    def points(self, x: npt.ArrayLike, y: npt.ArrayLike) -> Floats:
        """Return points, shape (n, 2), in the coordinates of the axes."""
        both = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        sides = (self.panel.x, self.panel.y)
        with np.errstate(divide="ignore", invalid="ignore"):
            scaled = [
                np.log10(v) if side.scale == "log" else v
                for v, side in zip(both, sides, strict=True)
            ]
        return np.stack(scaled, axis=-1)

    def lines(self, *lines: Floats) -> list[Floats]:
        """Return the finite parts of lines within the panel, because a view does not clip."""
        return frame.pieces(lines, *zip(self.frame.x, self.frame.y, strict=True))


def _side(panel: Panel, which: str) -> tuple[charts.Ends, str]:
    """Return the limits and the name of an axis; powers of ten for a logarithmic one."""
    side: Axis = getattr(panel, which)
    ends = side.ends or holding(*(_values(mark, which) for mark in panel.marks))
    if side.scale != "log":
        return ends, side.name
    low, high = (float(np.log10(end)) for end in ends)
    return (low, high), f"log10 of {side.name}"


def _values(mark: Mark, which: str) -> npt.ArrayLike:
    if isinstance(mark, charts.Band):
        return mark.x if which == "x" else np.concatenate([mark.low, mark.high])
    if isinstance(mark, charts.Steps):
        return mark.edges if which == "x" else np.append(mark.values, 0.0)
    if isinstance(mark, (charts.Line, charts.Points)):
        return mark.x if which == "x" else mark.y
    return []


def places(chart: Chart) -> list[Place]:
    """Return the panels with a mark in the recording, each with its position."""
    recorded = (
        panel for panel in chart.recorded or chart.panels if any(mark.path for mark in panel.marks)
    )
    return [Place.of(panel, chart.ratio) for panel in recorded]


def blueprint(chart: Chart) -> rrb.Blueprint:
    """Return the layout: the panels, with legend and summary beside them."""
    views = [one.frame.view(one.panel.where, title(one.panel)) for one in places(chart)]
    front: rrb.Container = rrb.Vertical(*views)
    if chart.tabs:
        front = rrb.Tabs(*views, active_tab=0)
    elif len(views) > 3:  # noqa: PLR2004
        front = rrb.Grid(*views, grid_columns=2)
    aside = rrb.Vertical(
        rrb.TextDocumentView(origin="/legend", name="Legend"),
        rrb.TextDocumentView(origin="/summary", name="Summary"),
    )
    return frame.screen(front, aside, shares=[11, 6])


def title(panel: Panel) -> str:
    """Return the title of the view of a panel."""
    text = panel.title or panel.name
    return text[:1].upper() + text[1:]


def log(stream: rr.RecordingStream, dataset: xr.Dataset, chart: Chart) -> None:
    """Log every panel of a chart, the legend and the dataset's summary, all static."""
    frame.summary(stream, dataset)
    named: dict[str, str] = {}
    for place in places(chart):
        log_panel(stream, place)
    for panel in chart.recorded or chart.panels:
        named |= legend(panel.marks)
    lines = [f"- {name}: {shade}" for name, shade in named.items()]
    frame.text(stream, "legend", "\n".join([*lines, "", chart.remark]).strip() or chart.title)


def legend(marks: Sequence[Mark]) -> dict[str, str]:
    """Return the names of recorded marks, with their colours in words."""
    named = {mark.name: palette.in_words(mark.colour) for mark in marks if mark.name and mark.path}
    for mark in marks:
        if isinstance(mark, charts.Image):
            named |= {name: palette.in_words(colour) for name, colour in mark.classes if name}
    return named


def log_panel(stream: rr.RecordingStream, place: Place) -> None:
    """Log the frame of a panel and those of its marks that have a path."""
    root = place.panel.where
    place.frame.log(stream, root)
    for mark in place.panel.marks:
        if mark.path:
            _LOG[type(mark)](stream, f"{root}/data/{mark.path}", mark, place)


def _colour(mark: Mark) -> tuple[int, int, int]:
    return PALE.get(mark.colour) or palette.parts(mark.colour)


def _strips(
    stream: rr.RecordingStream, path: str, mark: Mark, lines: Sequence[Floats], width: float
) -> None:
    strips = rr.LineStrips2D(
        [line.astype(np.float32) for line in lines],
        colors=[_colour(mark)],
        radii=rr.Radius.ui_points(width),
        draw_order=None if mark.order is None else 20.0 + mark.order,
    )
    stream.log(path, strips, static=True)


def _line(stream: rr.RecordingStream, path: str, mark: charts.Line, place: Place) -> None:
    x, y = np.asarray(mark.x, dtype=float), np.asarray(mark.y, dtype=float)
    if mark.step:
        x, y = np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]
        if y.size > 1 and y[-1] == y[-2]:
            x, y = x[:-1], y[:-1]  # the last value extends to its edge only
    _strips(stream, path, mark, place.lines(place.points(x, y)), mark.width)


def _points(stream: rr.RecordingStream, path: str, mark: charts.Points, place: Place) -> None:
    at = place.points(mark.x, mark.y)
    at = at[np.isfinite(at).all(axis=1)]
    if len(at):
        size = rr.Radius.ui_points(max(0.7 * mark.size, 0.7))
        spots = rr.Points2D(at.astype(np.float32), colors=[_colour(mark)], radii=size)
        stream.log(path, spots, static=True)


def _band(stream: rr.RecordingStream, path: str, mark: charts.Band, place: Place) -> None:
    low, high = (np.asarray(edge) for edge in (mark.low, mark.high))
    edges = (place.points(mark.x, np.where(low < high, edge, np.nan)) for edge in (low, high))
    _strips(stream, path, mark, place.lines(*edges), 0.7)


def _steps(stream: rr.RecordingStream, path: str, mark: charts.Steps, place: Place) -> None:
    heights = np.concatenate([[0.0], np.repeat(mark.values, 2), [0.0]])
    outline = place.points(np.repeat(mark.edges, 2), heights)
    _strips(stream, path, mark, place.lines(outline), mark.width)


def _level(stream: rr.RecordingStream, path: str, mark: charts.Level, place: Place) -> None:
    across = mark.axis == "y"
    at = place.points(1.0 if across else mark.value, mark.value if across else 1.0)
    ends = np.repeat(at[None], 2, axis=0)
    ends[:, 0 if across else 1] = place.frame.x if across else place.frame.y
    _strips(stream, path, mark, place.lines(ends), mark.width)


def _image(stream: rr.RecordingStream, path: str, mark: charts.Image, place: Place) -> None:
    """Log classes with names and colours, or numbers as colours from blue to red with their bar."""
    stream.log(path, place.frame.of_pixels(mark.values.shape), static=True)
    if mark.colours is None:
        context = [(k, n, palette.parts(colour)) for k, (n, colour) in enumerate(mark.classes)]
        stream.log(place.panel.where, rr.AnnotationContext(context), static=True)
        stream.log(path, rr.SegmentationImage(mark.values, opacity=1.0), static=True)
        return
    low, high = mark.colours.low, mark.colours.high
    # Scales with two halves are centred at 0, others at their least value.
    middle, half = low, max(high - low, 1e-9)
    if mark.colours.scale == "centred":
        middle, half = 0.0, max(abs(low), abs(high))
    known = np.isfinite(mark.values)
    scaled = np.where(known, (mark.values - middle) / half, 0.0).ravel()
    shades = palette.diverging(scaled).reshape(*mark.values.shape, 3)
    shades[~known] = palette.rgb("undecided")
    stream.log(path, rr.Image(shades), static=True)
    column = palette.diverging((np.linspace(low, high, 256) - middle) / half)
    bar = rr.Image(column.reshape(256, 1, 3))
    place.frame.bar(stream, place.panel.where, bar, low=low, high=high)


_LOG: Final[dict[type[Mark], Log]] = {
    charts.Line: _line,
    charts.Points: _points,
    charts.Band: _band,
    charts.Steps: _steps,
    charts.Level: _level,
    charts.Image: _image,
}
