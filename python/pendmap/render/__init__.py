"""Matplotlib figures for papers; the only package that imports matplotlib.

``draw`` chooses the figure by the kind of dataset. It needs no display.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pendmap.charts import registry
from pendmap.charts.runs import RunPanel
from pendmap.render.drawing import figure
from pendmap.render.of_records import (
    draw_comparison,
    draw_discrepancy,
    draw_identification,
    draw_record,
    draw_runs,
    write_report,
)
from pendmap.render.written import SUFFIXES, written

if TYPE_CHECKING:
    import os
    from pathlib import Path

    import xarray as xr

__all__ = [
    "SUFFIXES",
    "RunPanel",
    "draw",
    "draw_comparison",
    "draw_discrepancy",
    "draw_identification",
    "draw_record",
    "draw_runs",
    "write_report",
]


def draw(  # noqa: PLR0913 (all of these a user may choose)
    dataset: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    layer: str | None = None,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
    colormap: str | None = None,
) -> Path:
    """Draw a dataset into a file.

    Basin map: labels, attractors with their shares, and settle time; with unreliable labels the
    settle time and net turns come first; with meaningless labels the net turns and the finite-time
    exponent. Closed orbits: paths and points in the phase plane. Map over two parameters: kinds of
    attractor, striped if several coexist, and the largest exponent. Bifurcation diagram:
    stroboscopic angles, sweeps up and down, exponents. Critical curves: stable regions and their
    boundaries. Melnikov's criterion: the threshold against the frequency. Trajectory: time history,
    energy, phase plane, Poincare section. Exponent: growth along the start, the running mean, its
    distribution. Lifetime: the survival curve with its tail, and the mean lifetime against the
    start of the tail.

    Parameters
    ----------
    dataset : xarray.Dataset
        Result of ``pendmap.basins``, ``pendmap.orbit``, ``pendmap.parameter_map``,
        ``pendmap.bifurcation``, ``pendmap.lyapunov``, ``pendmap.lifetime``, ``pendmap.tongues``,
        ``pendmap.melnikov`` or ``pendmap.simulate``; ``attrs["kind"]`` names the kind. A
        selection (a range, every k-th value, reversed, transposed) is drawn with its own cells,
        coordinates and shares.
    path : str or path
        The file to write, ``.png``, ``.svg`` or ``.pdf``; an existing one is replaced.
    layer : str, optional
        Part to draw alone, large: ``labels``, ``settle``, ``turns`` or ``exponent`` of a map,
        over draws also ``probability`` and ``entropy``; ``history``, ``energy``, ``phase`` or
        ``section`` of a trajectory; ``growth``, ``average`` or ``distribution`` of an exponent;
        ``survival`` or ``tail`` of a lifetime; ``theta`` or ``velocity`` of a bifurcation diagram;
        of critical curves the plane: ``omega-p`` or ``e-alpha2``; of a map over two parameters
        ``kinds``, ``exponent``, ``attractors``, ``period``, ``winding``, ``undecided``, over draws
        ``certainty``, or ``share KIND``.
    size : (float, float), optional
        Width and height in inches; by default as large as the parts need.
    dpi : float, optional
        Pixels per inch, 200 by default.
    colormap : str, optional
        Name of a matplotlib colour map for the map's scalar layers.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    InputError
        For an unknown kind of dataset, suffix, layer or colour map, and for an impossible size or
        resolution.
    MemoryError
        If the dataset is too large.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> figures.draw(pendmap.load("basins.nc"), "settle.pdf", layer="settle")  # doctest: +SKIP
    """
    dataset = registry.ready(dataset, "draw")

    return written(
        path,
        lambda dpi: figure(dataset, layer=layer, size=size, dpi=dpi, colormap=colormap),
        size=size,
        dpi=dpi,
    )
