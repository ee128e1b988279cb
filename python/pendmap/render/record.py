"""The figure of one record: what is used of it, what was found, its clock and its noise."""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.ticker import NullFormatter
from matplotlib.transforms import ScaledTranslation

from pendmap.errors import InputError
from pendmap.formatting import moment
from pendmap.records.noise import noise_floor
from pendmap.records.summary import noise_said, noise_unit
from pendmap.render import sheet as sheets
from pendmap.render import style
from pendmap.signal.local_polynomial import local_fit
from pendmap.signal.robust import true_runs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Transform
    from numpy.typing import NDArray

    from pendmap.records import Run

USED: Final = "#1d3557"
UNUSED: Final = "#a9a9a9"
FALSE: Final = "#d55e00"
BAND: Final = "#ececec"

ANGLE: Final = "\N{GREEK SMALL LETTER THETA} (rad)"

MOST_POINTS: Final = 20_000
"""Residuals that are drawn; more only make a figure large."""

MOST_LINES: Final = 14
"""Lines of findings below the panels."""

FEW: Final = 400
"""Samples under which each is drawn as a dot."""

APART: Final = 0.22
"""Inches between numbers in one row."""

SHORT: Final = 2e-3
"""Share of the record under which a finding is a line, not a span."""


def figure(run: Run, size: tuple[float, float] | None, dpi: float) -> Figure:
    """Return the figure of one record."""
    width = size[0] if size else 8.6
    letters = max(int((width - 1.0) / 0.073), 20)
    noted = _listed(run, letters)
    below = 0.3 + 0.17 * len(noted) if noted else 0.0
    height = size[1] if size else 6.1 + below
    across = width - sheets.LEFT - sheets.RIGHT
    down = height - sheets.TOP - sheets.BOTTOM - below
    _refuse_small(size, across, down)
    sheet = sheets.headed((width, height), dpi, f"Record {run.name}", _subtitle(run))
    gap_x, gap_y, flags = 0.85, 0.85, 0.3
    top = 0.55 * (down - gap_y)
    low = down - gap_y - top
    base = sheets.BOTTOM + below
    first = sheets.place(sheet, sheets.LEFT, base + low + gap_y, across, top)
    marks = sheets.place(sheet, sheets.LEFT, base + low + gap_y + top, across, flags)
    _history(first, run)
    _flags(marks, run)
    half = (across - gap_x) / 2
    _intervals(sheets.place(sheet, sheets.LEFT, base, half, low), run)
    last = sheets.place(sheet, sheets.LEFT + half + gap_x, base, half, low)
    if run.peaks_only:
        _decay(last, run)
    else:
        _residuals(last, run)
    for k, line in enumerate(noted):
        at = (below - 0.08 - 0.17 * k) / height
        sheet.text(sheets.LEFT / width - 0.03, at, line, fontsize=8.5, va="top", color=style.INK)
    return sheet


def _refuse_small(size: tuple[float, float] | None, across: float, down: float) -> None:
    if across >= 3.0 and down >= 3.0:  # noqa: PLR2004 (inches)
        return
    width, height = size or (0.0, 0.0)
    least = f"{width + max(3.0 - across, 0):.1f} x {height + max(3.0 - down, 0):.1f}"
    raise InputError(
        f"size {size} leaves no room for the panels; it must be at least {least} inches"
    )


def _subtitle(run: Run) -> str:
    if run.peaks_only:
        return f"{run.time.size} turning points, {moment(run.time[0])} to {moment(run.time[-1])} s"
    said = noise_said(noise_floor(run), noise_unit(run)).split(",", maxsplit=1)[0]
    said = said.replace("+-", "\N{PLUS-MINUS SIGN}")
    used = f"{run.trusted.sum()} of {run.time.size} samples for fitting"
    return f"{run.kind}, {run.rate_hz:.5g} Hz, {used};   noise {said}"


def _listed(run: Run, letters: int) -> list[str]:
    """Return the findings in lines, numbered as in the figure."""
    lines: list[str] = []
    for number, found in enumerate(run.findings, 1):
        mended = "mended: " if found.mended else ""
        lines += textwrap.wrap(
            f"{number}  {mended}{found.text}", letters, subsequent_indent="    ", max_lines=2
        )
    if len(lines) > MOST_LINES:
        lines = [*lines[: MOST_LINES - 1], "...  pendmap look has the rest"]
    return lines


