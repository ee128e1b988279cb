"""The figure of one trajectory: time history, phase plane, Poincare section."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from matplotlib.patches import Patch

from pendmap.errors import InputError
from pendmap.figures import sheet as sheets
from pendmap.figures import style
from pendmap.model.units import Units
from pendmap.pictures import layers as layering
from pendmap.pictures import names, plane

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["PARTS", "figure"]

PARTS = ("history", "phase", "section")
"""Parts of the figure by the name a user types."""

LATE = 0.2
"""The last share of a trajectory, drawn dark, so that what it settles to stands out."""

FLAT = 0.1
"""Range in rad under which a history counts as a straight line."""

MANY = 500
"""Points of a section above which they are drawn smaller."""

LEGEND_ROOM = 2.6
"""Inches of a panel whose title leaves room for a legend beside it."""

_EARLY_COLOUR, _LATE_COLOUR, _REST_COLOUR = "#93a7c1", "#1d3557", "#f8edd6"


def figure(
    dataset: xr.Dataset,
    *,
    layer: str | None,
    size: tuple[float, float] | None,
    dpi: float,
    colormap: str | None,
) -> Figure:
    """Return the figure of a trajectory; see :func:`pendmap.figures.draw`."""
    if layer is not None and layer not in PARTS:
        raise InputError(f"no layer {layer!r} in a trajectory; it has {', '.join(PARTS)}")
    if colormap is not None:
        raise InputError(f"colormap {colormap!r}: a trajectory's figure has no colour map")
    width, height = size or ((5.6, 5.3) if layer in ("phase", "section") else (8.6, 6.9))
    if size is None and layer == "history":
        height = 3.6
    across, down = width - sheets.LEFT - sheets.RIGHT, height - sheets.TOP - sheets.BOTTOM
    gap_x, gap_y = 0.8, 0.9
    need = (2.0, 2.2) if layer is None else (sheets.LEAST, sheets.LEAST)
    if across < need[0] or down < need[1]:
        least = f"{width - across + need[0]:.1f} x {height - down + need[1]:.1f}"
        raise InputError(
            f"size {size} leaves no room for the panels; it must be at least {least} inches"
        )
    sheet = sheets.headed((width, height), dpi, "Trajectory", _subtitle(dataset))
    draw = {"history": _history, "phase": _phase, "section": _section}
    if layer is not None:
        draw[layer](sheets.place(sheet, sheets.LEFT, sheets.BOTTOM, across, down), dataset, "")
        return sheet
    half, top = (across - gap_x) / 2, 0.36 * (down - gap_y)
    low = down - gap_y - top
    first = sheets.place(sheet, sheets.LEFT, height - sheets.TOP - top, across, top)
    second = sheets.place(sheet, sheets.LEFT, sheets.BOTTOM, half, low)
    third = sheets.place(sheet, sheets.LEFT + half + gap_x, sheets.BOTTOM, half, low)
    for axes, part, mark in zip((first, second, third), PARTS, "abc", strict=True):
        draw[part](axes, dataset, f"({mark}) ")
    return sheet


def _subtitle(dataset: xr.Dataset) -> str:
    attrs = dataset.attrs
    start = f"from \N{GREEK SMALL LETTER THETA} = {float(attrs['theta0']):.6g}, "
    units = Units.of(attrs)
    start += f"{names.velocity(units)} = {units.spoken(format(float(attrs['velocity0']), '.6g'))}"
    return f"{layering.parameters(attrs)};   {start}".replace("-", "\N{MINUS SIGN}")


def _history(axes: Axes, dataset: xr.Dataset, mark: str) -> None:
    time, theta = dataset["time"].values, dataset["theta"].values
    late = _late(time)
    axes.plot(time[: late + 1], theta[: late + 1], color=_EARLY_COLOUR, lw=1.0)
    axes.plot(time[late:], theta[late:], color=_LATE_COLOUR, lw=1.0)
    axes.margins(x=0.0, y=0.06)
    low, high = axes.get_ylim()
    if high - low < FLAT:
        axes.set_ylim(low - FLAT, high + FLAT)
    style.scale(axes, "y", axes.get_ylim(), names.ANGLE, angle=True)
    if time[-1] > time[0]:
        clock = names.clock(Units.of(dataset.attrs))
        style.scale(axes, "x", (float(time[0]), float(time[-1])), clock)
    _at_rest(axes, dataset)
    axes.set_title(mark + "time history")


def _at_rest(axes: Axes, dataset: xr.Dataset) -> None:
    """Shade the times at which friction holds the pendulum, and say so above the panel."""
    spans = resting(dataset)
    if not len(spans):
        return
    widths = [(begin, end - begin) for begin, end in spans]
    across = axes.get_xaxis_transform()
    axes.broken_barh(widths, (0.0, 1.0), transform=across, color=_REST_COLOUR, lw=0, zorder=0)
    box = axes.get_window_extent()
    if box.width / axes.figure.dpi < LEGEND_ROOM:
        return
    axes.legend(
        [Patch(color=_REST_COLOUR, lw=0)],
        ["at rest"],
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        borderpad=0.0,
        borderaxespad=0.4,
        handlelength=1.4,
        handletextpad=0.5,
    )


def resting(dataset: xr.Dataset) -> npt.NDArray[np.float64]:
    """Return when friction holds the pendulum, from and to, shape (n, 2)."""
    if "event_kind" not in dataset:
        return np.empty((0, 2))
    kinds, times = dataset["event_kind"].values, dataset["event_time"].values
    last = float(dataset["time"].values[-1])
    begins = times[kinds == "stick"]
    ends = np.append(times[kinds == "release"], last)[: begins.size]
    return np.stack([begins, ends], axis=1)


def _phase(axes: Axes, dataset: xr.Dataset, mark: str) -> None:
    theta, velocity = dataset["theta"].values, dataset["velocity"].values
    late = _late(dataset["time"].values)
    early = plane.broken_at_wrap(theta[: late + 1], velocity[: late + 1])
    last = plane.broken_at_wrap(theta[late:], velocity[late:])
    axes.plot(early[:, 0], early[:, 1], color=_EARLY_COLOUR, lw=0.5)
    axes.plot(last[:, 0], last[:, 1], color=_LATE_COLOUR, lw=0.7)
    if dataset.attrs.get("stuck"):
        rest = plane.wrapped(theta[-1:])
        axes.plot(rest, velocity[-1:], "o", ms=3.5, mew=0, color=_LATE_COLOUR)
    style.phase_plane(axes, (-math.pi, math.pi), plane.padded(velocity), Units.of(dataset.attrs))
    axes.set_title(mark + "phase plane")


def _section(axes: Axes, dataset: xr.Dataset, mark: str) -> None:
    theta, velocity = dataset["section_theta"].values, dataset["section_velocity"].values
    time = dataset["time"].values
    late = dataset["section_time"].values >= time[_late(time)] if time.size else []
    size = 1.3 if theta.size > MANY else 2.6
    for which, colour in ((~np.asarray(late, bool), _EARLY_COLOUR), (late, _LATE_COLOUR)):
        axes.plot(theta[which], velocity[which], "o", ms=size, mew=0, color=colour)
    speeds = plane.padded(dataset["velocity"].values)
    style.phase_plane(axes, (-math.pi, math.pi), speeds, Units.of(dataset.attrs))
    axes.set_title(mark + "Poincar\N{LATIN SMALL LETTER E WITH ACUTE} section, once a period")


def _late(time: npt.NDArray[np.float64]) -> int:
    """Return the first index of the last part."""
    if time.size == 0:
        return 0
    return int(np.searchsorted(time, time[-1] - LATE * (time[-1] - time[0])))
