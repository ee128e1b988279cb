"""The figure of a lifetime: the survival curve with its tail, and where that begins."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pendmap.charts import basins as layering
from pendmap.charts import lifetime as drawn
from pendmap.errors import InputError
from pendmap.formatting import counted
from pendmap.render import style
from pendmap.render.sheet import Panel, Sheet

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_FIT, _BAND = "#d55e00", "#f4c3a0"
_RATIO, _HEIGHT, _WIDTHS = 0.8, 4.6, {1: 6.0, 2: 9.6}
_STYLES = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (5, 1.5, 1.2, 1.5)))
_LEAST_SIGNIFICANT = 0.05


def figure(
    dataset: xr.Dataset,
    *,
    layer: str | None,
    size: tuple[float, float] | None,
    dpi: float,
    colormap: str | None,
) -> Figure:
    """Return the figure of a lifetime; see :func:`pendmap.render.draw`."""
    if colormap is not None:
        raise InputError(f"colormap {colormap!r}: a figure of a lifetime has no colour map")
    parts: dict[str, tuple[str, Callable[[Axes, xr.Dataset], None]]] = {
        "survival": ("share of starts still alive", _survival)
    }
    if dataset.sizes["tail_begin"] > 1:
        parts["tail"] = ("mean time left, against where the tail begins", _tail)
    if layer is not None and layer not in parts:
        raise InputError(f"no layer {layer!r} in this figure; it has {', '.join(parts)}")
    shown = [layer] if layer else list(parts)
    marks = [f"({mark}) " for mark in "ab"] if len(shown) > 1 else [""]
    handles, texts = _legend(dataset, shown)
    starts = counted(int(dataset.attrs["starts"]), "start")
    sheet = Sheet(
        [Panel(title=mark + parts[part][0]) for mark, part in zip(marks, shown, strict=False)],
        ratio=_RATIO,
        title=drawn.title(dataset),
        subtitle=f"{layering.parameters(dataset.attrs)};   {starts}",
        handles=handles,
        texts=texts,
        labels=(0.5, 0.4),
        size=size or (_WIDTHS[len(shown)], _HEIGHT),
        dpi=dpi,
    )
    for axes, part in zip(sheet.axes, shown, strict=True):
        parts[part][1](axes, dataset)
    return sheet.figure


def _looks(dataset: xr.Dataset) -> list[tuple[drawn.Curve, dict[str, Any]]]:
    """Return the curves with their colours and dashes: twins lie on one another."""
    found = []
    for k, curve in enumerate(drawn.curves(dataset)):
        width = 1.8 if k == 0 else 1.3
        dashes = _STYLES[k % len(_STYLES)]
        found.append((curve, {"color": curve.colour, "lw": width, "ls": dashes}))
    return found


def _legend(dataset: xr.Dataset, shown: list[str]) -> tuple[list[Any], list[str]]:
    handles: list[Any] = []
    texts: list[str] = []
    if "survival" in shown:
        for curve, look in _looks(dataset):
            handles.append(Line2D([], [], **look))
            texts.append(curve.text if not curve.name else f"those that {curve.text} captures")
    tail = drawn.fit(dataset)
    if tail is not None:
        line = Line2D([], [], color=_FIT, lw=1.4)
        handles.append((Patch(color=_BAND, lw=0), line))
        texts.append(tail.text)
    if "tail" in shown:
        handles.append(_point(empty=False))
        texts.append("from here on exponential, with standard error")
        handles.append(_point(empty=True))
        texts.append("not exponential at the 5 % level")
    return handles, texts


def _point(*, empty: bool) -> Line2D:
    face = "white" if empty else style.INK
    return Line2D([], [], ls="", marker="o", ms=4, mfc=face, mec=style.INK, mew=0.8)


def _survival(axes: Axes, dataset: xr.Dataset) -> None:
    for curve, look in _looks(dataset):
        axes.plot(curve.periods, curve.share, drawstyle="steps-post", **look)
    tail = drawn.fit(dataset)
    if tail is not None:
        axes.fill_between(tail.periods, tail.low, tail.high, color=_BAND, lw=0, zorder=1)
        axes.plot(tail.periods, tail.share, color=_FIT, lw=1.4, zorder=5)
        axes.axvline(tail.periods[0], color=style.QUIET, lw=0.7, ls=(0, (2, 2)))
    axes.set_yscale("log")
    drawn_low = min(np.min(one.share[one.share > 0], initial=1.0) for one in drawn.curves(dataset))
    axes.set_ylim(max(0.5 / float(dataset.attrs["starts"]), 0.5 * drawn_low), 1.5)
    periods = drawn.curves(dataset)[0].periods
    axes.set_xlim(periods[0], max(periods[-1], periods[0] + 1.0))
    style.scale(axes, "x", axes.get_xlim(), "periods")
    axes.set_ylabel("share alive", labelpad=2)


def _tail(axes: Axes, dataset: xr.Dataset) -> None:
    begin, mean = dataset["tail_begin"].values, dataset["tail_mean"].values
    error, chance = dataset["tail_stderr"].values, dataset["tail_exponential"].values
    smooth = chance > _LEAST_SIGNIFICANT
    axes.errorbar(begin, mean, error, fmt="none", ecolor=style.QUIET, elinewidth=0.8, zorder=2)
    for which, empty in ((smooth, False), (~smooth, True)):
        look = _point(empty=empty)
        axes.plot(
            begin[which],
            mean[which],
            ls="",
            marker="o",
            ms=4,
            mfc=look.get_markerfacecolor(),
            mec=style.INK,
            mew=0.8,
            zorder=3,
        )
    a = dataset.attrs
    if a["transient_chaos"]:
        middle, wide = float(a["mean_periods"]), drawn.SIGMAS * float(a["stderr"])
        axes.axhspan(middle - wide, middle + wide, color=_BAND, lw=0, zorder=0)
        axes.axhline(middle, color=_FIT, lw=1.4, zorder=1)
        axes.axvline(float(a["from_period"]), color=style.QUIET, lw=0.7, ls=(0, (2, 2)))
    precise = error < np.maximum(0.25 * mean, 1e-9)
    low = float(np.min((mean - error)[precise], initial=float(mean.min())))
    high = float(np.max((mean + error)[precise], initial=low * 1.05))
    room = 0.08 * (high - low)
    axes.set_ylim(low - room, high + room)
    axes.set_xlim(0, 1.03 * float(begin[-1]))
    style.scale(axes, "x", axes.get_xlim(), "where the tail begins (periods)")
    style.scale(axes, "y", axes.get_ylim(), "mean time left (periods)")
