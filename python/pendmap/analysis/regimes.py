"""Regimes: the sets of kinds of attractor over a plane, by name, and their shares."""

from __future__ import annotations

import itertools
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.signal import Floats


UNDECIDED = "undecided"  # Kind of a cell in which no attractor was found

_ORDER = (
    "rest",
    "inverted rest",
    "oscillation",
    "rotation",
    "quasiperiodic rotation",
    "libration chaos",
    "rotating chaos",
    "tumbling chaos",
    UNDECIDED,
)


def kind_of(kind: str, n: int, w: int) -> str:
    """Return the name of a kind of attractor, like ``rotation 1:2``; mirror images have one."""
    if kind == "oscillation":
        return f"oscillation period {n}"
    if kind == "rotation":
        return f"rotation {n}:{abs(w)}"
    return kind.replace("_", " ")


def order(name: str) -> tuple[int, int, int]:
    """Return the rank of a kind: rest first, chaos last, short periods before long."""
    place = next(k for k, word in enumerate(_ORDER) if name.startswith(word))
    digits = name.rsplit(" ", 1)[-1]
    n, _, w = digits.partition(":")
    return (place, int(n) if n.isdigit() else 0, int(w) if w.isdigit() else 0)


def regimes(
    names: Sequence[str], cell: NDArray[np.int32], cells: int
) -> tuple[list[tuple[str, ...]], NDArray[np.int16], Floats]:
    """Return the sets of kinds, the most frequent first; the set of each cell; their shares."""
    bounds = np.searchsorted(cell, np.arange(cells + 1))
    own = [
        tuple(sorted(set(names[low:high]), key=order)) or (UNDECIDED,)
        for low, high in itertools.pairwise(bounds)
    ]
    counted = Counter(own)
    sets = sorted(counted, key=lambda one: (-counted[one], [order(name) for name in one]))
    place = {one: k for k, one in enumerate(sets)}
    share = np.array([counted[one] / cells for one in sets])
    return sets, np.array([place[one] for one in own], dtype=np.int16), share
