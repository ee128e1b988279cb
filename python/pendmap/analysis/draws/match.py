"""Identification of attractors and orbits between two models of similar parameters."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.signal import Floats


_APART = math.pi  # Distance assigned to an attractor without points, rad


def plain(name: str) -> str:
    """Return a name without its angle (``... at +0.1234``), which moves with the parameters."""
    return name.partition(" at ")[0]


def names_of(dataset: xr.Dataset, one: str) -> list[str]:
    """Return the names of the attractors or orbits of a dataset."""
    return [str(name) for name in dataset[one].values]


def points_of(dataset: xr.Dataset, one: str) -> list[Floats]:
    """Return the stroboscopic points of each attractor or orbit, shape (M, 2)."""
    points = np.stack([dataset["point_theta"].values, dataset["point_velocity"].values], axis=1)
    owner = dataset[f"point_{one}"].values
    return [points[owner == k] for k in dataset["id"].values]


def matched(
    names: list[str],
    points: list[Floats],
    others: list[str],
    theirs: list[Floats],
) -> list[int]:
    """Match attractors of equal :func:`plain` names by least distance; return indices, else -1."""
    found = [-1] * len(others)
    for name in dict.fromkeys(map(plain, others)):
        mine = [k for k, own in enumerate(names) if plain(own) == name]
        new = [k for k, own in enumerate(others) if plain(own) == name]
        if not mine:
            continue
        far = np.array([[distance(points[i], theirs[j]) for j in new] for i in mine])
        for i, j in zip(*linear_sum_assignment(far), strict=True):
            found[new[j]] = mine[i]
    return found


def distance(one: Floats, other: Floats) -> float:
    """Return the mean distance from points of ``one`` to the nearest of ``other``, modulo turns."""
    if not (one.size and other.size):
        return _APART
    away = one[:, None] - other[None]
    away[..., 0] = np.remainder(away[..., 0] + math.pi, math.tau) - math.pi
    return float(np.hypot(away[..., 0], away[..., 1]).min(axis=1).mean())
