"""Style of all figures: fonts, ticks, colour maps, text widths, and writing to files."""

from __future__ import annotations

import functools
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

from pendmap.charts.marks import INK
from pendmap.errors import InputError
from pendmap.files import whole_file

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Sequence

    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf")  # File suffixes that can be drawn

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

MOST, PIXELS = 100.0, 20000  # Largest side of a figure, inches and pixels

DPI = (20, 1200)  # Least and greatest pixels per inch


@functools.lru_cache(maxsize=4096)
def inches(text: str, size: float | None = None, *, bold: bool = False) -> float:
    """Return the width of a line of text in inches, by default in the font size of ticks."""
    if not text.strip():
        return 0.0
    weight = "bold" if bold else "normal"
    font = FontProperties(family=RC["font.sans-serif"], weight=weight)
    path = TextPath((0, 0), text, size=size or RC["xtick.labelsize"], prop=font)
    return float(path.get_extents().width) / 72


def width_of(title: str) -> float:
    """Return the width of the longest line of a panel's title, in inches."""
    return max(inches(line, RC["axes.titlesize"]) for line in title.split("\n"))


def folded(title: str, room: float) -> str:
    """Return a title on two lines of nearly equal length, or on three if there is less room."""
    letters = max(len(line) for line in title.split("\n")) or 1
    size = width_of(title) / letters
    lines = title
    for count in range(2, 4):
        lines = textwrap.fill(title, max(-(-len(title) // count) + 3, 8))
        if room == 0.0 or width_of(lines) <= room + 0.15 or size == 0:
            break
    return lines


def halves(text: str) -> list[str]:
    """Return a text on two lines as equal as possible, broken at one of its semicolons."""
    parts = text.split(";   ")
    both = [[";   ".join(parts[:k]), ";   ".join(parts[k:])] for k in range(1, len(parts))]
    return min(both, key=longest, default=[text])


def longest(lines: Sequence[str]) -> float:
    """Return the width of the longest line, in inches."""
    return max(inches(line, RC["font.size"]) for line in lines)


def colour_map(name: str) -> Colormap:
    """Return a copy of a matplotlib colour map; raise InputError for an unknown name."""
    if name not in mpl.colormaps:
        known = "viridis, cividis, magma, inferno, plasma, RdBu_r, PuOr"
        raise InputError(f"no colour map {name!r}; there are for example {known}")
    return mpl.colormaps[name].copy()


def written(
    path: str | os.PathLike[str],
    make: Callable[[float], Figure],
    *,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
) -> Path:
    """Write the figure that ``make`` returns for a resolution into a file; return its path.

    ``size``, inches, and ``dpi`` are the requested values; InputError is raised for impossible
    ones. Files are undated, so that equal figures give equal files.
    """
    pixels, (low, high) = 200.0 if dpi is None else float(dpi), DPI
    if not low <= pixels <= high:
        raise InputError(f"dpi {pixels:g} is not between {low} and {high}")
    if size is not None and not all(0 < side <= MOST for side in size):
        raise InputError(f"size {size}: width and height are positive, at most {MOST:g} inches")
    if size is not None and max(size) * pixels > PIXELS:
        said = f"at most {PIXELS} pixels a side are possible"
        raise InputError(f"size {size} at {pixels:g} dpi: {said}")
    with whole_file(path, SUFFIXES) as part, mpl.rc_context(RC):
        figure, suffix = make(pixels), part.suffix.lower().lstrip(".")
        metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(suffix, {})
        figure.savefig(part, format=suffix, dpi=figure.dpi, metadata=metadata)
    return Path(path)
