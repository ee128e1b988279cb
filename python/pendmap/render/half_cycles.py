"""The record of a decay with its half cycles: angle, velocity and its sign (figure 4)."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D

from pendmap.charts import names
from pendmap.charts.methods import EVEN, MEASURED, ODD
from pendmap.charts.record import UNUSED
from pendmap.render import blocks, sides, style
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from pendmap.identification import IdentificationReport, Peaks
    from pendmap.records import Run
    from pendmap.render.blocks import Box

    Floats = NDArray[np.float64]

NEAR: Final = 6
"""Half cycles that a near view holds."""
POINTS: Final = 500
"""Places of a near view at which the velocity is computed."""
SPAN: Final = 0.2
"""Half width of the stretch a cubic is fitted to, over the length of a half cycle."""

_SI: Final = Units(si=True)


@dataclasses.dataclass(frozen=True)
class Course:
    """A record as its peaks count it: the turns that it rests away from its start taken off.

    Samples for fitting (s, rad), the number of the half cycle of each, -1 outside; all others.
    """

    time: Floats
    theta: Floats
    half: NDArray[np.int64]
    other_time: Floats
    other_theta: Floats


def course_of(run: Run, peaks: Peaks) -> Course:
    """Return a run's samples with the numbers of their half cycles."""
    good = run.trusted
    time, theta = run.time[good], run.theta[good]
    away = 0.0
    half = np.full(time.size, -1, np.int64)
    if len(peaks):
        at = np.interp(peaks.time, time, theta) - peaks.amplitude
        away = math.tau * round(float(np.median(at)) / math.tau)
        place = np.searchsorted(peaks.time, time, side="right") - 1
        inside = (place >= 0) & (place < len(peaks) - 1)
        place = np.clip(place, 0, max(len(peaks) - 2, 0))
        if len(peaks) > 1:
            whole = np.diff(peaks.index)[place] == 1
            half = np.where(inside & whole, peaks.index[place], -1)
    return Course(time, theta - away, half, run.time[~good], run.theta[~good] - away)


def first_and_last(peaks: Peaks, count: int = NEAR) -> list[tuple[float, float]]:
    """Return the spans of the first and the last half cycles; one span where these are all."""
    time = peaks.time
    if time.size <= 2 * count + 1:
        return [(float(time[0]), float(time[-1]))]
    return [
        (float(time[0]), float(time[count])),
        (float(time[-1 - count]), float(time[-1])),
    ]


def _height(report: IdentificationReport) -> float:
    return 2.4 if len(report.peaks) < 3 else 4.6 if report.run.peaks_only else 5.6  # noqa: PLR2004


def _draw(
    figure: Figure, box: Box, report: IdentificationReport, letters: Iterator[str], title: str
) -> None:
    run, peaks = report.run, report.peaks
    odd, even = (Line2D([], [], color=colour, lw=2.0) for colour in (ODD, EVEN))
    turn = Line2D([], [], color=MEASURED, ls="none", marker="o", mfc="white", ms=4.5)
    zero = Line2D([], [], color=MEASURED, ls="none", marker="|", ms=7, mew=1.2)
    handles, texts = [even, odd, turn], ["even half cycles", "odd half cycles", "peaks"]
    if peaks.crossing_time.size:
        handles, texts = [*handles, zero], [*texts, "crossings of zero"]
    room = blocks.named(figure, box, title, handles, texts)
    course = course_of(run, peaks)
    if len(peaks) < 3:  # noqa: PLR2004 (a half cycle on either side)
        _whole(room.panel(figure), course, peaks, next(letters), thin=True)
        return
    rows = [1.0, 1.1] if run.peaks_only else [1.0, 1.9]
    top, low = room.rows(rows, [blocks.BELOW + blocks.TITLE + 0.05])
    _whole(top.panel(figure), course, peaks, next(letters), thin=not run.peaks_only)
    spans = first_and_last(peaks)
    words = (
        ("the first half cycles", "the last half cycles") if len(spans) > 1 else ("all of them",)
    )
    for cell, span, said in zip(low.columns(len(spans), 0.85), spans, words, strict=True):
        _near(figure, cell, report, course, span, next(letters) + said)


def _near(  # noqa: PLR0913, PLR0917 (where, what of which)
    figure: Figure,
    box: Box,
    report: IdentificationReport,
    course: Course,
    span: tuple[float, float],
    title: str,
) -> None:
    """Draw angle, velocity and its sign over a span, above one another."""
    run, peaks = report.run, report.peaks
    pad = 0.02 * (span[1] - span[0])
    ends = (span[0] - pad, span[1] + pad)
    shares = [1.0, 0.35] if run.peaks_only else [1.0, 0.8, 0.28]
    cells = box.rows(shares, [0.1] * (len(shares) - 1))
    panels = [cell.panel(figure) for cell in cells]
    _angle(panels[0], course, peaks, ends, only=run.peaks_only)
    panels[0].set_title(title)
    if not run.peaks_only:
        _velocity(panels[1], run, course, peaks, ends)
    _sign(panels[-1], peaks)
    for axes in panels:
        axes.set_xlim(*ends)
        sides.scale(axes, "x", ends, names.clock(_SI))
        if axes is not panels[-1]:
            axes.set_xticklabels([])
            axes.set_xlabel("")


def _whole(axes: Axes, course: Course, peaks: Peaks, title: str, *, thin: bool) -> None:
    axes.plot(course.other_time, course.other_theta, ".", color=UNUSED, ms=0.8, rasterized=True)
    if thin:
        _coloured(axes, course.time, course.theta, course.half, 0.6)
    _peaks(axes, peaks, 1.6 if thin else 3.0, by_parity=not thin)
    every = np.concatenate([course.theta, course.other_theta])
    sides.angle_axis(axes, every)
    _time(axes, np.concatenate([course.time, course.other_time]))
    more = "; grey: not for fitting" if course.other_time.size else ""
    axes.set_title(f"{title}the whole record, {len(peaks)} peaks{more}")


