"""The figure of a Lyapunov exponent: growth along the start, the running mean, its distribution."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from pendmap.charts import basins as layering
from pendmap.charts import lyapunov as drawn
from pendmap.charts import names
from pendmap.errors import InputError
from pendmap.formatting import counted
from pendmap.render import style
from pendmap.render.sheet import Panel, Sheet
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LINE, _MEAN, _BAND, _TRANSIENT = "#1d3557", "#d55e00", "#9db4d3", "#f8edd6"
_RATIO, _HEIGHT, _WIDTHS = 0.8, 4.3, {1: 6.0, 2: 8.8, 3: 12.4}
_BINS = 60
_TWO_DECADES = 100
_SIGMAS = 2


def figure(
    dataset: xr.Dataset,
    *,
    layer: str | None,
    size: tuple[float, float] | None,
    dpi: float,
    colormap: str | None,
) -> Figure:
    """Return the figure of an exponent; see :func:`pendmap.render.draw`."""
    if colormap is not None:
        raise InputError(f"colormap {colormap!r}: a figure of an exponent has no colour map")
    parts: dict[str, tuple[str, Callable[[Axes, xr.Dataset, Units], None]]] = {
        "growth": ("growth along the start's own trajectory", _growth)
    }
    if dataset.sizes["window"]:
        count = dataset.attrs["trajectories"]
        parts["average"] = (f"mean over {count} trajectories", _average)
        window = dataset.attrs["window"]
        parts["distribution"] = (f"exponents over {window} periods", _distribution)
    else:
        parts["average"] = (f"exponent over {dataset.attrs['window']} periods", _sliding)
    if layer is not None and layer not in parts:
        raise InputError(f"no layer {layer!r} in this figure; it has {', '.join(parts)}")
    shown = [layer] if layer else list(parts)
    marks = [f"({mark}) " for mark in "abc"] if len(shown) > 1 else [""]
    units = Units.of(dataset.attrs)
    handles, texts = _legend(dataset, shown)
    sheet = Sheet(
        [Panel(title=mark + parts[part][0]) for mark, part in zip(marks, shown, strict=False)],
        ratio=_RATIO,
        title=drawn.title(dataset),
        subtitle=_subtitle(dataset, units),
        handles=handles,
        texts=texts,
        labels=(0.5, 0.4),
        size=size or (_WIDTHS[len(shown)], _HEIGHT),
        dpi=dpi,
    )
    for axes, part in zip(sheet.axes, shown, strict=True):
        parts[part][1](axes, dataset, units)
    return sheet.figure


def _subtitle(dataset: xr.Dataset, units: Units) -> str:
    a = dataset.attrs
    start = f"from \N{GREEK SMALL LETTER THETA} = {float(a['theta0']):.6g}, "
    start += f"{names.velocity(units)} = {units.spoken(format(float(a['velocity0']), '.6g'))}"
    return f"{layering.parameters(a)};   {start}".replace("-", "\N{MINUS SIGN}")


def _legend(dataset: xr.Dataset, shown: list[str]) -> tuple[list[Any], list[str]]:
    """Return what lines and shades mean, those that are there."""
    handles: list[Any] = []
    texts: list[str] = []
    if math.isfinite(dataset.attrs["exponent"]):
        handles.append(Line2D([], [], color=_MEAN, lw=1.6, ls=(0, (4, 2))))
        texts.append(drawn.value(dataset))
    if dataset.attrs["transient_periods"] > 0 and shown != ["distribution"]:
        handles.append(Patch(color=_TRANSIENT, lw=0))
        texts.append(f"transient, {counted(int(dataset.attrs['transient_periods']), 'period')}")
    if dataset.sizes["window"] and "average" in shown:
        if math.isfinite(dataset.attrs["stderr"]):
            handles.append(Patch(color=_BAND, lw=0))
            texts.append(f"\N{PLUS-MINUS SIGN}{_SIGMAS} standard errors of the mean")
        if dataset.attrs["end"] == "undamped":
            handles.append(Line2D([], [], color=style.INK, lw=1.0, ls=":"))
            texts.append("regular motion: deviations grow as \N{GREEK SMALL LETTER TAU}")
    return handles, texts


def _growth(axes: Axes, dataset: xr.Dataset, _: Units) -> None:
    periods, growth = dataset["elapsed"].values, dataset["growth"].values
    transient = max(int(dataset.attrs["transient_periods"]), 0)
    if transient:
        axes.axvspan(0, transient, color=_TRANSIENT, lw=0, zorder=0)
    axes.axhline(0.0, color=style.QUIET, lw=0.6, zorder=1)
    axes.plot(periods, growth, color=_LINE, lw=1.1)
    rate = float(dataset.attrs["per_period"])
    if math.isfinite(rate) and math.isfinite(dataset.attrs["stderr"]):
        begin = min(int(np.searchsorted(periods, transient)), periods.size - 1)
        # Beside a line of so many decades the constant matters little: it meets the end.
        last = growth[-1] if transient else rate * periods[-1]
        line = last + rate * (periods[begin:] - periods[-1])
        axes.plot(periods[begin:], line, color=_MEAN, lw=1.6, ls=(0, (4, 2)))
    axes.margins(x=0.0, y=0.06)
    axes.set_xlim(*drawn.elapsed(dataset))
    style.scale(axes, "x", axes.get_xlim(), "periods since the start")
    low, high = axes.get_ylim()
    style.scale(axes, "y", (low, high), "ln |\N{GREEK SMALL LETTER DELTA}x|")


def _average(axes: Axes, dataset: xr.Dataset, units: Units) -> None:
    periods = dataset["averaged"].values
    mean, error = dataset["running_exponent"].values, dataset["running_stderr"].values
    a = dataset.attrs
    if math.isfinite(a["stderr"]):
        low, high = mean - _SIGMAS * error, mean + _SIGMAS * error
        axes.fill_between(periods, low, high, color=_BAND, lw=0, zorder=1)
    if a["end"] == "undamped":
        regular = np.log1p(periods / a["dropped_periods"]) / (periods * a["forcing_period"])
        axes.plot(periods, regular, color=style.INK, lw=1.0, ls=":", zorder=4)
    axes.axhline(float(dataset.attrs["exponent"]), color=_MEAN, lw=1.6, ls=(0, (4, 2)), zorder=2)
    axes.plot(periods, mean, color=_LINE, lw=1.2, zorder=3)
    axes.set_xscale("log")
    axes.set_xlim(periods[0], periods[-1])
    subs = (1.0, 2.0, 5.0) if periods[-1] < _TWO_DECADES * periods[0] else (1.0,)
    axes.xaxis.set_major_locator(LogLocator(subs=subs))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("periods averaged, each")
    axes.margins(y=0.08)
    style.scale(axes, "y", axes.get_ylim(), _rate(units))


def _sliding(axes: Axes, dataset: xr.Dataset, units: Units) -> None:
    periods, values = drawn.sliding(dataset)
    transient = max(int(dataset.attrs["transient_periods"]), 0)
    if transient:
        axes.axvspan(0, transient, color=_TRANSIENT, lw=0, zorder=0)
    axes.axhline(0.0, color=style.QUIET, lw=0.6, zorder=1)
    axes.plot(periods, values, color=_LINE, lw=1.1, zorder=3)
    if math.isfinite(dataset.attrs["exponent"]):
        axes.axhline(dataset.attrs["exponent"], color=_MEAN, lw=1.6, ls=(0, (4, 2)), zorder=2)
    axes.margins(y=0.08)
    axes.set_xlim(*drawn.elapsed(dataset))
    style.scale(axes, "x", axes.get_xlim(), "periods since the start, last of each")
    style.scale(axes, "y", axes.get_ylim(), _rate(units))


def _distribution(axes: Axes, dataset: xr.Dataset, units: Units) -> None:
    values = dataset["finite_time_exponent"].values.ravel()
    density, edges = np.histogram(values, bins=_BINS, density=True)
    axes.stairs(density, edges, fill=True, color=_BAND, lw=0)
    axes.stairs(density, edges, color=_LINE, lw=0.9)
    axes.axvline(float(dataset.attrs["exponent"]), color=_MEAN, lw=1.6, ls=(0, (4, 2)))
    if edges[0] < 0 < edges[-1]:
        axes.axvline(0.0, color=style.QUIET, lw=0.6)
    axes.set_ylim(0, 1.08 * density.max())
    axes.set_xlim(edges[0], edges[-1])
    style.scale(axes, "x", axes.get_xlim(), _rate(units))
    style.scale(axes, "y", axes.get_ylim(), "density")


def _rate(units: Units) -> str:
    return f"\N{GREEK SMALL LETTER LAMDA} ({names.per_time(units)})"
