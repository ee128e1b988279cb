"""The figure of Melnikov's threshold against the frequency of the drive."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D

from pendmap.charts import basins as layering
from pendmap.charts.melnikov import highest
from pendmap.errors import InputError
from pendmap.render import style
from pendmap.render.sheet import Panel, Sheet

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_LOOKS: dict[str, tuple[str, Any]] = {
    "loop": (style.INK, "-"),
    "forward": ("#d55e00", "-"),
    "backward": ("#0072b2", (0, (5, 2))),
}


def figure(
    dataset: xr.Dataset,
    *,
    layer: str | None,
    size: tuple[float, float] | None,
    dpi: float,
    colormap: str | None,
) -> Figure:
    """Return the figure of Melnikov's threshold; see :func:`pendmap.render.draw`."""
    if layer is not None:
        raise InputError(f"no layer {layer!r}: a figure of Melnikov's threshold has one part")
    if colormap is not None:
        raise InputError(f"colormap {colormap!r}: this figure has no colour map")
    a = dataset.attrs
    omega, p = dataset["omega"].values, dataset["p_melnikov"].values
    own = (float(a["own_omega"]), abs(float(a["own_p"])))
    top = highest(dataset)
    x = (min(float(omega[0]), own[0]), max(float(omega[-1]), own[0]))
    at = {str(name): p[:, k] for k, name in enumerate(dataset["branch"].values)}
    apart = np.abs(at["forward"] - at["backward"]) if {"forward", "backward"} <= set(at) else p[:0]
    alike = bool(np.isfinite(apart).any()) and np.nanmax(apart) < 1e-9 * top
    there = [name for name, values in at.items() if (values <= top).any()]
    looped = "loop" in at
    branches = ["forward"] if alike and not looped else there
    handles, texts = [], []
    for name in branches:
        colour, look = _LOOKS[name]
        handles.append(Line2D([], [], color=colour, linestyle=look, linewidth=1.6))
        texts.append(_said(name, looped=looped, alike=alike))
    handles.append(Line2D([], [], color=style.INK, marker="*", markersize=9, linestyle="none"))
    texts.append("this pendulum")
    sheet = Sheet(
        [Panel()],
        ratio=0.68,
        title="Homoclinic threshold, Melnikov, first order",
        subtitle=layering.parameters(a),
        handles=handles,
        texts=texts,
        labels=(style.widest(0.0, top), style.widest(*x)),
        size=size,
        dpi=dpi,
    )
    axes = sheet.axes[0]
    for name in branches:
        colour, look = _LOOKS[name]
        axes.plot(omega, at[name], color=colour, linestyle=look, linewidth=1.6)
        axes.fill_between(omega, at[name], top, color=colour, alpha=0.10, linewidth=0)
    axes.plot(*own, marker="*", color=style.INK, markersize=9, clip_on=False, zorder=4)
    damped = np.nanmax(at.get("loop", p), initial=0.0) > 0
    follows = "fractal boundaries of basins" if damped else "chaos; no basins without damping"
    axes.text(
        0.5,
        0.93,
        f"manifolds cross: {follows}",
        ha="center",
        transform=axes.transAxes,
        color=style.QUIET,
        bbox={"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 2},
        zorder=3,
    )
    axes.set_xlim(*x)
    axes.set_ylim(0.0, top)
    axes.set_xlabel("\N{GREEK SMALL LETTER OMEGA} = \N{GREEK CAPITAL LETTER OMEGA}/w0")
    axes.set_ylabel("p = Y\N{GREEK CAPITAL LETTER OMEGA}\N{SUPERSCRIPT TWO}/g")
    return sheet.figure


def _said(name: str, *, looped: bool, alike: bool) -> str:
    if name == "loop":
        return "homoclinic, loop of upright rest"
    if looped:
        return f"heteroclinic, {name}"
    return "threshold, both branches" if alike else f"threshold, {name}"