def _history(axes: Axes, run: Run) -> None:
    time, theta = run.time, run.theta
    dots = "o" if run.peaks_only or time.size < FEW else None
    line = "none" if run.peaks_only else "-"
    drawn = {"marker": dots, "ms": 2.2, "lw": 0.8, "ls": line}
    alone = lone(~run.trusted)
    breaks = broken(run)
    axes.plot(*shown_line(time, theta, ~run.trusted & ~alone, breaks), color=UNUSED, **drawn)  # type: ignore[arg-type]
    axes.plot(*shown_line(time, theta, run.trusted, breaks), color=USED, **drawn)  # type: ignore[arg-type]
    axes.plot(time[alone], theta[alone], "x", color=FALSE, ms=4.5, mew=1.0)
    for segment in run.segments:
        if not segment.used:
            axes.axvspan(segment.from_s, segment.to_s, color=BAND, lw=0, zorder=0)
    _limits(axes, run)
    style.scale(axes, "x", axes.get_xlim(), "t (s)")
    style.scale(axes, "y", axes.get_ylim(), ANGLE, angle=float(np.ptp(axes.get_ylim())) > 2)  # noqa: PLR2004
    parts = [("for fitting", USED), ("not for fitting", UNUSED), ("outliers", FALSE)]
    shown = [True, bool((~run.trusted & ~alone).any()), bool(alone.any())]
    at = 1.0
    for (text, colour), there in reversed(list(zip(parts, shown, strict=True))):
        if there:
            size = style.inches(text) / (axes.get_window_extent().width / axes.figure.dpi)
            axes.text(
                at, -0.0, text, color=colour, transform=_under(axes), ha="right", va="top",
                fontsize=8.5,
            )  # fmt: skip
            at -= size + 0.025


def _under(axes: Axes) -> Transform:
    """Coordinates across the panel and, in inches, from a little under its tick labels."""
    return axes.transAxes + ScaledTranslation(0, -0.24, axes.figure.dpi_scale_trans)


def _limits(axes: Axes, run: Run) -> None:
    low, high = float(run.time[0]), float(run.time[-1])
    pad = 0.01 * (high - low)
    axes.set_xlim(low - pad, high + pad)
    bottom, top = float(run.theta.min()), float(run.theta.max())
    pad = max(0.06 * (top - bottom), 1e-6)
    axes.set_ylim(bottom - pad, top + pad)


