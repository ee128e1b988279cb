"""The gap of a diagnosis: residuals in time, by run, and the error of forecasts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts.methods import look
from pendmap.render import blocks, sides, style

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pendmap.comparison.forecast import Forecast
    from pendmap.diagnosis import Discrepancy
    from pendmap.render.blocks import Box

BEFORE, AFTER = look("before").colour, look("after").colour

RUNS: Final = 3
"""Runs whose residuals are drawn: those that the baseline misses most."""

PART: Final = 0.1
"""Part of a small swing over which residuals are averaged: what a model lacks is slower."""

WIDE: Final = 8.0
"""Ratio of the greatest residual to the least from which on they are drawn logarithmically."""

NAME: Final = 0.18
"""Inches of a line of words above what is drawn."""

LONGEST: Final = 11
"""Letters of a name that is turned: more do not fit beneath a panel."""

BEGINNING: Final = 3
"""Letters of a longer one that stay before the dots: numbers, which tell runs apart, come last."""


def short(name: str) -> str:
    """Return a run's name as there is room for it under an axis, the middle left out."""
    bare = name.removesuffix(".csv")
    if len(bare) <= LONGEST:
        return bare
    return f"{bare[:BEGINNING]}\N{HORIZONTAL ELLIPSIS}{bare[BEGINNING + 1 - LONGEST :]}"


def name_runs(axes: Axes, names: Sequence[str]) -> None:
    """Write the names of runs beneath a panel: level where they have room, else turned."""
    axes.set_xlim(-0.6, len(names) - 0.4)
    bare = [name.removesuffix(".csv") for name in names]
    room = axes.get_window_extent().width / axes.figure.dpi / (len(names) + 0.2)
    for level in (bare, list(map(_folded, bare))):
        lines = "\n".join(level).split("\n")
        if max(map(style.inches, lines)) + 0.1 <= room:
            axes.set_xticks(range(len(names)), level)
            return
    axes.set_xticks(range(len(names)), list(map(short, names)), rotation=45, ha="right")


def _folded(name: str) -> str:
    """Return a name on two lines, divided behind the mark that is nearest to its middle."""
    marks = [k for k, letter in enumerate(name[:-1], start=1) if letter in "_- ."]
    at = min(marks, key=lambda k: abs(2 * k - len(name)), default=0)
    return f"{name[:at]}\n{name[at:]}" if at else name


def models(found: Discrepancy) -> list[tuple[str, str]]:
    """Return what the models are called, and their colours; the baseline alone where it stays."""
    return [("before", BEFORE), ("after", AFTER)] if found.adds else [("baseline", BEFORE)]


def draw_residuals(made: Figure, box: Box, found: Discrepancy) -> None:
    """Draw record less model of the runs that the baseline misses most, before and after."""
    runs = found.evidence.fitted
    rows = [row for row in found.gap.by_run if not row.held_out]
    order = sorted(range(len(runs)), key=lambda k: -rows[k].before / rows[k].noise_floor)[:RUNS]
    longest = max(float(runs[k].time[-1]) for k in order)
    cells = box.rows([1.0] * len(order), [0.18] * (len(order) - 1))
    for place, (cell, k) in enumerate(zip(cells, sorted(order), strict=True)):
        axes = cell.panel(made)
        run = runs[k]
        interval = float(np.median(np.diff(run.time)))
        every = max(round(PART * math.tau / (found.base.trial.fit.model.w0 * interval)), 1)
        time = run.time[::every]
        floor = 1e3 * rows[k].noise_floor / math.sqrt(every)
        axes.axhspan(
            -2 * floor, 2 * floor, color=blocks.NOISE, lw=0, label="noise, 2 standard errors"
        )
        fits = (found.base.trial.fit, found.best.trial.fit)
        for (name, colour), fit in zip(models(found), fits, strict=False):
            residual = 1e3 * fit.residuals[k]
            if run.trusted is not None:
                residual = np.where(run.trusted, residual, math.nan)
            mean = _smoothed(residual, every)
            axes.plot(time, mean[: time.size], color=colour, lw=1.0, label=name)
        sides.headroom(axes, NAME)
        axes.annotate(
            run.name,
            (0.008, 1.0),
            xycoords="axes fraction",
            xytext=(0, -3),
            textcoords="offset points",
            va="top",
            fontsize=8.5,
        )
        if place == 0:
            axes.set_title("Record less model, means over a tenth of a swing")
            axes.legend(
                loc="lower right",
                bbox_to_anchor=(1.0, 1.0),
                ncols=3,
                borderaxespad=0,
                borderpad=0.3,
            )
        axes.set_xlim(0 if time[0] >= 0 else float(time[0]), longest)
        if place == len(order) - 1:
            axes.set_xlabel("time (s)")
        else:
            axes.tick_params(labelbottom=False)
    # One for all panels: each by itself is too low for it.
    whole = made.get_size_inches()
    at = ((box.left - 0.62) / whole[0], (box.bottom + box.height / 2) / whole[1])
    made.text(*at, "residual (mrad)", rotation=90, va="center", ha="center")


