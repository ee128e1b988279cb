"""The figure of a map over two parameters: kinds of attractor, and the largest exponent."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.colors import BoundaryNorm, Normalize, TwoSlopeNorm, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from pendmap.charts import parameter_map as drawn
from pendmap.charts import plane
from pendmap.render import style
from pendmap.render.sheet import Panel, Sheet

if TYPE_CHECKING:
    import numpy.typing as npt
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CELLS = 1200
"""Rows and columns of a layer that are drawn at most, unless the panel has more pixels."""

_LEADING = ("kinds", "exponent")
_RATIO = 0.85
_STRIPE = 0.045
"""Inches of a stripe, along a row."""
_CURVE: dict[str, Any] = {
    "color": style.INK,
    "linewidth": 1.1,
    "path_effects": [withStroke(linewidth=2.6, foreground="white")],
}
_LEAST = 0.05
"""Least part of the other one that a half of the exponents' scale reaches."""

_COUNTS = ("attractors", "period", "winding")
_MOST_COUNT = 8
_MAPS = {"exponent": "RdBu_r", "attractors": "viridis", "period": "viridis", "winding": "viridis"}


def figure(
    dataset: xr.Dataset,
    *,
    layer: str | None,
    size: tuple[float, float] | None,
    dpi: float,
    colormap: str | None,
) -> Figure:
    """Return the figure of a map over two parameters; see :func:`pendmap.render.draw`."""
    leading = ("kinds", "certainty") if "certainty" in dataset else _LEADING
    shown = (drawn.named(dataset, layer),) if layer else leading
    if colormap is not None:
        style.colour_map(colormap)
    listed = drawn.kinds(dataset) if "kinds" in shown else []
    across, up = drawn.edges(dataset)
    texts = [kind.text for kind in listed]
    handles: list[Any] = [
        Patch(facecolor=kind.colour, edgecolor=style.QUIET, linewidth=0.5) for kind in listed
    ]
    curves = drawn.curves(dataset)
    for name, (style_, lines) in curves.items():
        if any(np.isfinite(line).all(axis=1).sum() > 1 for line in lines):
            texts.append(name)
            handles.append(Line2D([], [], linestyle=style_, **_CURVE))
    mark = len(shown) > 1
    panels = [
        Panel(
            bar="" if one == "kinds" else drawn.said(dataset, one),
            title=(f"({'ab'[k]}) " if mark else "") + _heading(one),
        )
        for k, one in enumerate(shown)
    ]
    sheet = Sheet(
        panels,
        ratio=_RATIO,
        title=drawn.title(dataset),
        subtitle=drawn.subtitle(dataset),
        handles=handles,
        texts=texts,
        labels=(style.widest(*up), style.widest(*across)),
        size=size,
        dpi=dpi,
    )
    for one, axes, bar in zip(shown, sheet.axes, sheet.bars, strict=True):
        extent = (*across, *up)
        if one == "kinds":
            colours = np.array([to_rgb(kind.colour) for kind in listed])
            width = max(2, round(_STRIPE * dpi))
            image = drawn.striped(dataset, sheet.pixels, width)
            axes.imshow(
                colours[image],
                extent=extent,
                origin="lower",
                aspect="auto",
                interpolation="nearest",
            )
        else:
            values = drawn.layer(dataset, one, max(CELLS, sheet.pixels))
            _scalar(axes, bar, dataset, one, values, extent=extent, colormap=colormap)
        for style_, lines in curves.values():
            for line in lines:
                axes.plot(*line.T, linestyle=style_, **_CURVE)
        axes.set_xlim(*across)
        axes.set_ylim(*up)
        for which, ends, name in zip("xy", (across, up), drawn.axes(dataset), strict=True):
            style.scale(axes, which, ends, name)
    return sheet.figure


def _heading(one: str) -> str:
    if one == "kinds":
        return f"{drawn.LAYERS[one]}; stripes: they coexist"
    return drawn.LAYERS.get(one, one)


def _scalar(  # noqa: PLR0913 (where to draw, what, and how)
    axes: Axes,
    bar: Axes | None,
    dataset: xr.Dataset,
    one: str,
    values: npt.NDArray[np.float64],
    *,
    extent: tuple[float, float, float, float],
    colormap: str | None,
) -> None:
    if one == "period":
        values = np.where(values > 0, values, np.nan)
    axes.set_facecolor("#d9d9d9")
    norm, extend, ticks = _norm(one, values[np.isfinite(values)])
    image = axes.imshow(
        values,
        extent=extent,
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        cmap=style.colour_map(colormap or _MAPS.get(one, "cividis")),
        norm=norm,
    )
    if bar is not None:
        style.colour_bar(bar, image, drawn.said(dataset, one), extend, ticks)


def _few(low: float, high: float) -> list[float]:
    """Return at most four round places in a half of a colour bar."""
    ticks = [at for at, _ in plane.plain_ticks(low, high)]
    return ticks[::2] if low == 0.0 or len(ticks) % 2 else ticks[1::2]


def _norm(one: str, values: npt.NDArray[np.float64]) -> tuple[Normalize, str, list[float] | None]:
    """Return the colour scale: exponents about 0, counts in steps, shares from 0 to 1."""
    if one == "exponent":
        low, high = (float(q) for q in np.quantile(values, [0.01, 0.99])) if values.size else (0, 0)
        low, high = min(low, -1e-3, -_LEAST * high), max(high, 1e-3, -_LEAST * low)
        # The halves have scales of their own: without ticks on both, dark blue would look as far
        # from 0 as dark red.
        ticks = [at for side in ((low, 0.0), (0.0, high)) for at in _few(*side)]
        return TwoSlopeNorm(0.0, low, high), "both", sorted(set(ticks))
    if one in _COUNTS:
        top = int(min(values.max(initial=1), _MOST_COUNT))
        bounds = np.arange(-0.5 if one != "period" else 0.5, top + 1)
        extend: Literal["max", "neither"] = "max" if values.max(initial=0) > top else "neither"
        ticks = [float(k) for k in range(int(bounds[0] + 0.5), top + 1)]
        return BoundaryNorm(bounds, 256, extend=extend), extend, ticks
    return Normalize(0.0, 1.0), "neither", None
