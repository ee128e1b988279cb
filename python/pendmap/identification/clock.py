"""Times counted from a record's first sample: time stamps leave no digits for what happens."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["from_first", "span"]


def from_first(time: ArrayLike) -> tuple[NDArray[np.float64], float]:
    """Return times from the first one on, and the first one, s."""
    t = np.ascontiguousarray(time, dtype=np.float64)
    if t.ndim != 1 or t.size == 0 or not np.isfinite(t[0]):
        return t, 0.0
    return t - t[0], float(t[0])


def span(time: NDArray[np.float64]) -> str:
    """Return which part of its own clock a record covers, in words."""
    first, last = (f"{round(float(t), 4):.15g}" for t in (time[0], time[-1]))
    return f"{first} to {last} s"
