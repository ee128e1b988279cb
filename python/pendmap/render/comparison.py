"""The figure of a comparison: a model over records that it was not fitted to."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pendmap.charts import names
from pendmap.charts.methods import MEASURED, NOISE, look
from pendmap.comparison.forced import ForcedComparison
from pendmap.comparison.free import MODEL, RunComparison
from pendmap.formatting import counted
from pendmap.identification.readings import as_angles
from pendmap.render import blocks, forced, sides, style
from pendmap.render import sheet as sheets
from pendmap.render.decays import MOST, draw_residuals
from pendmap.render.errors import draw_panels
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pendmap.comparison import Comparison
    from pendmap.render.blocks import Box

    Compared = RunComparison | ForcedComparison

ALL: Final = 3
"""Runs up to which each has a row of its own."""
CHOSEN: Final = 2
"""Rows where there are more: those held out first, then those that the model misses most."""
WIDTH: Final = 11.6
ROW: Final = 2.35
ALONE: Final = 3.4
OVERVIEW: Final = 1.95
LEGEND: Final = 0.38
"""Inches: of the sheet, of a run's row, of the only one, of the panel of all runs, of the legend.
The whole is no higher than a screen is beside its width."""
GAP: Final = 0.72
"""Inches between the panels of a row."""
SPREAD: Final = 10.0
"""Greatest over least ratio from which on the panel of all runs has powers of ten."""
HELD: Final = "#d55e00"
_SI: Final = Units(si=True)


def figure(comparison: Comparison, *, dpi: float = 200.0) -> Figure:
    """Return the figure: a row a run, with record and model, the residual, figure 7.

    Where there are more than :data:`ALL` runs, all of them stand in one panel, and
    :data:`CHOSEN` have rows.
    """
    every = comparison.every
    many = len(every) > ALL
    ranked = sorted(every, key=lambda one: (not one.run.hold_out, -ratio(one)))
    rows = ranked[:CHOSEN] if many else every
    high = ALONE if len(rows) == 1 else ROW
    top = high * len(rows) + (OVERVIEW if many else 0.0)
    size = (WIDTH, top + LEGEND + 0.7)
    kinds = ((len(comparison.runs), "free decay"), (len(comparison.forced), "forced run"))
    said = ", ".join(counted(count, kind) for count, kind in kinds if count)
    if many:
        said += f"; below, {len(rows)} of them: held out first, then those missed most"
    made = sheets.headed(size, dpi, "Model against record", said)
    _legend(made, rows, top + LEGEND)
    letters = iter(f"({letter}) " for letter in "abcdefghijklmnopqrstuvwxyz")
    if many:
        top -= OVERVIEW
        _overview(made, blocks.Box(0.0, top, WIDTH, OVERVIEW), every, letters)
    for one in rows:
        top -= high
        _row(made, blocks.Box(0.0, top, WIDTH, high), one, letters)
    return made


def ratio(one: Compared) -> float:
    """Return the rms of what a model misses, over the record's noise."""
    return one.rms / one.sigma if one.sigma > 0 else math.inf


def _legend(figure: Figure, rows: Sequence[Compared], top: float) -> None:
    style_of = look(MODEL)
    driven = any(isinstance(one, ForcedComparison) for one in rows)
    handles: list[Artist] = [
        Line2D([], [], color=MEASURED, marker=".", ls="-" if driven else "", lw=0.7, ms=5),
        Line2D([], [], color=style_of.colour, lw=1.6),
        Line2D([], [], color=MEASURED, lw=0.8, ls="--"),
    ]
    texts = ["record", style_of.label, "standard deviation of its noise"]
    decays = [one for one in rows if isinstance(one, RunComparison)]
    if any(one.errors and np.any(one.peaks.turned.stderr_amplitude > 0) for one in decays):
        handles, texts = [*handles, Patch(color=NOISE, lw=0)], [*texts, blocks.NOISE_SAID]
    if driven:
        shades, named = forced.legend()
        handles, texts = [*handles, *shades], [*texts, *named]
    blocks.named(figure, blocks.Box(0.0, top - 1.0, WIDTH, 1.0), "", handles, texts)


def _overview(figure: Figure, box: Box, runs: Sequence[Compared], letters: Iterator[str]) -> None:
    """Draw how far the model is from each run, in units of its noise."""
    axes = blocks.named(figure, box, "").panel(figure)
    ratios = np.array([min(ratio(one), 1e12) for one in runs])
    held = np.array([one.run.hold_out for one in runs])
    axes.axhline(1.0, color=MEASURED, lw=0.8, ls="--")
    places = np.arange(len(runs))
    for which, colour in ((~held, look(MODEL).colour), (held, HELD)):
        axes.plot(places[which], ratios[which], "o", color=colour, ms=5, mew=0)
    low, high = min(float(ratios.min()), 1.0), max(float(ratios.max()), 1.0)
    if high > SPREAD * low:
        sides.log_axis(axes, "y", (low / 1.5, high * 1.5), "rms / noise")
    else:
        axes.set_ylim(0, 1.15 * high)
        sides.scale(axes, "y", (0, 1.15 * high), "rms / noise")
    axes.set_xlim(-0.5, len(runs) - 0.5)
    _names(axes, [one.run.name for one in runs])
    held_out = "; orange: held out" if held.any() else ""
    axes.set_title(next(letters) + f"all runs: the residual over the noise{held_out}")


