"""Style of all figures: fonts, ticks, colour maps, text widths, and writing to files."""

from __future__ import annotations

import functools
import re
import textwrap
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
from matplotlib.colors import Colormap
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

from pendmap.errors import InputError
from pendmap.files import whole_file

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Sequence

    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf")  # File suffixes that can be drawn

STYLE: Final = Path(__file__).parents[1] / "figures.mplstyle"
RC: Final[dict[Any, Any]] = dict(mpl.rc_params_from_file(STYLE, use_default_template=False))
COLUMN: Final = 120.0  # Width of a figure below which its fonts are those of a journal's column, mm
IN_COLUMN: Final[dict[Any, Any]] = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.5,
}

MOST, PIXELS = 100.0, 20000  # Largest side of a figure, inches and pixels

FEWEST = 12  # Letters of a line below which a text is not broken

DPI = (20, 1200)  # Least and greatest pixels per inch


DRAWING: Final = threading.RLock()
"""Held while a figure is made, drawn or written: matplotlib and its settings have no threads."""

SYMBOLS: Final = {
    "E / (m g l)": "$E/(mgl)$",
    "d²θ/dt²": "$d^2θ/dt^2$",
    "dθ/dτ": "$dθ/dτ$",
    "dθ/dt": "$dθ/dt$",
    "θr": "$θ_r$",
    "w0": "$ω_0$",
    "c/m": "$c/m$",
    "Tr": "$T_r$",
    "α²": "$α^2$",
    "YΩ²/g": "$YΩ^2/g$",
    "p/ω²": "$p/ω^2$",
    "1/ω²": "$1/ω^2$",
    "Y/l": "$Y/l$",
    "δx": "$δx$",
    **{letter: f"${letter}$" for letter in "θτγωΩφζλδ"},
    **{letter: f"${letter}$" for letter in "ptelEYfQ"},
}
"""Symbols in the texts of charts, and their form in mathtext."""
_FOUND: Final = re.compile(
    r"\$-?10\^\{-?\d+\}\$|"
    + "|".join(map(re.escape, dict.fromkeys(SYMBOLS.values())))
    + r"|\$|(?<![\w$])(?:"
    + "|".join(re.escape(name) for name in SYMBOLS if name not in "ptelEYfQ")
    + r")(?![\w$])"
    r"|(?<![^\s(,;|])[ptelEYfQ](?= (?:[=<>(−-]|and )|$)"
)
"""Mathtext made here, a dollar sign of a name, or a symbol; a Latin letter only as a quantity."""


@functools.lru_cache(maxsize=4096)
def typeset(text: str) -> str:
    """Return a text of a chart with its symbols in italics, by mathtext.

    >>> typeset("θr = 0.02,  p (g)")
    '$θ_r$ = 0.02,  $p$ (g)'
    """

    def one(found: re.Match[str]) -> str:
        return r"\$" if found[0] == "$" else SYMBOLS.get(found[0], found[0])

    return _FOUND.sub(one, text.replace(r"\$", "$"))


def points(name: str) -> float:
    """Return the font size of a setting such as ``"axes.titlesize"``, in points."""
    settings: Any = mpl.rcParams
    return float(FontProperties(size=settings[name]).get_size_in_points())


def inches(text: str, size: float | None = None, *, bold: bool = False) -> float:
    """Return the width of the widest line in inches, by default in the font size of ticks."""
    family, size = tuple(mpl.rcParams["font.family"]), size or points("xtick.labelsize")
    lines = (typeset(line) for line in text.split("\n") if line.strip())
    return max((_width(line, size, family, bold=bold) for line in lines), default=0.0)


@functools.lru_cache(maxsize=4096)
def _width(text: str, size: float, family: tuple[str, ...], *, bold: bool) -> float:
    font = FontProperties(family=list(family), weight="bold" if bold else "normal")
    path = TextPath((0, 0), text, size=size, prop=font)
    return float(path.get_extents().width) / 72


def width_of(title: str) -> float:
    """Return the width of the longest line of a panel's title, in inches."""
    return inches(title, points("axes.titlesize"))


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


def broken(text: str, room: float, size: float, *, bold: bool = False) -> str:
    """Return a text in lines of at most ``room`` inches, broken between words."""
    letters, lines = len(text), text
    while inches(lines, size, bold=bold) > room and letters > FEWEST:
        letters -= 1
        lines = textwrap.fill(text, letters)
    return lines


def halves(text: str) -> list[str]:
    """Return a text on two lines as equal as possible, broken at one of its semicolons."""
    parts = text.split(";   ")
    both = [[";   ".join(parts[:k]), ";   ".join(parts[k:])] for k in range(1, len(parts))]
    return min(both, key=longest, default=[text])


def longest(lines: Sequence[str]) -> float:
    """Return the width of the longest line, in inches."""
    return max(inches(line, points("font.size")) for line in lines)


def colour_map(name: str | Colormap) -> Colormap:
    """Return a copy of a colour map, or of matplotlib's; raise InputError for an unknown name."""
    if isinstance(name, Colormap):
        return name.copy()
    if not isinstance(name, str) or name not in mpl.colormaps:
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
    with DRAWING, whole_file(path, SUFFIXES) as part, mpl.rc_context(RC):
        figure, suffix = make(pixels), part.suffix.lower().lstrip(".")
        metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(suffix, {})
        figure.savefig(part, format=suffix, dpi=figure.dpi, metadata=metadata)
    return Path(path)
