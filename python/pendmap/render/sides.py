"""Sides of panels: ranges, and as many labels as have room, over many powers of ten too."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.ticker import NullFormatter, NullLocator

from pendmap.charts import names, plane
from pendmap.render import style

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

MOSTLY: Final = 95
"""Percent of the curve nearest to 0 that its straight part holds."""
WIDE: Final = 2.0
"""Range of angles from which on multiples of pi are its labels, rad."""
LABEL: Final = 0.42
"""Inches that a label beside a panel may have."""
NARROW: Final = 12.0
"""Times its straight part that an axis reaches at most without powers of ten: so far what is small
is still seen on a straight axis, which needs no explanation."""
CLOSE: Final = 5.0
"""Ratio of its ends under which a logarithmic axis has equally spaced labels."""
LINE: Final = 0.16
"""Inches between labels above one another."""


def wide_axis(axes: Axes, which: str, values: NDArray[np.float64], name: str) -> None:
    """Give a side the range of values with a margin, ticks and name."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    pad = 0.06 * (high - low) or max(abs(low), 1.0) * 0.05
    (axes.set_xlim if which == "x" else axes.set_ylim)(low - pad, high + pad)
    style.scale(axes, which, (low - pad, high + pad), name)


def angle_axis(axes: Axes, values: NDArray[np.float64], name: str = names.ANGLE) -> None:
    """Give the height a range in rad: multiples of pi, numbers, or where these are long, mrad."""
    wide_axis(axes, "y", values, name)
    low, high = axes.get_ylim()
    if high - low > WIDE and name == names.ANGLE:
        style.scale(axes, "y", (low, high), name, angle=True)
    elif style.widest(low, high) > LABEL:
        style.scale(axes, "y", (1e3 * low, 1e3 * high), name.replace("(rad", "(mrad"))
        texts = [text.get_text() for text in axes.get_yticklabels()]
        axes.set_yticks(axes.get_yticks() / 1e3, texts)
        axes.set_ylim(low, high)


def middle_axis(axes: Axes, reach: float, name: str) -> None:
    """Give a low panel three labels: 0 and a round number on both sides."""
    axes.set_ylim(-reach, reach)
    tick = float(f"{0.7 * reach:.1g}")
    tick = tick if tick < reach else tick / 2
    minus = "\N{MINUS SIGN}"
    apart = axes.get_window_extent().height / axes.figure.dpi * tick / (2 * reach)
    zero = "0" if apart >= LINE else ""
    axes.yaxis.set_ticks([-tick, 0.0, tick], [f"{minus}{tick:g}", zero, f"{tick:g}"])
    axes.set_ylabel(name, labelpad=2)


def log_axis(axes: Axes, which: str, ends: tuple[float, float], name: str) -> None:
    """Give a side a logarithmic scale, with as many labels as have room."""
    set_scale, set_ends, axis = (
        (axes.set_xscale, axes.set_xlim, axes.xaxis)
        if which == "x"
        else (axes.set_yscale, axes.set_ylim, axes.yaxis)
    )
    set_scale("log")
    set_ends(*ends)
    box = axes.get_window_extent()
    room = (box.width if which == "x" else box.height) / axes.figure.dpi
    decade = room / math.log10(ends[1] / ends[0])
    ticks = next(
        (some for some in _candidates(*ends) if _fits(some, decade, across=which == "x")), []
    )
    axis.set_ticks(ticks, [_power(tick) for tick in ticks])
    axis.set_minor_formatter(NullFormatter())
    axes.set_xlabel(name) if which == "x" else axes.set_ylabel(name, labelpad=2)