def _names(axes: Axes, texts: Sequence[str]) -> None:
    """Name as many runs below a panel as there is room for."""
    room = axes.get_window_extent().width / axes.figure.dpi / len(texts)
    widest = max(style.inches(text, style.RC["xtick.labelsize"]) for text in texts) + 0.1
    every = max(1, math.ceil(widest / room))
    axes.set_xticks(range(0, len(texts), every), list(texts[::every]))


def _row(figure: Figure, box: Box, one: Compared, letters: Iterator[str]) -> None:
    run = one.run
    held = ", held out" if run.hold_out else ""
    heading = (
        f"{run.name}{held}: rms {_small(one.rms)}, {ratio(one):.3g} times the noise of "
        f"{_small(one.sigma)}"
    )
    if isinstance(one, ForcedComparison):
        heading += f", in {counted(one.windows, 'window')}"
    cells = blocks.named(figure, box, heading).columns(4, GAP)
    if isinstance(one, ForcedComparison):
        _forced(figure, cells, one, letters)
        return
    left, right = (cell.panel(figure) for cell in cells[:2])
    _over_record(left, one)
    left.set_title(next(letters) + "record and model")
    draw_residuals(right, run, one.residual, one.sigma, MODEL)
    right.set_title(next(letters) + "record less model")
    for axes in (left, right):
        ends = (float(run.time[0]), float(run.time[-1]))
        axes.set_xlim(*ends)
        sides.scale(axes, "x", ends, names.clock(_SI))
    if one.errors is None:
        few = "Fewer than three peaks:\nno errors of periods and peaks."
        why = one.table.left_out or next(iter(one.table.lost.values()), "")
        blocks.say(figure, cells[2], blocks.sentence(why, 40) if why else few)
        return
    titles = (next(letters) + "error of each period", next(letters) + "error of each peak")
    periods, peaks = (cell.panel(figure) for cell in cells[2:])
    draw_panels(periods, peaks, {MODEL: one.errors}, one.peaks, titles)


def _small(angle: float) -> str:
    """Return an angle in rad or mrad."""
    return f"{angle:.3g} rad" if angle >= 1 else f"{1e3 * angle:.3g} mrad"


def _forced(
    figure: Figure, cells: Sequence[Box], one: ForcedComparison, letters: Iterator[str]
) -> None:
    """Draw a forced run: the record, its phase plane, the model's, the statistics."""
    history, phase, other = (cell.panel(figure) for cell in cells[:3])
    forced.draw_history(history, one.time, one.measured, MEASURED)
    history.set_title(next(letters) + "record")
    fastest = max(float(np.abs(v).max()) for v in (one.velocity, one.example[1]))
    forced.draw_phase(phase, (one.measured, one.velocity), MEASURED, fastest)
    phase.set_title(next(letters) + "record")
    if one.steady is None or one.steady.measured.at_rest:
        forced.draw_phase(other, one.example, look(MODEL).colour, fastest)
        other.set_title(next(letters) + "a member of the ensemble")
    else:
        forced.draw_cycles(other, one)
        other.set_title(next(letters) + one.steady.measured.kind)
    last = cells[3].less(left=-0.45, bottom=-0.38).panel(figure)
    forced.draw_statistics(last, one)
    last.set_title(next(letters) + "record (95 % of the ensemble)")


def _over_record(axes: Axes, one: RunComparison) -> None:
    run = one.run
    every = max(1, run.time.size // MOST)
    sensor = run.accelerometer
    factor = 1.0 if sensor is None else sensor.gain
    readings = run.theta if sensor is None else factor * as_angles(run)
    shown = np.where(run.trusted, readings, np.nan)
    # The reading of the model: what the sensor makes of its angle stands in the residual alone.
    angle = readings - factor * one.residual
    if sensor is None and run.rod_sensor is not None:
        angle = one.curve[0]  # a gyroscope reads no angle
    made = np.where(run.trusted, angle, np.nan)
    axes.plot(run.time[::every], shown[::every], ".", color=MEASURED, ms=1.5, rasterized=True)
    axes.plot(run.time[::every], made[::every], color=look(MODEL).colour, lw=0.7)
    known = shown[np.isfinite(shown)]
    if sensor is None:
        sides.angle_axis(axes, known)
        return
    pad = 0.05 * float(np.ptp(known))
    ends = (float(known.min()) - pad, float(known.max()) + pad)
    axes.set_ylim(*ends)
    unit = sensor.unit.replace("s2", "s\u00b2")
    sides.scale(axes, "y", ends, f"acceleration ({unit})")
