"""Charts of a comparison: a model with records that it was not fitted to, free and forced."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts import names, plane
from pendmap.charts.chart import Axis, Chart, Panel, Sheet, bare, holding, nothing
from pendmap.charts.identification import error_panels, residuals
from pendmap.charts.marks import QUIET, Areas, Level, Line, Mark, Points, Text
from pendmap.charts.palette import MEASURED, look
from pendmap.comparison.experiment import written
from pendmap.comparison.forced import ForcedComparison
from pendmap.comparison.free import MODEL, RunComparison
from pendmap.formatting import counted
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.comparison import Comparison
    from pendmap.comparison.forced import Statistic

    Compared = RunComparison | ForcedComparison

ALL: Final = 3  # Number of runs up to which each has a row
CHOSEN: Final = 2
"""Number of rows for more runs: those held out first, then those with the largest residual."""
WIDTH: Final = 11.6
ROW: Final = 2.35
ALONE: Final = 3.4
OVERVIEW: Final = 1.95
"""Inches: width of the sheet; heights of a run's row, of a single one, of the panel of all runs.
The sheet fits the proportions of a screen."""
HELD: Final = "#d55e00"
NAMED: Final = 40  # Greatest number of runs named below a panel
DOTS: Final = 6_000  # Greatest number of readings of a decay drawn
SAMPLES: Final = 20_000  # Greatest number of samples of a curve drawn
ENSEMBLE: Final = "#9ecae1"  # Colour of an ensemble
EVERY: Final = 3  # Step between the drawn samples of a measured cycle
BINS: Final = 24  # Bins of a histogram of an ensemble
TALL: Final = 0.36  # Height of a histogram over that of its row
_SI: Final = Units(si=True)


def sheet(comparison: Comparison) -> Sheet:
    """Return a row for each run; of many runs one panel of all, and the rows of a few."""
    every = comparison.every
    many = len(every) > ALL
    ranked = sorted(every, key=lambda one: (not one.run.hold_out, -_ratio(one)))
    shown = ranked[:CHOSEN] if many else every
    kinds = ((len(comparison.runs), "free decay"), (len(comparison.forced), "forced run"))
    text = ", ".join(counted(count, kind) for count, kind in kinds if count)
    charts = [_row(one, ALONE if len(shown) == 1 else ROW) for one in shown]
    if many:
        text += f"; below, {len(shown)} of them: held out first, then those missed most"
        charts.insert(0, _overview(every))
    return Sheet("Model against record", text, [charts], legend=True)


def _ratio(one: Compared) -> float:
    """Return the root mean square residual of a model over the record's noise."""
    return one.rms / one.sigma if one.sigma > 0 else math.inf