def _time(axes: Axes, time: Floats) -> None:
    pad = 0.01 * (time.max() - time.min())
    axes.set_xlim(time.min() - pad, time.max() + pad)
    sides.scale(axes, "x", axes.get_xlim(), names.clock(_SI))


def _coloured(axes: Axes, time: Floats, values: Floats, half: NDArray[np.int64], lw: float) -> None:
    """Draw a curve, each half cycle in the colour of its parity, the rest grey."""
    for which, colour in (
        (half < 0, UNUSED),
        ((half >= 0) & (half % 2 == 0), EVEN),
        ((half >= 0) & (half % 2 == 1), ODD),
    ):
        # One sample more at the end, so that the pieces meet.
        shown = which | np.concatenate([[False], which[:-1]])
        axes.plot(time, np.where(shown, values, np.nan), color=colour, lw=lw)


def _peaks(axes: Axes, peaks: Peaks, size: float, *, by_parity: bool = False) -> None:
    for odd, colour in ((False, EVEN), (True, ODD)):
        which = peaks.odd == odd
        axes.plot(
            peaks.time[which],
            peaks.amplitude[which],
            "o",
            mfc="white",
            mec=colour if by_parity else MEASURED,
            ms=size,
            mew=0.4 + 0.11 * size,
            zorder=4,
        )


def _angle(
    axes: Axes, course: Course, peaks: Peaks, ends: tuple[float, float], *, only: bool
) -> None:
    near = (course.time >= ends[0]) & (course.time <= ends[1])
    if not only:
        _coloured(axes, course.time[near], course.theta[near], course.half[near], 1.1)
    seen = (peaks.time >= ends[0]) & (peaks.time <= ends[1])
    some = peaks.select(seen)
    known = np.isfinite(some.stderr_amplitude)
    axes.errorbar(
        some.time[known],
        some.amplitude[known],
        1.96 * some.stderr_amplitude[known],
        fmt="none",
        ecolor=MEASURED,
        elinewidth=0.8,
        capsize=2.0,
        zorder=3,
    )
    _peaks(axes, some, 4.5, by_parity=only)
    axes.axhline(0.0, color=style.QUIET, lw=0.6, zorder=0)
    cross = (peaks.crossing_time >= ends[0]) & (peaks.crossing_time <= ends[1])
    axes.plot(
        peaks.crossing_time[cross], np.zeros(int(cross.sum())), "|", color=MEASURED, ms=8, mew=1.2
    )
    sides.angle_axis(axes, np.concatenate([course.theta[near], some.amplitude]))


def _velocity(
    axes: Axes, run: Run, course: Course, peaks: Peaks, ends: tuple[float, float]
) -> None:
    """Draw the velocity that was measured, or else the slopes of cubics through the samples."""
    near = (course.time >= ends[0]) & (course.time <= ends[1])
    time, half = course.time[near], course.half[near]
    if run.velocity is not None:
        speed = run.velocity[run.trusted][near]
    else:
        every = max(1, time.size // POINTS)
        time, half = time[::every], half[::every]
        within = (peaks.time >= ends[0]) & (peaks.time <= ends[1])
        steps = np.diff(peaks.time[within])
        speed = _slopes(course, time, SPAN * float(np.median(steps)))
    _coloured(axes, time, speed, half, 1.1)
    axes.axhline(0.0, color=style.QUIET, lw=0.6, zorder=0)
    sides.angle_axis(axes, speed, names.speed(_SI))


def _slopes(course: Course, at: Floats, reach: float) -> Floats:
    """Return the slope in the middle of a cubic through the samples within a reach, rad/s."""
    result = np.full(at.size, math.nan)
    low = np.searchsorted(course.time, at - reach)
    high = np.searchsorted(course.time, at + reach, side="right")
    for k, (a, b) in enumerate(zip(low, high, strict=True)):
        if b - a >= 5:  # noqa: PLR2004 (one more than a cubic has)
            scaled = (course.time[a:b] - at[k]) / reach
            powers = np.vander(scaled, 4, increasing=True)
            result[k] = np.linalg.lstsq(powers, course.theta[a:b], rcond=None)[0][1] / reach
    return result


def _sign(axes: Axes, peaks: Peaks) -> None:
    """Draw the sign of the velocity: that of the way from each peak to the next."""
    for parity, colour in ((0, EVEN), (1, ODD)):
        whole = np.flatnonzero((np.diff(peaks.index) == 1) & (peaks.index[:-1] % 2 == parity))
        sign = np.sign(peaks.amplitude[whole + 1] - peaks.amplitude[whole])
        begin, end, none = peaks.time[whole], peaks.time[whole + 1], np.zeros(whole.size)
        corners = [(begin, none), (end, none), (end, sign), (begin, sign)]
        # One collection: a record may have thousands of half cycles.
        boxes = np.array(corners).transpose(2, 0, 1)
        axes.add_collection(PolyCollection(list(boxes), facecolors=colour, lw=0, alpha=0.85))
    axes.axhline(0.0, color=style.QUIET, lw=0.6)
    axes.set_ylim(-1.35, 1.35)
    axes.yaxis.set_ticks([-1, 0, 1], ["\N{MINUS SIGN}1", "0", "1"])
    axes.set_ylabel("sign", labelpad=2)


BLOCK: Final = blocks.Block("record", "The record and its half cycles", _height, _draw)
