"""Charts of records: one in detail, or an experiment as strips."""

from __future__ import annotations

import math
import operator
import textwrap
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts import names
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.marks import ALARM, QUIET, Line, Mark, Points, Span, Steps, Text
from pendmap.formatting import listed, moment, typographic
from pendmap.records import Run
from pendmap.records.noise import noise_floor
from pendmap.records.summary import noise_said, noise_unit
from pendmap.signal.local_polynomial import local_fit
from pendmap.signal.robust import true_runs

if TYPE_CHECKING:
    from pendmap.charts.marks import Floats
    from pendmap.records import Experiment

USED: Final = "#1d3557"
UNUSED: Final = "#a9a9a9"
FALSE: Final = "#d55e00"
_BAND: Final = "#ececec"
MOST_POINTS: Final = 20_000  # Greatest number of residuals drawn; more only make a figure larger
MOST_LINES: Final = 14  # Greatest number of lines of findings below the panels
MOST_RUNS: Final = 12  # Greatest number of strips of a figure; the text of ``look`` lists every run
FEW: Final = 400  # Number of samples below which each is drawn as a dot
LETTERS: Final = 104  # Letters per line below the panels
APART: Final = 0.03  # Least distance between numbers in a row, over the width of the record
SHORT: Final = 2e-3  # Duration of a finding, over the record's, below which it is drawn as a point
WIDTH: Final = 8.6  # Width of a figure, inches


def sheet(records: Experiment | Run) -> Chart:
    """Return one record in detail, or a strip of each run."""
    if isinstance(records, Run):
        return _one(records)
    return _one(records.runs[0]) if len(records.runs) == 1 else _many(records)


def _one(run: Run) -> Chart:
    lines: list[str] = []
    for number, finding in enumerate(run.findings, 1):
        text = f"{number}  {'mended: ' if finding.mended else ''}{finding.text}"
        lines += textwrap.wrap(text, LETTERS, subsequent_indent="    ", max_lines=2)
    if len(lines) > MOST_LINES:
        lines = [*lines[: MOST_LINES - 1], "...  pendmap look has the rest"]
    if run.peaks_only:
        ends = f"{moment(run.time[0])} to {moment(run.time[-1])} s"
        subtitle, below = f"{run.time.size} turning points, {ends}", [_intervals(run)]
    else:
        noise = noise_said(noise_floor(run), noise_unit(run)).split(",", maxsplit=1)[0]
        used = f"{run.trusted.sum()} of {run.time.size} samples for fitting"
        subtitle = f"{run.kind}, {run.rate_hz:.5g} Hz, {used};   noise {typographic(noise)}"
        below = [_intervals(run), _residuals(run)]
    return Chart(
        f"Record {run.name}",
        subtitle,
        [[_flags(run)], [history(run)], below],
        heights=(0.15, 1.25, 1.0),
        size=(WIDTH, 6.3 + 0.19 * len(lines)),
        notes=lines,
    )


def _samples(run: Run, time: Floats, width: float) -> list[Mark]:
    """Return marks of the samples: those for fitting, others, and isolated outliers."""
    alone = np.zeros(time.size, bool)
    for low, high in zip(*true_runs(~run.trusted), strict=True):
        alone[low:high] = high - low <= 3  # noqa: PLR2004
    steps = np.diff(run.time)
    # A line from the previous sample would cross a gap.
    breaks = np.flatnonzero(np.concatenate([[False], steps > 5 * np.median(steps)]))
    marks: list[Mark] = []
    for which, colour, text in (
        (~run.trusted & ~alone, UNUSED, "not for fitting"),
        (run.trusted, USED, "for fitting"),
    ):
        look: dict[str, Any] = {"colour": colour, "name": text if which.any() else ""}
        if not run.peaks_only:
            shown = np.where(which, run.theta, np.nan)
            line = np.insert(time, breaks, time[breaks]), np.insert(shown, breaks, np.nan)
            marks.append(Line(*line, width=width, **look))
        if run.peaks_only or time.size < FEW:
            marks.append(Points(time[which], run.theta[which], size=2.2, **look))
    if alone.any():
        cross: dict[str, Any] = {"colour": FALSE, "marker": "x", "size": 4.5, "edge_width": 1.0}
        marks.append(Points(time[alone], run.theta[alone], name="outliers", **cross))
    return marks


def history(run: Run) -> Panel:
    """Return the angle over time, with what is for fitting and what is not."""
    spans = [(part.from_s, part.to_s) for part in run.segments if not part.used]
    marks = _samples(run, run.time, 0.8)
    if spans:
        marks.append(Span(spans, colour=_BAND))
    clock = names.seconds(run.time)
    return Panel("history", "", clock, names.angle(holding(run.theta)), marks)


