"""Planes of labels whose boundary has a known dimension."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    Labels = npt.NDArray[np.int64]


def centres(side: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return the centres of side x side cells of the unit square."""
    middle = (np.arange(side) + 0.5) / side
    return np.meshgrid(middle, middle)[0], np.meshgrid(middle, middle)[1]


def line(side: int, seed: int) -> Labels:
    """Return two labels on both sides of a straight line: dimension 1."""
    rng = np.random.default_rng(seed)
    x, y = centres(side)
    angle, shift = rng.uniform(0, 2 * np.pi), rng.uniform(-0.1, 0.1)
    return np.where((x - 0.5) * np.cos(angle) + (y - 0.5) * np.sin(angle) > shift, 1, 2)


def disc(side: int, seed: int) -> Labels:
    """Return the labels of a disc at a random place: dimension 1."""
    rng = np.random.default_rng(seed)
    x, y = centres(side)
    radius, (left, low) = rng.uniform(0.2, 0.35), rng.uniform(0.4, 0.6, 2)
    return np.where((x - left) ** 2 + (y - low) ** 2 < radius**2, 1, 2)


def cantor(side: int, seed: int, ratio: float) -> Labels:
    """Return labels of a Cantor set's gaps, by generation, times an interval.

    Each of the two parts has ``ratio`` of the length of the whole: dimension ``1 + ln 2 / ln
    (1/ratio)``.
    """
    rng = np.random.default_rng(seed)
    u = (centres(side)[0] + rng.uniform(0.1, 0.4)) / rng.uniform(1.5, 2.0)
    label, inside = np.ones(u.shape, dtype=np.int64), np.ones(u.shape, dtype=bool)
    for generation in range(24):
        gap = inside & (u > ratio) & (u < 1 - ratio)
        label[gap] = 1 + generation % 2
        inside &= ~gap
        u = np.where(u >= 0.5, (u - (1 - ratio)) / ratio, u / ratio)
    return label


def spread(side: int, seed: int, labels: int) -> Labels:
    """Return random labels: dimension 2."""
    return np.random.default_rng(seed).integers(1, labels + 1, (side, side))
