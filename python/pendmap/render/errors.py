"""The error of each simulated period and peak, for every model (figure 7)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.patches import Patch

from pendmap.charts import names
from pendmap.charts.methods import NOISE, drawn, look
from pendmap.render import blocks, sides
from pendmap.render.decays import NOTHING, Z95, handles_of
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pendmap.identification import IdentificationReport, PeakErrors, Peaks
    from pendmap.render.blocks import Box

PEAK: Final = "measured peak |\N{GREEK SMALL LETTER THETA}| (rad)"
_SI: Final = Units(si=True)


def _height(report: IdentificationReport) -> float:
    return 3.6 if report.table.errors else 0.9


def _draw(
    figure: Figure, box: Box, report: IdentificationReport, letters: Iterator[str], title: str
) -> None:
    if report.table.left_out:
        blocks.say(figure, blocks.named(figure, box, title), blocks.sentence(report.table.left_out))
        return
    errors = {name: report.table.errors[name] for name in drawn(report.table.errors)}
    draw_errors(figure, box, errors, report.peaks, letters, title)


def draw_errors(  # noqa: PLR0913, PLR0917 (where, what, and how it is named)
    figure: Figure,
    box: Box,
    errors: Mapping[str, PeakErrors],
    peaks: Peaks,
    letters: Iterator[str],
    title: str,
) -> None:
    """Draw :func:`draw_panels` with a heading and names."""
    if not errors:
        room = blocks.named(figure, box, title)
        blocks.say(figure, room, NOTHING)
        return
    handles, texts = handles_of(list(errors))
    if np.any(peaks.turned.stderr_amplitude > 0):
        handles, texts = [*handles, Patch(color=NOISE, lw=0)], [*texts, blocks.NOISE_SAID]
    room = blocks.named(figure, box, title, handles, texts)
    left, right = (cell.panel(figure) for cell in room.columns(2, 0.85))
    titles = (
        next(letters) + "of each period",
        next(letters) + "of each peak; time runs to the left",
    )
    draw_panels(left, right, errors, peaks, titles)


def draw_panels(
    left: Axes,
    right: Axes,
    errors: Mapping[str, PeakErrors],
    peaks: Peaks,
    titles: tuple[str, str],
) -> None:
    """Draw the errors of periods and peaks by model, with what the noise of the peaks explains."""
    for name, each in errors.items():
        one = look(name)
        for axes, x, y in (
            (left, each.period_time, each.period_error),
            (right, each.peak[1:], each.peak_error[1:]),
        ):
            axes.plot(x, y, color=one.colour, ls=one.dash, lw=1.1)
    some = next(iter(errors.values()))
    _noise(left, right, peaks.turned, some)
    sides.signed_log_axis(left, [e.period_error for e in errors.values()], "error (%)")
    sides.signed_log_axis(right, [e.peak_error[1:] for e in errors.values()], "error (%)")
    left.set_title(titles[0])
    right.set_title(titles[1])
    if some.period_time.size:
        ends = (float(some.period_time[0]), float(some.period_time[-1]))
        pad = 0.02 * (ends[1] - ends[0]) or 0.5
        left.set_xlim(ends[0] - pad, ends[1] + pad)
        sides.scale(left, "x", left.get_xlim(), names.clock(_SI))
    sizes = some.peak[1:]
    ends = (max(float(np.min(sizes)), 1e-9) / 1.15, float(np.max(sizes)) * 1.15)
    sides.log_axis(right, "x", ends, PEAK)


def _noise(left: Axes, right: Axes, turned: Peaks, some: PeakErrors) -> None:
    """Shade what the standard errors of the measured peaks make of both errors, percent."""
    at = np.searchsorted(turned.time, some.period_time)
    variance = turned.stderr_time**2
    error = Z95 * 100 * np.sqrt(variance[at] + variance[at + 2]) / some.period
    left.fill_between(some.period_time, -error, error, color=NOISE, lw=0, zorder=0)
    order = np.argsort(some.peak)
    error = Z95 * 100 * (turned.stderr_amplitude / some.peak)[order]
    right.fill_between(some.peak[order], -error, error, color=NOISE, lw=0, zorder=0)


BLOCK: Final = blocks.Block(
    "errors", "What simulated periods and peaks miss of the measured ones", _height, _draw
)
