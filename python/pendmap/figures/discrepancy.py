"""The figure of a diagnosis: residuals, residual torque and ranking, and the effect run by run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap.figures import sheet as sheets
from pendmap.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pendmap.discrepancy import Discrepancy

__all__ = ["figure"]

BEFORE, AFTER, NOISE = "#d55e00", "#0072b2", "#d9d9d9"
"""Colours of Okabe & Ito, told apart in all kinds of colour vision, and by their lightness."""

SIZE = (8.6, 9.3)
"""Width and height in inches."""

RUNS = 3
"""Runs whose residuals are drawn: those that the baseline misses most."""

RANKED = 8
"""Candidates in the ranking."""

PART = 0.1
"""Part of a small swing over which residuals are averaged: what a model lacks is slower."""


def figure(found: Discrepancy, *, dpi: float) -> Figure:
    """Return the figure of a diagnosis; see :func:`pendmap.figures.draw_discrepancy`."""
    gap = found.gap
    names = ", ".join(effect.name for effect in found.effects) or "no effect claimed"
    subtitle = (
        f"residual {1e3 * gap.before:.3g} mrad before, {1e3 * gap.after:.3g} after, noise "
        f"{1e3 * gap.noise_floor:.3g};   held out {1e3 * gap.held_out_before:.3g} before, "
        f"{1e3 * gap.held_out_after:.3g} after"
    )
    made = sheets.headed(SIZE, dpi, f"{found.verdict}: {names}", subtitle, left=0.75)
    _residuals(made, found)
    for column, (over, label) in enumerate(
        (("angle", "angle  (rad)"), ("velocity", "velocity  (rad/s)"))
    ):
        axes = sheets.place(made, 0.85 + 4.1 * column, 3.75, 3.35, 1.6)
        _torque(axes, found, over, label, named=column == 0)
    _ranking(sheets.place(made, 2.05, 0.6, 2.15, 2.3), found)
    _coefficients(sheets.place(made, 5.35, 0.6, 2.95, 2.3), found)
    return made


def _residuals(made: Figure, found: Discrepancy) -> None:
    runs = found.evidence.fitted
    rows = [row for row in found.gap.by_run if not row.held_out]
    order = sorted(range(len(runs)), key=lambda k: -rows[k].before / rows[k].noise_floor)[:RUNS]
    longest = max(float(runs[k].time[-1]) for k in order)
    high = 2.45 / len(order) - 0.18
    for place, k in enumerate(sorted(order)):
        axes = sheets.place(made, 0.85, 6.05 + (len(order) - 1 - place) * (high + 0.18), 7.45, high)
        run = runs[k]
        interval = float(np.median(np.diff(run.time)))
        every = max(round(PART * math.tau / (found.base.trial.fit.model.w0 * interval)), 1)
        time = run.time[::every]
        floor = 1e3 * rows[k].noise_floor / math.sqrt(every)
        axes.axhspan(-2 * floor, 2 * floor, color=NOISE, lw=0, label="noise, 2 standard errors")
        for name, colour, trial in (
            ("before", BEFORE, found.base.trial),
            ("after", AFTER, found.best.trial),
        ):
            residual = 1e3 * trial.fit.residuals[k]
            if run.trusted is not None:
                residual = np.where(run.trusted, residual, math.nan)
            mean = _smoothed(residual, every)
            axes.plot(time, mean[: time.size], color=colour, lw=1.0, label=name)
        axes.set_ylabel("mrad")
        axes.text(0.008, 0.94, run.name, transform=axes.transAxes, va="top", fontsize=8.5, zorder=5)
        if place == 0:
            axes.set_title("Record less model, means over a tenth of a swing")
            axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=3, borderaxespad=0)
        axes.set_xlim(0 if time[0] >= 0 else float(time[0]), longest)
        if place == len(order) - 1:
            axes.set_xlabel("time  (s)")
        else:
            axes.tick_params(labelbottom=False)


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


def _torque(axes: Axes, found: Discrepancy, over: str, label: str, *, named: bool) -> None:
    for name, colour, mark, torque in (
        ("before", BEFORE, "o", found.torque_before),
        ("after", AFTER, "s", found.torque_after),
    ):
        _bins(axes, torque.rows[over], (name, colour, mark))
    axes.axhline(0, color=style.QUIET, lw=0.7)
    axes.set_xlabel(label)
    axes.set_title(f"Torque that the model lacks, over {over}")
    if named:
        axes.set_ylabel("rad/s\N{SUPERSCRIPT TWO}")
        axes.legend(loc="best", ncols=2, columnspacing=1.0, handletextpad=0.3)


def _bins(axes: Axes, rows: list[dict[str, Any]], how: tuple[str, str, str]) -> None:
    name, colour, mark = how
    axes.errorbar(
        [0.5 * (row["from"] + row["to"]) for row in rows],
        [row["torque"] for row in rows],
        yerr=[1.96 * row["stderr"] for row in rows],
        fmt=mark,
        ms=4,
        lw=1.0,
        color=colour,
        mfc="white" if mark == "o" else colour,
        label=name,
    )


def _ranking(axes: Axes, found: Discrepancy) -> None:
    best = [found.scores.scores[k] for k in found.scores.best()[:RANKED]]
    level = found.base.trial.remainder.level
    named = {effect.name for effect in found.effects}
    values = [max(score.gain / level, 0.1) for score in best]
    places = np.arange(len(best))[::-1]
    colours = [AFTER if score.candidate.name in named else "#9a9a9a" for score in best]
    axes.barh(places, values, color=colours, height=0.7)
    axes.axvline(12, color=style.INK, lw=0.9, ls="--")
    axes.set_xscale("log")
    axes.set_xlim(1, max(30.0, 2 * max(values, default=1.0)))
    axes.set_yticks(places, [score.candidate.name for score in best])
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("score G;  dashed: 12")
    # The names stand left of the bars, and the title above them.
    axes.set_title("Candidates at the baseline", x=-0.75)


def _coefficients(axes: Axes, found: Discrepancy) -> None:
    standings = found.judgement.standings
    shown = standings[0].candidate.free[0] if standings else "c_over_m"
    fit = found.nearest.trial.fit
    pairs = found.runs.coefficients[shown]
    known = [(k, v, e) for k, (v, e) in enumerate(pairs) if math.isfinite(e)]
    mean, error = fit.estimates[shown].value, fit.estimates[shown].stderr or 0.0
    power = 3 * math.floor(math.log10(abs(mean)) / 3) if mean else 0
    scale = 10.0**-power
    axes.axhspan(
        scale * (mean - 1.96 * error), scale * (mean + 1.96 * error), color=NOISE, lw=0, zorder=0
    )
    axes.errorbar(
        range(len(known)),
        [scale * value for _, value, _ in known],
        yerr=[1.96 * scale * e for _, _, e in known],
        fmt="s",
        ms=4,
        lw=1.0,
        color=AFTER,
    )
    # A run that hardly shows the effect would hide the others.
    errors = sorted(scale * e for _, _, e in known)
    reach = 6 * errors[len(errors) // 2] if errors else 1.0
    spread = max((abs(scale * (v - mean)) for _, v, e in known if scale * e < reach), default=0.0)
    half = max(1.4 * spread, reach, 3 * scale * error)
    axes.set_ylim(scale * mean - half, scale * mean + half)
    axes.set_xlim(-0.6, len(known) - 0.4)
    names = [found.evidence.fitted[k].name.removesuffix(".csv") for k, _, _ in known]
    axes.set_xticks(range(len(known)), [name[-6:] for name in names], rotation=45, ha="right")
    axes.set_ylabel(f"10$^{{{power}}}$ SI" if power else "SI", labelpad=2)
    claimed = "" if found.effects else " (not claimed)"
    axes.set_title(f"{shown} run by run{claimed}")
