"""Sides of panels: ranges, and as many labels as have room, over many powers of ten too."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.charts import names, plane
from pendmap.charts.chart import Axis
from pendmap.render import style, ticks

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from pendmap.units import Units

MOSTLY: Final = 95
"""Percent of the curve nearest to 0 that its straight part holds."""
WIDE: Final = 2.0
"""Range of angles from which on multiples of pi are its labels, rad."""
LABEL: Final = 0.42
"""Inches that a label beside a panel may have."""
NARROW: Final = 12.0
"""Times its straight part that an axis reaches at most without powers of ten: so far what is small
is still seen on a straight axis, which needs no explanation."""
LINE: Final = 0.16
"""Inches between labels above one another."""


def wide_axis(axes: Axes, which: str, values: NDArray[np.float64], name: str) -> None:
    """Give a side the range of values with a margin, ticks and name."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    pad = 0.06 * (high - low) or max(abs(low), 1.0) * 0.05
    (axes.set_xlim if which == "x" else axes.set_ylim)(low - pad, high + pad)
    scale(axes, which, (low - pad, high + pad), name)


def scale(
    axes: Axes, which: str, limits: tuple[float, float], name: str, *, angle: bool = False
) -> None:
    """Give one side of a panel its ends, a handful of ticks and its name."""
    ticks.scale(axes, which, Axis(name, limits, "angle" if angle else "plain"))


def phase_plane(
    axes: Axes, theta: tuple[float, float], velocity: tuple[float, float], units: Units
) -> None:
    """Give axes the limits, ticks and names of the phase plane."""
    for which, side in zip("xy", names.phase_plane(theta, velocity, units), strict=True):
        ticks.scale(axes, which, side)


def angle_axis(axes: Axes, values: NDArray[np.float64], name: str = names.ANGLE) -> None:
    """Give the height a range in rad: multiples of pi, numbers, or where these are long, mrad."""
    wide_axis(axes, "y", values, name)
    low, high = axes.get_ylim()
    if high - low > WIDE and name == names.ANGLE:
        scale(axes, "y", (low, high), name, angle=True)
    elif (
        max(style.inches(text) for _, text in plane.short_ticks(low, high, angle=False)[1]) > LABEL
    ):
        milli = name.replace("(rad", "(mrad")
        ticks.scale(axes, "y", Axis(milli, (low, high), factor=1e3))


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
    ticks.scale(axes, which, Axis(name, ends, "log"))


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
        scale(axes, "y", (-1, 1), name)
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
    ticks.scale(axes, "y", Axis(name, ends, "signed", straight=inner))
    for end in (-inner, inner):
        axes.axhline(end, color=style.QUIET, lw=0.6, ls=":", zorder=0)
    _say_bent(axes, name, f"beyond \N{PLUS-MINUS SIGN}{ticks.power(inner)}")


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
