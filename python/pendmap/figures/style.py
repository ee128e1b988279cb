"""How all figures look: type, ticks, colour bars, and how they are written."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from matplotlib.ticker import NullLocator

from pendmap.errors import InputError
from pendmap.pictures import plane

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

__all__ = [
    "RC",
    "check_size",
    "colour_bar",
    "colour_map",
    "phase_plane",
    "resolution",
    "write",
]

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

THETA = "\N{GREEK SMALL LETTER THETA} (rad)"
VELOCITY = "d\N{GREEK SMALL LETTER THETA}/d\N{GREEK SMALL LETTER TAU}"

MOST, PIXELS = 100.0, 20000
"""Inches and pixels that a side of a figure may have."""

DPI = (20, 1200)
"""Pixels per inch that may be chosen."""


def phase_plane(axes: Axes, theta: tuple[float, float], velocity: tuple[float, float]) -> None:
    """Give axes the limits, ticks and names of the phase plane."""
    axes.set_xlim(*theta)
    axes.set_ylim(*velocity)
    width = axes.get_window_extent().width / axes.figure.dpi
    ticks = plane.angle_ticks(*theta)
    every = math.ceil(len(ticks) * 0.42 / max(width, 0.1))
    zero = next((k for k, tick in enumerate(ticks) if tick[1] == "0"), 0)
    ticks = ticks[zero % every :: every]
    axes.set_xticks([x for x, _ in ticks], [text for _, text in ticks])
    axes.set_xlabel(THETA)
    axes.set_ylabel(VELOCITY, labelpad=2)


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
