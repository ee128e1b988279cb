"""Charts of an identification: figures 4 to 7 of the paper and its table 1, for one record."""

from __future__ import annotations

import dataclasses
import math
import textwrap
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from pendmap.analysis.trajectory import simulate
from pendmap.charts import half_cycles, names
from pendmap.charts.chart import Axis, Chart, Panel, Sheet, bare, holding, nothing
from pendmap.charts.marks import QUIET, Band, Line, Mark, Points, Span, Table, Text
from pendmap.charts.palette import MEASURED, NOISE, NOISE_SAID, look
from pendmap.charts.record import FEW, history
from pendmap.errors import InputError
from pendmap.formatting import estimate_text, typographic
from pendmap.identification.engineering import swing_amplitude
from pendmap.identification.methods.registry import BEST
from pendmap.identification.report import in_line, run_entries, table1_table
from pendmap.identification.table1 import first_state, simulated_peaks
from pendmap.signal.robust import Z95, span

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pendmap.charts.marks import Ends, Floats
    from pendmap.identification import IdentificationReport, PeakErrors, Peaks
    from pendmap.identification.fit import TrajectoryFit
    from pendmap.model import Rig
    from pendmap.records import Run

WIDTH: Final = 8.6  # Width of a column, inches
SAMPLES: Final = 64  # Samples per swing of a simulation
MOST: Final = 6_000  # Greatest number of residuals drawn
SWINGS: Final = 3  # Swings of small amplitude in the close view of a fit
CURVE: Final = 600  # Points of the curve in it
LINE: Final = 0.2  # Height of a row of the table, inches
LETTERS: Final = 110  # Letters per line below the table
NOTHING: Final = "no method can be applied, or there are fewer than three peaks"
QUANTITIES: Final = {"w0": "w0 (rad/s)", "c_over_m": "c/m (1/s)", "Tr": "Tr (rad/s²)"}
"""Estimates in the table, with the heads of their columns."""


def sheet(report: IdentificationReport) -> Chart:
    """Return the record, a close view of the fit, its residual, and the envelope."""
    run, best, joint = report.run, report.sound, report.joint
    known = "" if best is None else in_line(best.estimates).replace("^2", "²")
    text = known or "no method gives a model"
    whole = dataclasses.replace(history(run), name="record", title="record")
    rows = [[whole], [_envelope_of_fit(report)]]
    if joint is not None:
        gain = 1.0 if run.gyroscope is None else run.gyroscope.w0
        read = gain * joint.given[0].theta
        left, sigma = joint.fit.residuals[0], joint.readings[0].sigma
        below = residuals(run, left, sigma, BEST, "residual: record less fit")
        rows = [[*rows[0], _close(run, joint.fit, read, read - gain * left)], [below, *rows[1]]]
        ratios = {one["name"]: one["rms"] / one["noise"] for one in run_entries(report)}
        worst = max(ratios, key=ratios.__getitem__)
        text += f";   residual {ratios[worst]:.3g} times the noise"
        if len(ratios) > 1:
            text += f" in {worst}, the worst of {len(ratios)} runs; drawn: the longest"
    size = (11.0, 6.6) if joint is not None else (WIDTH, 5.6)
    return Chart(f"Identification: {run.name}", typographic(text), rows, size=size)


def _close(run: Run, fit: TrajectoryFit, read: Floats, made: Floats) -> Panel:
    """Return the readings of the first swings, and those of the fit as a line."""
    theta, velocity = fit.curves[0]
    begin = float(run.time[run.trusted][0])
    ends = (begin, begin + SWINGS * math.tau / fit["w0"])
    near = (run.time >= ends[0]) & (run.time <= ends[1]) & np.isfinite(theta)
    time, line = run.time[near], made[near]
    if run.gyroscope is None and time.size > 1:
        # Between readings the model moves on smoothly; the sensor's own error is added.
        smooth = np.linspace(time[0], time[-1], CURVE)
        motion = CubicHermiteSpline(time, theta[near], velocity[near])(smooth)
        time, line = smooth, motion + np.interp(smooth, time, line - theta[near])
    shown = near & run.trusted
    marks: list[Mark] = [
        Points(run.time[shown], read[shown], colour=MEASURED, size=3.0, order=1.0, name="readings"),
        dataclasses.replace(_line(time, line, BEST, 1.4), name="fit"),
    ]
    up = names.angle(holding(line, read[shown]))
    if run.gyroscope is not None:
        up = Axis("angular rate (rad/s)", up.ends)
    return Panel("fit", "fit: the first swings", Axis(names.TIME, ends), up, marks)


