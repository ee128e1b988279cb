"""Candidates of a diagnosis: their scores, and a coefficient run by run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.discrepancy.select import GATE
from pendmap.figures import blocks, style
from pendmap.figures.gap import AFTER, short
from pendmap.pictures.names import unit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pendmap.discrepancy import Discrepancy

__all__ = ["draw_coefficients", "draw_ranking", "shown_coefficients"]

RANKED: Final = 8
"""Candidates in the ranking."""

Z95: Final = 1.959963984540054


def draw_ranking(axes: Axes, found: Discrepancy) -> None:
    """Draw the greatest scores at the baseline, those of the effects found in colour."""
    best = [found.scores.scores[k] for k in found.scores.best()[:RANKED]]
    level = found.base.trial.remainder.level
    named = {effect.name for effect in found.effects}
    values = [max(score.gain / level, 0.1) for score in best]
    places = np.arange(len(best))[::-1]
    colours = [AFTER if score.candidate.name in named else "#9a9a9a" for score in best]
    axes.barh(places, values, color=colours, height=0.7)
    axes.axvline(GATE, color=style.INK, lw=0.9, ls="--")
    axes.set_xscale("log")
    axes.set_xlim(1, max(30.0, 2 * max(values, default=1.0)))
    axes.set_yticks(places, [score.candidate.name for score in best])
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel(f"score G;  dashed: {GATE:g}")
    # The names stand left of the bars, and the title above them.
    axes.set_title("Candidates at the baseline", x=-0.75)


def shown_coefficients(found: Discrepancy) -> list[str]:
    """Return the parameters that are drawn run by run: the sizes of what was found."""
    sizes = [standing.candidate.free[0] for standing in found.judgement.standings]
    known = found.runs.coefficients
    return sizes or next(([name] for name in ("c_over_m", "w0") if name in known), [])


def draw_coefficients(axes: Axes, found: Discrepancy, shown: str) -> None:
    """Draw a parameter as each run would have it, over what all together have."""
    fit = found.nearest.trial.fit
    pairs = found.runs.coefficients[shown]
    known = [(k, v, e) for k, (v, e) in enumerate(pairs) if math.isfinite(e)]
    mean, error = fit.estimates[shown].value, fit.estimates[shown].stderr or 0.0
    power = 3 * math.floor(math.log10(abs(mean)) / 3) if mean else 0
    scale = 10.0**-power
    low, high = (scale * (mean + sign * Z95 * error) for sign in (-1, 1))
    axes.axhspan(low, high, color=blocks.NOISE, lw=0, zorder=0)
    axes.errorbar(
        range(len(known)),
        [scale * value for _, value, _ in known],
        yerr=[Z95 * scale * e for _, _, e in known],
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
    names = [short(found.evidence.fitted[k].name) for k, _, _ in known]
    axes.set_xticks(range(len(known)), names, rotation=45, ha="right")
    times = f"10$^{{{power}}}$ " if power else ""
    axes.set_ylabel(f"{times}{unit_of(shown, found.definition)}".strip(), labelpad=2)
    claimed = "" if found.effects else " (not claimed)"
    axes.set_title(f"{shown} run by run{claimed}")
