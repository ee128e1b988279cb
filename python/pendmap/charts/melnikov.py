"""How much of Melnikov's threshold is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray as xr


_HIGH = 12.0
"""Largest threshold shown, in units of the least: a loop's goes to infinity between frequencies."""


def highest(dataset: xr.Dataset) -> float:
    """Return the largest ``p`` of a picture of thresholds; the pendulum's own is in it."""
    p = dataset["p_melnikov"].values
    known = p[np.isfinite(p)]
    shown = min(float(known.max()), _HIGH * float(known.min())) if known.size else 1.0
    return max(shown, 1.15 * abs(float(dataset.attrs["own_p"])), 1e-3)