def _envelope_of_fit(report: IdentificationReport) -> Panel:
    """Return the measured peaks, and the amplitude of the model's swings as a line."""
    run, turned, best = report.run, report.peaks.turned, report.sound
    size = np.abs(turned.amplitude - (0.0 if best is None else best.zero))
    spots: dict[str, Any] = {"fill": "#ffffff", "edge_width": 0.8, "order": 3.0}
    marks: list[Mark] = [
        Points(turned.time, size, colour=MEASURED, size=3.2, name="measured peaks", **spots)
    ]
    if not size.size:
        marks = []
    reach = [np.zeros(1), size]
    if (joint := report.joint) is not None:
        swing = swing_amplitude(joint.fit.curves[0], joint.fit["w0"])
        marks.append(dataclasses.replace(_line(run.time, swing, BEST, 1.4), name="fit"))
        reach.append(swing)
    elif best is not None and not report.table.left_out and best.method not in report.table.lost:
        one = Decay.of(best.rig, report.peaks, best.zero)
        marks.append(_line(one.peak_time, np.abs(one.peak), best.method, 1.4))
    up = Axis("amplitude (rad)", (0.0, 1.06 * holding(*reach, margin=0.0)[1]))
    return Panel("envelope", "envelope of the swings", names.seconds(run.time), up, marks)


def whole(
    report: IdentificationReport,
    *,
    parts: Sequence[str] = (),
    title: str | None = None,
    subtitle: str | None = None,
) -> Sheet:
    """Return parts, by default all methods' figures, in one column, or many in two columns."""
    for name in parts:
        if name not in PARTS:
            raise InputError(f"parts must be among {', '.join(PARTS)}, got {name!r}")
    charts = [PARTS[name](report) for name in parts or PARTS]
    if title is not None and len(charts) == 1:
        charts = [dataclasses.replace(charts[0], title="")]
    high = np.cumsum([0.0, *(chart.size[1] for chart in charts if chart.size)])
    columns = [charts]
    if len(charts) > 2:  # noqa: PLR2004
        k = min(range(1, len(charts)), key=lambda k: max(high[k], high[-1] - high[k]))
        columns = [charts[:k], charts[k:]]
    run, peaks = report.run, report.peaks
    noise = f"noise {peaks.sigma:.2g} rad" if peaks.sigma else "no noise seen"
    text = f"{len(peaks)} peaks, {span(run.time)}"
    if len(report.runs) > 1:
        fitted = f"fitted to {len(report.runs)} runs; drawn: {run.name}, the longest"
        text = f"{fitted};   {text}, {noise}"
    elif not run.peaks_only:
        used = f"{run.trusted.sum()} of {run.time.size} samples for fitting"
        text = f"{run.rate_hz:.5g} Hz, {used};   {text}, {noise}"
    return Sheet(
        title or f"Identification: {run.name}", text if subtitle is None else subtitle, columns
    )


@dataclasses.dataclass(frozen=True)
class Decay:
    """A model simulated from the first peak of a record (figure 6), with the zero error."""

    peak_time: Floats
    peak: Floats
    time: Floats
    theta: Floats

    @classmethod
    def of(cls, rig: Rig, peaks: Peaks, zero: float) -> Decay:
        """Return the simulation of a model whose sensor has a zero error, rad."""
        first, last = first_state(peaks), float(peaks.turned.time[-1])
        begun = dataclasses.replace(first, theta=first.theta - zero)
        peak_time, peak = simulated_peaks(rig, begun, last)
        until = max(last - begun.time, 1e-3) * 1.01
        run = simulate(rig, begun.theta, 0.0, until, samples=SAMPLES)
        time, theta = run["time"].values + begun.time, run["theta"].values + zero
        return cls(peak_time, peak + zero, time, theta)


