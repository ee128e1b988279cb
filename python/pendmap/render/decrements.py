"""The decrement of each three peaks against their size (figure 5), with the zero error and without.

A zero error ``b`` of the angle makes the drops between peaks alternate by ``2 b``, and with them
the decrements of triplets that begin at odd and at even peaks.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pendmap.charts.identification import MINUS
from pendmap.charts.methods import EVEN, MEASURED, NOISE, ODD, look
from pendmap.formatting import Estimate, estimate_text
from pendmap.identification.methods.combined import CUT, triplets
from pendmap.identification.table1 import first_state, simulated_peaks
from pendmap.render import blocks, sides, style

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from pendmap.identification import Identification, IdentificationReport, Peaks
    from pendmap.render.blocks import Box

    Floats = NDArray[np.float64]

DELTA: Final = "\N{GREEK SMALL LETTER DELTA}"
SIZE: Final = "middle peak |\N{GREEK SMALL LETTER THETA}| (rad)"
Z95: Final = 1.959963984540054
REACH: Final = 3.0
"""How far the signed panels reach, over the distance of nine tenths of the triplets from 0."""


@dataclasses.dataclass(frozen=True)
class Triplets:
    """Decrements of three peaks in a row (eq. 2.7), by the size of the middle peak in rad.

    ``delta`` is NaN where a peak is not smaller than the one before; its standard error is from
    those of the peaks; ``odd`` says whether the first of the three has an odd number.
    """

    size: Floats
    delta: Floats
    stderr: Floats
    odd: NDArray[np.bool_]


def triplets_of(peaks: Peaks, zero: float = 0.0) -> Triplets:
    """Return the triplets of neighbouring peaks, with a zero error (rad) taken off the angles.

    ``stderr(delta)**2 = [(s_0 / p)**2 + (s_1 (1/p + 1/q))**2 + (s_2 / q)**2] / pi**2`` with the
    drops ``p`` and ``q`` and the standard errors ``s_k`` of the peaks.
    """
    turned = peaks.turned
    size = np.abs(turned.amplitude - zero)
    if size.size < 3:  # noqa: PLR2004
        none = np.empty(0)
        return Triplets(none, none, none, np.empty(0, bool))
    delta, _ = triplets(size)
    row = turned.index[2:] - turned.index[:-2] == 2  # noqa: PLR2004
    stderr = _stderr(size, turned.stderr_amplitude)
    falling = (size[:-2] > size[1:-1]) & (size[1:-1] > size[2:])
    delta = np.where(falling, delta, np.nan)
    odd = turned.index[:-2] % 2 == 1
    return Triplets(size[1:-1][row], delta[row], stderr[row], odd[row])


def _stderr(size: Floats, error: Floats) -> Floats:
    """Standard errors of the triplets of absolute peaks with these standard errors."""
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = 1 / (size[:-2] - size[1:-1]), 1 / (size[1:-1] - size[2:])
        parts = (error[:-2] * first, error[1:-1] * (first + second), error[2:] * second)
    return np.asarray(np.sqrt(sum(part**2 for part in parts)) / math.pi)


def _height(report: IdentificationReport) -> float:
    return 5.0 if triplets_of(report.peaks).size.size else 0.9


def _zero(report: IdentificationReport) -> Estimate | None:
    """Return the zero error by the first method that knows it."""
    for found in report.methods.values():
        if found.applicable and "offset" in found.estimates:
            return found.estimates["offset"]
    return None


def _source(report: IdentificationReport) -> Identification | None:
    """Return the first method that knows frequency, damping and zero, or else the first two.

    Peaks of an angle that is only roughly made judge none.
    """
    if report.table.left_out:
        return None
    able = [found for found in report.methods.values() if found.applicable]
    for wanted in ({"w0", "c_over_m", "offset"}, {"w0", "c_over_m"}):
        for found in able:
            if wanted <= set(found.estimates):
                return found
    return None


def _draw(
    figure: Figure, box: Box, report: IdentificationReport, letters: Iterator[str], title: str
) -> None:
    raw, zero, source = triplets_of(report.peaks), _zero(report), _source(report)
    if not raw.size.size:
        room = blocks.named(figure, box, title)
        blocks.say(figure, room, "Fewer than three peaks in a row.")
        return
    odd, even = (
        Line2D([], [], color=colour, ls="none", marker=marker, ms=4, mfc=fill)
        for colour, marker, fill in ((ODD, "o", ODD), (EVEN, "s", "white"))
    )
    handles, texts = [even, odd], ["from an even peak", "from an odd peak"]
    if source is not None:
        name = look(source.method).label
        handles.append(Line2D([], [], color=MEASURED, lw=1.0))
        texts.append(f"{name}, simulated")
        handles.append(Line2D([], [], color=MEASURED, lw=1.0, ls="--"))
        texts.append(f"its {DELTA} = {_delta(source):.3g}")
        handles.append(Line2D([], [], color=style.QUIET, lw=1.0, ls=":"))
        texts.append("12\N{DEGREE SIGN}")
        if np.any(raw.stderr > 0):
            handles.append(Patch(color=NOISE, lw=0))  # type: ignore[arg-type]
            texts.append(blocks.NOISE_SAID)
    room = blocks.named(figure, box, title, handles, texts)
    columns = [("as recorded", raw, 0.0 if zero is None else zero.value)]
    if zero is not None:
        columns.append(("zero error removed", triplets_of(report.peaks, zero.value), 0.0))
    cells = room.columns(len(columns), 0.85)
    grid = [cell.rows([1.0, 1.0], [0.14 + blocks.TITLE]) for cell in cells]
    ends = (max(float(raw.size.min()) / 1.25, 1e-9), float(raw.size.max()) * 1.15)
    known = np.concatenate([c[1].delta[np.isfinite(c[1].delta)] for c in columns])
    level = abs(_delta(source)) if source is not None else 0.0
    for k, ((said, some, shift), (top, low)) in enumerate(zip(columns, grid, strict=True)):
        lost = int(np.isnan(some.delta).sum())
        count = f": {lost} of {some.delta.size} have none" if lost else ""
        axes = [top.panel(figure), low.panel(figure)]
        axes[0].set_title(f"{next(letters)}|{DELTA}|, {said}{count}")
        removed = f", {_removed(zero)} removed" if zero is not None and k else ""
        axes[1].set_title(f"{next(letters)}{DELTA}{removed}")
        for panel in axes:
            sides.log_axis(panel, "x", ends, SIZE)
        _log_height(axes[0], known, level)
        _signed_height(axes[1], known, level)
        if source is not None:
            for panel, absolute in zip(axes, (True, False), strict=True):
                _model(panel, report.peaks, source, shift, absolute=absolute)
        for panel, absolute in zip(axes, (True, False), strict=True):
            _points(panel, some, absolute=absolute)
        axes[0].set_xticklabels([])
        axes[0].set_xlabel("")


def _removed(zero: Estimate) -> str:
    error = None if zero.stderr is None else 1e3 * zero.stderr
    return f"{estimate_text(Estimate(1e3 * zero.value, error), minus=MINUS)} mrad"


def _delta(found: Identification) -> float:
    """``zeta / sqrt(1 - zeta^2)`` of what was found."""
    zeta = found["c_over_m"] / (2 * found["w0"])
    return zeta / math.sqrt(max(1 - zeta**2, 1e-12))


def _log_height(axes: Axes, known: Floats, level: float) -> None:
    sizes = np.abs(known[known != 0])
    everything = np.append(sizes, level) if level else sizes
    if not everything.size:
        everything = np.array([1e-3, 1.0])
    low = max(float(np.percentile(everything, 2)), float(everything.max()) * 1e-4)
    low = min(low, level) if level else low
    sides.log_axis(axes, "y", (low / 1.6, float(everything.max()) * 1.6), f"|{DELTA}|")


def _signed_height(axes: Axes, known: Floats, level: float) -> None:
    """Reach as far as most of the triplets; those beyond stand at the edge."""
    far = float(np.percentile(np.abs(known), 90)) if known.size else 1.0
    far = max(REACH * far if known.size < 10 else 1.35 * far, 4 * level, 1e-6)  # noqa: PLR2004
    axes.set_ylim(-far, far)
    sides.scale(axes, "y", (-far, far), DELTA)
    axes.axhline(0.0, color=style.QUIET, lw=0.6, zorder=0)


def _points(axes: Axes, some: Triplets, *, absolute: bool) -> None:
    low, high = axes.get_ylim()
    value = np.abs(some.delta) if absolute else some.delta
    for odd, colour, marker in ((False, EVEN, "s"), (True, ODD, "o")):
        which = (some.odd == odd) & np.isfinite(value)
        x, y = some.size[which], value[which]
        inside = (y >= low) & (y <= high)
        fill = colour if odd else "white"
        axes.plot(
            x[inside],
            y[inside],
            marker,
            color=colour,
            ms=3.0,
            mew=0.8,
            mfc=fill,
            ls="none",
            zorder=3,
        )
        for beyond, edge, arrow in ((y > high, high, "^"), (y < low, low, "v")):
            axes.plot(
                x[beyond],
                np.full(int(beyond.sum()), edge),
                arrow,
                color=colour,
                ms=3.6,
                mew=0,
                ls="none",
                clip_on=False,
                zorder=3,
            )


def _model(
    axes: Axes, peaks: Peaks, source: Identification, shift: float, *, absolute: bool
) -> None:
    """Draw the triplets of the simulated peaks, with their zero error, and the noise about them."""
    level = _delta(source)
    axes.axhline(abs(level) if absolute else level, color=MEASURED, lw=1.0, ls="--", zorder=2)
    axes.axvline(CUT, color=style.QUIET, lw=0.7, ls=":", zorder=1)
    turned, start = peaks.turned, first_state(peaks)
    own = source["offset"] if "offset" in source.estimates else 0.0
    begun = dataclasses.replace(start, theta=start.theta - own)
    _, angles = simulated_peaks(source.rig, begun, float(turned.time[-1]))
    size = np.abs(angles + shift)
    if size.size < 3:  # noqa: PLR2004
        return
    rising = np.argsort(np.abs(turned.amplitude))
    error = np.interp(size, np.abs(turned.amplitude)[rising], turned.stderr_amplitude[rising])
    delta, _ = triplets(size)
    wide = Z95 * _stderr(size, error)
    odd = (np.arange(delta.size) + int(turned.index[0])) % 2 == 1
    seen = np.isfinite(delta) & (size[1:-1] >= axes.get_xlim()[0])
    floor = axes.get_ylim()[0]
    for parity, colour in ((False, EVEN), (True, ODD)):
        which = seen & (odd == parity)
        x = size[1:-1][which]
        y = np.abs(delta[which]) if absolute else delta[which]
        axes.plot(x, y, color=colour, lw=1.0, zorder=2.5)
        low, high = np.maximum(y - wide[which], floor), y + wide[which]
        axes.fill_between(x, low, high, color=NOISE, alpha=0.7, lw=0, zorder=1)


BLOCK: Final = blocks.Block(
    "decrement",
    f"The decrement {DELTA} of each three peaks",
    _height,
    _draw,
)
