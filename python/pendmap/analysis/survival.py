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
    from numpy.typing import NDArray

    from pendmap.model import Pendulum


Times = npt.NDArray[np.int64]

LEAST: Final = 100  # Smallest number of captures in a tail

LEVEL: Final = 0.05  # Level of the tests of a tail: a lower p-value rejects the exponential

_BINS: Final = 8  # Intervals of the tail, of equal expected captures, whose rates are compared

_GROWTH: Final = 1.1  # Ratio of successive beginnings of the tail that are tested

_AGREEING: Final = 3  # Number of successive beginnings that must pass the tests
_FOLLOWED: Final = 400  # Largest number of trajectories along which deviations are followed
_LONGEST: Final = 400  # Largest number of periods of these trajectories
_LEAST_FOLLOWED: Final = 20  # Smallest number of trajectories for an estimate of growth
_SETTLING: Final = 4.0
"""Logarithm of the factor by which a trajectory approaches an attractor until its capture."""
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
    weibull: float
    """p-value of an exponential tail in the score test of a Weibull distribution's shape."""
    steady: float
    """p-value of an exponential tail in a chi-squared test of the rates in eight intervals."""

    @property
    def is_exponential(self) -> bool:
        """Whether neither test rejects the exponential."""
        return min(self.weibull, self.steady) > LEVEL


def tail(times: Times, censored: int, bound: int, start: int) -> Tail:
    """Fit an exponential to times beyond ``start``; ``censored`` ones are cut off at ``bound``.

    Maximum likelihood: the mean is the sum of all times beyond ``start``, censored ones included,
    over the number of captures (Cox & Oakes 1984, Analysis of Survival Data, sections 3.2 and 3.3).
    """
    lives = times[times > start] - start
    count, left = lives.size, bound - start
    total = float(lives.sum()) + censored * left
    if count == 0:
        return Tail(start, math.inf, math.inf, 0, censored, math.nan, math.nan)
    mean = total / count
    return Tail(
        start,
        mean,
        mean / math.sqrt(count),
        count,
        censored,
        _weibull(lives, censored, left),
        _steady(lives, censored, left, count / total),
    )


def begin(times: Times, censored: int, bound: int) -> Tail | None:
    """Return the exponential tail, or None if there is none.

    It begins at twice the earliest period from which three successive beginnings pass the tests:
    at that period itself noise may hide a remaining transient, which would bias the mean.
    """
    row: list[Tail] = []
    for start in _beginnings(times):
        now = tail(times, censored, bound, start)
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


def _weibull(lives: Times, censored: int, left: int) -> float:
    """Return the p-value of ``k = 1`` in the score test of the shape k in ``exp(-(x/a)^k)``."""
    x = lives - 0.5  # times are rounded up to whole periods: half a period too long on average
    logs = np.log(x)
    end, log_end = float(left), math.log(max(left, 1))
    count = x.size
    first = float((x * logs).sum()) + censored * end * log_end
    second = float((x * logs**2).sum()) + censored * end * log_end**2
    rate = count / (float(x.sum()) + censored * end)
    score = count + float(logs.sum()) - rate * first
    variance = count + rate * second - (rate * first) ** 2 / count
    return math.erfc(abs(score) / math.sqrt(2 * variance)) if variance > 0 else 0.0


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
    basin_map: xr.Dataset,
    fitted: Tail | None,
    pendulum: Pendulum,
    threads: int,
) -> tuple[float, float, int]:
    """Return exponent per period of starts before capture, its standard error, their number."""
    none = math.nan, math.nan, 0
    if fitted is None:
        return none
    units = Units.of(facts(basin_map))
    settle, label = basin_map["settle_periods"].values, basin_map["label"].values
    end = np.where(settle >= 0, settle, basin_map.attrs["max_periods"])
    end = end - _settling(basin_map, pendulum.period)
    never = (label < 0) | np.concatenate([[False], chaotic(basin_map)])[np.maximum(label, 0)]
    # Long-lived trajectories sample the natural measure of the saddle.
    least = _ALIGNED + max(math.ceil(fitted.mean / 2), 10)
    chosen = np.flatnonzero((end >= min(least, _LONGEST // 2)) & ~never)[:_FOLLOWED]
    if chosen.size < _LEAST_FOLLOWED:
        return none
    end = np.minimum(end[chosen], _LONGEST)
    speeds = units.bare(basin_map["start_velocity"].values[chosen], VELOCITY)
    growth = _core.growth(
        pendulum,
        basin_map["start_theta"].values[chosen].copy(),
        np.ascontiguousarray(speeds),
        int(end.max()),
        1,
        int(basin_map.attrs["steps_per_period"]),
        threads,
    )
    periods = np.arange(growth.shape[1])
    mine = (periods >= _ALIGNED) & (periods < end[:, None])
    length = mine.sum(axis=1)
    gain = np.where(mine, growth, 0.0).sum(axis=1)
    mean = gain.sum() / length.sum()
    spread = ((gain - mean * length) ** 2).sum()
    stderr = math.sqrt(spread * chosen.size / (chosen.size - 1)) / length.sum()
    return float(mean), float(stderr), int(chosen.size)


def _settling(basin_map: xr.Dataset, period: float) -> NDArray[np.int64]:
    """Return the number of periods in which each start approaches its attractor."""
    rate = -Units.of(facts(basin_map)).bare(basin_map["exponent"].values, RATE) * period
    rate = np.where(np.isfinite(rate) & (rate > 0), rate, _SETTLING / _LEAST_SETTLING)
    periods = np.clip(np.ceil(_SETTLING / rate), _LEAST_SETTLING, _MOST_SETTLING)
    label = basin_map["label"].values.astype(np.int64)
    by_label = np.concatenate([[0], periods]).astype(np.int64)
    return np.asarray(by_label[np.maximum(label, 0)])