def simulated(report: IdentificationReport) -> dict[str, Decay]:
    """Return the simulation of each method's model; empty if there is too little to compare."""
    if report.table.left_out or len(report.peaks.turned) < 3:  # noqa: PLR2004 (one full cycle)
        return {}
    made = {}
    for name in report.methods:
        result = report.methods[name]
        if not result.applicable or "w0" not in result.estimates or name in report.table.lost:
            continue
        rig = report.joint.fit.model if name == BEST and report.joint is not None else result.rig
        made[name] = Decay.of(rig, report.peaks, result.zero)
    return made


def _line(x: Floats, y: Floats, method: str, width: float) -> Line:
    one = look(method)
    return Line(x, y, colour=one.colour, dash=one.dash, width=width, name=one.label)


def decays(report: IdentificationReport) -> Chart:
    """Return peaks and their differences of every model, and residuals of the fitted one."""
    title = "The decay by each model"
    made, run, turned = simulated(report), report.run, report.peaks.turned
    last = []
    if (joint := report.joint) is not None:
        text, sigma = "the record less the trajectory fitted to it", joint.readings[0].sigma
        last = [residuals(run, joint.fit.residuals[0], sigma, BEST, text)]
    if not made:
        chart = nothing(title, report.table.left_out or NOTHING)
        two = dataclasses.replace(chart, rows=[*chart.rows, last], size=(WIDTH, 2.6))
        return two if last else chart
    ends = holding(turned.time, margin=0.01)
    shown = [[_envelope(turned, made, ends)], [_differences(turned, made, ends)], last]
    shown = [row for row in shown if row]
    heights = (1.7, 1.35, 0.75)[: len(shown)]
    return Chart(title, "", shown, heights=heights, size=(WIDTH, 4.6 + 1.3 * len(last)))


def _envelope(turned: Peaks, made: Mapping[str, Decay], ends: Ends) -> Panel:
    size = np.abs(turned.amplitude)
    spots: dict[str, Any] = {"size": 2.4, "order": 5.0, "name": "measured"}
    marks: list[Mark] = [Points(turned.time, size, colour=MEASURED, **spots)]
    marks += [_line(one.peak_time, np.abs(one.peak), name, 1.3) for name, one in made.items()]
    up = Axis("peak |θ| (rad)", (0.0, 1.06 * float(size.max())))
    title = "peaks, simulated from the first one on"
    return Panel("peaks", title, Axis("", ends, ticks=()), up, marks)


def _differences(turned: Peaks, made: Mapping[str, Decay], ends: Ends) -> Panel:
    """Return the difference of each simulated peak from the measured one of equal number."""
    number = turned.index - turned.index[0]
    curves, marks = [], _noise(turned.time, 1e3 * Z95 * turned.stderr_amplitude)
    for name, one in made.items():
        simulated = np.full(int(number[-1]) + 1, math.nan)
        count = min(simulated.size, one.peak.size)
        simulated[:count] = np.abs(one.peak[:count])
        away = 1e3 * (simulated[number] - np.abs(turned.amplitude))
        curves.append(away[1:])
        marks.append(_line(turned.time[1:], away[1:], name, 1.2))
    least = 1e3 * float(np.median(turned.stderr_amplitude))
    least = least if 0 < least < math.inf else 1e-12
    up, lines = names.signed(curves, "difference (mrad)", least=least)
    title = "simulated less measured peak"
    return Panel("differences", title, Axis(names.TIME, ends), up, [*marks, *lines])


def _noise(x: Floats, error: Floats) -> list[Mark]:
    """Return the band of the noise about 0, named if the noise is known."""
    name = NOISE_SAID if np.any(error > 0) else ""
    return [Band(x, -error, error, colour=NOISE, order=0.0, name=name)]


