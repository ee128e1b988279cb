"""The figure of one trajectory: time history, energy, phase plane, Poincare section."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from matplotlib.patches import Patch

from pendmap.analysis.trajectory import energy
from pendmap.charts import basins as layering
from pendmap.charts import names, plane
from pendmap.charts.curves import envelope
from pendmap.errors import InputError
from pendmap.render import sheet as sheets
from pendmap.render import style
from pendmap.units import Units

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PARTS = ("history", "energy", "phase", "section")
"""Parts of the figure by the name a user types."""

LATE = 0.2
"""The last share of a trajectory, drawn dark, so that what it settles to stands out."""

FLAT = 0.1
"""Range in rad under which a history counts as a straight line."""

SIZES = ((500, 2.6), (20_000, 1.3), (math.inf, 0.6))
"""Sizes of the points of a section, each up to so many of them."""

UPSIDE_DOWN = 2.0
"""Energy over m g l of a pendulum that rests upside down."""

MOST_DRAWN = 20_000
"""Bins of a curve against time that is drawn by its lowest and highest values."""

MOST_PERIODS = 200
"""Periods of which the phase curve is drawn whole; of more it is the last half of so many."""

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
    """Return the figure of a trajectory; see :func:`pendmap.render.draw`."""
    if layer is not None and layer not in PARTS:
        raise InputError(f"no layer {layer!r} in a trajectory; it has {', '.join(PARTS)}")
    if colormap is not None:
        raise InputError(f"colormap {colormap!r}: a trajectory's figure has no colour map")
    width, height = size or ((5.6, 5.3) if layer in ("phase", "section") else (8.6, 8.2))
    if size is None and layer in ("history", "energy"):
        height = 3.6
    across, down = width - sheets.LEFT - sheets.RIGHT, height - sheets.TOP - sheets.BOTTOM
    gap_x, gap_y, gap_energy = 0.8, 0.9, 0.4
    need = (2.0, 3.2) if layer is None else (sheets.LEAST, sheets.LEAST)
    if across < need[0] or down < need[1]:
        least = f"{width - across + need[0]:.1f} x {height - down + need[1]:.1f}"
        raise InputError(
            f"size {size} leaves no room for the panels; it must be at least {least} inches"
        )
    sheet = sheets.headed((width, height), dpi, "Trajectory", _subtitle(dataset))
    draw = {"history": _history, "energy": _energy, "phase": _phase, "section": _section}
    if layer is not None:
        draw[layer](sheets.place(sheet, sheets.LEFT, sheets.BOTTOM, across, down), dataset, "")
        return sheet
    half, rest = (across - gap_x) / 2, down - gap_y - gap_energy
    top, middle = 0.32 * rest, 0.2 * rest
    low = rest - top - middle
    bottom = sheets.BOTTOM + low + gap_y
    first = sheets.place(sheet, sheets.LEFT, bottom + middle + gap_energy, across, top)
    second = sheets.place(sheet, sheets.LEFT, bottom, across, middle)
    third = sheets.place(sheet, sheets.LEFT, sheets.BOTTOM, half, low)
    fourth = sheets.place(sheet, sheets.LEFT + half + gap_x, sheets.BOTTOM, half, low)
    for axes, part, mark in zip((first, second, third, fourth), PARTS, "abcd", strict=True):
        draw[part](axes, dataset, f"({mark}) ")
    first.set_xlabel("")
    first.tick_params(labelbottom=False)  # one clock for both
    return sheet


def _subtitle(dataset: xr.Dataset) -> str:
    attrs = dataset.attrs
    start = f"from \N{GREEK SMALL LETTER THETA} = {float(attrs['theta0']):.6g}, "
    units = Units.of(attrs)
    start += f"{names.velocity(units)} = {units.spoken(format(float(attrs['velocity0']), '.6g'))}"
    return f"{layering.parameters(attrs)};   {start}".replace("-", "\N{MINUS SIGN}")


def _history(axes: Axes, dataset: xr.Dataset, mark: str) -> None:
    _against_time(axes, dataset, dataset["theta"].values)
    low, high = axes.get_ylim()
    if high - low < FLAT:
        axes.set_ylim(low - FLAT, high + FLAT)
    style.scale(axes, "y", axes.get_ylim(), names.ANGLE, angle=True)
    _at_rest(axes, dataset)
    axes.set_title(mark + "time history (dark: the last fifth)")


def _energy(axes: Axes, dataset: xr.Dataset, mark: str) -> None:
    theta, velocity = dataset["theta"].values, dataset["velocity"].values
    _against_time(axes, dataset, energy(theta, velocity, dataset.attrs))
    low, high = axes.get_ylim()
    if high - low < FLAT:
        axes.set_ylim(low - FLAT, high + FLAT)
    low, high = axes.get_ylim()
    style.scale(axes, "y", (low, high), "E / (m g l)")
    if low < UPSIDE_DOWN < high:  # above it, it can go over the top
        axes.axhline(UPSIDE_DOWN, color=style.QUIET, lw=0.8, ls=(0, (4, 3)), zorder=0)
    named = "energy" + (" (dashed: upside down at rest)" if low < UPSIDE_DOWN < high else "")
    axes.set_title(mark + named)


def _against_time(axes: Axes, dataset: xr.Dataset, values: npt.NDArray[np.float64]) -> None:
    """Draw a curve against time, its last part dark; a long one by its lowest and highest."""
    time = dataset["time"].values
    late = _late(time)
    for part, colour in (
        (slice(None, late + 1), _EARLY_COLOUR),
        (slice(late, None), _LATE_COLOUR),
    ):
        axes.plot(*envelope(time[part], values[part], MOST_DRAWN), color=colour, lw=1.0)
    axes.margins(x=0.0, y=0.06)
    if time[-1] > time[0]:
        clock = names.clock(Units.of(dataset.attrs))
        style.scale(axes, "x", (float(time[0]), float(time[-1])), clock)


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
    """Return when friction holds the pendulum within the times shown, from and to, shape (n, 2)."""
    if "event_kind" not in dataset:
        return np.empty((0, 2))
    kinds, times = dataset["event_kind"].values, dataset["event_time"].values
    first, last = (float(dataset["time"].values[end]) for end in (0, -1))
    begins, releases = times[kinds == "stick"], times[kinds == "release"]
    ends = np.append(releases, np.inf)[np.searchsorted(releases, begins)]
    spans = np.clip(np.stack([begins, ends], axis=1), first, last)
    within: npt.NDArray[np.float64] = spans[spans[:, 0] < spans[:, 1]]
    return within


def _phase(axes: Axes, dataset: xr.Dataset, mark: str) -> None:
    theta, velocity = dataset["theta"].values, dataset["velocity"].values
    late, first, which = _late(dataset["time"].values), 0, ""
    if dataset.sizes["period"] > MOST_PERIODS:
        beginning = dataset["section_time"].values[-1 - MOST_PERIODS // 2]
        late = first = int(np.searchsorted(dataset["time"].values, beginning))
        which = f", the last {MOST_PERIODS // 2} periods"
    early = plane.broken_at_wrap(theta[first : late + 1], velocity[first : late + 1])
    last = plane.broken_at_wrap(theta[late:], velocity[late:])
    axes.plot(early[:, 0], early[:, 1], color=_EARLY_COLOUR, lw=0.5)
    axes.plot(last[:, 0], last[:, 1], color=_LATE_COLOUR, lw=0.7)
    if (dataset.attrs.get("stuck") or np.ptp(theta) == 0.0) and velocity[-1] == 0.0:
        rest = plane.wrapped(theta[-1:])
        axes.plot(rest, velocity[-1:], "o", ms=3.5, mew=0, color=_LATE_COLOUR)
    style.phase_plane(axes, (-math.pi, math.pi), plane.padded(velocity), Units.of(dataset.attrs))
    axes.set_title(mark + "phase plane" + which)


def _section(axes: Axes, dataset: xr.Dataset, mark: str) -> None:
    theta, velocity = dataset["section_theta"].values, dataset["section_velocity"].values
    time = dataset["time"].values
    late = dataset["section_time"].values >= time[_late(time)] if time.size else []
    size = next(size for most, size in SIZES if theta.size <= most)
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
