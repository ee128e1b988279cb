"""Marks of charts drawn with matplotlib, and their legend handles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import BoundaryNorm, LogNorm, Normalize, TwoSlopeNorm, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from pendmap.charts import marks as charts
from pendmap.formatting import typographic
from pendmap.render import style

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.axes import Axes

    from pendmap.charts.marks import Mark

TABLE, APART = 8.0, 0.14  # Font size of a table; least distance between its columns, inches
HANDLE: Final = 0.6  # Width of the handle of a legend's entry with its distances, inches
LEGEND: Final[dict[str, Any]] = {
    "handlelength": 1.7,
    "handleheight": 1.0,
    "handletextpad": 0.6,
    "columnspacing": 1.6,
    "borderpad": 0.1,
}
"""Distances in legends, in font sizes."""
_CELLS: Final = 1200  # Greatest number of columns of a density, and three times that of rows
_PALEST: Final = 0.2  # Opacity of a single point in a density
MANY: Final = 2000  # Number of points from which they are rasterised in vector files


def draw(axes: Axes, mark: Mark) -> None:
    """Draw a mark."""
    _DRAW[type(mark)](axes, mark)


def _common(mark: Mark) -> dict[str, Any]:
    order = {} if mark.order is None else {"zorder": mark.order}
    return order if mark.alpha == 1 else order | {"alpha": mark.alpha}


def _dash(dash: charts.Dash) -> Any:  # noqa: ANN401 (as matplotlib takes it)
    return dash if isinstance(dash, str) else (0, dash)


def _look(mark: charts.Line) -> dict[str, Any]:
    look = {"color": mark.colour, "lw": mark.width, "ls": _dash(mark.dash)} | _common(mark)
    if mark.halo:
        stroke = withStroke(linewidth=1.3 * mark.width + 0.9, foreground=mark.halo)
        look["path_effects"] = [stroke]
    return look


def _spots(mark: charts.Points) -> dict[str, Any]:
    look = {
        "marker": mark.marker,
        "ls": "none",
        "ms": mark.size,
        "color": mark.colour,
        "mfc": mark.fill or mark.colour,
        "mec": mark.edge or mark.colour,
        "mew": mark.edge_width,
    } | _common(mark)
    if mark.halo:
        look["path_effects"] = [withStroke(linewidth=0.42 * mark.size, foreground=mark.halo)]
    return look


def _line(axes: Axes, mark: charts.Line) -> None:
    axes.plot(mark.x, mark.y, drawstyle="steps-post" if mark.step else "default", **_look(mark))


def _points(axes: Axes, mark: charts.Points) -> None:
    if not np.size(mark.x):
        return  # it appears in the legend alone
    many = np.size(mark.x) > MANY
    if many and mark.cells is not None:
        _density(axes, mark, mark.cells)
        return
    axes.plot(mark.x, mark.y, clip_on=mark.clip, rasterized=many, **_spots(mark))


def _density(axes: Axes, mark: charts.Points, cells: charts.Floats) -> None:
    """Draw the number of points in each pixel, on a logarithmic scale from pale to full colour."""
    known = np.isfinite(mark.x) & np.isfinite(mark.y)
    x, y = mark.x[known], mark.y[known]
    every = np.linspace(0, cells.size - 1, min(cells.size, _CELLS + 1))
    across = cells[every.round().astype(int)]
    rows = int(np.clip(x.size / np.unique(x).size, 50, _CELLS // 3))
    up = np.linspace(float(y.min()), float(y.max()), rows + 1)
    counts = np.histogram2d(x, y, (across, up))[0].T
    shares = np.log1p(counts) / np.log1p(np.quantile(counts[counts > 0], 0.98))
    shades = np.empty((*counts.shape, 4))
    shades[..., :3] = to_rgb(mark.colour)
    shades[..., 3] = np.where(counts > 0, np.clip(shares, _PALEST, 1.0), 0.0)
    axes.pcolormesh(across, up, shades, rasterized=True, **_common(mark))


def _band(axes: Axes, mark: charts.Band) -> None:
    step: Any = "post" if mark.step else None
    look: dict[str, Any] = {"zorder": 0.5} | _common(mark)
    axes.fill_between(mark.x, mark.low, mark.high, step=step, color=mark.colour, lw=0, **look)


def _steps(axes: Axes, mark: charts.Steps) -> None:
    look: dict[str, Any] = {"baseline": None, "lw": mark.width}
    if mark.filled:
        look = {"fill": True, "lw": 0}
    axes.stairs(mark.values, mark.edges, color=mark.colour, **(look | _common(mark)))


def _areas(axes: Axes, mark: charts.Areas) -> None:
    # Edges of equal colour hide seams between neighbours. A hatch has no edges.
    look: dict[str, Any] = {"facecolors": mark.colour, "edgecolors": mark.colour, "lw": 0.3}
    if mark.hatch:
        look = {"facecolors": "none", "edgecolors": mark.colour, "hatch": mark.hatch, "lw": 0}
    axes.add_collection(PolyCollection(list(mark.shapes), **(look | _common(mark))))


def _level(axes: Axes, mark: charts.Level) -> None:
    look = {"color": mark.colour, "lw": mark.width, "ls": _dash(mark.dash)}
    across = axes.axvline if mark.axis == "x" else axes.axhline
    across(mark.value, **(look | {"zorder": 1.2} | _common(mark)))


def _span(axes: Axes, mark: charts.Span) -> None:
    shade = axes.axvspan if mark.axis == "x" else axes.axhspan
    for low, high in np.reshape(mark.ends, (-1, 2)):
        shade(low, high, color=mark.colour, lw=0, **({"zorder": 0} | _common(mark)))


def _text(axes: Axes, mark: charts.Text) -> None:
    across, up = mark.align
    look: dict[str, Any] = {"color": mark.colour, "ha": across, "va": up, "fontsize": mark.size}
    axes.text(mark.x, mark.y, style.typeset(mark.text), **(look | _common(mark)))


def _table(axes: Axes, mark: charts.Table) -> None:
    """Write a table as wide as the figure, in a smaller font if the figure is too narrow."""
    columns = zip(mark.head, *mark.rows, strict=True)
    texts = ([line for cell in column for line in cell.split("\n")] for column in columns)
    wide = [APART + max(style.inches(line, TABLE) for line in lines) for lines in texts]
    edges = np.cumsum(wide)
    figure: Any = axes.figure
    room = figure.bbox.width / figure.get_figure(root=True).dpi - 0.2
    look: dict[str, Any] = {"va": "bottom", "linespacing": 1.15}
    look["fontsize"] = TABLE * min(room / float(edges[-1]), 1.0)
    for down, row in enumerate([mark.head, *mark.rows]):
        look["color"] = charts.INK if down else charts.QUIET
        axes.text(0.0, down + 1.4, style.typeset(row[0]), ha="left", **look)
        for edge, text in zip(edges[1:], row[1:], strict=True):
            axes.text(edge / edges[-1], down + 1.4, style.typeset(text), ha="right", **look)


def _image(axes: Axes, mark: charts.Image) -> None:
    where: dict[str, Any] = {"origin": "lower", "aspect": "auto", "interpolation": "nearest"}
    where |= {"extent": (*mark.x, *mark.y)} | _common(mark)
    if mark.colours is None:
        shades = np.round(255 * np.array([to_rgb(colour) for _, colour in mark.classes]))
        axes.imshow(shades.astype(np.uint8).reshape(-1, 3)[mark.values], **where)
        return
    look = mark.colours
    drawn = axes.imshow(mark.values, cmap=style.colour_map(look.map), norm=_norm(look), **where)
    bar = axes.figure.colorbar(
        drawn, ax=axes, extend=look.beyond, extendfrac=0.03, pad=0.02, aspect=28, fraction=0.05
    )
    if look.ticks is not None:
        texts = [typographic(f"{tick:.6g}") for tick in look.ticks]
        bar.set_ticks(list(look.ticks), labels=texts)
    bar.ax.minorticks_off()
    bar.outline.set_linewidth(0.7)
    bar.set_label(style.typeset(look.name), labelpad=4)


def _norm(look: charts.Colours) -> Normalize:
    if look.scale == "log":
        return LogNorm(look.low, look.high)
    if look.scale == "centred":
        return TwoSlopeNorm(0.0, look.low, look.high)
    if look.scale == "counts":
        return BoundaryNorm(np.arange(look.low, look.high + 1), 256, extend=look.beyond)
    return Normalize(look.low, look.high)


_DRAW: Final[dict[type[Mark], Callable[[Axes, Any], None]]] = {
    charts.Line: _line,
    charts.Points: _points,
    charts.Band: _band,
    charts.Steps: _steps,
    charts.Areas: _areas,
    charts.Level: _level,
    charts.Span: _span,
    charts.Text: _text,
    charts.Table: _table,
    charts.Image: _image,
}


def legend(marks: Sequence[Mark]) -> dict[str, Any]:
    """Return the handles of the named marks by their texts; equal names share one entry."""
    named: dict[str, list[Any]] = {}
    # Points that are nowhere are entries of the legend alone.
    alone = {m.name for m in marks if isinstance(m, charts.Points) and not np.size(m.x)}
    for mark in marks:
        if isinstance(mark, charts.Image):
            for name, colour in mark.classes:
                if name in alone:
                    continue
                patch = Patch(facecolor=colour, edgecolor=charts.QUIET, linewidth=0.5)
                named.setdefault(name, []).append(patch)
        elif mark.name:
            named.setdefault(mark.name, []).append(_handle(mark))
    every = {style.typeset(name): handles[:3] for name, handles in named.items() if name}
    return {name: tuple(some) if len(some) > 1 else some[0] for name, some in every.items()}


def shape(texts: Sequence[str], room: float) -> tuple[list[str], int]:
    """Return texts of a legend in lines that fit into ``room`` inches, and its columns."""
    size = style.points("legend.fontsize")
    lines = [style.broken(text, room - HANDLE, size) for text in texts]
    widest = max((style.inches(text, size) for text in lines), default=0.0) + HANDLE
    most = min(max(int((room - 0.2) // widest), 1), max(len(lines), 1))
    rows = max(-(-len(lines) // most), 1)
    return lines, max(-(-len(lines) // rows), 1)


def _handle(mark: Mark) -> Any:  # noqa: ANN401 (an artist)
    if isinstance(mark, charts.Line):
        return Line2D([], [], **(_look(mark) | {"lw": max(mark.width, 0.6)}))
    if isinstance(mark, charts.Points):
        size = min(max(mark.size, 3.0), 9.0)
        return Line2D([], [], **(_spots(mark) | {"ms": size}))
    if isinstance(mark, charts.Level):
        return Line2D([], [], color=mark.colour, lw=mark.width, ls=_dash(mark.dash))
    if isinstance(mark, charts.Areas) and mark.hatch:
        return Patch(facecolor="none", edgecolor=mark.colour, hatch=mark.hatch, lw=0)
    return Patch(facecolor=mark.colour, alpha=mark.alpha, lw=0)
