"""The figure of closed orbits: their paths and stroboscopic points in the phase plane."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from pendmap.charts import basins as layering
from pendmap.charts import orbits as drawn
from pendmap.charts import plane
from pendmap.errors import InputError
from pendmap.formatting import counted
from pendmap.render import style
from pendmap.render.sheet import Panel, Sheet
from pendmap.units import VELOCITY, Units

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pendmap.charts.orbits import Closed


def figure(
    dataset: xr.Dataset,
    *,
    layer: str | None,
    size: tuple[float, float] | None,
    dpi: float,
    colormap: str | None,
) -> Figure:
    """Return the figure of closed orbits; see :func:`pendmap.render.draw`."""
    if layer is not None:
        raise InputError(f"no layer {layer!r}: a figure of orbits has one part")
    if colormap is not None:
        raise InputError(f"colormap {colormap!r}: a figure of orbits has no colour map")
    orbits = drawn.closed(dataset)
    units = Units.of(dataset.attrs)
    theta, velocity = drawn.angles(orbits, dataset), drawn.speeds(orbits, dataset)
    low, high = (units.bare(end, VELOCITY) for end in velocity)
    named = sorted(orbits, key=lambda one: one.id)[: drawn.MOST]
    texts = [one.text for one in named]
    handles: list[Any] = [_handle(one) for one in named]
    if len(orbits) > len(named):
        texts.append(f"and {len(orbits) - len(named)} more")
        handles.append(Line2D([], [], linestyle="none"))
    count = int(dataset.attrs.get("draws", 0))
    over = f";   grey dots: {counted(count, 'draw')}" if count else ""
    sheet = Sheet(
        [Panel()],
        ratio=min(max((high - low) / (theta[1] - theta[0]), 0.6), 1.1),
        title=drawn.title(dataset),
        subtitle=layering.parameters(dataset.attrs) + over,
        handles=handles,
        texts=texts,
        labels=(style.widest(*velocity), style.widest(*theta, angle=True)),
        size=size,
        dpi=dpi,
    )
    axes = sheet.axes[0]
    if count:
        at = [dataset[f"drawn_{name}"].values.ravel() for name in ("theta", "velocity")]
        points = plane.copies(dataset, np.stack(at, axis=1)[np.isfinite(at[0])], *theta)
        axes.plot(points[:, 0], points[:, 1], ".", color=style.QUIET, markersize=3, zorder=3)
    for one in orbits:
        _orbit(axes, one, dataset, theta)
    style.phase_plane(axes, theta, velocity, units)
    return sheet.figure


def _look(one: Closed) -> dict[str, Any]:
    """Return how an orbit looks: full where it is stable; broken, and points empty, where not."""
    return {
        "color": one.colour,
        "linestyle": "-" if one.stable else (0, (4.0, 2.0)),
        "linewidth": 1.6 if one.stable else 1.0,
        "marker": "o",
        "markersize": 5.0,
        "markeredgewidth": 1.0,
        "markeredgecolor": style.INK,
        "markerfacecolor": one.colour if one.stable else "white",
        # Pale colours on white, and all of them in grey, need an edge.
        "path_effects": [withStroke(linewidth=2.6 if one.stable else 1.6, foreground=style.QUIET)],
    }


def _handle(one: Closed) -> Line2D:
    return Line2D([], [], **_look(one))


def _orbit(axes: Axes, one: Closed, dataset: xr.Dataset, theta: tuple[float, float]) -> None:
    look = _look(one)
    axes.plot(one.path[:, 0], one.path[:, 1], **(look | {"marker": ""}))
    at = plane.copies(dataset, one.points, *theta)
    axes.plot(at[:, 0], at[:, 1], zorder=4, clip_on=False, **(look | {"linestyle": "none"}))
