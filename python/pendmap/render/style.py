"""How all figures look: type, ticks, colour bars, and how they are written."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath
from matplotlib.ticker import NullLocator

from pendmap.charts import names, plane
from pendmap.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

    from pendmap.units import Units

INK = "#222222"
QUIET = "#666666"
ALARM = "#a61c00"

RC: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.0,
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titlepad": 6.0,
    "axes.unicode_minus": True,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "pendmap",
    "pdf.fonttype": 42,
    "path.simplify": True,
    "agg.path.chunksize": 20000,
}

MOST, PIXELS = 100.0, 20000
"""Inches and pixels that a side of a figure may have."""

TICKS = 4
"""Ticks that a logarithmic colour bar has at least, where its range allows."""

DPI = (20, 1200)
"""Pixels per inch that may be chosen."""


def phase_plane(
    axes: Axes, theta: tuple[float, float], velocity: tuple[float, float], units: Units
) -> None:
    """Give axes the limits, ticks and names of the phase plane."""
    axes.set_xlim(*theta)
    axes.set_ylim(*velocity)
    scale(axes, "x", theta, names.ANGLE, angle=True)
    scale(axes, "y", velocity, names.speed(units))


def scale(
    axes: Axes, which: str, limits: tuple[float, float], name: str, *, angle: bool = False
) -> None:
    """Give one side of a panel a handful of ticks, none into another, and its name.

    Parameters
    ----------
    axes : Axes
        The panel.
    which : str
        ``"x"`` or ``"y"``.
    limits : (float, float)
        Its ends.
    name : str
        Symbol and unit, a blank between them; what the labels leave out is subtracted there.
    angle : bool
        Whether multiples of pi are wanted.
    """
    low, high = limits
    shift, ticks = plane.short_ticks(low, high, angle=angle)
    box = axes.get_window_extent()
    room = (box.width if which == "x" else box.height) / axes.figure.dpi
    size = max(inches(text) for _, text in ticks) + 0.14 if which == "x" else 0.17
    apart = room * (ticks[1][0] - ticks[0][0]) / (high - low) if len(ticks) > 1 else room
    every = math.ceil(size / max(apart, 1e-3))
    zero = next((k for k, tick in enumerate(ticks) if tick[1] == "0"), 0)
    ticks = ticks[zero % every :: every]
    places, labels = [shift + at for at, _ in ticks], [text for _, text in ticks]
    name = plane.shifted(name, shift)
    if which == "x":
        axes.set_xticks(places, labels)
        axes.set_xlabel(name)
    else:
        axes.set_yticks(places, labels)
        axes.set_ylabel(name, labelpad=2)


def widest(low: float, high: float, *, angle: bool = False) -> float:
    """Return the width of the longest label that an axis has, in inches."""
    return max(inches(text) for _, text in plane.short_ticks(low, high, angle=angle)[1])


def inches(text: str, size: float | None = None, *, bold: bool = False) -> float:
    """Return the width of a line of text in inches, in the size of ticks where none is given."""
    if not text.strip():
        return 0.0
    weight = "bold" if bold else "normal"
    font = FontProperties(family=RC["font.sans-serif"], weight=weight)
    path = TextPath((0, 0), text, size=size or RC["xtick.labelsize"], prop=font)
    return float(path.get_extents().width) / 72


def colour_bar(
    axes: Axes, drawn: ScalarMappable, text: str, extend: str, ticks: Sequence[float] | None
) -> None:
    """Fill the narrow axes beside a panel with its colour bar."""
    bar = axes.figure.colorbar(drawn, cax=axes, extend=extend, extendfrac=0.03)
    if ticks is not None:
        bar.set_ticks(
            [float(t) for t in ticks],
            labels=[f"{t:.6g}".replace("-", "\N{MINUS SIGN}") for t in ticks],
        )
    bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.outline.set_linewidth(0.7)
    bar.set_label(text, labelpad=4)


def log_ticks(low: float, high: float) -> list[float]:
    """Return ticks 1, 2, 5, 10, ... between the ends; more of them where these are close."""
    for steps in ((1,), (1, 3), (1, 2, 5), tuple(range(1, 10))):
        powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        ticks = [m * 10.0**k for k in powers for m in steps]
        inside = [t for t in ticks if low * 0.999 <= t <= high * 1.001]
        if len(inside) >= TICKS:
            return inside
    return sorted({round(x) for x in np.linspace(low, high, 5)})


def colour_map(name: str) -> Colormap:
    """Return a matplotlib colour map by its name.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name not in mpl.colormaps:
        known = "viridis, cividis, magma, inferno, plasma, RdBu_r, PuOr"
        raise InputError(f"no colour map {name!r}; there are for example {known}")
    return mpl.colormaps[name].copy()


def resolution(dpi: float | None) -> float:
    """Return the pixels per inch, 200 where nothing is said.

    Raises
    ------
    InputError
        If it is not between 20 and 1200.
    """
    if dpi is None:
        return 200.0
    low, high = DPI
    if not low <= dpi <= high:
        raise InputError(f"dpi {dpi:g} is not between {low} and {high}")
    return float(dpi)


def check_size(size: tuple[float, float] | None, dpi: float) -> None:
    """Refuse a size in inches that no figure has, or more pixels than fit.

    Raises
    ------
    InputError
        If width or height is not positive, or more than ``MOST`` inches or ``PIXELS`` pixels.
    """
    if size is None:
        return
    if not all(0 < side <= MOST for side in size):
        raise InputError(f"size {size}: width and height are positive, at most {MOST:g} inches")
    if max(size) * dpi > PIXELS:
        raise InputError(f"size {size} at {dpi:g} dpi: at most {PIXELS} pixels a side are possible")


def write(figure: Figure, path: Path) -> None:
    """Write a figure in its suffix's format, undated, so that equal figures are equal files."""
    suffix = path.suffix.lower().lstrip(".")
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(suffix, {})
    figure.savefig(path, format=suffix, dpi=figure.dpi, metadata=metadata)