def lone(marked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which of the marked samples stand in stretches of three at most: outliers."""
    few = np.zeros(marked.size, bool)
    for low, high in zip(*true_runs(marked), strict=True):
        few[low:high] = high - low <= 3  # noqa: PLR2004
    return few


def broken(run: Run) -> NDArray[np.bool_]:
    """Whether a line from the sample before would cross a gap."""
    steps = np.diff(run.time)
    return np.concatenate([[False], steps > 5 * np.median(steps)])


def shown_line(
    time: NDArray[np.float64],
    theta: NDArray[np.float64],
    which: NDArray[np.bool_],
    breaks: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a line that shows some samples and is broken where there are none."""
    shown = np.where(which, theta, np.nan)
    at = np.flatnonzero(breaks)
    return np.insert(time, at, time[at]), np.insert(shown, at, np.nan)


def _flags(axes: Axes, run: Run) -> None:
    """Number the findings that have a place, above the panel, in rows that do not meet."""
    low, high = float(run.time[0]), float(run.time[-1])
    pad = 0.01 * (high - low)
    axes.set_xlim(low - pad, high + pad)
    axes.set_ylim(0, 2)
    axes.axis("off")
    width = axes.get_window_extent().width / axes.figure.dpi
    taken: list[list[float]] = [[], []]
    for number, found in enumerate(run.findings, 1):
        if found.from_s is None or found.to_s is None:
            continue
        left, right = max(found.from_s, low), min(found.to_s, high)
        if right < low or left > high:
            continue
        inch = (left - low + pad) / (high - low + 2 * pad) * width
        row = next((r for r in (0, 1) if all(abs(inch - x) > APART for x in taken[r])), None)
        if row is None:
            continue
        taken[row].append(inch)
        colour = style.QUIET if found.mended else style.ALARM
        if right - left > SHORT * (high - low) and not found.where.startswith("row"):
            axes.plot([left, right], [row + 0.1] * 2, color=colour, lw=1.6, solid_capstyle="butt")
        else:
            axes.plot([left], [row + 0.12], "v", color=colour, ms=3.5, mew=0)
        axes.text(left, row + 0.28, str(number), color=colour, fontsize=8, ha="center", va="bottom")


def _intervals(axes: Axes, run: Run) -> None:
    """Draw how often each interval between samples occurs."""
    steps = 1e3 * np.diff(run.time)
    usual = float(np.median(steps))
    low, high = float(steps.min()), float(steps.max())
    wide = high > 20 * max(low, 1e-9 * usual)
    if wide:
        edges = np.geomspace(max(low, 1e-6 * usual) / 1.1, high * 1.1, 61)
        axes.set_xscale("log")
    else:
        pad = max(0.05 * (high - low), 0.02 * usual)
        edges = np.linspace(low - pad, high + pad, 61)
    axes.hist(steps, edges.tolist(), color=USED, log=True)
    axes.set_ylim(0.7, 1.5 * steps.size)
    _powers(axes, "y", (0.7, 1.5 * steps.size))
    axes.set_xlim(edges[0], edges[-1])
    ends = (float(edges[0]), float(edges[-1]))
    if wide:
        _powers(axes, "x", ends)
    else:
        style.scale(axes, "x", ends, "interval (ms)")
    axes.set_xlabel("interval (ms)")
    axes.set_ylabel("samples", labelpad=2)
    axes.set_title("(b) between turning points" if run.peaks_only else "(b) the clock")


def _powers(axes: Axes, which: str, ends: tuple[float, float]) -> None:
    """Give a logarithmic side a few powers of ten, those within its ends."""
    low, high = math.ceil(math.log10(ends[0])), math.floor(math.log10(ends[1]))
    every = max((high - low) // 5 + 1, 1)
    powers = range(low, high + 1, every)
    labels = [f"{10.0**k:g}" for k in powers]
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_ticks([10.0**k for k in powers], labels)
    axis.set_minor_formatter(NullFormatter())


def _decay(axes: Axes, run: Run) -> None:
    size = np.maximum(np.abs(run.theta), 1e-9)
    axes.plot(run.time, size, "o", color=USED, ms=2.5)
    axes.set_yscale("log")
    ends = (float(size.min()) / 1.5, float(size.max()) * 1.5)
    axes.set_ylim(*ends)
    ticks = style.log_ticks(*ends)
    axes.yaxis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.yaxis.set_minor_formatter(NullFormatter())
    style.scale(axes, "x", (float(run.time[0]), float(run.time[-1])), "t (s)")
    axes.set_ylabel("|\N{GREEK SMALL LETTER THETA}| (rad)", labelpad=2)
    axes.set_title("(c) the decay")


def _residuals(axes: Axes, run: Run) -> None:
    """Draw what samples are away from their neighbours, against speed, and the noise found."""
    noise = noise_floor(run)
    read = run.theta if run.gyroscope is None else run.read
    fit = local_fit(run.time, read)
    keep = run.trusted[fit.middle]
    speed, residual = np.abs(fit.slope[keep]), 1e3 * np.abs(fit.residual[keep])
    stride = max(speed.size // MOST_POINTS, 1)
    axes.set_title("(c) away from nine neighbours")
    if not speed.size or not math.isfinite(noise.sigma):
        axes.text(0.5, 0.5, "too few samples", transform=axes.transAxes, ha="center")
        axes.set_xticks([])
        axes.set_yticks([])
        return
    axes.plot(speed[::stride], residual[::stride], ".", color="#a9b8cc", ms=1.5, rasterized=True)
    for part in noise.by_speed:
        high = min(part.speed_to, float(speed.max()))
        level = 1e3 * part.sigma
        axes.plot([part.speed_from, high], [level, level], color=FALSE, lw=1.8)
    top = max(4.5e3 * noise.sigma, 1e3 * max((p.sigma for p in noise.by_speed), default=0.0) * 1.5)
    # What is read changes by speeds, a rate by accelerations.
    speeds = "|d\N{GREEK SMALL LETTER THETA}/dt| (rad/s)"
    if run.gyroscope is not None:
        two = "\N{SUPERSCRIPT TWO}"
        speeds = f"|d{two}\N{GREEK SMALL LETTER THETA}/dt{two}| (rad/s{two})"
    fastest = max((part.speed_to for part in noise.by_speed), default=float(speed.max()))
    axes.set_xlim(0, max(fastest * 1.03, 1e-9))
    axes.set_ylim(0, max(top, 1e-9))
    style.scale(axes, "x", axes.get_xlim(), speeds)
    style.scale(axes, "y", axes.get_ylim(), f"residual (m{noise_unit(run)})")
    axes.text(
        0.98, 0.96, "line: standard deviation", transform=axes.transAxes, ha="right", va="top",
        color=FALSE, fontsize=8.5,
    )  # fmt: skip
