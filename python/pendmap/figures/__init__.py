"""Figures for papers; the only place that imports matplotlib.

``draw`` looks at what a dataset holds and draws the figure for it. It needs no display.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl

from pendmap.errors import InputError
from pendmap.figures import (
    basins,
    diagrams,
    exponents,
    lifetimes,
    melnikov,
    orbits,
    planes,
    style,
    tongues,
    trajectory,
)
from pendmap.figures import runs as runs_figure
from pendmap.figures.runs import RunPanel
from pendmap.files import whole_file
from pendmap.pictures.layers import refuse_lists

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    import xarray as xr

    from pendmap.discrepancy import Discrepancy
    from pendmap.identification import Comparison, ForcedComparison, IdentificationReport
    from pendmap.records import Experiment

__all__ = [
    "SUFFIXES",
    "RunPanel",
    "draw",
    "draw_comparison",
    "draw_discrepancy",
    "draw_identification",
    "draw_motions",
    "draw_pendulum",
    "draw_record",
    "draw_runs",
    "draw_tongues",
    "draw_tumbling",
    "write_report",
]

SUFFIXES = (".png", ".svg", ".pdf")
"""The kinds of file that can be drawn."""

_KINDS = {
    "basins": basins.figure,
    "bifurcation": diagrams.figure,
    "lifetime": lifetimes.figure,
    "lyapunov": exponents.figure,
    "melnikov": melnikov.figure,
    "orbits": orbits.figure,
    "parameter_map": planes.figure,
    "tongues": tongues.figure,
    "trajectory": trajectory.figure,
}


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

    Of a basin map: the labels, with the attractors marked and named with their shares, and the
    settle time beside them; where the labels are unreliable, settle time and net turns lead; where
    labels tell nothing, the net turns and the finite-time exponent. Of closed orbits: their paths
    and points in the phase plane. Of a map over two parameters: the kinds of attractor, striped
    where several coexist, and the largest exponent. Of a bifurcation diagram: stroboscopic angles,
    sweeps up and down, exponents. Of critical curves: stable regions and their boundaries. Of
    Melnikov's criterion: the threshold against the frequency. Of a trajectory: time history,
    energy, phase plane, Poincare section. Of an exponent: growth along the start, the running mean,
    its distribution. Of a lifetime: the survival curve with its tail, and the mean over where the
    tail begins.

    Parameters
    ----------
    dataset : xarray.Dataset
        What ``pendmap.basins``, ``pendmap.orbit``, ``pendmap.parameter_map``,
        ``pendmap.bifurcation``, ``pendmap.lyapunov``, ``pendmap.lifetime``, ``pendmap.tongues``,
        ``pendmap.melnikov`` or ``pendmap.simulate`` returned;
        ``attrs["kind"]`` tells which.
    path : str or path
        The file to write, ``.png``, ``.svg`` or ``.pdf``; an existing one is replaced.
    layer : str, optional
        Draw one part alone, large: ``labels``, ``settle``, ``turns`` or ``exponent`` of a map;
        ``history``, ``energy``, ``phase`` or ``section`` of a trajectory; ``growth``, ``average``
        or ``distribution`` of an exponent; ``survival`` or ``tail`` of a lifetime; ``theta`` or
        ``velocity`` of a bifurcation diagram; of critical curves the plane: ``omega-p`` or
        ``e-alpha2``; of a map over two parameters ``kinds``, ``exponent``, ``attractors``,
        ``period``, ``winding``, ``undecided`` or ``share KIND``.
    size : (float, float), optional
        Width and height in inches; by default as large as the parts need.
    dpi : float, optional
        Pixels per inch, 200 by default.
    colormap : str, optional
        Name of a matplotlib colour map for the map's scalar layers.

    Returns
    -------
    Path
        The file, complete.

    Raises
    ------
    InputError
        For an unknown kind of dataset, suffix, layer or colour map, and for an impossible size or
        resolution.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> figures.draw(pendmap.load("basins.nc"), "settle.pdf", layer="settle")  # doctest: +SKIP
    """
    kind = dataset.attrs.get("kind")
    if kind not in _KINDS:
        known = ", ".join(_KINDS)
        raise InputError(
            f"cannot draw a dataset of kind {kind!r}; kinds that can be drawn: {known}"
        )
    refuse_lists(dataset)
    resolution = style.resolution(dpi)
    style.check_size(size, resolution)
    with whole_file(path, SUFFIXES) as part, mpl.rc_context(style.RC):
        made = _KINDS[kind](dataset, layer=layer, size=size, dpi=resolution, colormap=colormap)
        style.write(made, part)
    return Path(path)


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
        As of :func:`draw`.
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
    dpi = style.resolution(None)
    with whole_file(path, SUFFIXES) as part, mpl.rc_context(style.RC):
        made = tongues.figure(
            dataset, layer=None, size=None, dpi=dpi, colormap=None, title=title, marks=marks
        )
        style.write(made, part)
    return Path(path)


