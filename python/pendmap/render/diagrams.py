"""The figure of a bifurcation diagram: points, sweeps up and down, exponents."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D

from pendmap.charts import bifurcation as drawn
from pendmap.charts import names, palette, plane
from pendmap.errors import InputError
from pendmap.render import style
from pendmap.render.sheet import headed, place
from pendmap.units import Units

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pendmap.charts.bifurcation import Family

_SIZE = (7.4, 6.8)
_LEFT, _RIGHT, _TOP, _BELOW = 0.85, 0.2, 0.98, 0.5
_STRIP, _GAP, _EXPONENT = 0.42, 0.16, 1.35
_ROW, _COLUMN = 0.19, 2.1
_LEAST = (4.5, 4.8)
_LAYERS = ("theta", "velocity")


def figure(
    dataset: xr.Dataset,
    *,
    layer: str | None,
    size: tuple[float, float] | None,
    dpi: float,
    colormap: str | None,
) -> Figure:
    """Return the figure of a bifurcation diagram; see :func:`pendmap.render.draw`."""
    shown = layer or _LAYERS[0]
    if shown not in _LAYERS:
        raise InputError(f"layer must be one of {', '.join(_LAYERS)} in a diagram, got {shown!r}")
    if colormap is not None:
        raise InputError(f"colormap {colormap!r}: a bifurcation diagram has no colour map")
    every = drawn.families(dataset)
    listed = every[: drawn.MOST]
    texts = [one.text for one in listed]
    handles: list[Any] = [
        Line2D([], [], marker="s", linestyle="none", color=one.colour, markersize=6)
        for one in listed
    ]
    if len(every) > len(listed):
        texts.append(f"{len(every) - len(listed)} more")
        handles.append(Line2D([], [], marker="s", linestyle="none", color=palette.UNNAMED))
    if dataset.sizes["loose"]:
        texts.append("sweep, undecided")
        handles.append(Line2D([], [], marker="o", linestyle="none", color=palette.UNNAMED, ms=2))
    if any((dataset[sweep].values < 0).any() for sweep in ("up", "down")):
        texts.append("sweep on none")
        white = Line2D([], [], marker="s", linestyle="none", color="white", markersize=6)
        white.set(markeredgecolor=style.QUIET, markeredgewidth=0.6)
        handles.append(white)
    width, height = size or _SIZE
    columns = max(1, int((width - _LEFT) / _COLUMN))
    rows = math.ceil(len(texts) / columns)
    below = _BELOW + _ROW * rows + 0.25
    main = height - _TOP - below - _STRIP - _EXPONENT - 2 * _GAP
    if width < _LEAST[0] or main < 1.0:
        least = (_LEAST[0], _LEAST[1] + _ROW * rows)
        raise InputError(
            f"size {size} leaves no room for the panels; it must be at least"
            f" {least[0]:.1f} x {least[1]:.1f} inches"
        )
    sheet = headed((width, height), dpi, drawn.title(dataset), drawn.subtitle(dataset), left=_LEFT)
    wide = width - _LEFT - _RIGHT
    tops = (height - _TOP - main, height - _TOP - main - _GAP - _STRIP, below)
    axes = [
        place(sheet, _LEFT, bottom, wide, tall)
        for bottom, tall in zip(tops, (main, _STRIP, _EXPONENT), strict=True)
    ]
    ends = drawn.across(dataset)
    _points(axes[0], dataset, every, shown)
    _sweeps(axes[1], dataset, every)
    _exponents(axes[2], dataset, every)
    for panel in axes:
        panel.set_xlim(*ends)
    for panel in axes[:2]:
        panel.tick_params(labelbottom=False, bottom=False)
    style.scale(axes[2], "x", ends, drawn.name(dataset))
    sheet.legend(
        handles,
        texts,
        loc="lower left",
        bbox_to_anchor=(_LEFT / width, 0.12 / height),
        ncols=columns,
        borderpad=0.0,
        borderaxespad=0.0,
        labelspacing=0.45,
        handletextpad=0.3,
        columnspacing=1.6,
    )
    return sheet


def _points(axes: Axes, dataset: xr.Dataset, every: list[Family], shown: str) -> None:
    """Draw the stroboscopic points: those of orbits larger than those of chaos."""
    column = 1 + _LAYERS.index(shown)
    values = dataset[str(dataset.attrs["varied"])].values
    # Where values are far apart a point must be seen.
    size = min(3.0, max(0.9, 200.0 / values.size))
    for one in reversed(every):
        chaotic = "chaos" in one.name
        axes.plot(
            one.points[:, 0],
            one.points[:, column],
            "o",
            ms=0.45 if chaotic else size,
            mew=0,
            color=one.colour,
            rasterized=True,
        )
    loose = dataset["loose_value"].values, dataset[f"loose_{shown}"].values
    axes.plot(*loose, "o", ms=0.45, mew=0, color=palette.UNNAMED, rasterized=True, zorder=1)
    if shown == "theta":
        angles = plane.angles(dataset, dataset["point_theta"].values)
        axes.set_ylim(angles)
        style.scale(axes, "y", angles, names.ANGLE, angle=True)
    else:
        low, high = plane.padded(dataset["point_velocity"].values)
        axes.set_ylim(low, high)
        style.scale(axes, "y", (low, high), names.speed(Units.of(dataset.attrs)))


def _sweeps(axes: Axes, dataset: xr.Dataset, every: list[Family]) -> None:
    """Draw a strip for each sweep: on which attractor it is."""
    low, high = drawn.across(dataset)
    strip = np.ones((2, dataset.sizes[str(dataset.attrs["varied"])], 3))
    for one in every:
        strip[1, one.up] = to_rgb(one.colour)
        strip[0, one.down] = to_rgb(one.colour)
    axes.imshow(
        strip, extent=(low, high, -1, 1), aspect="auto", origin="lower", interpolation="nearest"
    )
    axes.axhline(0, color="white", linewidth=1.2)
    axes.set_yticks([0.5, -0.5], ["up \N{RIGHTWARDS ARROW}", "\N{LEFTWARDS ARROW} down"])
    axes.tick_params(left=False)


def _exponents(axes: Axes, dataset: xr.Dataset, every: list[Family]) -> None:
    axes.axhline(0, color=style.QUIET, linewidth=0.7)
    for one in reversed(every):
        axes.plot(*one.exponents.T, "o", ms=1.6, mew=0, color=one.colour, rasterized=True)
    known = dataset["entry_exponent"].values
    known = known[np.isfinite(known)]
    low, high = plane.padded(known) if known.size else (-1.0, 1.0)
    axes.set_ylim(low, high)
    name = f"exponent {names.per_time(Units.of(dataset.attrs))}"
    style.scale(axes, "y", (low, high), name)
