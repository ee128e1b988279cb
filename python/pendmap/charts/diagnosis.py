"""Charts of a diagnosis: residuals, forecasts, missing torque, candidates, effects by run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts import names
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.identification import error_panels
from pendmap.charts.marks import (
    INK,
    QUIET,
    Areas,
    Band,
    Level,
    Line,
    Mark,
    Points,
    Span,
    Text,
    bars,
)
from pendmap.charts.palette import NOISE, NOISE_SAID, look
from pendmap.formatting import typographic
from pendmap.identification.sensitivity import sensitivities
from pendmap.model.labels import unit_of
from pendmap.residuals.torque import OVER
from pendmap.signal.robust import Z95

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.comparison.forecast import Forecast
    from pendmap.diagnosis import Discrepancy
    from pendmap.diagnosis.candidates import Candidate

ACCELERATION: Final = "rad/s²"  # Unit of a torque per moment of inertia
RMS: Final = "rms (mrad)"  # Root mean square of residuals, with its unit
LACKED: Final = "Torque that the model lacks"
BEFORE, AFTER = look("before").colour, look("after").colour
ALIKE, OTHER = "#56b4e9", "#9a9a9a"
"""Colours of candidates that are indistinguishable from an effect found, and of all others."""
RUNS: Final = 3  # Number of runs whose residuals are drawn: those with the worst baseline fit
PART: Final = 0.1
"""Part of a small swing over which residuals are averaged; model errors are slower."""
CYCLES: Final = 3  # Number of free runs in figure 7: those held out first, then the longest
SHARES: Final = [(float(share), str(share)) for share in (0, 25, 50, 75, 100)]
SIZE: Final = (9.2, 12.2)  # Width and height of the sheet in inches, of two effects or fewer


def sheet(result: Discrepancy) -> Chart:
    """Return the sheet: residuals, their rms and forecasts, torques, ranking, an effect by run."""
    rms = result.gap
    subtitle = (
        f"residual {1e3 * rms.before:.3g} mrad before, {1e3 * rms.after:.3g} after, noise "
        f"{1e3 * rms.noise_floor:.3g};   held out {1e3 * rms.held_out_before:.3g} before, "
        f"{1e3 * rms.held_out_after:.3g} after"
    )
    rows = [[panel] for panel in residuals(result)]
    heights = [0.62] * len(rows)
    gap = [by_run(result)]
    if result.forecasts:
        gap.append(forecast(result, max(result.forecasts, key=lambda one: one.starts)))
    rows += [gap, [torque(result, "angle"), torque(result, "velocity")]]
    last = [ranking(result), *(effect_panels(result) or [torque(result, "amplitude")])]
    if len(last) % 2 and len(last) > 1:
        last.append(torque(result, "amplitude"))
    rows += [last[k : k + 2] for k in range(0, len(last), 2)]
    heights += [1.2, 1.2, 1.5, *[1.2] * (len(last) // 2 - 1)]
    size = SIZE[0], SIZE[1] + 2.2 * (len(last) // 2 - 1)
    return Chart(_title(result), subtitle, rows, heights=heights, size=size, letters=False)


def parts(result: Discrepancy) -> dict[str, Chart]:
    """Return the non-empty charts of a report by the names that it uses."""
    starts = " and ".join(f"{one.starts} {one.kind}" for one in result.forecasts)
    forecasts = f"forecasts from {starts} starts on what was held out" if starts else ""
    gap = [by_run(result), *(forecast(result, one) for one in result.forecasts)]
    torques = [torque(result, over) for over in OVER if _torque_rows(result, over)]
    pairs = [torques[k : k + 2] for k in range(0, len(torques), 2)]
    ranked = [ranking(result)] if result.scores.best() else []
    by_itself = "what each effect promises to close by itself, and closes beside the others"
    single = len(result.data.fitted) == 1
    effects = effect_panels(result)
    runs, alone = ([], [[one] for one in effects]) if single else (effects, [])
    worst = "the runs with the largest residuals of the baseline"
    cycles = _cycles(result)
    first_peak = "from the first measured peak on"
    made = {
        "residuals": ("Residuals", worst, [[panel] for panel in residuals(result)], 4.2),
        "gap": ("The gap", forecasts, [gap], 3.7),
        "torque": (LACKED, "per moment of inertia; bands: 95 %", pairs, 1.1 + 2.3 * len(pairs)),
        "ranking": ("Ranking", by_itself, [ranked], 3.5),
        "runs": ("Run by run", "bars and band: 95 %", [runs], 3.5),
        "parts": ("The effects in the record", worst, alone, 1.1 + 1.7 * len(alone)),
        "figure_7": ("Simulated periods and peaks", first_peak, cycles, 1.1 + 2.6 * len(cycles)),
    }
    return {
        name: Chart(title, text, rows, size=(SIZE[0], high), letters=False)
        for name, (title, text, rows, high) in made.items()
        if any(rows)
    }


def _cycles(result: Discrepancy) -> list[list[Panel]]:
    """Return the errors of simulated periods and peaks of the models, a row for each free run."""
    rows = []
    for one in sorted(result.cycles, key=lambda one: (not one.held_out, -len(one.peaks)))[:CYCLES]:
        errors, name = one.errors, one.name + (", held out" if one.held_out else "")
        if not result.adds:
            errors = {"baseline": errors["before"]} if "before" in errors else {}
        titles = (f"{name}: each period", "each peak; time runs to the left")
        rows += [error_panels(errors, one.peaks, titles)] if errors else []
    return rows


def _title(result: Discrepancy) -> str:
    """Return the verdict with its names; for indistinguishable effects with all of them."""
    alike = {one[0]: one for one in result.equivalent}
    text = [effect.name for effect in result.effects]
    if result.verdict == "ambiguous":
        text = [" or ".join(alike.get(name, [name])) for name in text]
    between = "; " if result.verdict == "ambiguous" else ", "
    return f"{result.verdict}: {between.join(text) or 'no effect claimed'}"


def models(result: Discrepancy) -> list[tuple[str, str]]:
    """Return names and colours of the models; the baseline alone if no effect was added."""
    return [("before", BEFORE), ("after", AFTER)] if result.adds else [("baseline", BEFORE)]


def residuals(result: Discrepancy) -> list[Panel]:
    """Return the residuals of the runs with the worst baseline fit, before and after."""
    runs = result.data.fitted
    rows = [row for row in result.gap.by_run if not row.held_out]
    order = sorted(range(len(runs)), key=lambda k: -rows[k].before / rows[k].noise_floor)[:RUNS]
    longest = max(float(runs[k].time[-1]) for k in order)
    fits = (result.base.fitted.fit, result.best.fitted.fit)
    panels = []
    for k in sorted(order):
        run = runs[k]
        interval = float(np.median(np.diff(run.time)))
        every = max(round(PART * math.tau / (fits[0].model.w0 * interval)), 1)
        time = run.time[::every]
        floor = 2e3 * rows[k].noise_floor / math.sqrt(every)
        text = "noise, 2 standard errors"
        marks: list[Mark] = [Span((-floor, floor), axis="y", colour=NOISE, name=text)]
        shown = [np.array([-floor, floor])]
        for (name, colour), fit in zip(models(result), fits, strict=False):
            used = True if run.trusted is None else run.trusted
            residual = np.where(used, 1e3 * fit.residuals[k], math.nan)
            bins = np.pad(residual, (0, -residual.size % every), constant_values=math.nan)
            bins = bins.reshape(-1, every)
            count = np.isfinite(bins).sum(axis=1)
            mean = np.where(count > 0, np.nansum(bins, axis=1) / np.maximum(count, 1), math.nan)
            marks.append(Line(time, mean, colour=colour, width=1.0, name=name))
            shown.append(mean)
        across = Axis("time (s)" if k == max(order) else "", (min(0.0, float(time[0])), longest))
        title = f"{run.name}: record less model, means over a tenth of a swing"
        panels.append(Panel(f"residual {k}", title, across, Axis("mrad", holding(*shown)), marks))
    return panels


def _runs(files: Sequence[str]) -> Axis:
    ticks = [(float(k), name.removesuffix(".csv")) for k, name in enumerate(files)]
    return Axis("", (-0.6, len(files) - 0.4), ticks=ticks)


def by_run(result: Discrepancy) -> Panel:
    """Return the residual of each run before and after with its noise, held-out runs last."""
    rows = result.gap.by_run
    at = np.arange(len(rows), dtype=float)
    back = [k for k, row in enumerate(rows) if row.held_out]
    noise, before, after = (
        1e3 * np.array([getattr(row, key) for row in rows])
        for key in ("noise_floor", "before", "after")
    )
    marks: list[Mark] = []
    if back:
        marks.append(Span((back[0] - 0.5, back[-1] + 0.5), colour="#f1f1f1", name="held out"))
    level, ends = bars(noise, at - 0.32, at + 0.32)
    (first, _), *further = models(result)
    marks += [
        Line(*bars(at, after, before), colour="#bbbbbb", width=1.0, order=1.0),
        Points(at, before, colour=BEFORE, fill="#ffffff", edge_width=1.0, size=5.0, name=first),
        Line(ends, level, width=1.1, name="noise"),
    ]
    for name, colour in further:
        marks.append(Points(at, after, marker="s", colour=colour, size=4.0, name=name))
    across, up = _runs([row.name for row in rows]), names.sizes(RMS, noise, before, after)
    return Panel("by run", "Residual by run", across, up, marks)


def forecast(result: Discrepancy, one: Forecast) -> Panel:
    """Return the forecast error against the horizon, with the noise."""
    floor = 1e3 * one.noise_floor
    marks: list[Mark] = [Level(floor, width=1.1, name="noise", path="noise")]
    errors = [1e3 * one.before, 1e3 * one.after][: len(models(result))]
    for (name, colour), error in zip(models(result), errors, strict=True):
        marks.append(Line(one.horizon, error, colour=colour, width=1.4, name=name, path=name))
    across = Axis("time ahead (s)", (0.0, float(one.horizon[-1])))
    title, up = f"Error of forecasts, {one.kind} runs", names.sizes(RMS, floor, *errors)
    root = f"forecast/{one.kind}"
    return Panel(f"forecast {one.kind}", title, across, up, marks, root=root)


def _torque_rows(result: Discrepancy, over: str) -> list[list[dict[str, Any]]]:
    """Return the torque bins of the models; empty if there are none."""
    torques = (result.torque_before, result.torque_after)[: len(models(result))]
    rows = [torque.rows.get(over, []) for torque in torques]
    return rows if any(rows) else []


def torque(result: Discrepancy, over: str) -> Panel:
    """Return the missing torque of the models over one quantity, with 95 % bands."""
    marks: list[Mark] = [Level(0.0, colour=QUIET, path="zero")]
    shown, bins, text = [np.zeros(1)], [], "torque"
    for (name, colour), rows in zip(models(result), _torque_rows(result, over), strict=False):
        if not rows:
            continue
        bins.append(np.array([rows[0]["from"], *(row["to"] for row in rows)]))
        text = "torque along\nthe motion" if rows[0]["along_motion"] else "torque"
        value, error = (np.array([row[key] for row in rows]) for key in ("torque", "stderr"))
        value, error = np.append(value, value[-1]), np.append(error, error[-1])
        shown += [value - Z95 * error, value + Z95 * error]
        look: dict[str, Any] = {"colour": colour, "step": True}
        marks += [
            Band(bins[-1], *shown[-2:], alpha=0.25, path=f"{name}/bars", **look),
            Line(bins[-1], value, width=1.3, name=name, path=name, **look),
        ]
    title = f"{LACKED}, over {over.replace('_', ' ')}"
    name = "{1} ({2})".format(*OVER[over])
    across = Axis(name, holding(*bins, margin=0.0) if bins else None)
    up = Axis(f"{text} ({ACCELERATION})", holding(*shown))
    return Panel(over, title, across, up, marks, root=f"torque/{over}")


def ranking(result: Discrepancy) -> Panel:
    """Return the share of the gap that each effect of the table closes, and the fall of the BIC."""
    rows = result.standings.rows
    marks: list[Mark] = []
    for row, y in zip(rows, range(len(rows) - 1, -1, -1), strict=True):
        colour, text = OTHER, "other effects"
        if row.mark in {"alike", "wider"}:
            colour, text = ALIKE, "does the same"
        elif row.mark not in {"", "less"}:
            colour, text = AFTER, "found" if result.effects else "nearest, not claimed"
        value = 100 * (row.alone or 0.0)
        box = np.array([(0, y - 0.3), (value, y - 0.3), (value, y + 0.3), (0, y + 0.3)], float)
        marks.append(Areas([box], colour=colour, name=f"{text}: alone"))
        if row.last is not None:
            look: dict[str, Any] = {"marker": "D", "size": 5.5, "fill": "#ffffff", "order": 4.0}
            at = np.array([100 * row.last]), np.array([float(y)])
            marks.append(Points(*at, colour=INK, edge_width=1.2, name="beside the others", **look))
        if row.bic is not None:
            words = typographic(f"BIC {row.cells[3]}")
            marks.append(Text(105.0, y, words, colour=QUIET, align=("left", "center"), size=7.5))
    across = Axis("share of the squared gap closed (%)", (0.0, 130.0), ticks=SHARES)
    ticks = [(float(y), row.candidate.name) for y, row in enumerate(reversed(rows))]
    up = Axis("", (-0.6, max(len(rows), 1) - 0.4), ticks=ticks)
    return Panel("ranking", "What each effect closes; fall of the BIC", across, up, marks)


def effect_panels(result: Discrepancy) -> list[Panel]:
    """Return a panel of each effect of the best model: run by run, or its part of one record."""
    if len(result.data.fitted) > 1:
        return [coefficients(result, name) for name in shown_coefficients(result)]
    return [part_of_record(result, one.candidate) for one in result.assessment.identified]


def part_of_record(result: Discrepancy, candidate: Candidate) -> Panel:
    """Return what an effect changes in a record that no other parameter of the model can change."""
    fitted = result.nearest.fitted
    slopes = sensitivities(fitted.fit, fitted.runs, (), fitted.fit.model)
    free = candidate.free[0]
    place, (run,) = slopes.names.index(free), fitted.runs
    column, others = slopes.columns[:, place], np.delete(slopes.columns, place, axis=1)
    others = others / np.maximum(np.linalg.norm(others, axis=0), 1e-300)
    alone = column - others @ np.linalg.lstsq(others, column, rcond=1e-9)[0]
    change = np.full(run.time.size, math.nan)
    shown = np.flatnonzero(run.counted)[: alone.size]
    change[shown] = 1e3 * fitted.fit[free] * alone[: shown.size] * run.sigmas[shown]
    wide = Z95 * 1e3 * float(np.median(result.data.fitted[0].sigmas))
    marks: list[Mark] = [
        Span((-wide, wide), axis="y", colour=NOISE, name=NOISE_SAID),
        Line(run.time, change, colour=AFTER, width=0.8, name="effect"),
    ]
    claimed = "" if result.effects else " (not claimed)"
    title = f"{candidate.name}{claimed}: what it alone changes in the record"
    across, up = Axis("time (s)", holding(run.time, margin=0.01)), Axis("mrad", holding(change))
    return Panel(f"part {candidate.name}", title, across, up, marks)


def shown_coefficients(result: Discrepancy) -> list[str]:
    """Return the parameters that are drawn run by run: the sizes of the effects found."""
    if len(result.data.fitted) == 1:
        return []
    sizes = [standing.candidate.free[0] for standing in result.assessment.identified]
    known = [name for name in ("c_over_m", "w0", "Tr") if name in result.runs.coefficients]

    def apart(name: str) -> float:
        errors = [error for _, error in result.runs.shown(name)]
        return result.runs.between(name) / min(errors, default=math.inf)

    return sizes or ([max(known, key=apart)] if known else [])


def _together(result: Discrepancy, shown: str) -> tuple[float, float]:
    """Return the 95 % interval of a parameter from all runs together."""
    trial = result.nearest.fitted
    estimate = trial.fit.estimates[shown]
    for standing, effect in zip(result.assessment.identified, result.effects, strict=False):
        bounds = effect.ci95.get(standing.candidate.size)
        if standing.candidate.free[0] == shown and bounds is not None:
            # A negative size may be stated as a positive one, with the phase shifted by pi.
            turned = estimate.value * effect.parameters[standing.candidate.size] < 0
            return (-bounds[1], -bounds[0]) if turned else bounds
    half = Z95 * math.sqrt(trial.widening) * (estimate.stderr or 0.0)
    return estimate.value - half, estimate.value + half


def coefficients(result: Discrepancy, shown: str) -> Panel:
    """Return the value of a parameter from each run, and from all runs together.

    The axis contains the interval of all runs together, and runs of which at least half have a
    smaller error; others are marked at its ends.
    """
    mean = result.nearest.fitted.fit.estimates[shown].value
    power = 3 * math.floor(math.log10(abs(mean)) / 3) if mean else 0
    pairs = 10.0**-power * np.array(result.runs.coefficients[shown], dtype=float)
    at, (value, error) = np.arange(len(pairs), dtype=float), pairs.T
    together = [10.0**-power * end for end in _together(result, shown)]
    known = np.isfinite(error)
    reach = 6 * float(np.median(error[known])) if known.any() else 0.0
    least, most = value - Z95 * error, value + Z95 * error
    sure = known & (error < reach)
    around = 10.0**-power * mean + np.array([-reach, reach])
    low, high = holding(together, around, least[sure], most[sure])
    marks: list[Mark] = [
        Span(together, axis="y", colour=NOISE, name="all together"),
        Line(*bars(at[known], least[known], most[known]), colour=AFTER, width=1.0),
        Points(at[known], value[known], marker="s", size=4.0, colour=AFTER, name="own value"),
    ]
    for which, place, mark, text in (
        (known & (most > high), 0.97, "^", "beyond the axis"),
        (known & (least < low), 0.03, "v", "beyond the axis"),
        (~known, 0.06, "x", "undetectable"),
    ):
        if which.any():
            spots = np.full(np.count_nonzero(which), low + place * (high - low))
            cross: dict[str, Any] = {"marker": mark, "size": 4.5, "edge_width": 1.0}
            marks.append(Points(at[which], spots, colour=QUIET, name=text, **cross))
    times = f"$10^{{{power}}}$ " if power else ""
    unit = f"{times}{unit_of(shown, result.definition)}".strip()
    mine = shown.rpartition(".")[2]
    claimed = "" if result.effects else " (not claimed)"
    up = Axis(f"{mine} ({unit})" if unit else mine, (low, high))
    across = _runs([run.name for run in result.data.fitted])
    return Panel(f"run by run {shown}", f"{shown}{claimed}", across, up, marks)
