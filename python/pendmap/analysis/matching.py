"""Matching: which attractors of neighbouring models are one, and their numbers along parameters."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from pendmap.signal import Floats

Place = TypeVar("Place")
_APART: Final = math.pi  # Distance assigned to an attractor without points, rad


def matched(
    old: Sequence[Floats],
    new: Sequence[Floats],
    reach: Callable[[int, int], float],
    continued: Iterable[tuple[int, int]] = (),
    *,
    circle: bool = True,
) -> list[tuple[bool, float, int, int]]:
    """Match attractors of two models, given by their points: first what Newton's method continues.

    Of the others the nearest pairs come first, those apart by less than ``reach`` of their numbers;
    0 where they are not alike. Return whether no orbit leads there, distance, and both numbers.
    """
    pairs = [(False, _apart(old[k], new[m], circle=circle), k, m) for k, m in continued]
    taken = {k for _, _, k, _ in pairs}, {m for *_, m in pairs}
    both = itertools.product(range(len(old)), range(len(new)))
    free = [(k, m) for k, m in both if k not in taken[0] and m not in taken[1] and reach(k, m)]
    for far, k, m in sorted((_apart(old[k], new[m], circle=circle), k, m) for k, m in free):
        if k not in taken[0] and m not in taken[1] and far < reach(k, m):
            taken[0].add(k)
            taken[1].add(m)
            pairs.append((True, far, k, m))
    return pairs


def numbered(
    sizes: Mapping[Place, int], links: Iterable[tuple[tuple[Place, int], tuple[Place, int]]]
) -> dict[Place, list[int]]:
    """Return the branch of each attractor of each model, numbered from 0 in their order.

    A link joins the branches of two attractors, unless some model has attractors of both.
    """
    branch = {(place, k): {place: k} for place, size in sizes.items() for k in range(size)}
    for one, other in links:
        small, large = sorted((branch[one], branch[other]), key=len)
        if large.keys().isdisjoint(small):
            large |= small
            branch |= dict.fromkeys(small.items(), large)
    number: dict[int, int] = {}
    return {
        place: [number.setdefault(id(branch[place, k]), len(number)) for k in range(size)]
        for place, size in sizes.items()
    }


def _apart(one: Floats, other: Floats, *, circle: bool) -> float:
    """Return the larger of the mean distances from the points of one set to the other."""
    return max(distance(one, other, circle=circle), distance(other, one, circle=circle))


def distance(one: Floats, other: Floats, *, circle: bool = True) -> float:
    """Return the mean distance from points of one set to the other's; angles are on a circle."""
    if not (one.size and other.size):
        return _APART
    away = one[:, None] - other[None]
    if circle:
        away[..., 0] = np.remainder(away[..., 0] + math.pi, math.tau) - math.pi
    return float(np.hypot(away[..., 0], away[..., 1]).min(axis=1).mean())
