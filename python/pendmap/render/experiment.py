"""The figure of an experiment: a strip of each run, or its one record in detail."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError
from pendmap.render import record, style
from pendmap.render import sheet as sheets

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pendmap.records import Experiment, Finding, Run

MOST_RUNS: Final = 12
"""Strips of one figure; the text of ``look`` has every run."""


def figure(
    experiment: Experiment, *, size: tuple[float, float] | None = None, dpi: float = 200.0
) -> Figure:
    """Return the figure of an experiment; see :func:`pendmap.render.draw_record`."""
    if len(experiment.runs) == 1:
        return record.figure(experiment.runs[0], size, dpi)
    return _many(experiment, size, dpi)


def _many(experiment: Experiment, size: tuple[float, float] | None, dpi: float) -> Figure:
    runs = experiment.runs[:MOST_RUNS]
    width = size[0] if size else 8.6
    strip, gap = 0.85, 0.36
    height = size[1] if size else sheets.TOP + sheets.BOTTOM + len(runs) * (strip + gap)
    across = width - sheets.LEFT - sheets.RIGHT
    strip = (height - sheets.TOP - sheets.BOTTOM) / len(runs) - gap
    if across < 3.0 or strip < 0.4:  # noqa: PLR2004 (inches)
        least = sheets.TOP + sheets.BOTTOM + len(runs) * (0.4 + gap)
        wide = sheets.LEFT + sheets.RIGHT + 3.0
        raise InputError(
            f"size {size} leaves no room for the panels; it must be at least"
            f" {wide:.1f} x {least:.1f} inches"
        )
    shown = f", the first {MOST_RUNS}" if len(experiment.runs) > MOST_RUNS else ""
    title = f"Experiment {experiment.path.resolve().name}"
    known = ", ".join(f"{name} = {value:g}" for name, value in experiment.known.items())
    sheet = sheets.headed(
        (width, height), dpi, title, f"{len(experiment.runs)} runs{shown};   {known}".rstrip("; ")
    )
    longest = max(float(run.time[-1] - run.time[0]) for run in runs)
    for k, run in enumerate(runs):
        bottom = height - sheets.TOP - (k + 1) * (strip + gap) + gap
        _strip(sheets.place(sheet, sheets.LEFT, bottom, across, strip), run, longest)
        if k + 1 < len(runs):
            sheet.axes[-1].set_xticklabels([])
            sheet.axes[-1].set_xlabel("")
    return sheet


def _strip(axes: Axes, run: Run, longest: float) -> None:
    """Draw one run from its own start, so that all share a scale of time."""
    time = run.time - run.time[0]
    breaks = record.broken(run)
    alone = record.lone(~run.trusted)
    axes.plot(
        *record.shown_line(time, run.theta, ~run.trusted & ~alone, breaks),
        color=record.UNUSED,
        lw=0.7,
    )
    axes.plot(*record.shown_line(time, run.theta, run.trusted, breaks), color=record.USED, lw=0.7)
    axes.plot(time[alone], run.theta[alone], "x", color=record.FALSE, ms=3.5, mew=0.9)
    low, high = float(run.theta.min()), float(run.theta.max())
    pad = max(0.08 * (high - low), 1e-6)
    axes.set_ylim(low - pad, high + pad)
    axes.set_xlim(-0.01 * longest, 1.01 * longest)
    style.scale(axes, "x", (0.0, longest), "t from the start (s)")
    style.scale(axes, "y", axes.get_ylim(), record.ANGLE, angle=high - low > 2)  # noqa: PLR2004
    said: list[str] = [run.kind]
    if run.drive is not None:
        said.append(
            f"p = {run.drive['p']:g}, \N{GREEK CAPITAL LETTER OMEGA} = {run.drive['Omega']:g} rad/s"
        )
    if run.hold_out:
        said.append("held out")
    odd = sum(not found.mended for found in run.findings)
    said.append(_odd(run.findings, odd))
    axes.set_title(f"{run.name}: " + ", ".join(filter(None, said)), fontsize=8.5, pad=3)


def _odd(findings: tuple[Finding, ...], odd: int) -> str:
    keys = [found.what for found in findings][:3]
    more = ", ..." if len(findings) > len(keys) else ""
    return ", ".join(keys) + more if odd or keys else ""
