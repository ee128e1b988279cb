"""Figure files, written complete or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl

from pendmap.files import whole_file
from pendmap.render import drawing, style

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from pendmap.charts.chart import Chart, Sheet

SUFFIXES = (".png", ".svg", ".pdf")  # File suffixes that can be drawn


def save(
    chart: Chart | Sheet,
    path: str | os.PathLike[str],
    *,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
) -> Path:
    """Write the figure of a chart, or of a sheet of charts, into a file; return its path."""
    return written(path, lambda dpi: drawing.draw(chart, size=size, dpi=dpi), size=size, dpi=dpi)


def written(
    path: str | os.PathLike[str],
    make: Callable[[float], Figure],
    *,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
) -> Path:
    """Write the figure that ``make`` returns for a resolution into a file; return its path.

    ``size`` and ``dpi`` are the requested values; impossible ones are refused.
    """
    resolution = style.resolution(dpi)
    style.check_size(size, resolution)
    with whole_file(path, SUFFIXES) as part, mpl.rc_context(style.RC):
        style.write(make(resolution), part)
    return Path(path)