def residuals(run: Run, residual: Floats, sigma: float, method: str, title: str) -> Panel:
    """Return the residuals of a model over a record, with a band of their noise."""
    gyroscope = run.gyroscope
    size, unit = (1e3, "mrad") if gyroscope is None else (1e3 * gyroscope.w0, "mrad/s")
    away = size * np.where(run.trusted, residual, np.nan)
    every, noise = max(1, away.size // MOST), size * sigma
    known = np.abs(away[np.isfinite(away)])
    top = max(1.4 * float(np.percentile(known, 99.5)), 2.6 * noise) if known.size else noise
    dots: dict[str, Any] = {"colour": look(method).colour, "size": 1.2 if away.size > FEW else 3.0}
    marks: list[Mark] = [Points(run.time[::every], away[::every], **dots)]
    marks.append(Span((-Z95 * noise, Z95 * noise), axis="y", colour=NOISE, name=NOISE_SAID))
    return Panel(
        "residual", title, names.seconds(run.time), Axis(f"residual ({unit})", (-top, top)), marks
    )


def errors(report: IdentificationReport) -> Chart:
    """Return the errors of periods and peaks of every model."""
    title, known = "Errors of simulated periods and peaks", report.table.errors
    if report.table.left_out or not known:
        return nothing(title, report.table.left_out or NOTHING)
    titles = ("of each period", "of each peak; time runs to the left")
    return Chart(title, "", [error_panels(known, report.peaks, titles)], size=(WIDTH, 3.6))


def error_panels(
    known: Mapping[str, PeakErrors], peaks: Peaks, titles: tuple[str, str]
) -> list[Panel]:
    """Return the errors of periods and peaks, percent, over the band of the peaks' noise."""
    some, turned = next(iter(known.values())), peaks.turned
    at = np.searchsorted(turned.time, some.period_time)
    variance = turned.stderr_time**2
    error = Z95 * 100 * np.sqrt(variance[at] + variance[at + 2]) / some.period
    order = np.argsort(some.peak)
    wide = Z95 * 100 * (turned.stderr_amplitude / some.peak)[order]
    ends = (max(float(np.min(some.peak[1:])), 1e-9) / 1.15, float(np.max(some.peak[1:])) * 1.15)
    size = Axis("measured peak |θ| (rad)", ends, "log")
    time = Axis(names.TIME, holding(some.period_time, margin=0.02))
    periods = [(one.period_time, one.period_error) for one in known.values()]
    sizes = [(one.peak[1:], one.peak_error[1:]) for one in known.values()]
    panels: list[Panel] = []
    for title, across, noise, curves in (
        (titles[0], time, _noise(some.period_time, error), periods),
        (titles[1], size, _noise(some.peak[order], wide), sizes),
    ):
        up, lines = names.signed([y for _, y in curves], "error (%)")
        mine = [_line(*curve, method, 1.1) for method, curve in zip(known, curves, strict=True)]
        panels.append(Panel("errors", title, across, up, [*noise, *mine, *lines]))
    return panels


def table(report: IdentificationReport) -> Chart:
    """Return table 1 of a record, and below it the inapplicable methods with the reason."""
    head, errors = table1_table(report)
    heads = [] if report.table.left_out else head[1:]
    dash, of_method = "\N{EN DASH}", {name: cells for name, *cells in errors}
    body, reasons = [], []
    for name, method in report.methods.items():
        label = look(name).label
        if not method.applicable:
            why = method.warnings[-1] if method.warnings else "not applicable"
            reasons += textwrap.wrap(f"{label}: {why}", LETTERS, subsequent_indent="    ")
            continue
        known = [method.estimates.get(key) for key in QUANTITIES]
        cells = [dash if one is None else typographic(estimate_text(one)) for one in known]
        cells += [cell.removesuffix(" %") for cell in of_method.get(name, [dash] * len(heads))]
        body.append([label, *cells])
    about = "in brackets: standard error of the last digits;   at rest: the simulation stands still"
    notes = [about, *reasons] if body else reasons
    down = 2.5 + len(body)
    words = [
        Text(0.0, down + k, text, colour=QUIET, align=("left", "bottom"), size=8.0)
        for k, text in enumerate(notes)
    ]
    high = down + len(notes) - 0.9
    heads = ["method", *QUANTITIES.values(), *heads]
    heads = [name.replace(" ", "\n", 1) if " " in name else f"\n{name}" for name in heads]
    panel = bare("table", Table(heads, body), *words, high=high)
    title = "Damping by each method, and errors of its simulation (%)"
    return Chart(title, "", [[panel]], size=(WIDTH, 0.55 + LINE * high))


PARTS: Final[dict[str, Callable[[IdentificationReport], Chart]]] = {
    "record": half_cycles.part,
    "decrement": half_cycles.decrements,
    "decay": decays,
    "errors": errors,
    "table": table,
}
"""Parts of the sheet by the name a user types: figures 4, 5, 6, 7 and table 1."""
