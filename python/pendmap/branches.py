"""Branches: attractors at neighbouring values of a parameter that are one and the same."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Branches", "branches"]

_NEAR = 0.3
"""Nearest points of neighbouring attractors of one branch are nearer than this, in rad and 1."""


@dataclasses.dataclass(frozen=True)
class Branches:
    """Which branch each attractor belongs to.

    Attributes
    ----------
    of_entry : ndarray
        Branch of each entry, from 0.
    members : list of list of int
        Entries of each branch, value by value.
    """

    of_entry: NDArray[np.int32]
    members: list[list[int]]


def branches(raw: dict[str, Any], values: int) -> Branches:
    """Link attractors at neighbouring values.

    Two are linked where kind, period and winding agree and their points are nearest to one another,
    and near; chaos of one kind and sense is linked whatever its points.

    Parameters
    ----------
    raw : dict
        ``cell``, ``kind``, ``n``, ``w`` of the entries, and ``point_entry``, ``point_theta``,
        ``point_velocity``, as the core gives them.
    values : int
        How many values the parameter has.
    """
    cell = raw["cell"]
    bounds = np.searchsorted(cell, np.arange(values + 1))
    first = np.searchsorted(raw["point_entry"], np.arange(cell.size + 1))
    plane = np.stack([raw["point_theta"], raw["point_velocity"]], axis=1)
    key = [
        (kind, int(n), int(w)) for kind, n, w in zip(raw["kind"], raw["n"], raw["w"], strict=True)
    ]
    of_entry = np.full(cell.size, -1, dtype=np.int32)
    members: list[list[int]] = []
    for value in range(values):
        here = range(bounds[value], bounds[value + 1])
        before = range(bounds[value - 1], bounds[value]) if value else range(0)
        pairs = sorted(
            (apart, a, b)
            for a in before
            for b in here
            if key[a] == key[b]
            and (apart := _apart(plane, first, a, b, closed=key[a][1] > 0)) < _NEAR
        )
        taken: set[int] = set()
        for _, a, b in pairs:
            if a not in taken and of_entry[b] < 0:
                taken.add(a)
                of_entry[b] = of_entry[a]
                members[of_entry[a]].append(b)
        for b in here:
            if of_entry[b] < 0:
                of_entry[b] = len(members)
                members.append([b])
    return Branches(of_entry, members)


def _apart(
    plane: NDArray[np.float64], first: NDArray[np.intp], a: int, b: int, *, closed: bool
) -> float:
    """Return how far the first point of ``a`` is from the nearest of ``b``; 0 for chaos."""
    if not closed:
        return 0.0
    gap = plane[first[b] : first[b + 1]] - plane[first[a]]
    gap[:, 0] = (gap[:, 0] + np.pi) % (2 * np.pi) - np.pi
    return float(np.hypot(gap[:, 0], gap[:, 1]).min())
