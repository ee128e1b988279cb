"""Marks of charts: lines, points, bands, images and text, as arrays and plain values.

Marks are in the units of their axes. A mark with a ``name`` is in the legend; marks of equal
name share one entry. In a recording a mark has its ``path`` below the data of its panel, by
default its number and name.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

Floats = npt.NDArray[np.float64]
Dash = str | tuple[float, ...]
Ends = tuple[float, float]

NONE: Final = np.empty(0)  # Coordinates of a mark that the legend alone shows
INK, QUIET, ALARM = "#222222", "#666666", "#a61c00"
"""Colours of text and axes, of secondary elements, and of warnings."""
DASHED, DOTTED = (4.0, 2.0), (1.2, 1.2)  # Dashes: lengths of lines and gaps, in line widths


@dataclass(frozen=True, kw_only=True, eq=False)
class Mark:
    """Attributes of all marks; a mark of higher ``order`` covers the others."""

    colour: str = INK
    name: str = ""
    path: str = ""
    order: float | None = None
    alpha: float = 1.0


@dataclass(frozen=True, eq=False)
class Line(Mark):
    """A line through points, broken at values that are not numbers; ``halo`` is its outline."""

    x: Floats
    y: Floats
    _: dataclasses.KW_ONLY
    width: float = 1.2
    dash: Dash = "-"
    step: bool = False
    halo: str = ""


@dataclass(frozen=True, eq=False)
class Points(Mark):
    """Separate points; ``fill`` and ``edge`` default to ``colour``.

    A figure may show many points as their density in columns, if edges of ``cells`` are given. A
    recording shows points only at their values ``when`` of the timeline of the chart.
    """

    x: Floats
    y: Floats
    _: dataclasses.KW_ONLY
    marker: str = "o"
    size: float = 3.0
    fill: str = ""
    edge: str = ""
    edge_width: float = 0.0
    halo: str = ""
    clip: bool = True
    cells: Floats | None = None
    when: Floats | None = None


@dataclass(frozen=True, eq=False)
class Band(Mark):
    """The area between two curves."""

    x: Floats
    low: Floats
    high: Floats
    _: dataclasses.KW_ONLY
    step: bool = False


@dataclass(frozen=True, eq=False)
class Steps(Mark):
    """A histogram, ``n`` values over ``n + 1`` edges: outline or area."""

    edges: Floats
    values: Floats
    _: dataclasses.KW_ONLY
    filled: bool = False
    width: float = 1.0


@dataclass(frozen=True, eq=False)
class Areas(Mark):
    """Polygons, each of shape (m, 2); hatched or filled."""

    shapes: Sequence[Floats]
    _: dataclasses.KW_ONLY
    hatch: str = ""


@dataclass(frozen=True, eq=False)
class Colours:
    """Colour scale of an image, and the name of its colour bar.

    ``scale`` is ``linear``, ``log``, ``centred`` (two halves about 0) or ``counts`` (whole numbers
    in steps); ``beyond`` tells which ends are exceeded by values.
    """

    name: str
    map: Any  # name of a colour map of matplotlib, or the map
    low: float
    high: float
    scale: Literal["linear", "log", "centred", "counts"] = "linear"
    beyond: Literal["neither", "min", "max", "both"] = "neither"
    ticks: Sequence[float] | None = None


@dataclass(frozen=True, eq=False)
class Image(Mark):
    """Cells between the ends of both axes, row 0 lowest.

    ``values`` are numbers, shape (rows, columns), nan where missing, coloured by ``colours``; or
    they are indices into ``classes``, pairs of name and colour.
    """

    values: npt.NDArray[Any]
    x: Ends
    y: Ends
    _: dataclasses.KW_ONLY
    colours: Colours | None = None
    classes: Sequence[tuple[str, str]] = ()


@dataclass(frozen=True, eq=False)
class Level(Mark):
    """A line across the panel at a value of one axis."""

    value: float
    _: dataclasses.KW_ONLY
    axis: Literal["x", "y"] = "y"
    width: float = 0.7
    dash: Dash = "-"


ZERO: Final = Level(0.0, colour=QUIET, width=0.6, order=0.0)  # Line at 0, below other marks


@dataclass(frozen=True, eq=False)
class Span(Mark):
    """Shaded intervals of one axis, shape (n, 2), across the panel."""

    ends: npt.ArrayLike
    _: dataclasses.KW_ONLY
    axis: Literal["x", "y"] = "x"


@dataclass(frozen=True, eq=False)
class Text(Mark):
    """Text at a position; ``align``: horizontal, vertical."""

    x: float
    y: float
    text: str
    _: dataclasses.KW_ONLY
    align: tuple[str, str] = ("center", "center")
    size: float = 9.0


@dataclass(frozen=True, eq=False)
class Table(Mark):
    """Rows of text over a whole panel; the first column is left-aligned, others right-aligned."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]


def together(lines: Iterable[Floats]) -> tuple[Floats, Floats]:
    """Return lines, each of shape (n, 2), as one line broken between them: x and y."""
    gap = np.full((1, 2), np.nan)
    parts = [part for line in lines for part in (line, gap)]
    both = np.concatenate([np.empty((0, 2)), *parts])
    return both[:, 0], both[:, 1]


def bars(x: npt.ArrayLike, low: npt.ArrayLike, high: npt.ArrayLike) -> tuple[Floats, Floats]:
    """Return vertical bars from low to high as one broken line: x and y."""
    at, bottom, top = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (x, low, high)))
    gap = np.full(at.shape, np.nan)
    return np.repeat(at, 3), np.stack([bottom, top, gap], axis=1).ravel()


def this_pendulum(x: float, y: float, *, named: bool = True, clip: bool = True) -> Points:
    """Return the star at the parameters of the pendulum itself."""
    look: dict[str, Any] = {"marker": "*", "size": 9.0, "order": 4.0, "path": "own", "clip": clip}
    return Points(np.array([x]), np.array([y]), name="this pendulum" if named else "", **look)
