"""Style of all figures: fonts, symbols, colour maps, text widths, and writing to files."""

from __future__ import annotations

import contextlib
import functools
import re
import textwrap
import threading
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
from matplotlib.colors import Colormap
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

from pendmap.errors import InputError
from pendmap.files import whole_file
from pendmap.model.labels import MATHTEXT

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Iterator

    from matplotlib.axes import Axes
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
PIXELS = 20000  # Largest side of a figure, pixels
FEWEST = 12  # Letters of a line that is not broken
DPI = (20, 1200)  # Least and greatest pixels per inch
DRAWING: Final = threading.RLock()
"""Held while a figure is made, drawn or written: matplotlib and its settings have no threads."""

SYMBOLS: Final = {
    **MATHTEXT,
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
    """Return a text of a chart with its symbols in italics, by mathtext."""

    def one(result: re.Match[str]) -> str:
        return r"\$" if result[0] == "$" else SYMBOLS.get(result[0], result[0])

    return _FOUND.sub(one, text.replace(r"\$", "$"))


def points(name: str) -> float:
    """Return the font size of a setting such as ``"axes.titlesize"``, in points."""
    settings: Any = mpl.rcParams
    return float(FontProperties(size=settings[name]).get_size_in_points())


def smaller(share: float) -> dict[Any, Any]:
    """Return settings with smaller fonts, and smaller distances around texts."""
    settings: Any = mpl.rcParams
    sides = [f"{side}tick.major.{what}" for side in "xy" for what in ("size", "pad")]
    pads = [f"figure.constrained_layout.{side}_pad" for side in "wh"]
    lengths = [*sides, *pads, "axes.titlepad", "axes.labelpad"]
    fonts = {name: share * points(name) for name in IN_COLUMN}
    return fonts | {name: share * settings[name] for name in lengths}


def inches(text: str, size: float) -> float:
    """Return the width of the widest line of a text in inches."""
    family = tuple(mpl.rcParams["font.family"])
    lines = (typeset(line) for line in text.split("\n") if line.strip())
    return max((_width(line, size, family) for line in lines), default=0.0)


@functools.lru_cache(maxsize=4096)
def _width(text: str, size: float, family: tuple[str, ...]) -> float:
    path = TextPath((0, 0), text, size=size, prop=FontProperties(family=list(family)))
    return float(path.get_extents().width) / 72


def broken(text: str, room: float, size: float) -> str:
    """Return a text in lines of about ``room`` inches at most, broken between words."""
    wide = inches(text, size)
    if wide <= room:
        return text
    letters = max(int(0.95 * len(text) * room / wide), FEWEST)
    return textwrap.fill(text, letters, break_long_words=False, break_on_hyphens=False)


def wrap(texts: Iterable[Any], axes: Axes, side: str = "width", share: float = 1.0) -> None:
    """Break the lines of texts between words, at each drawing, at a share of a side of axes."""
    for text in texts:
        text.set_wrap(True)
        # Else the side is that of the figure. A partial function can be pickled with it.
        text._get_wrap_line_width = functools.partial(_length, axes, side, share)  # noqa: SLF001


def _length(axes: Axes, side: str, share: float) -> float:
    """Return a share of the width or height of axes in pixels."""
    return share * float(getattr(axes.bbox, side))


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Draw without the warning of matplotlib that a figure is too small for its texts."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="constrained_layout not applied")
        yield


def colour_map(name: str | Colormap) -> Colormap:
    """Return a copy of a colour map, or of matplotlib's; raise InputError for an unknown name."""
    if isinstance(name, Colormap):
        return name.copy()
    if not isinstance(name, str) or name not in mpl.colormaps:
        known = "viridis, cividis, magma, inferno, plasma, RdBu_r, PuOr"
        raise InputError(f"no colour map {name!r}; there are for example {known}")
    return mpl.colormaps[name].copy()


def written(
    path: str | os.PathLike[str], make: Callable[[float], Figure], *, dpi: float | None = None
) -> Path:
    """Write the figure that ``make`` returns for a resolution into a file; return its path."""
    pixels, (low, high) = 200.0 if dpi is None else float(dpi), DPI
    if not low <= pixels <= high:
        raise InputError(f"dpi {pixels:g} is not between {low} and {high}")
    with DRAWING, whole_file(path, SUFFIXES) as part, mpl.rc_context(RC), quiet():
        figure, suffix = make(pixels), part.suffix.lower().lstrip(".")
        metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(suffix, {})
        figure.savefig(part, format=suffix, dpi=figure.dpi, metadata=metadata)
    return Path(path)
