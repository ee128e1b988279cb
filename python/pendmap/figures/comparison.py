"""The figure of a comparison: a model over records that it was not fitted to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.lines import Line2D

from pendmap.figures import blocks, sides, style
from pendmap.figures import sheet as sheets
from pendmap.figures.decays import MOST, draw_residuals
from pendmap.figures.errors import draw_errors
from pendmap.identification.compare import MODEL
from pendmap.model.units import Units
from pendmap.pictures import names
from pendmap.pictures.methods import MEASURED, look

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

    from pendmap.figures.blocks import Box
    from pendmap.identification import Comparison, RunComparison

__all__ = ["MOST_RUNS", "figure"]

MOST_RUNS: Final = 6
"""Runs that are drawn: those held out first."""
WIDTH: Final = 8.6
"""Inches."""
HIGH: Final = (2.9, 3.6)
"""Inches of the record with its residual, and of the errors."""
_SI: Final = Units(si=True)


def figure(comparison: Comparison, *, dpi: float = 200.0) -> Figure:
    """Return the figure: each run with the model over it, the residual, figure 7."""
    runs = sorted(comparison.runs, key=lambda one: not one.run.hold_out)[:MOST_RUNS]
    high = sum(HIGH) * len(runs)
    size = (WIDTH, high + sheets.TOP - 0.2)
    said = f"{len(comparison.runs)} free decays" if len(comparison.runs) > 1 else runs[0].run.name
    if len(comparison.runs) > len(runs):
        said += f", {len(runs)} of them drawn"
    made = sheets.headed(size, dpi, "Model against record", said, left=0.1)
    letters = iter(f"({letter}) " for letter in "abcdefghijklmnopqrstuvwxyz")
    top = high
    for one in runs:
        top -= HIGH[0]
        _over_record(made, blocks.Box(0.0, top, WIDTH, HIGH[0]), one, letters)
        top -= HIGH[1]
        errors = {} if one.errors is None else {MODEL: one.errors}
        box = blocks.Box(0.0, top, WIDTH, HIGH[1])
        draw_errors(made, box, errors, one.peaks, letters, "Simulated periods and peaks")
    return made


def _over_record(figure: Figure, box: Box, one: RunComparison, letters: Iterator[str]) -> None:
    held = ", held out" if one.run.hold_out else ""
    heading = f"{one.run.name}{held}: rms {one.rms:.3g} rad, noise {one.sigma:.2g} rad"
    style_of = look(MODEL)
    handles = [
        Line2D([], [], color=MEASURED, marker=".", ls="", ms=5),
        Line2D([], [], color=style_of.colour, lw=1.2),
        Line2D([], [], color=MEASURED, lw=0.8, ls="--"),
    ]
    room = blocks.named(figure, box, heading, handles, ["record", style_of.label, "its noise"])
    left, right = (cell.panel(figure) for cell in room.columns(2, 0.85))
    run = one.run
    every = max(1, run.time.size // MOST)
    shown = np.where(run.trusted, run.theta, np.nan)
    # The reading of the model: what the sensor makes of its angle stands in the residual alone.
    made = np.where(run.trusted, run.theta - one.residual, np.nan)
    left.plot(run.time[::every], shown[::every], ".", color=MEASURED, ms=1.5, rasterized=True)
    left.plot(run.time[::every], made[::every], color=style_of.colour, lw=0.7)
    sides.angle_axis(left, shown[np.isfinite(shown)])
    left.set_title(next(letters) + "the record, and the model over it")
    draw_residuals(right, run, one.residual, one.sigma, MODEL)
    right.set_title(next(letters) + "record less model")
    for axes in (left, right):
        ends = (float(run.time[0]), float(run.time[-1]))
        axes.set_xlim(*ends)
        style.scale(axes, "x", ends, names.clock(_SI))
