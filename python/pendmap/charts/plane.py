"""Geometry of panels: cell edges, ticks, thinned maps and curves, copies of points, wrapping."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from pendmap.charts.chart import holding
from pendmap.formatting import typographic

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.charts.chart import Axis
    from pendmap.charts.marks import Floats

Ticks = list[tuple[float, str]]
TWO_PI = 2.0 * math.pi
FEWEST, MOST = 2.0, 6.5  # Least and greatest number of tick steps of a range of angles
FURTHEST = 1000  # Multiple of pi beyond which angles have plain numbers as labels
NARROW = 1e-4
"""Width of a window, relative to its distance from 0, below which its ticks have an offset."""
_FINE = 8  # Pixels of the narrowest cell if cells differ in width
MOST_COPIES = 100  # Greatest number of copies of a point, at distances of 2 pi, in a window


def edges(dataset: xr.Dataset, name: str) -> Floats:
    """Return the edges of the cells along a rising axis of N values, shape (N + 1,).

    The outer edges are those of the outermost cells; an inner edge is midway between the edges of
    two cells. Cells have the bounds that the axis names (CF conventions); without them each extends
    halfway to its neighbours, and a single cell is 1 wide.
    """
    axis = dataset[name]
    x = np.asarray(axis.values, dtype=float)
    bounds = axis.attrs.get("bounds")
    if bounds in dataset:
        pairs = np.sort(np.asarray(dataset[bounds].transpose(name, ...).values, dtype=float))
        first, last = pairs[0, 0], pairs[-1, 1]
        between = 0.5 * (pairs[:-1, 1] + pairs[1:, 0])
    elif x.size > 1:
        between = 0.5 * (x[:-1] + x[1:])
        first, last = 2 * x[0] - between[0], 2 * x[-1] - between[-1]
    else:
        first, between, last = x[0] - 0.5, x[:0], x[0] + 0.5
    return np.array([first, *between, last])


def outer_edges(dataset: xr.Dataset, name: str) -> tuple[float, float]:
    """Return the first and the last of the edges of the cells along an axis."""
    every = edges(dataset, name)
    return float(every[0]), float(every[-1])


def pixels(dataset: xr.Dataset, array: xr.DataArray, limit: int) -> npt.NDArray[Any]:
    """Return an array over two rising axes as an image of at most ``limit`` pixels along each."""
    shown = {str(d): cells(edges(dataset, str(d)), limit) for d in array.dims}
    return np.asarray(array.isel(shown).values)


def cells(bounds: Floats, limit: int) -> npt.NDArray[np.intp] | slice:
    """Return the index of the cell of each pixel between these edges."""
    count, whole = bounds.size - 1, float(bounds[-1] - bounds[0])
    widths = np.diff(bounds)
    rounding = 8 * np.finfo(float).eps * float(np.abs(bounds).max())
    if np.ptp(widths) <= 1e-6 * widths.mean() + rounding:
        if count <= limit:
            return slice(None)
        return ((np.arange(limit) + 0.5) * (count / limit)).astype(np.intp)
    narrowest = max(float(widths.min()), _FINE * whole / limit)
    shown = min(limit, math.ceil(_FINE * whole / narrowest))
    centres = bounds[0] + (np.arange(shown) + 0.5) * (whole / shown)
    inside: npt.NDArray[np.intp] = np.searchsorted(bounds[1:-1], centres, side="right")
    return inside


def on_line(dataset: xr.Dataset) -> bool:
    """Return whether angles are not wrapped, because an effect depends on the number of turns."""
    return str(dataset.attrs.get("angle")) == "line"


def angles(dataset: xr.Dataset, theta: Floats) -> tuple[float, float]:
    """Return the limits of an axis of angles: one turn, or all angles if they are not wrapped."""
    return holding(theta) if on_line(dataset) and theta.size else (-math.pi, math.pi)


def points(dataset: xr.Dataset) -> Floats:
    """Return the stroboscopic points of a result, shape (m, 2): angle in rad, velocity."""
    return np.stack([dataset["point_theta"].values, dataset["point_velocity"].values], axis=1)


def copies(dataset: xr.Dataset, points: Floats, low: float, high: float) -> Floats:
    """Return the points, shape (m, 2), in [low, high], with their copies shifted by 2 pi k."""
    if on_line(dataset):
        return points[(points[:, 0] >= low) & (points[:, 0] <= high)]
    if high - low > MOST_COPIES * TWO_PI:
        return np.empty((0, 2))
    slack = 1e-9 * max(1.0, abs(low), abs(high))
    first = math.floor((low - math.pi) / TWO_PI)
    last = math.ceil((high + math.pi) / TWO_PI)
    every = np.concatenate([points + np.array([k * TWO_PI, 0.0]) for k in range(first, last + 1)])
    inside: Floats = every[(every[:, 0] >= low - slack) & (every[:, 0] <= high + slack)]
    return inside


def ticks(axis: Axis, low: float, high: float, most: int = 8) -> tuple[str, Ticks]:
    """Return the name of an axis and its ticks with labels between two ends, about ``most``."""
    name, listed = axis.name, list(axis.ticks or ())
    if axis.ticks is None and axis.scale == "log":
        listed = [(at, power(at)) for at in log_ticks(low, high, most)]
    elif axis.ticks is None and axis.scale == "signed":
        last = max(0, math.floor(math.log10(max(-low, high) / axis.straight)))
        sizes = [axis.straight * 10.0**k for k in range(last, -1, -(2 * last + 3) // most)]
        listed = [(at, power(at)) for size in sizes for at in (-size, size)] + [(0.0, "0")]
    elif axis.ticks is None:
        shift, short = short_ticks(low, high, angle=axis.scale == "angle")
        zero = next((k for k, tick in enumerate(short) if tick[1] == "0"), 0)
        every = -(-len(short) // most)
        listed = [(shift + at, text) for at, text in short[zero % every :: every]]
        name = shifted(name, shift)
    slack = 1e-9 * (high - low)
    return name, [one for one in listed if low - slack <= one[0] <= high + slack]


def angle_ticks(low: float, high: float) -> Ticks:
    """Return a few ticks at multiples of pi, or plain numbers in a small or distant window."""
    if max(abs(low), abs(high)) > FURTHEST * math.pi:
        return plain_ticks(low, high)
    for quarters in (2**k for k in range(12)):
        step = quarters * math.pi / 4
        if FEWEST <= (high - low) / step <= MOST:
            return [(k * step, _multiple_of_pi(k * quarters)) for k in _between(low, high, step)]
    return plain_ticks(low, high)


def plain_ticks(low: float, high: float) -> Ticks:
    """Return about five ticks at round numbers from ``low`` to ``high``, with labels."""
    raw = (high - low) / 6
    size = max(abs(low), abs(high))
    if not (size * 1e-15 < raw < math.inf) or raw < sys.float_info.min:
        return [(low, _written(low, 17))]  # narrower than the resolution of floating-point numbers
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(m * power for m in (1, 2, 2.5, 5, 10) if m * power >= raw * 0.999)
    digits = min(17, max(6, 3 + math.floor(math.log10(size / step))))
    return [(k * step, _written(k * step, digits)) for k in _between(low, high, step)]


def log_ticks(low: float, high: float, most: int = 8) -> list[float]:
    """Return at most ``most`` ticks at 1, 2, 5, or 1, 3, or 1 times powers of ten."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    listed: list[float] = []
    for steps in ((1, 2, 5), (1, 3), (1,)):
        every = (m * 10.0**k for k in powers for m in steps)
        listed = [at for at in every if low * 0.999 <= at <= high * 1.001]
        if len(listed) <= most:
            break
    if len(listed) < 3:  # noqa: PLR2004 (a scale)
        return [at for at, _ in plain_ticks(low, high)]
    return listed[:: -(-len(listed) // most)]


def short_ticks(low: float, high: float, *, angle: bool) -> tuple[float, Ticks]:
    """Return the offset subtracted from an axis, usually 0, and the ticks of the difference."""
    shift = _offset(low, high)
    make = angle_ticks if angle and not shift else plain_ticks
    return shift, make(low - shift, high - shift)


def power(value: float) -> str:
    """Return a label of a logarithmic axis, short for powers of ten."""
    if value == 0:
        return "0"
    size = math.log10(abs(value))
    if abs(size - round(size)) < 1e-9 and not -3 <= size <= 3:  # noqa: PLR2004
        return f"${'-' * (value < 0)}10^{{{round(size)}}}$"
    return typographic(f"{value:g}")


def shifted(name: str, shift: float) -> str:
    """Return an axis name (symbol, blank, unit) with the offset subtracted from the axis."""
    if not shift:
        return name
    symbol, _, unit = name.partition(" ")
    sign = "-" if shift > 0 else "+"
    return typographic(f"{symbol} {sign} {abs(shift):.15g} {unit}".strip())


def broken_at_wrap(theta: npt.ArrayLike, velocity: npt.ArrayLike) -> Floats:
    """Return a curve on the cylinder, shape (n + 3 m, 2), its angle wrapped to (-pi, pi]."""
    angle, rate = np.asarray(theta, dtype=float), np.asarray(velocity, dtype=float)
    within = wrapped(angle)
    turn = np.round((angle - within) / TWO_PI)
    curve: Floats = np.stack([within, rate], axis=1)
    at = np.flatnonzero(np.diff(turn))
    edge = np.where(turn[at + 1] > turn[at], math.pi, -math.pi)
    part = (edge - within[at]) / (angle[at + 1] - angle[at])
    part = np.clip(part, 0.0, 1.0)  # rounding may be coarser than the steps
    crossing = rate[at] + part * (rate[at + 1] - rate[at])
    gap = np.full_like(edge, np.nan)
    extra = np.stack([edge, crossing, gap, gap, -edge, crossing], axis=1).reshape(-1, 2)
    return np.insert(curve, np.repeat(at + 1, 3), extra, axis=0)


def envelope(time: Floats, values: Floats, bins: int) -> tuple[Floats, Floats]:
    """Return the lowest and the highest sample of a curve in each of ``bins`` bins."""
    count = values.size
    if count <= 2 * bins:
        return time, values
    edges = np.linspace(0, count, bins + 1).astype(np.int64)
    # Bins differ by at most one sample: padded to the longest, each bin is a row.
    rows = np.minimum(edges[:-1, None] + np.arange(np.diff(edges).max()), edges[1:, None] - 1)
    of_rows, one = values[rows], np.arange(bins)
    lowest, highest = (rows[one, end(axis=1)] for end in (of_rows.argmin, of_rows.argmax))
    at = np.unique(np.concatenate([[0, count - 1], lowest, highest]))
    return time[at], values[at]


def wrapped(theta: Floats) -> Floats:
    """Return angles wrapped to (-pi, pi], for angles of any size."""
    within: Floats = math.pi - np.remainder(math.pi - theta, TWO_PI)
    return within


def _offset(low: float, high: float) -> float:
    """Return a round number near a window far from 0 relative to its width, else 0."""
    width = high - low
    if not 0.0 < width < NARROW * max(abs(low), abs(high)):
        return 0.0
    unit = 10.0 ** math.ceil(math.log10(width))
    return unit * round(low / unit)


def _written(value: float, digits: int) -> str:
    return typographic(f"{value:.{digits}g}")


def _between(low: float, high: float, step: float) -> range:
    return range(math.ceil(low / step - 1e-6), math.floor(high / step + 1e-6) + 1)


def _multiple_of_pi(quarters: int) -> str:
    """Return ``quarters * pi / 4`` in lowest terms, such as -3 pi/2."""
    if quarters == 0:
        return "0"
    divisor = math.gcd(quarters, 4)
    top, bottom = abs(quarters) // divisor, 4 // divisor
    sign, below = "-" if quarters < 0 else "", f"/{bottom}" if bottom > 1 else ""
    return typographic(f"{sign}{top if top > 1 else ''}π{below}")
