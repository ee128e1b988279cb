"""Figures of the paper that are of no dataset: 1, 2, 3, 8 and 9."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pendmap.charts import names, plane
from pendmap.errors import InputError
from pendmap.render import sheet as sheets
from pendmap.render import style, tongues
from pendmap.render.written import written
from pendmap.units import Units

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence
    from pathlib import Path

    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pendmap.comparison import ForcedComparison


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
        As of :func:`pendmap.render.draw`.
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
    return written(
        path, lambda dpi: figure(runs, size=size, dpi=dpi, title=title), size=size, dpi=dpi
    )


def draw_pendulum(
    path: str | os.PathLike[str],
    *,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
    title: str | None = None,
) -> Path:
    """Draw the pendulum with its moving pivot and its equation (eq. 2.1) into a file: figure 3.

    Parameters, result and errors are those of :func:`pendmap.render.draw_record`; ``title`` stands
    above, by default what is drawn.
    """
    from pendmap.paper import drawings  # noqa: PLC0415 (likewise)

    return written(
        path, lambda dpi: drawings.figure(size=size, dpi=dpi, title=title), size=size, dpi=dpi
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
        Of :func:`pendmap.comparison.free`.
    steady : bool
        Whether their steady states are drawn, a phase plane each; else a row for each: histories
        and phase planes of the record and of a member of the ensemble, and the statistics.
    title, subtitle : str
        What stands above.
    path, dpi
        As for :func:`draw_pendulum`, whose result and errors are those here.
    """
    from pendmap.paper import drawings  # noqa: PLC0415 (likewise)

    make = drawings.steady_figure if steady else drawings.tumbling_figure
    return written(path, lambda dpi: make(runs, dpi=dpi, title=title, subtitle=subtitle), dpi=dpi)


# Trajectories side by side: time history, phase plane and Poincare section, a column each.


HISTORY, CURVE = 60, 100
"""Periods of the time history and of the phase curve, the first ones."""

_INK = "#1d3557"
_GAP_X, _GAP_Y, _LEAST = 0.75, 0.85, 1.0
_ROWS = (0.7, 1.0, 1.0)


def figure(
    runs: Sequence[xr.Dataset], *, size: tuple[float, float] | None, dpi: float, title: str | None
) -> Figure:
    """Return the figure; see :func:`pendmap.render.draw_tumbling`.

    Raises
    ------
    InputError
        If ``size`` leaves no room for the panels.
    """
    count = len(runs)
    width, height = size or (0.6 + 3.1 * count, 9.0)
    wide = (width - sheets.LEFT - sheets.RIGHT - (count - 1) * _GAP_X) / count
    high = (height - sheets.TOP - sheets.BOTTOM - 2 * _GAP_Y) / sum(_ROWS)
    if min(wide, high) < _LEAST:
        raise InputError(f"size {size} leaves no room for the panels; it must be larger")
    gammas = sorted({float(run.attrs["gamma"]) for run in runs})
    damping = ", ".join(f"{gamma:g}" for gamma in gammas)
    periods, points = (min(run.sizes["period"] for run in runs), CURVE), runs[0].sizes["period"]
    shared = (
        f"\N{GREEK SMALL LETTER GAMMA} = {damping};   time history, phase plane ({min(periods)} "
        f"periods), Poincar\N{LATIN SMALL LETTER E WITH ACUTE} section ({points} points)"
    )
    sheet = sheets.headed((width, height), dpi, title or "Trajectories", shared)
    bottoms = [sheets.BOTTOM + sum(_ROWS[k + 1 :]) * high + (2 - k) * _GAP_Y for k in range(3)]
    for k, draw in enumerate((_history, _phase, _section)):
        for column, run in enumerate(runs):
            left = sheets.LEFT + column * (wide + _GAP_X)
            axes = sheets.place(sheet, left, bottoms[k], wide, _ROWS[k] * high)
            draw(axes, run)
            if k == 0:
                attrs = run.attrs
                point = f"p = {attrs['p']:g}, \N{GREEK SMALL LETTER OMEGA} = {attrs['omega']:g}"
                axes.set_title(f"({'abcdefgh'[column]}) {point}")
            if column:
                axes.set_ylabel("")
    return sheet


def _first(run: xr.Dataset, periods: int) -> xr.Dataset:
    """Return so many periods, the first ones."""
    last = run["section_time"].values[min(periods, run.sizes["period"] - 1)]
    return run.sel(time=slice(None, last))


def _history(axes: Axes, run: xr.Dataset) -> None:
    part = _first(run, HISTORY)
    time, theta = part["time"].values, part["theta"].values
    axes.plot(time, theta, color=_INK, lw=0.8)
    axes.margins(x=0.0, y=0.06)
    style.scale(axes, "y", axes.get_ylim(), names.ANGLE, angle=True)
    clock = names.clock(Units.of(run.attrs))
    style.scale(axes, "x", (float(time[0]), float(time[-1])), clock)


def _phase(axes: Axes, run: xr.Dataset) -> None:
    part = _first(run, CURVE)
    curve = plane.broken_at_wrap(part["theta"].values, part["velocity"].values)
    axes.plot(curve[:, 0], curve[:, 1], color=_INK, lw=0.35)
    _phase_plane(axes, run)


def _section(axes: Axes, run: xr.Dataset) -> None:
    theta, velocity = run["section_theta"].values, run["section_velocity"].values
    axes.plot(theta, velocity, "o", ms=0.8, mew=0, color=_INK)
    _phase_plane(axes, run)


def _phase_plane(axes: Axes, run: xr.Dataset) -> None:
    speeds = plane.padded(run["velocity"].values)
    style.phase_plane(axes, (-math.pi, math.pi), speeds, Units.of(run.attrs))
