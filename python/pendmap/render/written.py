"""Figures into files: complete, or not there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl

from pendmap.files import whole_file
from pendmap.render import style

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf")
"""The kinds of file that can be drawn."""


def written(
    path: str | os.PathLike[str],
    make: Callable[[float], Figure],
    *,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
) -> Path:
    """Write a figure into a file and return its path.

    Parameters
    ----------
    path : str or path
        The file; an existing one is replaced.
    make : callable
        Makes the figure at so many pixels per inch.
    size : (float, float), optional
        What was asked for, inches.
    dpi : float, optional
        Pixels per inch, 200 by default.

    Raises
    ------
    InputError
        For an unknown suffix, and for an impossible size or resolution.
    OSError
        If the file cannot be written.
    """
    resolution = style.resolution(dpi)
    style.check_size(size, resolution)
    with whole_file(path, SUFFIXES) as part, mpl.rc_context(style.RC):
        style.write(make(resolution), part)
    return Path(path)
