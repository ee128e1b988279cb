"""Candidates of a diagnosis: their scores, and a coefficient run by run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pendmap.model.labels import unit_of
from pendmap.render import blocks, style
from pendmap.render.gap import AFTER, name_runs

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from pendmap.diagnosis import Discrepancy

RANKED: Final = 8
"""Candidates in the ranking."""

ALIKE, OTHER = "#56b4e9", "#9a9a9a"
"""Candidates that are not told apart from what was found, and all others."""

Z95: Final = 1.959963984540054


def draw_ranking(axes: Axes, found: Discrepancy) -> None:
    """Draw the greatest scores at the baseline, those of the effects found in colour."""
    best = [found.scores.scores[k] for k in found.scores.best()[:RANKED]]
    level = found.base.trial.remainder.level
    values = [max(score.gain / level, 0.1) for score in best]
    places = np.arange(len(best))[::-1]
    colours = [_colour(score.candidate.name, found) for score in best]
    axes.barh(places, values, color=colours, height=0.7)
    axes.set_xscale("log")
    axes.set_xlim(1, max(30.0, 2 * max(values, default=1.0)))
    axes.set_yticks(places, [score.candidate.name for score in best])
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("score G")
    # The names stand left of the bars, and the title above them.
    axes.set_title("Candidates at the baseline", x=-0.75)


def _colour(name: str, found: Discrepancy) -> str:
    if name in {effect.name for effect in found.effects}:
        return AFTER
    return ALIKE if any(name in names for names in found.equivalent) else OTHER


def ranking_handles(found: Discrepancy) -> list[Artist]:
    """Return what the colours of a ranking mean, those that are in it."""
    names = [found.scores.scores[k].candidate.name for k in found.scores.best()[:RANKED]]
    drawn = {_colour(name, found) for name in names}
    said = {AFTER: "found", ALIKE: "not told apart from it", OTHER: "not taken"}
    return [Patch(color=c, lw=0, label=text) for c, text in said.items() if c in drawn]


def shown_coefficients(found: Discrepancy) -> list[str]:
    """Return the parameters that are drawn run by run: the sizes of what was found.

    Where nothing was found, the parameter that differs most between runs, by its errors. One run
    has nothing to be compared with.
    """
    if len(found.evidence.fitted) == 1:
        return []
    sizes = [standing.candidate.free[0] for standing in found.judgement.standings]
    known = [name for name in ("c_over_m", "w0", "Tr") if name in found.runs.coefficients]

    def apart(name: str) -> float:
        errors = [error for _, error in found.runs.shown(name)]
        return found.runs.between(name) / min(errors, default=math.inf)

    return sizes or ([max(known, key=apart)] if known else [])


def coefficient_handles(found: Discrepancy, shown: Iterable[str]) -> list[Artist]:
    """Return what is drawn run by run, marks of what is not seen where there are any."""
    bar = Line2D([], [], color=AFTER, marker="s", ms=4, lw=1.0, label="own value")
    handles: list[Artist] = [bar, Patch(color=blocks.NOISE, lw=0, label="all together")]
    past = blind = False
    for name in shown:
        low, high = _reach(found, name)
        pairs = found.runs.coefficients[name]
        past |= any(v - Z95 * e < low or v + Z95 * e > high for v, e in pairs if math.isfinite(e))
        blind |= any(not math.isfinite(e) for _, e in pairs)
    marks = [("^", "beyond the axis", past), ("x", "does not show", blind)]
    return handles + [
        Line2D([], [], color=style.QUIET, marker=mark, ls="", ms=4.5, label=text)
        for mark, text, there in marks
        if there
    ]


def _together(found: Discrepancy, shown: str) -> tuple[float, float]:
    """Return the interval of 95 % that all runs together leave a parameter, as it is stated.

    That of the effect found; of what is not claimed, by the standard error as the report widens it.
    """
    trial = found.nearest.trial
    estimate = trial.fit.estimates[shown]
    for standing, effect in zip(found.judgement.standings, found.effects, strict=False):
        bounds = effect.ci95.get(standing.candidate.size)
        if standing.candidate.free[0] == shown and bounds is not None:
            # A size below 0 may be stated as one above it, half a turn on.
            turned = estimate.value * effect.parameters[standing.candidate.size] < 0
            return (-bounds[1], -bounds[0]) if turned else bounds
    half = Z95 * math.sqrt(trial.widening) * (estimate.stderr or 0.0)
    return estimate.value - half, estimate.value + half


def _reach(found: Discrepancy, shown: str) -> tuple[float, float]:
    """Return the ends of the axis: a run that hardly shows the effect would hide the others."""
    mean = found.nearest.trial.fit.estimates[shown].value
    known = [(v, e) for v, e in found.runs.coefficients[shown] if math.isfinite(e)]
    errors = sorted(e for _, e in known)
    reach = 6 * errors[len(errors) // 2] if errors else 0.0
    spread = max((abs(v - mean) for v, e in known if e < reach), default=0.0)
    wide = max(abs(end - mean) for end in _together(found, shown))
    half = max(1.4 * spread, reach, 1.5 * wide) or 1.0
    return mean - half, mean + half


def draw_coefficients(axes: Axes, found: Discrepancy, shown: str) -> None:
    """Draw a parameter as each run would have it, over what all together have."""
    pairs = found.runs.coefficients[shown]
    known = [(k, v, e) for k, (v, e) in enumerate(pairs) if math.isfinite(e)]
    mean = found.nearest.trial.fit.estimates[shown].value
    power = 3 * math.floor(math.log10(abs(mean)) / 3) if mean else 0
    scale = 10.0**-power
    axes.axhspan(*(scale * end for end in _together(found, shown)), color=blocks.NOISE, lw=0)
    axes.errorbar(
        [k for k, _, _ in known],
        [scale * value for _, value, _ in known],
        yerr=[Z95 * scale * e for _, _, e in known],
        fmt="s",
        ms=4,
        lw=1.0,
        color=AFTER,
    )
    low, high = _reach(found, shown)
    axes.set_ylim(scale * low, scale * high)
    name_runs(axes, [run.name for run in found.evidence.fitted])
    ends = axes.get_xaxis_transform()
    marks: dict[str, Any] = {"color": style.QUIET, "ls": "", "ms": 4.5, "transform": ends}
    up = [k for k, v, e in known if v + Z95 * e > high]
    down = [k for k, v, e in known if v - Z95 * e < low]
    blind = [k for k, (_, e) in enumerate(pairs) if not math.isfinite(e)]
    for places, at, mark in ((up, 0.97, "^"), (down, 0.03, "v"), (blind, 0.06, "x")):
        axes.plot(places, [at] * len(places), mark, **marks)
    times = f"10$^{{{power}}}$ " if power else ""
    unit = f"{times}{unit_of(shown, found.definition)}".strip()
    own = shown.rpartition(".")[2]
    axes.set_ylabel(f"{own} ({unit})" if unit else own, labelpad=2)
    claimed = "" if found.effects else " (not claimed)"
    _entitle(axes, f"{shown}{claimed}")


def _entitle(axes: Axes, title: str) -> None:
    """Write a title above a panel, smaller where it is too long."""
    size = style.RC["axes.titlesize"]
    room = axes.get_window_extent().width / axes.figure.dpi
    axes.set_title(title, fontsize=size * min(1.0, 0.94 * room / style.inches(title, size)))
