"""The figure of critical curves: where rest is stable, boundaries, folds, asymptotic curves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pendmap.analysis.critical_curves import PLANES, in_plane
from pendmap.analysis.tongues import NEAR
from pendmap.charts import basins as layering
from pendmap.charts import tongues as drawn
from pendmap.errors import InputError
from pendmap.render import style
from pendmap.render.sheet import Panel, Sheet

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from matplotlib.figure import Figure

_STABLE, _INVERTED = "#e3ecd8", "#9a6fb0"
_FOLD = "#009e73"
_LOOKS: tuple[Any, ...] = ("-.", "--", ":")


def figure(  # noqa: PLR0913 (all of these a user may choose)
    dataset: xr.Dataset,
    *,
    layer: str | None,
    size: tuple[float, float] | None,
    dpi: float,
    colormap: str | None,
    title: str = "Where rest is stable, hanging and inverted",
    marks: Sequence[tuple[float, float, str]] = (),
) -> Figure:
    """Return the figure of critical curves; see :func:`pendmap.render.draw`.

    ``marks`` are further points ``(p, omega, name)``.
    """
    plane = layer or str(dataset.attrs.get("plane", PLANES[0]))
    if plane not in PLANES:
        raise InputError(f"layer must be one of {', '.join(PLANES)}, got {plane!r}")
    if colormap is not None:
        raise InputError(f"colormap {colormap!r}: a figure of critical curves has no colour map")
    chart = drawn.chart(dataset, plane, NEAR)
    handles, texts = _legend(chart, own=not marks, damped=float(dataset.attrs["gamma"]) > 0)
    if dataset.attrs["moved"]:
        texts = [text.replace("rest is stable", "rest: its orbit is stable") for text in texts]
    sheet = Sheet(
        [Panel()],
        ratio=0.72,
        title=title,
        subtitle=layering.parameters({k: v for k, v in dataset.attrs.items() if k not in _DRIVE}),
        handles=handles,
        texts=texts,
        labels=(style.widest(*chart.y), style.widest(*chart.x)),
        size=size,
        dpi=dpi,
    )
    axes = sheet.axes[0]
    # Edges of the same colour: without them a seam shows between neighbours.
    areas = PolyCollection(chart.stable, facecolors=_STABLE, edgecolors=_STABLE, linewidths=0.3)
    axes.add_collection(areas)
    # A hatch shows what lies below it, and no seams.
    upright = PolyCollection(
        chart.inverted, facecolors="none", edgecolors=_INVERTED, hatch="////", linewidths=0
    )
    axes.add_collection(upright)
    axes.add_collection(LineCollection(chart.undamped, colors=style.QUIET, linewidths=0.6))
    axes.add_collection(LineCollection(chart.bands, colors=style.QUIET, linewidths=3.0, alpha=0.5))
    for multiplier, colour in drawn.COLOURS.items():
        thick = 1.5 if multiplier < 0 else 1.1
        both = [*chart.lines[multiplier], *chart.inverted_lines[multiplier]]
        axes.add_collection(LineCollection(both, colors=colour, linewidths=thick))
    for look, (near, far) in zip(_LOOKS, chart.asymptotic.values(), strict=False):
        axes.plot(near[:, 0], near[:, 1], linestyle=look, color=style.INK, linewidth=1.0)
        axes.plot(far[:, 0], far[:, 1], linestyle=look, color=style.INK, linewidth=0.5, alpha=0.45)
    axes.plot(chart.fold[:, 0], chart.fold[:, 1], color=_FOLD, linewidth=1.6, linestyle=(0, (5, 2)))
    if _ends_in_view(chart):
        axes.plot(chart.beyond[:, 0], chart.beyond[:, 1], color="#c8c8c8", linewidth=3.0, zorder=1)
    if marks:
        for p, omega, name in marks:
            (x,), (y,) = in_plane(np.array([omega]), np.array([p]), plane)
            at = float(x), float(y)
            axes.plot(*at, marker="o", color=style.INK, markersize=5)
            axes.annotate(name, at, xytext=(6, 4), textcoords="offset points")
    else:
        axes.plot(*chart.own, marker="*", color=style.INK, markersize=9, linestyle="none")
    axes.set_xlim(*chart.x)
    axes.set_ylim(*chart.y)
    axes.set_xlabel(chart.names[0])
    axes.set_ylabel(chart.names[1])
    return sheet.figure


_DRIVE = {"p", "omega", "phase", "Omega", "phi"}


def _ends_in_view(chart: drawn.Chart) -> bool:
    """Whether the largest amplitude computed is within the picture, not its upper edge."""
    return bool((chart.beyond[:, 1] < 0.995 * chart.y[1]).any())


def _legend(chart: drawn.Chart, *, own: bool, damped: bool) -> tuple[list[Any], list[str]]:
    entries: list[tuple[Any, str]] = [
        (Patch(facecolor=_STABLE, edgecolor=style.QUIET, linewidth=0.4), "hanging rest is stable"),
        (
            Line2D([], [], color=drawn.COLOURS[-1], linewidth=1.5),
            "exact, multiplier \N{MINUS SIGN}1 (period 2)",
        ),
        (Line2D([], [], color=drawn.COLOURS[1], linewidth=1.1), "exact, multiplier +1 (period 1)"),
    ]
    if chart.inverted:
        hatched = Patch(facecolor="none", edgecolor=_INVERTED, hatch="////", linewidth=0)
        entries.insert(1, (hatched, "inverted rest is stable"))
    if damped and chart.undamped:
        bare = Line2D([], [], color=style.QUIET, linewidth=0.6)
        entries.append((bare, "exact, without damping"))
    if (chart.fold == chart.fold).any(axis=0)[1]:
        fold = Line2D([], [], color=_FOLD, linewidth=1.6, linestyle=(0, (5, 2)))
        entries.append((fold, "fold: the oscillation exists from here"))
    for look, (name, parts) in zip(_LOOKS, chart.asymptotic.items(), strict=False):
        if np.isnan(parts).all():
            continue
        entries.append((Line2D([], [], color=style.INK, linewidth=1.0, linestyle=look), name))
    if chart.bands:
        band = Line2D([], [], color=style.QUIET, linewidth=3.0, alpha=0.5)
        entries.append((band, "95 % of the draws"))
    if _ends_in_view(chart):
        edge = Line2D([], [], color="#c8c8c8", linewidth=3.0)
        entries.append((edge, "largest p computed"))
    (left, right), (low, high) = chart.x, chart.y
    if own and left <= chart.own[0] <= right and low <= chart.own[1] <= high:
        star = Line2D([], [], color=style.INK, marker="*", markersize=9, linestyle="none")
        entries.append((star, "this pendulum"))
    return [e[0] for e in entries], [e[1] for e in entries]