def _smoothed(residual: Any, every: int) -> Any:  # noqa: ANN401 (arrays)
    """Return means over ``every`` samples; a bin without samples is not drawn."""
    whole = -(-residual.size // every) * every
    padded = np.full(whole, math.nan)
    padded[: residual.size] = residual
    rows = padded.reshape(-1, every)
    known = np.isfinite(rows)
    count = known.sum(axis=1)
    total = np.where(known, rows, 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), math.nan)


def draw_by_run(axes: Axes, found: Discrepancy) -> None:
    """Draw the residual of each run before and after over its noise, those held out last."""
    rows = found.gap.by_run
    places = np.arange(len(rows))
    back = [k for k, row in enumerate(rows) if row.held_out]
    if back:
        axes.axvspan(back[0] - 0.5, back[-1] + 0.5, color="#f1f1f1", lw=0, zorder=-1)
    noise = 1e3 * np.array([row.noise_floor for row in rows])
    before, after = (
        1e3 * np.array(values)
        for values in ([row.before for row in rows], [row.after for row in rows])
    )
    axes.vlines(places, after, before, color="#bbbbbb", lw=1.0, zorder=1)
    axes.plot(places, before, "o", color=BEFORE, mfc="white", ms=5)
    if found.adds:
        axes.plot(places, after, "s", color=AFTER, ms=4)
    axes.hlines(noise, places - 0.32, places + 0.32, color=style.INK, lw=1.1)
    every = np.concatenate([noise, before, after])
    every = every[np.isfinite(every)]
    low, high = float(every.min()), float(every.max())
    if high > WIDE * low:
        sides.log_axis(axes, "y", (low / 1.4, 1.5 * high), "rms (mrad)")
    else:
        axes.set_ylim(0, 1.15 * high)
        axes.set_ylabel("rms (mrad)", labelpad=2)
    name_runs(axes, [row.name for row in rows])
    axes.set_title("Residual by run" + (", shaded: held out" if back else ""))


def draw_forecast(
    axes: Axes, found: Discrepancy, forecast: Forecast, *, legend: bool = False
) -> None:
    """Draw the error of forecasts against their horizon, and the noise; names above the curves."""
    axes.axhline(1e3 * forecast.noise_floor, color=style.INK, lw=1.1, label="noise")
    errors = (forecast.before, forecast.after)
    for (name, colour), error in zip(models(found), errors, strict=False):
        axes.plot(forecast.horizon, 1e3 * error, color=colour, lw=1.4, label=name)
    every = 1e3 * np.concatenate([forecast.before, forecast.after, [forecast.noise_floor]])
    every = every[np.isfinite(every)]
    low, high = float(every.min()), float(every.max())
    if high > WIDE * low:
        sides.log_axis(axes, "y", (low / 1.4, 1.5 * high), "rms (mrad)")
    else:
        axes.set_ylim(0, 1.15 * high)
        axes.set_ylabel("rms (mrad)", labelpad=2)
    axes.set_xlim(0, float(forecast.horizon[-1]))
    axes.set_xlabel("time ahead (s)")
    axes.set_title(f"Error of forecasts, {forecast.kind} runs")
    if legend:
        sides.headroom(axes, NAME + 0.06)
        axes.legend(loc="upper left", ncols=3, columnspacing=1.0, handlelength=1.4)