def _candidates(low: float, high: float) -> Iterator[list[float]]:
    """Sets of round numbers between two ends, the fullest that is wanted first."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    if high < CLOSE * low:
        ticks = [at for at, _ in plane.plain_ticks(low, high) if low <= at <= high]
        yield ticks
        yield ticks[::2]
    narrow = high < 20 * low
    for steps in ((1, 2, 3, 5), (1, 2, 5), (1, 3), (1,)) if narrow else ((1, 3), (1,)):
        ticks = [m * 10.0**k for k in powers for m in steps]
        yield [tick for tick in ticks if low <= tick <= high]
    for every in range(2, len(powers) + 1):
        yield [10.0**k for k in powers if k % every == 0 and low <= 10.0**k <= high]


def _fits(ticks: Sequence[float], decade: float, *, across: bool) -> bool:
    """Whether labels have room, where a power of ten takes ``decade`` inches."""
    for one, other in itertools.pairwise(ticks):
        wide = LINE
        if across:
            wide = (style.inches(f"{one:g}") + style.inches(f"{other:g}")) / 2 + 0.1
        if math.log10(other / one) * decade < wide:
            return False
    return True


def signed_log_axis(
    axes: Axes, values: Sequence[NDArray[np.float64]], name: str, *, least: float = 1e-12
) -> None:
    """Give the height powers of ten on both sides of 0, straight around it.

    The straight part holds nearly all of the curve that stays nearest to 0: its noise makes no
    towers there, and what is a thousand times farther off is seen too. Dots mark where it ends, and
    the axis' name says so: nobody sees it by the curves.
    """
    known = [each[np.isfinite(each)] for each in values]
    known = [each for each in known if np.any(each != 0)]
    if not known:
        axes.set_ylim(-1, 1)
        style.scale(axes, "y", (-1, 1), name)
        return
    inner = min(float(np.percentile(np.abs(each), MOSTLY)) for each in known)
    inner = 10.0 ** math.ceil(math.log10(max(inner, least)) - 0.3)
    low = min(float(each.min()) for each in known)
    high = max(float(each.max()) for each in known)
    axes.axhline(0.0, color=style.QUIET, lw=0.6, zorder=0)
    if max(-low, high) <= NARROW * inner:
        wide_axis(axes, "y", np.array([low, high, 0.0]), name)
        return
    ends = (min(1.5 * low, -1.2 * inner), max(1.5 * high, 1.2 * inner))
    axes.set_yscale("symlog", linthresh=inner, linscale=1.0)
    axes.set_ylim(*ends)
    ticks = next(some for some in _signed_ticks(inner, ends) if _apart(axes, some))
    axes.yaxis.set_ticks(ticks, [_power(tick) for tick in ticks])
    axes.yaxis.set_minor_locator(NullLocator())
    for end in (-inner, inner):
        axes.axhline(end, color=style.QUIET, lw=0.6, ls=":", zorder=0)
    _say_bent(axes, name, f"beyond \N{PLUS-MINUS SIGN}{_power(inner)}")


def _say_bent(axes: Axes, name: str, beyond: str) -> None:
    """Name the height and where it is logarithmic: beside the panel, or above a low one."""
    size = style.RC["xtick.labelsize"]
    room = axes.get_window_extent().height / axes.figure.dpi
    for said in (f"logarithmic {beyond}", f"log {beyond}"):
        if style.inches(said, style.RC["font.size"]) <= room:
            axes.set_ylabel(f"{name}\n{said}", labelpad=2)
            return
    axes.set_ylabel(name, labelpad=2)
    axes.set_title(f"logarithmic {beyond}", loc="right", fontsize=size, color=style.QUIET)


def _signed_ticks(inner: float, ends: tuple[float, float]) -> Iterator[list[float]]:
    """Sets of round numbers on both sides of 0 from where the powers begin, the fullest first."""
    low, high = ends
    first, last = round(math.log10(inner)), math.floor(math.log10(max(-low, high)))
    for steps, every in (((1, 2, 5), 1), ((1, 3), 1), *(((1,), k) for k in range(1, 40))):
        # From the greatest down: it says how far the axis reaches.
        powers = range(last, first - 1, -every)
        sizes = sorted(m * 10.0**k for k in powers for m in steps)
        ticks = [*(-size for size in reversed(sizes)), 0.0, *sizes]
        yield [tick for tick in ticks if low <= tick <= high]


def _apart(axes: Axes, ticks: Sequence[float]) -> bool:
    """Whether labels above one another have room."""
    places = axes.transData.transform([(axes.get_xlim()[0], tick) for tick in ticks])[:, 1]
    return len(ticks) < 2 or float(np.diff(places).min()) / axes.figure.dpi >= LINE  # noqa: PLR2004


def headroom(axes: Axes, inches: float) -> None:
    """Raise the upper end of the height so that ``inches`` stay free above what is drawn."""
    share = inches * axes.figure.dpi / axes.get_window_extent().height
    bent = axes.yaxis.get_transform()
    low, high = bent.transform(np.array(axes.get_ylim()))
    top = high + (high - low) * share / (1 - share)
    axes.set_ylim(top=float(bent.inverted().transform(np.array([top]))[0]))


def _power(value: float) -> str:
    """Return a tick's label, short for any power of ten."""
    if value == 0:
        return "0"
    sign = "\N{MINUS SIGN}" if value < 0 else ""
    size = abs(value)
    power = math.log10(size)
    if abs(power - round(power)) < 1e-9 and not -3 <= power <= 3:  # noqa: PLR2004
        return f"${sign.replace(chr(0x2212), '-')}10^{{{round(power)}}}$"
    return f"{sign}{size:g}"