def draw_record(
    records: Experiment,
    path: str | os.PathLike[str],
    *,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
) -> Path:
    """Draw what an experiment holds into a file.

    Of one record: the angle with what is for fitting and what is not, the findings at their places
    and in words, the intervals of its clock, its noise against speed. Of several runs: a strip
    each.

    Parameters
    ----------
    records : Experiment
        What ``pendmap.read_experiment`` returned.
    path : str or path
        The file to write, ``.png``, ``.svg`` or ``.pdf``; an existing one is replaced.
    size : (float, float), optional
        Width and height in inches; by default as large as the parts need.
    dpi : float, optional
        Pixels per inch, 200 by default.

    Returns
    -------
    Path
        The file, complete.

    Raises
    ------
    InputError
        For an unknown suffix and an impossible size or resolution.
    OSError
        If the file cannot be written.
    """
    from pendmap.figures import experiment  # noqa: PLC0415 (what reads records takes a while)

    resolution = style.resolution(dpi)
    style.check_size(size, resolution)
    with whole_file(path, SUFFIXES) as part, mpl.rc_context(style.RC):
        style.write(experiment.figure(records, size=size, dpi=resolution), part)
    return Path(path)


def draw_comparison(comparison: Comparison, path: str | os.PathLike[str]) -> Path:
    """Draw a model beside the records that it is compared with into a file.

    For each run: record and model, the residual with the noise, errors of periods and peaks.

    Parameters
    ----------
    comparison : Comparison
        What ``pendmap.identification.compare`` returned.
    path : str or path
        As of :func:`draw`.

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
    from pendmap.figures import comparison as sheet  # noqa: PLC0415 (scipy takes a while)

    with whole_file(path, SUFFIXES) as part, mpl.rc_context(style.RC):
        style.write(sheet.figure(comparison, dpi=style.resolution(None)), part)
    return Path(path)


def draw_discrepancy(found: Discrepancy, path: str | os.PathLike[str]) -> Path:
    """Draw a diagnosis into a file.

    The residuals of the runs that the baseline misses most, before and after, over the noise; the
    residual by run, and the error of forecasts against their horizon; the torque that each model
    lacks over angle and velocity, with 95 % intervals; the scores of the candidates; the first
    effect's size run by run.

    Parameters
    ----------
    found : Discrepancy
        What ``pendmap.discrepancy.diagnose`` returned.
    path : str or path
        As of :func:`draw`.

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
    from pendmap.figures import discrepancy  # noqa: PLC0415 (scipy takes a while)

    with whole_file(path, SUFFIXES) as part, mpl.rc_context(style.RC):
        style.write(discrepancy.figure(found, dpi=style.resolution(None)), part)
    return Path(path)


