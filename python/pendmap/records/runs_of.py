"""Stretches of an array."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Places = NDArray[np.intp]

__all__ = ["equal_runs", "true_runs"]


def true_runs(mask: NDArray[np.bool_]) -> tuple[Places, Places]:
    """Return where stretches of True begin and end (the place after the last)."""
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)


def equal_runs(values: NDArray[np.float64], least: int) -> tuple[Places, Places]:
    """Return where stretches of at least ``least`` equal values begin and end."""
    low, high = true_runs(np.diff(values) == 0)
    long = high - low + 1 >= least
    return low[long], high[long] + 1
