"""Lifetimes: the exponential tail of times until something happens, some of them cut off."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from pendmap import _core
from pendmap.units import RATE, VELOCITY, Units

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr
    from numpy.typing import NDArray

    from pendmap.model import Pendulum


Times = npt.NDArray[np.int64]

LEAST: Final = 100
"""Captures without which nothing is said of a tail."""

LEVEL: Final = 0.05
"""Chance at which times of an exponential tail are taken for something else."""

_BINS: Final = 8
"""Stretches of the tail whose rates are compared, each with as many captures to be expected."""

_GROWTH: Final = 1.1
"""Each beginning that is tried over the one before."""

_AGREEING: Final = 3
"""Beginnings in a row that must be exponential."""


@dataclass(frozen=True)
class Tail:
    """What lives beyond ``begin`` periods.

    Attributes
    ----------
    begin : int
        Periods.
    mean, stderr : float
        Mean time that is left, in periods, and its standard error ``mean / sqrt(captured)``.
    captured, censored : int
        Captures after ``begin``, and trajectories alive at the bound.
    weibull, steady : float
        Chances of a shape as unlike an exponential's in a sample of one: by the score test for
        the shape of a Weibull distribution, and by chi squared of the rates in eight stretches.
    """

    begin: int
    mean: float
    stderr: float
    captured: int
    censored: int
    weibull: float
    steady: float

    @property
    def is_exponential(self) -> bool:
        """Whether neither test speaks against it."""
        return min(self.weibull, self.steady) > LEVEL


def tail(times: Times, censored: int, bound: int, start: int) -> Tail:
    """Fit an exponential to what lives beyond ``start`` periods.

    The maximum of the likelihood is at the sum of all times beyond ``start``, those cut off at
    ``bound`` included, over the number of captures.

    Parameters
    ----------
    times : ndarray of int, shape (N,)
        Periods until capture.
    censored : int
        Trajectories alive at ``bound``.
    bound : int
        Where these were given up.
    start : int
        Where the tail begins.

    References
    ----------
    Cox & Oakes (1984), Analysis of Survival Data, sections 3.2 and 3.3.
    """
    own = times[times > start] - start
    count, left = own.size, bound - start
    total = float(own.sum()) + censored * left
    if count == 0:
        return Tail(start, math.inf, math.inf, 0, censored, math.nan, math.nan)
    mean = total / count
    return Tail(
        start,
        mean,
        mean / math.sqrt(count),
        count,
        censored,
        _weibull(own, censored, left),
        _steady(own, censored, left, count / total),
    )


def begin(times: Times, censored: int, bound: int) -> Tail | None:
    """Return the tail from where it is exponential, None where it is so nowhere.

    Twice the earliest beginning of which both tests, and those of the next two tried, do not say
    otherwise: just there what is not yet exponential hides in the noise, and would bias the mean.

    Parameters
    ----------
    times, censored, bound
        As of :func:`tail`.
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
    """Return the tails from all beginnings that are tried, as long as any is left.

    Their means over their beginnings are level where the tail is exponential.
    """
    tails = (tail(times, censored, bound, start) for start in _beginnings(times))
    return [each for each in tails if each.captured >= LEAST // 4]


def _beginnings(times: Times) -> Iterator[int]:
    last, start = int(times.max(initial=0)), 0
    while start < last:
        yield start
        start = max(start + 1, round(start * _GROWTH))


def _weibull(own: Times, censored: int, left: int) -> float:
    """Chance of a score as large for the shape k in ``exp(-(x/a)^k)``, were k = 1."""
    x = own - 0.5  # a time in whole periods is over half a period before, on average
    logs = np.log(x)
    end, log_end = float(left), math.log(max(left, 1))
    count = x.size
    first = float((x * logs).sum()) + censored * end * log_end
    second = float((x * logs**2).sum()) + censored * end * log_end**2
    rate = count / (float(x.sum()) + censored * end)
    score = count + float(logs.sum()) - rate * first
    variance = count + rate * second - (rate * first) ** 2 / count
    return math.erfc(abs(score) / math.sqrt(2 * variance)) if variance > 0 else 0.0


def _steady(own: Times, censored: int, left: int, rate: float) -> float:
    """Chance of rates as different in stretches of the tail, were they all one."""
    from scipy.special import chdtrc  # noqa: PLC0415 (scipy takes a while)

    last = math.exp(-rate * left) if censored else 0.0
    shares = 1 - (1 - last) * np.arange(1, _BINS) / _BINS
    edges = np.unique(np.ceil(-np.log(shares) / rate).astype(np.int64))
    edges = np.concatenate([[0], edges[(edges > 0) & (edges < left)], [left]])
    squares = 0.0
    for low, high in itertools.pairwise(edges):
        inside = own[(own > low) & (own <= high)]
        beyond = int((own > high).sum()) + censored
        expected = rate * (float((inside - low).sum()) + beyond * float(high - low))
        if expected > 0:
            squares += (inside.size - expected) ** 2 / (expected * (1 - min(rate, 0.999)))
    return float(chdtrc(max(edges.size - 2, 1), squares))


# The chaotic saddle: how deviations grow while trajectories are not yet captured.


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
    fitted: Tail | None,
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
        pendulum,
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
