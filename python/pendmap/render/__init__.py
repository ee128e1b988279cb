"""Matplotlib figures for papers; the only package that imports matplotlib.

:func:`pendmap.plot` draws one part into Axes of one's own, ``draw`` a whole figure into a file. No
display is needed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import matplotlib as mpl

from pendmap.charts import registry
from pendmap.charts.chart import Chart, Sheet
from pendmap.errors import InputError
from pendmap.render import drawing, style
from pendmap.render.report import write_report
from pendmap.render.style import SUFFIXES

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

__all__ = ["SUFFIXES", "draw", "figure_of", "write_report"]

_INCH = 25.4  # mm


def figure_of(  # noqa: PLR0913 (all of these a user may choose)
    result: Any,  # noqa: ANN401 (a dataset, records, or what was found in records)
    *,
    layer: str | None = None,
    size: tuple[float, float] | None = None,
    width: float | None = None,
    title: bool = True,
    dpi: float = 200.0,
    colormap: str | Colormap | None = None,
) -> Figure:
    """Return the figure of a result, or of a chart; arguments are those of :func:`draw`."""
    if width is not None and not (size is None and 0 < width < math.inf):
        raise InputError(f"width must be positive, in mm, and no size given, got {width!r}")
    if isinstance(result, Chart | Sheet):
        made = result
    else:
        wide = width / _INCH if width else max(size or (0.0,))
        side = wide * dpi if wide * dpi <= style.PIXELS else 0.0  # a larger figure is refused
        cells = max(drawing.CELLS, math.ceil(side))
        made = registry.of_result(result, layer=layer, cells=cells)
    if colormap is not None:
        made = drawing.in_colours(made, colormap)
    narrow = style.IN_COLUMN if width is not None and width < style.COLUMN else {}
    with style.DRAWING, mpl.rc_context(style.RC | narrow):
        return drawing.draw(
            made, size=size, dpi=dpi, width=width / _INCH if width else None, title=title
        )


def draw(  # noqa: PLR0913 (all of these a user may choose)
    result: Any,  # noqa: ANN401 (as figure_of)
    path: str | os.PathLike[str],
    *,
    layer: str | None = None,
    size: tuple[float, float] | None = None,
    width: float | None = None,
    title: bool = True,
    dpi: float | None = None,
    colormap: str | Colormap | None = None,
) -> Path:
    """Draw a result into a file.

    The gallery of the manual shows what is drawn of each result. A selection of a dataset (a range,
    every k-th value, reversed, transposed) is drawn with its own cells, coordinates and shares.

    Parameters
    ----------
    result : xarray.Dataset or other result
        Result of an analysis, of ``pendmap.load``, ``read_experiment``, ``identify``, ``compare``
        or ``diagnose``.
    path : str or path
        The file to write, ``.png``, ``.svg`` or ``.pdf``; an existing one is replaced.
    layer : str, optional
        Part to draw alone, large; an unknown one is answered with those of the result. Of a map
        ``labels``, ``settle``, ``turns``, ``exponent``, ``probability``, ``entropy``; a trajectory
        ``history``, ``energy``, ``phase``, ``section``; an exponent ``growth``, ``average``,
        ``distribution``; a lifetime ``survival``, ``tail``; a diagram ``theta``, ``velocity``,
        ``sweeps``; critical curves ``omega-p``, ``e-alpha2``; a map over parameters ``kinds``,
        ``exponent``, ``attractors``, ``period``, ``winding``, ``undecided``, ``certainty``, ``share
        KIND``; a sweep ``fraction``, ``entropy``, ``uncertainty``, ``boundary``, ``main``; an
        identification ``record``, ``fit``, ``residual``, ``envelope``, and ``all`` panels of all
        methods.
    size : (float, float), optional
        Width and height in inches, like ``8x4`` in a command; by default what the parts need.
    width : float, optional
        Width in mm, in place of ``size``: 86 is one column of most journals, 178 two. The figure is
        as high as its parts need; below 120 mm its fonts have 8 points.
    title : bool
        False: no title and subtitle, for a figure with a caption.
    dpi : float, optional
        Pixels per inch of a .png; by default 200.
    colormap : str or Colormap, optional
        Name of a matplotlib colour map for the map's scalar layers.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    InputError
        For an unknown kind of result, suffix, layer or colour map, and for a resolution or a number
        of pixels that no file can have.
    MemoryError
        If the dataset is too large.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> render.draw(pendmap.load("basins.nc"), "settle.pdf", layer="settle")  # doctest: +SKIP
    """

    def make(dpi: float) -> Figure:
        look: dict[str, Any] = {"size": size, "width": width, "title": title, "colormap": colormap}
        return figure_of(result, layer=layer, dpi=dpi, **look)

    return style.written(path, make, dpi=dpi)