def _overview(runs: Sequence[Compared]) -> Chart:
    """Return the residual of the model in each run, in units of its noise."""
    ratios = np.array([min(_ratio(one), 1e12) for one in runs])
    held = np.array([one.run.hold_out for one in runs])
    places = np.arange(len(runs), dtype=float)
    marks: list[Mark] = [Level(1.0, colour=MEASURED, width=0.8, dash="--")]
    for which, colour in ((~held, look(MODEL).colour), (held, HELD)):
        marks.append(Points(places[which], ratios[which], colour=colour, size=5.0))
    every = -(-len(runs) // NAMED)
    ticks = [(float(k), runs[k].run.name) for k in range(0, len(runs), every)]
    across = Axis("", (-0.5, len(runs) - 0.5), ticks=ticks)
    title = "all runs: the residual over the noise" + ("; orange: held out" if held.any() else "")
    panel = Panel("all", title, across, names.sizes("rms / noise", ratios, 1.0), marks)
    return Chart("", "", [[panel]], size=(WIDTH, OVERVIEW))


def _row(one: Compared, high: float) -> Chart:
    run = one.run
    heading = (
        f"{run.name}{', held out' if run.hold_out else ''}: rms {_small(one.rms)}, "
        f"{_ratio(one):.3g} times the noise of {_small(one.sigma)}"
    )
    if isinstance(one, ForcedComparison):
        panels, heading = _forced(one), f"{heading}, in {counted(one.windows, 'window')}"
    else:
        panels = _free(one)
    return Chart(heading, "", [panels], size=(WIDTH, high))


def _small(angle: float) -> str:
    """Return an angle as text, in rad or mrad."""
    return f"{angle:.3g} rad" if angle >= 1 else f"{1e3 * angle:.3g} mrad"


def _free(one: RunComparison) -> list[Panel]:
    """Return record and model, the residual, and errors of periods and peaks."""
    left = residuals(one.run, one.residual, one.sigma, MODEL, "record less model")
    panels = [_over_record(one), left]
    if one.errors is None:
        few = "fewer than three peaks: no errors of periods and peaks"
        why = one.table.left_out or next(iter(one.table.lost.values()), "") or few
        return [*panels, *nothing("", why, 40).panels]
    titles = ("error of each period", "error of each peak")
    return [*panels, *error_panels({MODEL: one.errors}, one.peaks, titles)]


def _over_record(one: RunComparison) -> Panel:
    run = one.run
    # A gyroscope reads no angle.
    angle = run.theta - one.residual if run.gyroscope is None else one.curve[0]
    shown, made = (np.where(run.trusted, values, np.nan) for values in (run.theta, angle))
    some = slice(None, None, max(1, run.time.size // DOTS))
    marks: list[Mark] = [
        Points(run.time[some], shown[some], colour=MEASURED, size=1.5, name="record"),
        Line(run.time[some], made[some], colour=look(MODEL).colour, width=0.7, name="model"),
    ]
    up = names.angle(holding(shown))
    return Panel("record", "record and model", names.seconds(run.time), up, marks)


def _forced(one: ForcedComparison) -> list[Panel]:
    """Return the panels of a forced run: record, phase planes, statistics."""
    if one.steady is None or one.steady.measured.at_rest:
        third = phase(one, member="a member of the ensemble")
    else:
        third = cycles(one, one.steady.measured.name)
    return [history(one), phase(one), third, statistics(one)]


def history(one: ForcedComparison, *, member: str = "") -> Panel:
    """Return the angle in turns against time, of the record or a member."""
    reading, colour = (one.example[0], look(MODEL).colour) if member else (one.measured, MEASURED)
    turns, every = reading / math.tau, max(1, one.time.size // SAMPLES)
    line: dict[str, Any] = {"colour": colour, "width": 0.6, "name": "model" if member else "record"}
    marks: list[Mark] = [Line(one.time[::every], turns[::every], **line)]
    up = Axis("θ/2π (turns)", holding(turns, margin=0.08))
    clock = Axis(names.TIME, (float(one.time[0]), float(one.time[-1])))
    return Panel("history", member or "record", clock, up, marks)


def phase(one: ForcedComparison, *, member: str = "") -> Panel:
    """Return the path of the record or of a member in the phase plane, with a common scale."""
    (theta, velocity), colour = (one.measured, one.velocity), MEASURED
    if member:
        (theta, velocity), colour = one.example, look(MODEL).colour
    reach = 1.08 * max(float(np.abs(v).max()) for v in (one.velocity, one.example[1]))
    curve = plane.broken_at_wrap(theta[:SAMPLES], velocity[:SAMPLES])
    sides = names.phase_plane((-math.pi, math.pi), (-reach, reach), _SI)
    return Panel("phase", member or "record", *sides, [Line(*curve.T, colour=colour, width=0.4)])


def cycles(one: ForcedComparison, title: str) -> Panel:
    """Return the steady state of a record as points, and that of the model as a line."""
    result, model = one.steady, look(MODEL)
    marks: list[Mark] = []
    reach, speeds = math.pi, np.zeros(1)
    if result is not None:
        every = [cycle for cycle in (result.measured, result.model) if cycle is not None]
        speeds = np.concatenate([cycle.velocity for cycle in every])
        if result.measured.w == 0:
            reach = 1.08 * max(float(np.abs(cycle.theta).max()) for cycle in every)
        at = plane.wrapped(result.measured.theta), result.measured.velocity
        circle: dict[str, Any] = {"fill": "none", "size": 4.0, "edge_width": 0.8, "name": "record"}
        marks = [Points(at[0][::EVERY], at[1][::EVERY], colour=MEASURED, **circle)]
        if result.model is not None:
            theta, velocity = result.model.theta, result.model.velocity
            theta = np.append(theta, theta[0] + math.tau * result.model.w)
            curve = plane.broken_at_wrap(theta, np.append(velocity, velocity[0]))
            marks.append(Line(*curve.T, colour=model.colour, width=1.2, name="model"))
    sides = names.phase_plane((-reach, reach), holding(speeds), _SI)
    return Panel(f"cycles {one.run.name}", title, *sides, marks)


def statistics(one: ForcedComparison) -> Panel:
    """Return one row per statistic: the ensemble's histogram, and the record's value as a line."""
    marks: list[Mark] = []
    for base, item in enumerate(one.statistics, 1):
        mine, low, high = (written(value, 3) for value in (item.measured, *item.ci95))
        unit = f" {item.unit}" if item.unit and math.isfinite(item.ci95[0]) else ""
        text = f"{item.name} {mine} ({low if low == high else f'{low} to {high}'}){unit}"
        marks.append(Text(0.0, base - TALL - 0.07, text, align=("left", "bottom"), size=7.5))
        marks += _histogram(item, base)
    panel = bare("statistics", *marks, high=len(one.statistics))
    return dataclasses.replace(panel, title="record (95 % of the ensemble)")


def _histogram(one: Statistic, base: float) -> list[Mark]:
    """Return a histogram; members not settled by the end are a hatched column at the right."""
    every = np.append(one.ensemble, one.measured)
    known = every[np.isfinite(every)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    whole = not one.unit and high - low < BINS
    edges = np.arange(low - 0.5, high + 1) if whole else np.linspace(low, high, BINS + 1)
    wide = (edges[-1] - edges[0]) * (1 + 1e-9) or 1.0  # the last value is in the last column
    place = np.where(np.isfinite(every), 0.9 * (every - edges[0]) / wide, 0.975)
    counts, ends = np.histogram(place[:-1], [*np.linspace(0.0, 0.9, edges.size), 0.95, 1.0])
    tall = base - TALL * counts / max(counts.max(), 1)
    columns = [
        np.array([(left, base), (right, base), (right, up), (left, up)])
        for left, right, up in zip(ends[:-1], ends[1:], tall, strict=True)
        if up < base
    ]
    marks: list[Mark] = [Areas(columns, colour=ENSEMBLE, name="ensemble")]
    if counts[-1]:
        look: dict[str, Any] = {"name": "not settled by the end"}
        marks.append(Areas(columns[-1:], colour=ENSEMBLE, **look))
        marks.append(Areas(columns[-1:], colour="#ffffff", hatch="////", **look))
    return [
        *marks,
        Line(np.array([0.0, 1.0]), np.full(2, base), colour=QUIET, width=0.6),
        Line(np.full(2, place[-1]), np.array([base, base - TALL]), colour=MEASURED, width=1.6),
    ]


# Figures 8 and 9 of the paper.


def steady(runs: Sequence[ForcedComparison], title: str, subtitle: str) -> Chart:
    """Return a phase plane for each run: the record as points, the model as a line."""
    panels = [cycles(one, f"{_drive(one)}: {_reached(one)}") for one in runs]
    rows = [panels[k : k + 2] for k in range(0, len(panels), 2)]
    return Chart(title, subtitle, rows, size=(0.7 * WIDTH, 3.3 * len(rows) + 1.2))


def _reached(one: ForcedComparison) -> str:
    result = one.steady
    if result is None or result.model is None:
        return f"{result.measured.name}, not that of the model" if result else "no steady state"
    return f"{result.measured.name}, amplitude of the model {100 * result.overestimate:+.2g} %"


def _drive(one: ForcedComparison) -> str:
    given = one.run.drive or {}
    p, frequency = given.get("p") or 0.0, given.get("Omega") or 0.0
    return f"p = {p:g}, Ω = {frequency:.4g} rad/s"


def tumbling(runs: Sequence[ForcedComparison], title: str, subtitle: str) -> Sheet:
    """Return histories above, and phase planes and statistics below, for each run."""
    charts = []
    for one in runs:
        above = [history(one), history(one, member="a member")]
        below = [phase(one), phase(one, member="a member"), statistics(one)]
        heading = f"{_drive(one)}: {counted(one.ensemble.members, 'member')} of the ensemble"
        charts.append(Chart(heading, "", [above, below], heights=(0.7, 1.0), size=(WIDTH, 4.4)))
    return Sheet(title, subtitle, [charts], legend=True)
