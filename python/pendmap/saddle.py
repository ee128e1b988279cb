"""The chaotic saddle: how deviations grow while trajectories are not yet captured."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap import _core
from pendmap.model.units import RATE, VELOCITY, Units

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from pendmap import survival
    from pendmap.model import Pendulum

__all__ = ["growth_on_saddle"]

_FOLLOWED: Final = 400
"""Trajectories whose deviations are followed, and ..."""
_LONGEST: Final = 400
"""... for so many periods at the most."""
_LEAST_FOLLOWED: Final = 20
_SETTLING: Final = 4.0
"""A trajectory comes nearer to an attractor by this power of e before it counts as captured."""
_LEAST_SETTLING, _MOST_SETTLING = 10, 500
_ALIGNED: Final = 5
"""Periods in which a deviation turns into the direction of growth."""


def growth_on_saddle(
    found: xr.Dataset,
    fitted: survival.Tail | None,
    pendulum: Pendulum,
    threads: int | None,
) -> tuple[float, float, int]:
    """Return the exponent per period while trajectories live, its standard error, and of how many.

    From ``_ALIGNED`` periods on until the settling begins that ends in capture.
    """
    none = math.nan, math.nan, 0
    if fitted is None:
        return none
    units = Units.of(found.attrs)
    settle, label = found["settle_periods"].values, found["label"].values
    end = np.where(settle >= 0, settle, found.attrs["max_periods"])
    end = end - _settling(found, pendulum.period)
    chaos = np.array([str(kind).endswith("chaos") for kind in found["kind"].values], dtype=bool)
    never = (label < 0) | np.concatenate([[False], chaos])[np.maximum(label, 0)]
    # The natural measure of the saddle is where those are that live for long.
    least = _ALIGNED + max(math.ceil(fitted.mean / 2), 10)
    chosen = np.flatnonzero((end >= min(least, _LONGEST // 2)) & ~never)[:_FOLLOWED]
    if chosen.size < _LEAST_FOLLOWED:
        return none
    end = np.minimum(end[chosen], _LONGEST)
    speeds = units.bare(found["start_velocity"].values[chosen], VELOCITY)
    growth = _core.growth(
        pendulum.parameters,
        found["start_theta"].values[chosen].copy(),
        np.ascontiguousarray(speeds),
        int(end.max()),
        1,
        int(found.attrs["steps_per_period"]),
        threads or 0,
    )
    each = np.arange(growth.shape[1])
    mine = (each >= _ALIGNED) & (each < end[:, None])
    length = mine.sum(axis=1)
    gain = np.where(mine, growth, 0.0).sum(axis=1)
    mean = gain.sum() / length.sum()
    spread = ((gain - mean * length) ** 2).sum()
    stderr = math.sqrt(spread * chosen.size / (chosen.size - 1)) / length.sum()
    return float(mean), float(stderr), int(chosen.size)


def _settling(found: xr.Dataset, period: float) -> NDArray[np.int64]:
    """Return the periods that each start needs at its end to come near what captures it."""
    rate = -Units.of(found.attrs).bare(found["exponent"].values, RATE) * period
    rate = np.where(np.isfinite(rate) & (rate > 0), rate, _SETTLING / _LEAST_SETTLING)
    periods = np.clip(np.ceil(_SETTLING / rate), _LEAST_SETTLING, _MOST_SETTLING)
    label = found["label"].values.astype(np.int64)
    own = np.concatenate([[0], periods]).astype(np.int64)
    return np.asarray(own[np.maximum(label, 0)])
