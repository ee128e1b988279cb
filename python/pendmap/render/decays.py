"""The decay of each model beside the measured one (figure 6)."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pendmap.analysis.trajectory import simulate
from pendmap.charts import names
from pendmap.charts.methods import MEASURED, NOISE, drawn, look
from pendmap.identification.methods.registry import BEST
from pendmap.identification.table1 import first_state, simulated_peaks
from pendmap.render import blocks, sides
from pendmap.render.half_cycles import course_of, first_and_last
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from pendmap.identification import IdentificationReport, Peaks
    from pendmap.model import Rig
    from pendmap.records import Run
    from pendmap.render.blocks import Box
    from pendmap.render.half_cycles import Course

    Floats = NDArray[np.float64]

PEAK: Final = "peak |\N{GREEK SMALL LETTER THETA}| (rad)"
NEAR: Final = 5
"""Half cycles of the near views."""
Z95: Final = 1.959963984540054
SAMPLES: Final = 64
"""Samples of a simulation in a swing."""
MOST: Final = 6_000
"""Residuals that are drawn."""
DOTS: Final = 150
"""Readings of a near view that are drawn."""

NOTHING: Final = "No method can be applied, or there are fewer than three peaks."

_SI: Final = Units(si=True)


@dataclasses.dataclass(frozen=True)
class Decay:
    """A model simulated from the first peak of a record, as the sensor would show it: s, rad."""

    peak_time: Floats
    peak: Floats
    time: Floats
    theta: Floats


def _simulated(rig: Rig, peaks: Peaks, zero: float) -> Decay:
    turned, start = peaks.turned, first_state(peaks)
    begun = dataclasses.replace(start, theta=start.theta - zero)
    last = float(turned.time[-1])
    peak_time, peak = simulated_peaks(rig, begun, last)
    run = simulate(rig, begun.theta, 0.0, max(last - start.time, 1e-3) * 1.01, samples=SAMPLES)
    return Decay(
        peak_time, peak + zero, run["time"].values + start.time, run["theta"].values + zero
    )


def _able(report: IdentificationReport) -> list[str]:
    """Return the methods whose models are drawn; none where there is too little to compare."""
    if report.table.left_out or len(report.peaks.turned) < 3:  # noqa: PLR2004 (one full cycle)
        return []
    return drawn(
        name
        for name, found in report.methods.items()
        if found.applicable and "w0" in found.estimates and name not in report.table.lost
    )


def _decays(report: IdentificationReport) -> dict[str, Decay]:
    made = {}
    for name in _able(report):
        found = report.methods[name]
        rig = report.joint.fit.model if name == BEST and report.joint is not None else found.rig
        zero = found["offset"] if "offset" in found.estimates else 0.0
        made[name] = _simulated(rig, report.peaks, zero)
    return made


def handles_of(methods: list[str]) -> tuple[list[Artist], list[str]]:
    """Return the lines of methods for a legend, and what they are called."""
    looks = [look(name) for name in methods]
    handles: list[Artist] = [Line2D([], [], color=one.colour, ls=one.dash, lw=1.6) for one in looks]
    return handles, [one.label for one in looks]


def _height(report: IdentificationReport) -> float:
    if not _able(report):
        return 0.9 if report.joint is None or not report.table.left_out else 2.6
    return 6.3 + (0.0 if report.joint is None else 1.3)


def _draw(
    figure: Figure, box: Box, report: IdentificationReport, letters: Iterator[str], title: str
) -> None:
    decays = _decays(report)
    if not decays:
        room = blocks.named(figure, box, title)
        left_out = report.table.left_out
        blocks.say(figure, room, blocks.sentence(left_out) if left_out else NOTHING)
        if left_out and report.joint is not None:
            _over_time(room.less(top=0.6).panel(figure), report, letters)
        return
    handles, texts = handles_of(list(decays))
    dot = Line2D([], [], color=MEASURED, ls="none", marker=".", ms=5)
    handles, texts = [dot, *handles], ["measured", *texts]
    if np.any(report.peaks.turned.stderr_amplitude > 0):
        handles, texts = [*handles, Patch(color=NOISE, lw=0)], [*texts, blocks.NOISE_SAID]
    room = blocks.named(figure, box, title, handles, texts)
    shares, gap = [1.7, 1.35, 1.5], blocks.BELOW + blocks.TITLE + 0.03
    gaps = [blocks.TITLE + 0.1, gap]
    if report.joint is not None:
        shares, gaps = [*shares, 0.75], [*gaps, gap]
    cells = room.rows(shares, gaps)
    turned = report.peaks.turned
    ends = (float(turned.time[0]), float(turned.time[-1]))
    first = cells[0].panel(figure)
    _envelope(first, report, decays)
    first.set_title(next(letters) + "peaks, simulated from the first one on")
    second = cells[1].panel(figure)
    _differences(second, turned, decays)
    second.set_title(next(letters) + "simulated less measured peak")
    for axes in (first, second):
        _from_to(axes, ends)
    first.set_xticklabels([])
    first.set_xlabel("")
    spans = first_and_last(turned, NEAR)
    said = ("the beginning", "the end") if len(spans) > 1 else ("the angle",)
    course = course_of(report.run, report.peaks)
    for cell, span, text in zip(cells[2].columns(len(spans), 0.85), spans, said, strict=True):
        near = cell.panel(figure)
        _near(near, course, decays, span, only=report.run.peaks_only)
        near.set_title(next(letters) + text)
    if report.joint is not None:
        _over_time(cells[3].panel(figure), report, letters)


def _from_to(axes: Axes, ends: tuple[float, float]) -> None:
    pad = 0.01 * (ends[1] - ends[0])
    axes.set_xlim(ends[0] - pad, ends[1] + pad)
    sides.scale(axes, "x", axes.get_xlim(), names.clock(_SI))


def _envelope(axes: Axes, report: IdentificationReport, decays: dict[str, Decay]) -> None:
    turned = report.peaks.turned
    size = np.abs(turned.amplitude)
    axes.plot(turned.time, size, "o", color=MEASURED, ms=2.4, mew=0, zorder=5)
    for name, made in decays.items():
        one = look(name)
        axes.plot(made.peak_time, np.abs(made.peak), color=one.colour, ls=one.dash, lw=1.3)
    axes.set_ylim(0, 1.06 * float(size.max()))
    sides.scale(axes, "y", axes.get_ylim(), PEAK)


def _differences(axes: Axes, turned: Peaks, decays: dict[str, Decay]) -> None:
    """Draw what each simulated peak is larger than the measured one of its number."""
    number = turned.index - turned.index[0]
    curves = []
    for name, made in decays.items():
        simulated = np.full(int(number[-1]) + 1, math.nan)
        count = min(simulated.size, made.peak.size)
        simulated[:count] = np.abs(made.peak[:count])
        away = 1e3 * (simulated[number] - np.abs(turned.amplitude))
        curves.append(away[1:])
        one = look(name)
        axes.plot(turned.time[1:], away[1:], color=one.colour, ls=one.dash, lw=1.2)
    error = 1e3 * Z95 * turned.stderr_amplitude
    axes.fill_between(turned.time, -error, error, color=NOISE, lw=0, zorder=0)
    least = 1e3 * float(np.median(turned.stderr_amplitude))
    sides.signed_log_axis(
        axes, curves, "difference (mrad)", least=least if 0 < least < math.inf else 1e-12
    )


def _near(
    axes: Axes,
    course: Course,
    decays: dict[str, Decay],
    span: tuple[float, float],
    *,
    only: bool,
) -> None:
    inside = (course.time >= span[0]) & (course.time <= span[1])
    every = 1 if only else max(1, int(inside.sum()) // DOTS)
    time, theta = course.time[inside][::every], course.theta[inside][::every]
    axes.plot(time, theta, ".", color=MEASURED, ms=8.0 if only else 3.0, mew=0, zorder=5)
    values = [theta]
    for name, made in decays.items():
        one = look(name)
        shown = (made.time >= span[0]) & (made.time <= span[1])
        axes.plot(made.time[shown], made.theta[shown], color=one.colour, ls=one.dash, lw=1.1)
        values.append(made.theta[shown])
    everything = np.concatenate(values)
    # A model that decays too slowly would make the measured swing a line.
    bound = 3.0 * float(np.abs(theta).max()) if theta.size else math.inf
    sides.angle_axis(axes, np.clip(everything, -bound, bound))
    axes.set_xlim(*span)
    sides.scale(axes, "x", span, names.clock(_SI))


def _over_time(axes: Axes, report: IdentificationReport, letters: Iterator[str]) -> None:
    _residuals(axes, report)
    axes.set_title(next(letters) + "the record less the trajectory fitted to it")
    _from_to(axes, (float(report.run.time[0]), float(report.run.time[-1])))


def _residuals(axes: Axes, report: IdentificationReport) -> None:
    """Draw the residuals of the whole record, with the noise that it has without any model."""
    if report.joint is None:
        return
    draw_residuals(
        axes, report.run, report.joint.fit.residuals[0], report.joint.readings[0].sigma, BEST
    )


def draw_residuals(
    axes: Axes, run: Run, residual: NDArray[np.float64], sigma: float, method: str
) -> None:
    """Draw the residuals of a model over a record, with the noise ``sigma`` as lines.

    Of a gyroscope they are drawn as the rates that they are.
    """
    gyroscope = run.gyroscope
    size, unit = (1e3, "mrad") if gyroscope is None else (1e3 * gyroscope.gain, "mrad/s")
    away = size * np.where(run.trusted, residual, np.nan)
    every = max(1, away.size // MOST)
    one = look(method)
    axes.plot(run.time[::every], away[::every], ".", color=one.colour, ms=1.2, rasterized=True)
    noise = size * sigma
    for side in (-noise, noise):
        axes.axhline(side, color=MEASURED, lw=0.8, ls="--")
    known = np.abs(away[np.isfinite(away)])
    top = max(1.4 * float(np.percentile(known, 99.5)), 1.6 * noise) if known.size else noise
    sides.middle_axis(axes, top, unit)


BLOCK: Final = blocks.Block("decay", "The decay by each model", _height, _draw)
