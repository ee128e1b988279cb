"""Survival: the exponential tail of censored capture times, and growth on the chaotic saddle."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from pendmap import _core
from pendmap.analysis.orbit_table import chaotic
from pendmap.files import facts
from pendmap.units import RATE, VELOCITY, Units

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr

    from pendmap.model import Pendulum


Times = npt.NDArray[np.int64]

LEAST: Final = 100  # Smallest number of captures in a tail
LEVEL: Final = 0.05  # Level of the test of a tail: a lower p-value rejects the exponential
_BINS: Final = 8  # Intervals of the tail, of equal expected captures, whose rates are compared
_GROWTH: Final = 1.1  # Ratio of successive beginnings of the tail that are tested
_AGREEING: Final = 3  # Number of successive beginnings that must pass the test
_FOLLOWED: Final = 400  # Largest number of trajectories along which deviations are followed
_LONGEST: Final = 400  # Largest number of periods of these trajectories
_LEAST_FOLLOWED: Final = 20  # Smallest number of trajectories for an estimate of growth
_SETTLING: Final = 4.0  # ln of the factor by which a trajectory approaches until its capture
_LEAST_SETTLING, _MOST_SETTLING = 10, 500  # Bounds of the settling time, periods
_ALIGNED: Final = 5  # Periods in which a deviation aligns with the direction of growth


@dataclass(frozen=True)
class Tail:
    """Exponential fit to the times beyond ``begin`` periods."""

    begin: int
    mean: float
    stderr: float
    """Standard error ``mean / sqrt(captured)``, in periods."""
    captured: int
    censored: int
    chance: float
    """p-value of an exponential tail in a chi-squared test of the rates in eight intervals."""

    @property
    def is_exponential(self) -> bool:
        """Whether the test does not reject the exponential."""
        return self.chance > LEVEL


def tail(times: Times, censored: int, bound: int, start: int) -> Tail:
    """Fit an exponential to times beyond ``start``; ``censored`` ones are cut off at ``bound``.

    Maximum likelihood: the mean is the sum of all times beyond ``start``, censored ones included,
    over the number of captures (Cox & Oakes 1984, Analysis of Survival Data, sections 3.2 and 3.3).
    """
    lives = times[times > start] - start
    count, left = lives.size, bound - start
    total = float(lives.sum()) + censored * left
    if count == 0:
        return Tail(start, math.inf, math.inf, 0, censored, math.nan)
    mean = total / count
    chance = _steady(lives, censored, left, count / total)
    return Tail(start, mean, mean / math.sqrt(count), count, censored, chance)


def begin(times: Times, censored: int, bound: int, start: int | None = None) -> Tail | None:
    """Return the tail from ``start``, by default where it is exponential; None if there is none.

    It begins at twice the earliest period from which three successive beginnings pass the test:
    at that period itself noise may hide a remaining transient, which would bias the mean.
    """
    if start is not None:
        given = tail(times, censored, bound, start)
        return given if given.captured else None
    row: list[Tail] = []
    for period in _beginnings(times):
        now = tail(times, censored, bound, period)
        if now.captured < LEAST:
            return None
        row = [*row, now] if now.is_exponential else []
        if len(row) == _AGREEING:
            later = tail(times, censored, bound, 2 * row[0].begin)
            return later if later.captured >= LEAST and later.is_exponential else row[0]
    return None


def residual(times: Times, censored: int, bound: int) -> list[Tail]:
    """Return the tails from all beginnings; their means are constant in an exponential tail."""
    tails = (tail(times, censored, bound, start) for start in _beginnings(times))
    return [fit for fit in tails if fit.captured >= LEAST // 4]


def _beginnings(times: Times) -> Iterator[int]:
    last, start = int(times.max(initial=0)), 0
    while start < last:
        yield start
        start = max(start + 1, round(start * _GROWTH))


def _steady(lives: Times, censored: int, left: int, rate: float) -> float:
    """Return the p-value of equal rates in the intervals of the tail, by chi squared."""
    from scipy.special import chdtrc  # noqa: PLC0415 (scipy takes a while)

    last = math.exp(-rate * left) if censored else 0.0
    shares = 1 - (1 - last) * np.arange(1, _BINS) / _BINS
    edges = np.unique(np.ceil(-np.log(shares) / rate).astype(np.int64))
    edges = np.concatenate([[0], edges[(edges > 0) & (edges < left)], [left]])
    squares = 0.0
    for low, high in itertools.pairwise(edges):
        inside = lives[(lives > low) & (lives <= high)]
        beyond = int((lives > high).sum()) + censored
        expected = rate * (float((inside - low).sum()) + beyond * float(high - low))
        if expected > 0:
            squares += (inside.size - expected) ** 2 / (expected * (1 - min(rate, 0.999)))
    return float(chdtrc(max(edges.size - 2, 1), squares))


def growth_on_saddle(
    basin_map: xr.Dataset, fitted: Tail | None, pendulum: Pendulum, threads: int
) -> tuple[float, float]:
    """Return the exponent per period on the saddle, of long-lived starts, and its error."""
    if fitted is None:
        return math.nan, math.nan
    units = Units.of(facts(basin_map))
    label, settle = (basin_map[n].values.astype(np.int64) for n in ("label", "settle_periods"))
    # Periods in which each start approaches its attractor are not on the saddle.
    rate = -units.bare(basin_map["exponent"].values, RATE) * pendulum.period
    rate = np.where(np.isfinite(rate) & (rate > 0), rate, _SETTLING / _LEAST_SETTLING)
    approach = np.clip(np.ceil(_SETTLING / rate), _LEAST_SETTLING, _MOST_SETTLING)
    of_start = np.maximum(label, 0)
    end = np.where(settle >= 0, settle, basin_map.attrs["max_periods"])
    end = end - np.concatenate([[0], approach]).astype(np.int64)[of_start]
    never = (label < 0) | np.concatenate([[False], chaotic(basin_map)])[of_start]
    least = _ALIGNED + max(math.ceil(fitted.mean / 2), 10)
    chosen = np.flatnonzero((end >= min(least, _LONGEST // 2)) & ~never)[:_FOLLOWED]
    if chosen.size < _LEAST_FOLLOWED:
        return math.nan, math.nan
    end = np.minimum(end[chosen], _LONGEST)
    growth = _core.growth(
        pendulum,
        basin_map["start_theta"].values[chosen].copy(),
        np.ascontiguousarray(units.bare(basin_map["start_velocity"].values[chosen], VELOCITY)),
        int(end.max()),
        1,
        int(basin_map.attrs["steps_per_period"]),
        threads,
    )
    periods = np.arange(growth.shape[1])
    mine = (periods >= _ALIGNED) & (periods < end[:, None])
    length, gain = mine.sum(axis=1), np.where(mine, growth, 0.0).sum(axis=1)
    mean = gain.sum() / length.sum()
    spread = ((gain - mean * length) ** 2).sum()
    stderr = math.sqrt(spread * chosen.size / (chosen.size - 1)) / length.sum()
    return float(mean), float(stderr)