def write_report(found: Discrepancy, path: str | os.PathLike[str]) -> Path:
    """Write the report of a diagnosis with its figures.

    Parameters
    ----------
    found : Discrepancy
        What ``pendmap.discrepancy.diagnose`` returned.
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
    from pendmap.figures import report  # noqa: PLC0415 (scipy takes a while)

    target = Path(path)
    if target.suffix.lower() not in {"", *report.SUFFIXES} and not target.is_dir():
        allowed = ", ".join(report.SUFFIXES)
        raise InputError(
            f"cannot write {str(target)!r}: suffix {target.suffix!r}, allowed are {allowed}, or a "
            "folder"
        )
    return report.write(found, target)


def draw_runs(
    runs: Sequence[RunPanel], path: str | os.PathLike[str], *, title: str, subtitle: str
) -> Path:
    """Draw the records of an experiment into a file: a panel a run, measured angle against time.

    Parameters
    ----------
    runs : sequence of RunPanel
        One or more.
    path : str or path
        As of :func:`draw`.
    title, subtitle : str
        What stands above all panels.

    Returns
    -------
    Path
        The file, complete.

    Raises
    ------
    InputError
        For an unknown suffix, or without any run.
    OSError
        If the file cannot be written.
    """
    if not runs:
        raise InputError("runs is []: allowed is one record or more")
    with whole_file(path, SUFFIXES) as part, mpl.rc_context(style.RC):
        made = runs_figure.figure(runs, title=title, subtitle=subtitle, dpi=style.resolution(None))
        style.write(made, part)
    return Path(path)


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
    """Draw what was identified into a file: figures 4 to 7 of the paper and its table 1.

    Parameters
    ----------
    report : IdentificationReport
        What ``pendmap.identification.identify_experiment`` returned.
    path : str or path
        The file to write, ``.png``, ``.svg`` or ``.pdf``; an existing one is replaced.
    size : (float, float), optional
        Width and height in inches; by default as large as the parts need.
    dpi : float, optional
        Pixels per inch, 200 by default.
    parts : sequence of str, optional
        Which parts, by default all: ``record`` (figure 4: angle, velocity, its sign, odd and even
        half cycles), ``decrement`` (5: of each three peaks, with the zero error and without),
        ``decay`` (6: every model beside the record), ``errors`` (7: of periods and peaks) and
        ``table`` (table 1).
    title, subtitle : str, optional
        What stands above; by default the record's name, and what was measured.

    Returns
    -------
    Path
        The file, complete.

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
    from pendmap.figures import identification  # noqa: PLC0415 (likewise)

    resolution = style.resolution(dpi)
    style.check_size(size, resolution)
    with whole_file(path, SUFFIXES) as part, mpl.rc_context(style.RC):
        made = identification.figure(
            report, parts=parts, size=size, dpi=resolution, title=title, subtitle=subtitle
        )
        style.write(made, part)
    return Path(path)


def draw_pendulum(
    path: str | os.PathLike[str],
    *,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
    title: str | None = None,
) -> Path:
    """Draw the pendulum with its moving pivot and its equation (eq. 2.1) into a file: figure 3.

    Parameters, result and errors are those of :func:`draw_record`; ``title`` stands above, by
    default what is drawn.
    """
    from pendmap.figures import pendulum  # noqa: PLC0415 (likewise)

    resolution = style.resolution(dpi)
    style.check_size(size, resolution)
    with whole_file(path, SUFFIXES) as part, mpl.rc_context(style.RC):
        style.write(pendulum.figure(size=size, dpi=resolution, title=title), part)
    return Path(path)


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

    resolution = style.resolution(dpi)
    style.check_size(size, resolution)
    with whole_file(path, SUFFIXES) as part, mpl.rc_context(style.RC):
        style.write(tumbling.figure(runs, size=size, dpi=resolution, title=title), part)
    return Path(path)


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

    resolution = style.resolution(dpi)
    draw = motions.steady_figure if steady else motions.tumbling_figure
    with whole_file(path, SUFFIXES) as part, mpl.rc_context(style.RC):
        style.write(draw(runs, dpi=resolution, title=title, subtitle=subtitle), part)
    return Path(path)
