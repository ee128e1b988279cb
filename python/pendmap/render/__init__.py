"""Matplotlib figures for papers; the only package that imports matplotlib.

``draw`` chooses the figure of a dataset by its kind; records, comparisons, diagnoses and
identifications have functions of their own. No display is needed.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from pendmap.charts import registry
from pendmap.charts.runs import RunPanel, of_runs
from pendmap.errors import InputError
from pendmap.render import drawing
from pendmap.render.drawing import save
from pendmap.render.style import SUFFIXES, written

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    import xarray as xr

    from pendmap.charts.chart import Chart
    from pendmap.comparison import Comparison
    from pendmap.diagnosis import Discrepancy
    from pendmap.identification import IdentificationReport
    from pendmap.records import Experiment

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

    def chart(dpi: float) -> Chart:
        cells = max(drawing.CELLS, math.ceil(max(size or (0.0,)) * dpi))
        made = registry.build(dataset, layer=layer, cells=cells)
        return made if colormap is None else drawing.in_colours(made, colormap)

    return written(
        path, lambda dpi: drawing.draw(chart(dpi), size=size, dpi=dpi), size=size, dpi=dpi
    )


def draw_record(
    records: Experiment,
    path: str | os.PathLike[str],
    *,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
) -> Path:
    """Draw the records of an experiment into a file.

    One record: the angle with samples used and not used for fitting, the findings at their times
    and in words, the sampling intervals, the noise against speed. Several runs: a strip for each.

    Parameters
    ----------
    records : Experiment
        Result of ``pendmap.read_experiment``.
    path : str or path
        The file to write, ``.png``, ``.svg`` or ``.pdf``; an existing one is replaced.
    size : (float, float), optional
        Width and height in inches; by default as large as the parts need.
    dpi : float, optional
        Pixels per inch, 200 by default.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    InputError
        For an unknown suffix and an impossible size or resolution.
    OSError
        If the file cannot be written.
    """
    from pendmap.charts import record  # noqa: PLC0415 (what reads records takes a while)

    chart = record.sheet(records, **({"width": size[0]} if size else {}))
    return save(chart, path, size=size, dpi=dpi)


def draw_comparison(comparison: Comparison, path: str | os.PathLike[str]) -> Path:
    """Draw a model and the records that it is compared with into a file.

    For each run: record and model, the residual with the noise, errors of periods and peaks.

    Parameters
    ----------
    comparison : Comparison
        Result of :func:`pendmap.comparison.compare`.
    path : str or path
        As for :func:`pendmap.render.draw`.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    InputError
        For an unknown suffix.
    OSError
        If the file cannot be written.
    """
    from pendmap.charts import comparison as charts  # noqa: PLC0415 (scipy takes a while)

    return save(charts.sheet(comparison), path)


def draw_discrepancy(found: Discrepancy, path: str | os.PathLike[str]) -> Path:
    """Draw a diagnosis into a file.

    The residuals of the runs with the worst baseline fit, before and after, over the noise; the
    residual by run, and the forecast error against the horizon; the missing torque of each model
    over angle and velocity, with 95 % intervals; the scores of the candidates; the first effect's
    size run by run.

    Parameters
    ----------
    found : Discrepancy
        Result of ``pendmap.diagnosis.diagnose``.
    path : str or path
        As for :func:`pendmap.render.draw`.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    InputError
        For an unknown suffix.
    OSError
        If the file cannot be written.
    """
    from pendmap.charts import diagnosis  # noqa: PLC0415 (scipy takes a while)

    return save(diagnosis.sheet(found), path)


def write_report(found: Discrepancy, path: str | os.PathLike[str]) -> Path:
    """Write the report of a diagnosis with its figures.

    Parameters
    ----------
    found : Discrepancy
        Result of ``pendmap.diagnosis.diagnose``.
    path : str or path
        ``.html``: one file with the figures in it. ``.md``: Markdown, with the figures as ``.png``
        beside it. Without a suffix: a folder with both, ``report.html`` and ``report.md``.

    Returns
    -------
    Path
        The file or folder. Each file is complete; existing ones are replaced.

    Raises
    ------
    InputError
        For an unknown suffix.
    OSError
        If a file cannot be written.
    """
    from pendmap.render import report  # noqa: PLC0415 (scipy takes a while)

    target = Path(path)
    if target.suffix.lower() not in {"", *report.SUFFIXES} and not target.is_dir():
        known = " or ".join(report.SUFFIXES)
        raise InputError(
            f"cannot write {str(target)!r}: suffix must be {known}, or it must be a folder, got "
            f"{target.suffix!r}"
        )
    return report.write(found, target)


def draw_runs(
    runs: Sequence[RunPanel], path: str | os.PathLike[str], *, title: str, subtitle: str
) -> Path:
    """Draw the records of an experiment into a file: a panel per run, measured angle against time.

    Parameters
    ----------
    runs : sequence of RunPanel
        One or more.
    path : str or path
        As for :func:`pendmap.render.draw`.
    title, subtitle : str
        Text above all panels.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    InputError
        For an unknown suffix, or without any run.
    OSError
        If the file cannot be written.
    """
    if not runs:
        raise InputError("runs must hold one record or more, got []")
    return save(of_runs(runs, title=title, subtitle=subtitle), path)


def draw_identification(  # noqa: PLR0913 (all of these a user may choose)
    report: IdentificationReport,
    path: str | os.PathLike[str],
    *,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
    parts: Sequence[str] | None = None,
    title: str | None = None,
    subtitle: str | None = None,
) -> Path:
    """Draw an identification into a file: figures 4 to 7 of the paper and its table 1.

    Parameters
    ----------
    report : IdentificationReport
        Result of ``pendmap.identification.identify_experiment``.
    path : str or path
        The file to write, ``.png``, ``.svg`` or ``.pdf``; an existing one is replaced.
    size : (float, float), optional
        Width and height in inches; by default as large as the parts need.
    dpi : float, optional
        Pixels per inch, 200 by default.
    parts : sequence of str, optional
        Parts to draw, by default all: ``record`` (figure 4: angle, velocity, its sign, odd and even
        half cycles), ``decrement`` (5: from triples of peaks, with the zero error and without),
        ``decay`` (6: every model with the record), ``errors`` (7: of periods and peaks) and
        ``table`` (table 1).
    title, subtitle : str, optional
        Text above all parts; by default the record's name and the measured quantities.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    InputError
        For an unknown suffix or part, and for an impossible size or resolution.
    OSError
        If the file cannot be written.

    References
    ----------
    Horton, Wiercigroch & Xu (2008), Phil. Trans. R. Soc. A, section 3.
    """
    from pendmap.charts import identification as charts  # noqa: PLC0415 (likewise)

    sheet = charts.sheet(report, parts=parts, title=title, subtitle=subtitle)
    return save(sheet, path, size=size, dpi=dpi)
