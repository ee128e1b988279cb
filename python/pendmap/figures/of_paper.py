"""Figures of the paper that are of no dataset: 1, 2, 3, 8 and 9."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pendmap.figures import tongues
from pendmap.figures.written import written

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence
    from pathlib import Path

    import xarray as xr

    from pendmap.identification import ForcedComparison

__all__ = ["draw_motions", "draw_pendulum", "draw_tongues", "draw_tumbling"]


def draw_tongues(
    dataset: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    title: str,
    marks: Sequence[tuple[float, float, str]] = (),
) -> Path:
    """Draw critical curves with points marked into a file: figure 1.

    Parameters
    ----------
    dataset : xarray.Dataset
        What ``pendmap.tongues`` returned.
    path : str or path
        As of :func:`pendmap.figures.draw`.
    title : str
        What stands above.
    marks : sequence of (float, float, str)
        Amplitude ``p``, frequency ``omega`` and name of each point.

    Returns
    -------
    Path
        The file, complete.

    Raises
    ------
    InputError
        For an unknown suffix.
    OSError
        If the file cannot be written.
    """
    return written(
        path,
        lambda dpi: tongues.figure(
            dataset, layer=None, size=None, dpi=dpi, colormap=None, title=title, marks=marks
        ),
    )


def draw_tumbling(
    runs: Sequence[xr.Dataset],
    path: str | os.PathLike[str],
    *,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
    title: str | None = None,
) -> Path:
    """Draw time history, phase plane and Poincare section of trajectories, a column each: figure 2.

    Parameters
    ----------
    runs : sequence of Dataset
        Trajectories of :func:`pendmap.simulate`, from the instant from which they are shown.
    path, size, dpi, title
        As for :func:`draw_pendulum`, whose result and errors are those here.
    """
    from pendmap.figures import tumbling  # noqa: PLC0415 (likewise)

    return written(
        path, lambda dpi: tumbling.figure(runs, size=size, dpi=dpi, title=title), size=size, dpi=dpi
    )


def draw_pendulum(
    path: str | os.PathLike[str],
    *,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
    title: str | None = None,
) -> Path:
    """Draw the pendulum with its moving pivot and its equation (eq. 2.1) into a file: figure 3.

    Parameters, result and errors are those of :func:`pendmap.figures.draw_record`; ``title`` stands
    above, by default what is drawn.
    """
    from pendmap.figures import pendulum  # noqa: PLC0415 (likewise)

    return written(
        path, lambda dpi: pendulum.figure(size=size, dpi=dpi, title=title), size=size, dpi=dpi
    )


def draw_motions(  # noqa: PLR0913 (what, where, and how)
    runs: Sequence[ForcedComparison],
    path: str | os.PathLike[str],
    *,
    steady: bool,
    title: str,
    subtitle: str,
    dpi: float | None = None,
) -> Path:
    """Draw forced runs beside a model: the paper's figures 8 (steady states) and 9 (tumbling).

    Parameters
    ----------
    runs : sequence of ForcedComparison
        Of :func:`pendmap.identification.compare`.
    steady : bool
        Whether their steady states are drawn, a phase plane each; else a row for each: histories
        and phase planes of the record and of a member of the ensemble, and the statistics.
    title, subtitle : str
        What stands above.
    path, dpi
        As for :func:`draw_pendulum`, whose result and errors are those here.
    """
    from pendmap.figures import motions  # noqa: PLC0415 (likewise)

    make = motions.steady_figure if steady else motions.tumbling_figure
    return written(path, lambda dpi: make(runs, dpi=dpi, title=title, subtitle=subtitle), dpi=dpi)