def _flags(run: Run) -> Panel:
    """Return the numbers of findings at their times, in two rows without overlap."""
    low, high = float(run.time[0]), float(run.time[-1])
    begin, end = holding(run.time, margin=0.01)
    least = APART * (end - begin)
    last = [begin - least, begin - least]
    marks: list[Mark] = []
    placed = [
        (max(one.from_s, low), min(one.to_s, high), number, one)
        for number, one in enumerate(run.findings, 1)
        if one.from_s is not None and one.to_s is not None
    ]
    for left, right, number, finding in sorted(placed, key=operator.itemgetter(0)):
        row = int(left - last[0] < least)
        if right < left or left - last[row] < least:
            continue
        last[row] = left
        colour = QUIET if finding.mended else ALARM
        ends, height = np.array([left, right]), np.full(2, row + 0.12)
        if right - left > SHORT * (high - low) and not finding.where.startswith("row"):
            marks.append(Line(ends, height, colour=colour, width=1.6))
        else:
            marks.append(Points(ends[:1], height[:1], colour=colour, marker="v", size=3.5))
        side = ("center", "bottom")
        marks.append(Text(left, row + 0.28, str(number), colour=colour, align=side, size=8.0))
    return Panel("flags", "", Axis("", (begin, end)), Axis("", (0.0, 2.0)), marks, bare=True)


def _intervals(run: Run) -> Panel:
    """Return a histogram of the intervals between samples."""
    steps = 1e3 * np.diff(run.time)
    usual = float(np.median(steps))
    low, high = float(steps.min()), float(steps.max())
    pad = max(0.05 * (high - low), 0.02 * usual)
    edges = np.linspace(low - pad, high + pad, 61)
    if wide := high > 20 * max(low, 1e-9 * usual):
        edges = np.geomspace(max(low, 1e-6 * usual) / 1.1, high * 1.1, 61)
    counts = np.maximum(np.histogram(steps, edges)[0], 1e-3)
    ends = float(edges[0]), float(edges[-1])
    across = Axis("interval (ms)", ends, "log" if wide else "plain")
    up = Axis("samples", (0.7, 1.5 * steps.size), "log")
    title = "between turning points" if run.peaks_only else "the clock"
    return Panel("clock", title, across, up, [Steps(edges, counts, colour=USED, filled=True)])


def _residuals(run: Run) -> Panel:
    """Return the residuals of samples from a local fit against speed, with the estimated noise."""
    noise = noise_floor(run)
    read = run.theta if run.gyroscope is None else run.read
    fit = local_fit(run.time, read)
    keep = run.trusted[fit.middle]
    speed, residual = np.abs(fit.slope[keep]), 1e3 * np.abs(fit.residual[keep])
    title = "away from nine neighbours"
    if not speed.size or not math.isfinite(noise.sigma):
        none = Axis("", (0.0, 1.0), ticks=())
        return Panel("last", title, none, none, [Text(0.5, 0.5, "too few samples")])
    some = slice(None, None, max(speed.size // MOST_POINTS, 1))
    marks: list[Mark] = [Points(speed[some], residual[some], colour="#a9b8cc", size=0.8)]
    # Beside outliers a local fit may fail: the fastest hundredth is no measure.
    reach = np.linspace(0.0, 1.1 * float(np.quantile(speed, 0.99)), 50)
    law = noise.law
    sigma = np.full(50, noise.sigma) if law is None else np.hypot(law.still, law.tau * reach)
    marks.append(Line(reach, 1e3 * sigma, colour=FALSE, width=1.8, name="standard deviation"))
    top = 1e3 * max(4.5 * noise.sigma, 1.5 * float(sigma.max()))
    # An angle changes with the velocity, a rate with the acceleration.
    speeds = "|dθ/dt| (rad/s)" if run.gyroscope is None else "|d²θ/dt²| (rad/s²)"
    across = Axis(speeds, (0.0, max(float(reach[-1]) * 1.03, 1e-9)))
    up = Axis(f"residual (m{noise_unit(run)})", (0.0, max(top, 1e-9)))
    return Panel("last", title, across, up, marks)


def _many(experiment: Experiment) -> Chart:
    """Return a strip for each run, from its own start, with a common time scale."""
    runs = experiment.runs[:MOST_RUNS]
    longest = max(float(run.time[-1] - run.time[0]) for run in runs)
    shown = f", the first {MOST_RUNS}" if len(experiment.runs) > MOST_RUNS else ""
    known = ", ".join(f"{name} = {value:g}" for name, value in experiment.known.items())
    panels = []
    for k, run in enumerate(runs):
        drive = run.drive
        words = [
            run.kind,
            f"p = {drive['p']:g}, Ω = {drive['Omega']:g} rad/s" if drive else "",
            "held out" if run.hold_out else "",
            listed([finding.what for finding in run.findings], 3),
        ]
        title = f"{run.name}: " + ", ".join(filter(None, words))
        name = "t from the start (s)" if k + 1 == len(runs) else ""
        clock = Axis(name, (-0.01 * longest, 1.01 * longest))
        marks = _samples(run, run.time - run.time[0], 0.7)
        up = names.angle(holding(run.theta, margin=0.08))
        panels.append(Panel(str(k), title, clock, up, marks))
    return Chart(
        f"Experiment {experiment.path.resolve().name}",
        f"{len(experiment.runs)} runs{shown};   {known}".rstrip("; "),
        [[panel] for panel in panels],
        size=(WIDTH, 1.4 + 1.25 * len(runs)),
        letters=False,
    )
