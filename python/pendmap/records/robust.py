"""Standard deviations that some false samples do not change."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["broad_scale", "normal_scale"]


def normal_scale(values: Floats) -> float:
    """Return the standard deviation of normal values from the median of their sizes, robust."""
    return 1.4826 * float(np.median(np.abs(values))) if values.size else 0.0


def broad_scale(sizes: Floats) -> float:
    """Return a standard deviation from sizes, robust, that knows of long tails.

    The larger of those that the median and the 80 % quantile show: where noise changes with speed,
    or has long tails, the median alone is half of it. A tenth of false samples changes neither.
    """
    if not sizes.size:
        return 0.0
    half, most = np.quantile(sizes, [0.5, 0.8])
    return float(max(1.4826 * half, most / 1.2816))
