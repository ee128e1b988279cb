"""Panels of a forced run beside a model: what it does, its steady state, its statistics."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.patches import Patch

from pendmap.charts import names, plane
from pendmap.charts.methods import MEASURED, look
from pendmap.comparison.forced_summary import written
from pendmap.comparison.free import MODEL
from pendmap.render import sides, style
from pendmap.units import Units

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from pendmap.comparison import ForcedComparison
    from pendmap.comparison.forced import Statistic

    Floats = NDArray[np.float64]

_SI: Final = Units(si=True)
_WELLS: Final = 14
"""Wells up to which each has a band."""
_MOST: Final = 20_000
"""Samples of a curve."""
_BAND: Final = "#f0f0f0"
_SPREAD: Final = "#9ecae1"
"""Colours of every other well, and of an ensemble."""
_TURNS: Final = "\N{GREEK SMALL LETTER THETA}/2\N{GREEK SMALL LETTER PI} (turns)"
_EVERY: Final = 3
"""Of the samples of a measured cycle, every so many are drawn."""
_PAD: Final = 0.08
_BINS: Final = 24
_TALL: Final = 0.45
"""Height of a histogram, over its row's."""


def legend() -> tuple[list[Artist], list[str]]:
    """Return what the shades in these panels mean."""
    later = Patch(facecolor=_SPREAD, hatch="////", lw=0)
    handles: list[Artist] = [Patch(color=_BAND, lw=0), Patch(color=_SPREAD, lw=0), later]
    return handles, ["every other well", "ensemble", "not settled by the end"]


def draw_history(axes: Axes, time: Floats, reading: Floats, colour: str) -> None:
    """Draw the angle in turns against time; wells are bands."""
    every = max(1, time.size // _MOST)
    turns = reading / math.tau
    low, high = math.floor(turns.min() + 0.5), math.ceil(turns.max() - 0.5)
    if high - low < _WELLS:
        for well in range(low, high + 1, 2):
            axes.axhspan(well - 0.5, well + 0.5, color=_BAND, lw=0, zorder=0)
    axes.plot(time[::every], turns[::every], color=colour, lw=0.6)
    ends = float(time[0]), float(time[-1])
    axes.set_xlim(*ends)
    sides.scale(axes, "x", ends, names.clock(_SI))
    pad = _PAD * max(float(np.ptp(turns)), 0.1)
    limits = float(turns.min()) - pad, float(turns.max()) + pad
    axes.set_ylim(*limits)
    sides.scale(axes, "y", limits, _TURNS)


def draw_phase(axes: Axes, path: tuple[Floats, Floats], colour: str, fastest: float) -> None:
    """Draw readings and velocities in the phase plane, wrapped; ``fastest`` ends the axis."""
    curve = plane.broken_at_wrap(path[0][:_MOST], path[1][:_MOST])
    axes.plot(curve[:, 0], curve[:, 1], color=colour, lw=0.4)
    reach = (1 + _PAD) * fastest
    sides.phase_plane(axes, (-math.pi, math.pi), (-reach, reach), _SI)


def draw_cycles(axes: Axes, one: ForcedComparison) -> None:
    """Draw the steady state of a record as points, and the model's as a line."""
    found = one.steady
    if found is None:
        return
    every = [cycle for cycle in (found.measured, found.model) if cycle is not None]
    if found.model is not None:
        theta, velocity = _closed(found.model.theta, found.model.w), found.model.velocity
        curve = plane.broken_at_wrap(theta, np.append(velocity, velocity[0]))
        axes.plot(curve[:, 0], curve[:, 1], color=look(MODEL).colour, lw=1.2)
    wrapped = (found.measured.theta + math.pi) % math.tau - math.pi
    some = slice(None, None, _EVERY)
    axes.plot(
        wrapped[some], found.measured.velocity[some], "o", mec=MEASURED, mfc="none", ms=4, mew=0.8
    )
    speeds = np.concatenate([cycle.velocity for cycle in every])
    turning = found.measured.w != 0
    reach = math.pi if turning else (1 + _PAD) * max(float(np.abs(c.theta).max()) for c in every)
    angles = (-reach, reach)
    sides.phase_plane(axes, angles, plane.padded(speeds), _SI)


def _closed(theta: Floats, w: int) -> Floats:
    return np.append(theta, theta[0] + math.tau * w)


def draw_statistics(axes: Axes, one: ForcedComparison) -> None:
    """Draw each statistic in a row: the ensemble's histogram, and the record's value as a mark.

    What has not come by the record's end stands hatched at the right.
    """
    count = len(one.statistics)
    room = axes.get_window_extent().width / axes.figure.dpi
    for k, each in enumerate(one.statistics):
        base = count - 1 - k
        _row(axes, each, base)
        own, low, high = (written(each, value, 3) for value in (each.measured, *each.ci95))
        unit = f" {each.unit}" if each.unit and math.isfinite(each.ci95[0]) else ""
        said = f"{each.name} {own} ({low if low == high else f'{low} to {high}'}){unit}"
        at = base + _TALL + 0.07
        font = style.RC["xtick.labelsize"]
        font *= min(1.0, room / style.inches(said, font))
        axes.text(0.0, at, said, fontsize=font, va="bottom")
    axes.set_xlim(-0.02, 1.02)
    axes.set_ylim(-0.02, count + 0.02)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_axis_off()


def _row(axes: Axes, each: Statistic, base: float) -> None:
    known = each.ensemble[np.isfinite(each.ensemble)]
    ends = np.append(known, each.measured if math.isfinite(each.measured) else known[:0])
    low, high = (float(ends.min()), float(ends.max())) if ends.size else (0.0, 1.0)
    wide = high - low or 1.0
    whole = not each.unit and wide < _BINS
    edges = np.arange(low - 0.5, high + 1) if whole else np.linspace(low, low + wide, _BINS + 1)
    counts, edges = np.histogram(known, edges)
    never = each.ensemble.size - known.size
    tall = _TALL * counts / max(counts.max(initial=0), never, 1)
    # What has not come by the end stands at the right, outside.
    scale = (edges - edges[0]) / (edges[-1] - edges[0]) * 0.9
    axes.bar(scale[:-1], tall, np.diff(scale), base, align="edge", color=_SPREAD, lw=0)
    if never:
        share = _TALL * never / max(counts.max(initial=0), never)
        axes.bar(0.95, share, 0.05, base, align="edge", color=_SPREAD, hatch="////", lw=0)
    axes.plot([0, 1], [base, base], color=style.QUIET, lw=0.6)
    at = 0.975
    if math.isfinite(each.measured):
        at = (each.measured - edges[0]) / (edges[-1] - edges[0]) * 0.9
    axes.plot([at, at], [base, base + _TALL], color=MEASURED, lw=1.6)
