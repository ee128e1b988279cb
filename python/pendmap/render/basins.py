"""The figure of a basin map: labels, attractors, settle time, net turns, finite-time exponent."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.colors import LogNorm, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from pendmap.charts import basins as layering
from pendmap.charts import legend, palette, plane
from pendmap.errors import InputError
from pendmap.render import style
from pendmap.render.sheet import Panel, Sheet
from pendmap.units import VELOCITY, Units

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CELLS = 1200
"""Rows and columns of a map that a panel takes at most, unless the panel has more pixels."""

Extent = tuple[float, float, float, float]

SMALL = 0.64
"""Size of the panel of unreliable labels, relative to those that lead."""

LETTER = 0.082
"""Inches of a letter of a bold title."""

_FORWARD, _BACKWARD = "^>", "v<"
_SHAPES = {"oscillation": "sPXph8", "inverted_rest": "D"}
"""Markers by kind; the further ones where the colours begin again."""

_SECTION = "its attractor, once a period"
_COLOUR_MAPS = {
    "settle": "viridis",
    "turns": "RdBu_r",
    "exponent": "magma",
    "probability": "cividis",
    "entropy": "magma",
}


def figure(
    dataset: xr.Dataset,
    *,
    layer: str | None,
    size: tuple[float, float] | None,
    dpi: float,
    colormap: str | None,
) -> Figure:
    """Return the figure of a basin map; see :func:`pendmap.render.draw`."""
    shown = (layering.named(dataset, layer),) if layer else _leading(dataset)
    if colormap is not None:
        style.colour_map(colormap)
        if shown == ("labels",):
            raise InputError(f"colormap {colormap!r}: labels are coloured by attractor")
    theta = plane.outer_edges(dataset, "theta")
    velocity = plane.outer_edges(dataset, "velocity")
    units = Units.of(dataset.attrs)
    slow, fast = (units.bare(bound, VELOCITY) for bound in velocity)
    extent = (*theta, *velocity)
    listed = legend.entries(dataset)
    chaos = [e for e in listed if e.chaotic and len(e.points)]
    aside = layering.finite_time(dataset) and layer is None and bool(chaos)
    if "labels" not in shown and not layering.finite_time(dataset):
        listed = [e for e in listed if e.id < 1 or e.chaotic]
    panels = [_panel(dataset, k, shown) for k in range(len(shown))]
    beside = style.widest(*velocity)
    note = ""
    if aside:
        panels.append(Panel(SMALL, title=f"({'abcd'[len(shown)]}) {_SECTION}"))
        beside = max(beside, style.widest(*_section_range(chaos)))
        note = layering.exponents(dataset)
    elif panels[-1].share < 1:
        note = layering.warning(dataset)
    sheet = Sheet(
        panels,
        ratio=min(max((fast - slow) / (theta[1] - theta[0]), 0.3), 1.3),
        title=_title(dataset, shown),
        subtitle=_subtitle(dataset),
        handles=[_handle(entry) for entry in listed],
        texts=[_text(dataset, entry, shown) for entry in listed],
        labels=(beside, style.widest(*theta, angle=True)),
        note=note,
        size=size,
        dpi=dpi,
    )
    limit = max(CELLS, sheet.pixels)
    for one, axes, bar in zip(shown, sheet.axes, sheet.bars, strict=False):
        if one == "labels":
            colours = legend.colours(dataset)
            _image(axes, colours[plane.pixels(dataset, dataset["label"], limit) + 1], extent)
            _attractors(axes, dataset, listed, extent)
        else:
            _scalar(axes, bar, dataset, one, extent=extent, limit=limit, colormap=colormap)
        style.phase_plane(axes, theta, velocity, units)
    if "labels" in shown and not layering.reliable(dataset):
        _warn(sheet, sheet.axes[shown.index("labels")], dataset)
    if aside:
        _section(sheet.axes[-1], dataset, chaos)
        sheet.note(sheet.axes[-1], [(note, style.QUIET, "normal")])
    return sheet.figure


def _panel(dataset: xr.Dataset, k: int, shown: tuple[str, ...]) -> Panel:
    """Return what the sheet must know of the k-th layer that is shown."""
    title = _panel_title(dataset, k, shown)
    if shown[k] != "labels":
        return Panel(bar=layering.unit(dataset, shown[k]), title=title)
    if layering.reliable(dataset):
        return Panel(title=title)
    if len(shown) > 1:
        return Panel(SMALL, title=title)
    # The warning is its title, on two lines at most.
    return Panel(least=LETTER * (len(layering.warning(dataset)) / 2 + 8))


def _panel_title(dataset: xr.Dataset, k: int, shown: tuple[str, ...]) -> str:
    mark = f"({'abcd'[k]}) " if len(shown) > 1 else ""
    return mark + layering.what(dataset, shown[k])


def _leading(dataset: xr.Dataset) -> tuple[str, ...]:
    """Return the layers of the standard figure: two, or three where the labels are unreliable."""
    every = layering.layers(dataset)
    if layering.finite_time(dataset) or layering.reliable(dataset):
        return every[:2]
    return every[:3]


def _title(dataset: xr.Dataset, shown: tuple[str, ...]) -> str:
    if layering.finite_time(dataset):
        names = [str(name) for name in dataset["attractor"].values]
        if names:
            return f"{names[0].capitalize()} takes every start"
        return "No attractors" + (" without damping" if dataset.attrs.get("gamma") == 0 else "")
    if not layering.reliable(dataset) and "labels" not in shown[:1]:
        return "Fractal basins of attraction"
    return "Basins of attraction"


def _subtitle(dataset: xr.Dataset) -> str:
    rows, columns = dataset["label"].shape
    times = "\N{MULTIPLICATION SIGN}"
    return f"{layering.parameters(dataset.attrs)};   {columns} {times} {rows} cells"


def _text(dataset: xr.Dataset, entry: legend.Entry, shown: tuple[str, ...]) -> str:
    if layering.finite_time(dataset) and entry.chaotic:
        return f"{legend.typeset(entry.name)}, {entry.share} of the starts"
    if entry.chaotic and "labels" in shown and len(entry.points):
        return f"{entry.text} (dots: its points)"
    return entry.text


def _image(axes: Axes, rgb: npt.NDArray[np.uint8], extent: Extent) -> None:
    axes.imshow(
        rgb,
        extent=extent,
        origin="lower",
        aspect="auto",
        interpolation="nearest",
    )


def _scalar(  # noqa: PLR0913 (where to draw, what, and how)
    axes: Axes,
    bar: Axes | None,
    dataset: xr.Dataset,
    layer: str,
    *,
    extent: Extent,
    limit: int,
    colormap: str | None,
) -> None:
    """Draw one scalar layer; cells without a value keep the colour of their label."""
    values = plane.pixels(dataset, dataset[layering.VARIABLES[layer]], limit).astype(np.float32)
    label = plane.pixels(dataset, dataset["label"], limit)
    absent = (values < 0) if layer == "settle" else ~np.isfinite(values) | (label < 0)
    if absent.any():
        _image(axes, legend.colours(dataset)[label + 1], extent)
    if layer == "settle":
        np.maximum(values, 1.0, out=values)
    values[absent] = np.nan
    norm, extend, ticks = _scale(layer, values[~absent])
    drawn = axes.imshow(
        values,
        extent=extent,
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        cmap=style.colour_map(colormap or _COLOUR_MAPS[layer]),
        norm=norm,
    )
    if bar is not None:
        style.colour_bar(bar, drawn, layering.unit(dataset, layer), extend, ticks)


def _scale(
    layer: str, values: npt.NDArray[np.float32]
) -> tuple[Normalize, str, list[float] | None]:
    """Return the colour scale of a layer, which ends it cuts off, and its ticks.

    Settle time is logarithmic; net turns are symmetric about 0 and leave out the outermost
    two percent, so that a few long transients do not wash out the rest; so does the exponent.
    Probabilities reach from 0 to 1, entropies from 0 on.
    """
    if values.size == 0 or layer == "probability":
        return Normalize(0.0, 1.0), "neither", None
    if layer == "entropy":
        return Normalize(0.0, max(float(values.max()), 1e-3)), "neither", None
    if layer == "settle":
        low, high = float(values.min()), float(values.max())
        high = max(high, low + 1.0)
        return LogNorm(low, high), "neither", style.log_ticks(low, high)
    if layer == "turns":
        size = np.abs(values)
        top = max(1.0, float(np.ceil(np.quantile(size, 0.98))))
        ticks = MaxNLocator(6, integer=True, steps=[1, 2, 5, 10]).tick_values(-top, top)
        ticks = [float(t) for t in ticks if abs(t) <= top]
        return Normalize(-top, top), "both" if size.max() > top else "neither", ticks
    low, high = (float(q) for q in np.quantile(values, [0.005, 0.995]))
    if high <= low:
        low, high = low - 0.5, high + 0.5
    below, above = bool(values.min() < low), bool(values.max() > high)
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}
    return Normalize(low, high), extend.get((below, above), "neither"), None


def _marker(entry: legend.Entry) -> str:
    turn = palette.direction(entry.name, entry.kind)
    shapes = _FORWARD if turn > 0 else _BACKWARD if turn < 0 else _SHAPES.get(entry.kind, "o")
    return shapes[palette.lap(entry.name, entry.kind) % len(shapes)]


def _drawn(entry: legend.Entry, size: float) -> dict[str, Any]:
    return {
        "marker": _marker(entry),
        "linestyle": "none",
        "markersize": size,
        "markerfacecolor": entry.colour,
        "markeredgecolor": "white",
        "markeredgewidth": 0.17 * size,
        "path_effects": [withStroke(linewidth=0.42 * size, foreground=style.INK)],
    }


def _attractors(
    axes: Axes, dataset: xr.Dataset, listed: list[legend.Entry], extent: Extent
) -> None:
    """Mark the points of all attractors, with their copies 2 pi further."""
    box = axes.get_window_extent()
    size = min(6.5, max(3.5, 1.1 + 1.3 * box.width / axes.figure.dpi))
    for entry in listed:
        at = plane.copies(dataset, entry.points, extent[0], extent[1])
        at = at[(at[:, 1] >= extent[2]) & (at[:, 1] <= extent[3])]
        if entry.chaotic:
            _dots(axes, at, style.INK)
        elif len(at):
            axes.plot(at[:, 0], at[:, 1], clip_on=False, zorder=5, **_drawn(entry, size))


def _section(axes: Axes, dataset: xr.Dataset, chaos: list[legend.Entry]) -> None:
    """Draw the stroboscopic points of chaotic attractors on a plane of their own."""
    for entry in chaos:
        _dots(axes, entry.points, entry.colour)
    theta = plane.angles(dataset, np.concatenate([entry.points[:, 0] for entry in chaos]))
    style.phase_plane(axes, theta, _section_range(chaos), Units.of(dataset.attrs))


def _section_range(chaos: list[legend.Entry]) -> tuple[float, float]:
    speeds = np.concatenate([entry.points[:, 1] for entry in chaos])
    pad = 0.05 * max(float(np.ptp(speeds)), 1e-3)
    return float(speeds.min()) - pad, float(speeds.max()) + pad


def _dots(axes: Axes, at: npt.NDArray[np.float64], colour: str) -> None:
    axes.plot(at[:, 0], at[:, 1], "o", ms=1.1, mew=0, color=colour, zorder=4, rasterized=True)


def _handle(entry: legend.Entry) -> Patch | tuple[Patch, Line2D]:
    """Return a legend handle: the basin's colour with the attractor's marker upon it."""
    patch = Patch(facecolor=entry.colour, edgecolor=style.QUIET, linewidth=0.5)
    if entry.id < 1 or entry.chaotic:
        return patch
    return (patch, Line2D([], [], **_drawn(entry, 5.0)))


def _warn(sheet: Sheet, axes: Axes, dataset: xr.Dataset) -> None:
    """Mark the labels as unreliable: next to their small panel, or as the title of a large one."""
    text = layering.warning(dataset)
    if len(sheet.axes) == 1:
        width = int(sheet.inches(axes)[0] / LETTER)
        axes.set_title(textwrap.fill(text, max(12, width)), color=style.ALARM, weight="bold")
        return
    sheet.note(
        axes,
        [(text, style.ALARM, "bold"), (layering.transients(dataset), style.QUIET, "normal")],
    )
