"""The phase plane as it is drawn: cells, ticks, thinned maps, copies of points, wrapped curves."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "angle_ticks",
    "broken_at_wrap",
    "cell_edges",
    "copies",
    "padded",
    "plain_ticks",
    "shifted",
    "short_ticks",
    "thinned",
    "wrapped",
]

Floats = npt.NDArray[np.float64]
Ticks = list[tuple[float, str]]
TWO_PI = 2.0 * math.pi

FEWEST, MOST = 2.0, 6.5
"""Steps between ticks that a range of angles may have."""

FURTHEST = 1000
"""Multiples of pi beyond which angles are labelled with plain numbers."""

NARROW = 1e-4
"""Width of a window, relative to its distance from 0, under which its ticks have an offset."""

MOST_COPIES = 100
"""Copies of a point, 2 pi apart, that are told apart in a window."""


def cell_edges(axis: xr.DataArray) -> tuple[float, float]:
    """Return the outer edges of an axis of cells.

    Its attributes ``low`` and ``high``, or else half a cell beyond its equidistant centres, where a
    lone cell counts as 1 wide.
    """
    if "low" in axis.attrs and "high" in axis.attrs:
        return float(axis.attrs["low"]), float(axis.attrs["high"])
    x = np.asarray(axis.values, dtype=float)
    half = 0.5 * (x[-1] - x[0]) / (x.size - 1) if x.size > 1 else 0.5
    return float(x[0] - half), float(x[-1] + half)


def thinned(array: xr.DataArray, limit: int) -> npt.NDArray[Any]:
    """Return every k-th row and column, k the smallest that leaves at most ``limit`` of each.

    The cells are chosen before anything is converted, so that a large map is never copied whole.
    """
    strides = {d: -(-n // limit) for d, n in array.sizes.items()}
    cut = {d: slice((k - 1) // 2, None, k) for d, k in strides.items()}
    return np.asarray(array.isel(cut).values)


def copies(points: Floats, low: float, high: float) -> Floats:
    """Return the points, shape (m, 2), and their copies 2 pi k further that are in [low, high].

    None are returned where there would be more than a hundred of each.
    """
    if high - low > MOST_COPIES * TWO_PI:
        return np.empty((0, 2))
    slack = 1e-9 * max(1.0, abs(low), abs(high))
    first = math.floor((low - math.pi) / TWO_PI)
    last = math.ceil((high + math.pi) / TWO_PI)
    every = np.concatenate([points + np.array([k * TWO_PI, 0.0]) for k in range(first, last + 1)])
    inside: Floats = every[(every[:, 0] >= low - slack) & (every[:, 0] <= high + slack)]
    return inside


def angle_ticks(low: float, high: float) -> Ticks:
    """Return a handful of ticks at multiples of pi; plain numbers in a small or far window."""
    if max(abs(low), abs(high)) > FURTHEST * math.pi:
        return plain_ticks(low, high)
    for quarters in (2**k for k in range(12)):
        step = quarters * math.pi / 4
        if FEWEST <= (high - low) / step <= MOST:
            first, last = _between(low, high, step)
            return [(k * step, _multiple_of_pi(k * quarters)) for k in range(first, last + 1)]
    return plain_ticks(low, high)


def plain_ticks(low: float, high: float) -> Ticks:
    """Return about five round places between ``low`` and ``high`` with their labels."""
    raw = (high - low) / 6
    size = max(abs(low), abs(high))
    if not (size * 1e-15 < raw < math.inf) or raw < sys.float_info.min:
        return [(low, _written(low, 17))]  # narrower than numbers can tell apart
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(m * power for m in (1, 2, 2.5, 5, 10) if m * power >= raw * 0.999)
    first, last = _between(low, high, step)
    digits = min(17, max(6, 3 + math.floor(math.log10(size / step))))
    return [(k * step, _written(k * step, digits)) for k in range(first, last + 1)]


def short_ticks(low: float, high: float, *, angle: bool) -> tuple[float, Ticks]:
    """Return what is subtracted from an axis, usually 0, and the ticks of the difference."""
    shift = _offset(low, high)
    make = angle_ticks if angle and not shift else plain_ticks
    return shift, make(low - shift, high - shift)


def shifted(name: str, shift: float) -> str:
    """Return an axis's name, symbol and unit with a blank between, with what is subtracted."""
    if not shift:
        return name
    symbol, _, unit = name.partition(" ")
    sign = "\N{MINUS SIGN}" if shift > 0 else "+"
    return f"{symbol} {sign} {abs(shift):.15g} {unit}".strip()


def broken_at_wrap(theta: npt.ArrayLike, velocity: npt.ArrayLike) -> Floats:
    """Return a curve on the cylinder, its angle wrapped to (-pi, pi] and cut where it wraps.

    Parameters
    ----------
    theta : array_like, shape (n,)
        Angle in rad, unwrapped.
    velocity : array_like, shape (n,)
        Nondimensional velocity.

    Returns
    -------
    ndarray, shape (n + 3 m, 2)
        Each of the m crossings adds the point on one edge, a row of nan, and that on the other.
    """
    angle, rate = np.asarray(theta, dtype=float), np.asarray(velocity, dtype=float)
    within = wrapped(angle)
    turn = np.round((angle - within) / TWO_PI)
    curve: Floats = np.stack([within, rate], axis=1)
    at = np.flatnonzero(np.diff(turn))
    edge = np.where(turn[at + 1] > turn[at], math.pi, -math.pi)
    part = (edge - within[at]) / (angle[at + 1] - angle[at])
    part = np.clip(part, 0.0, 1.0)  # where rounding is coarser than the steps
    crossing = rate[at] + part * (rate[at + 1] - rate[at])
    gap = np.full_like(edge, np.nan)
    extra = np.stack([edge, crossing, gap, gap, -edge, crossing], axis=1).reshape(-1, 2)
    return np.insert(curve, np.repeat(at + 1, 3), extra, axis=0)


def wrapped(theta: Floats) -> Floats:
    """Return angles in (-pi, pi], also where they are as large as numbers get."""
    within: Floats = math.pi - np.remainder(math.pi - theta, TWO_PI)
    return within


def padded(values: Floats) -> tuple[float, float]:
    """Return the limits of an axis that holds the values, with a margin, never empty."""
    low, high = float(np.min(values)), float(np.max(values))
    pad = max(0.06 * (high - low), 0.05, 1e-6 * max(abs(low), abs(high)))
    return low - pad, high + pad


def _offset(low: float, high: float) -> float:
    """Return a round number near a window that is narrow for its distance from 0; else 0.

    Ticks of such a window are short as differences from it, and too long as they are.
    """
    width = high - low
    if not 0.0 < width < NARROW * max(abs(low), abs(high)):
        return 0.0
    unit = 10.0 ** math.ceil(math.log10(width))
    return unit * round(low / unit)


def _written(value: float, digits: int) -> str:
    return f"{value:.{digits}g}".replace("-", "\N{MINUS SIGN}")


def _between(low: float, high: float, step: float) -> tuple[int, int]:
    return math.ceil(low / step - 1e-6), math.floor(high / step + 1e-6)


def _multiple_of_pi(quarters: int) -> str:
    """Return ``quarters * pi / 4`` as it is written, such as -3 pi/2."""
    if quarters == 0:
        return "0"
    divisor = math.gcd(quarters, 4)
    top, bottom = abs(quarters) // divisor, 4 // divisor
    sign = "\N{MINUS SIGN}" if quarters < 0 else ""
    below = f"/{bottom}" if bottom > 1 else ""
    return f"{sign}{top if top > 1 else ''}\N{GREEK SMALL LETTER PI}{below}"
