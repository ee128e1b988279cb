"""Where critical curves need more frequencies: they turn, end or bend between two of them."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

__all__ = ["Curves", "denser"]

Floats: TypeAlias = NDArray[np.float64]

Curves: TypeAlias = "list[Floats]"
"""Amplitudes at one frequency, ascending, one array for each kind of curve."""

_BENT = 1e-3
"""A line may miss its curve by this part of the picture's height."""

_STEP = 1 / 4000
"""Bends are resolved down to this part of the picture's width."""

_NOSE = 1e-6
"""Turns and ends are: at a turn the curve's height goes with the root of the distance."""

_GRADED = 4.5
"""An interval is at most this many times as long as its neighbours."""

_ROUNDS = 24
_IN_VIEW = 1.05


def denser(
    frequencies: Floats,
    solve: Callable[[Floats], list[Any]],
    curves: Callable[[Any], Curves],
    views: Sequence[Callable[[Floats, Floats], tuple[Floats, Floats]]],
) -> tuple[Floats, list[Any]]:
    """Return frequencies with others between them, and what was found at each.

    Parameters
    ----------
    frequencies : ndarray
        Ascending, two or more.
    solve : callable
        Returns what is found at each of some frequencies.
    curves : callable
        The amplitudes in what was found at one of them.
    views : sequence of callable
        Take frequencies and amplitudes into a picture that is [0, 1] wide and high.

    Notes
    -----
    Intervals are halved in which a curve begins or ends, and beside a place where it bends, as long
    as that is in view. Which, does not depend on anything but the model and the frequencies.
    """
    found = solve(frequencies)
    for _ in range(_ROUNDS):
        rows = [curves(one) for one in found]
        wanted = np.zeros(frequencies.size - 1, dtype=bool)
        for view in views:
            x = view(frequencies, np.zeros_like(frequencies))[0]
            heights = [
                [view(np.full_like(values, w), values)[1] for values in row]
                for w, row in zip(frequencies, rows, strict=True)
            ]
            wanted |= _wanted(x, heights)
        halved = _graded(np.diff(frequencies), wanted)
        if not halved.size:
            break
        between = (frequencies[halved] + frequencies[halved + 1]) / 2
        more = solve(between)
        frequencies = np.insert(frequencies, halved + 1, between)
        for k, one in sorted(zip(halved, more, strict=True), key=lambda pair: -pair[0]):
            found.insert(k + 1, one)
    return frequencies, found


def _wanted(x: Floats, heights: Sequence[Sequence[Floats]]) -> NDArray[np.bool_]:
    """Tell which intervals are to be halved."""
    widths = np.abs(np.diff(x))
    wanted = np.zeros(widths.size, dtype=bool)
    for kind in range(len(heights[0])):
        mine = [row[kind] for row in heights]
        for k, (a, b) in enumerate(pairwise(mine)):
            if a.size != b.size and widths[k] > _NOSE:
                wanted[k] |= bool((_unmatched(a, b) < _IN_VIEW).any())
        for k in range(1, x.size - 1):
            here, before, after = mine[k], mine[k - 1], mine[k + 1]
            if not here.size == before.size == after.size:
                continue
            part = (x[k] - x[k - 1]) / (x[k + 1] - x[k - 1])
            off = np.abs(before + part * (after - before) - here) > _BENT
            if (off & (np.minimum(before, after) < _IN_VIEW)).any():
                wanted[k - 1] |= bool(widths[k - 1] > _STEP)
                wanted[k] |= bool(widths[k] > _STEP)
    return wanted


def _unmatched(a: Floats, b: Floats) -> Floats:
    """Return those neighbours in the longer list that leave the rest nearest to the shorter one."""
    short, long = sorted((a, b), key=len)
    extra = long.size - short.size

    def left(k: int) -> float:
        kept = np.delete(long, slice(k, k + extra))
        return float(np.abs(kept - short).sum())

    first = min(range(short.size + 1), key=left)
    return long[first : first + extra]


def _graded(widths: Floats, wanted: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the places of intervals to halve, those much longer than their neighbours too."""
    while True:
        after = np.where(wanted, widths / 2, widths)
        longer = np.zeros_like(wanted)
        longer[1:] |= after[1:] > _GRADED * after[:-1]
        longer[:-1] |= after[:-1] > _GRADED * after[1:]
        longer &= ~wanted
        if not longer.any():
            return np.flatnonzero(wanted)
        wanted = wanted | longer
