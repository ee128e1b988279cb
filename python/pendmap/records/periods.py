"""Period of a free swing against its amplitude, which increases as a pendulum's does.

    T(A) = T0 (2/pi) K(sin(A/2))

At an amplitude of 1 rad the period is 6.6 % longer than that of small swings.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.signal.half_cycles import after_turns, swings
from pendmap.signal.robust import Z95, normal_scale

if TYPE_CHECKING:
    from pendmap.signal import Floats, Indices


FEWEST_PERIODS: Final = 6  # Fewest periods that are analysed
LARGEST_SWING: Final = 3.0  # Largest amplitude, rad, at which the increase of the period is used
LEAST_ERROR: Final = 1e-3  # Least relative error of a scale factor


@dataclasses.dataclass(frozen=True)
class Periods:
    """Periods of a free swing against its amplitude."""

    amplitude: Floats  # amplitude of the readings about their middle, shape (M,)
    period: Floats  # s, shape (M,)

    @property
    def small(self) -> float:
        """Median period of the smallest third of the swings, s."""
        return float(np.median(self.period[self._smallest]))

    @property
    def smallest(self) -> float:
        """Period of infinitesimal swings, s: ``small``, corrected for its amplitude if below pi."""
        if float(np.min(self.amplitude)) >= math.pi:
            return self.small
        grown = growth(np.minimum(self.amplitude[self._smallest], 3.0))
        return self.small / float(np.median(grown))

    @property
    def _smallest(self) -> Indices:
        return np.argsort(self.amplitude)[: max(self.period.size // 3, 1)]


def small_period(time: Floats, theta: Floats, count: float) -> float:
    """Return the period of small swings, s; NaN if there are too few below half a turn."""
    periods = periods_of(time, theta - (middle_of(time, theta) or 0.0), count)
    if periods is None or float(np.min(periods.amplitude)) >= math.pi:
        return math.nan
    return periods.smallest


def periods_of(time: Floats, theta: Floats, count: float) -> Periods | None:
    """Return the periods of readings about 0; None if there are too few."""
    start = after_turns(theta)
    time, theta = time[start:], theta[start:]
    if time.size < 4 * FEWEST_PERIODS:
        return None
    noise = float(np.median(np.abs(np.diff(theta, 2)))) if theta.size > 2 else 0.0
    reach = float(np.quantile(np.abs(theta), 0.98))
    least = max(2.5 * count, min(4 * noise, 0.3 * reach), 0.02 * reach)
    half = swings(time, theta, least=least)
    if half.peak.size < FEWEST_PERIODS + 2:
        return None
    size = np.abs(half.peak)
    # The weighted mean of neighbours removes a small offset of the middle.
    amplitude = (size[:-2] + 2 * size[1:-1] + size[2:]) / 4
    period = half.period
    steady = np.abs(period / np.median(period) - 1) < 0.6
    inside = steady & (amplitude > 4 * least)
    if np.count_nonzero(inside) >= FEWEST_PERIODS:
        steady = inside
    if np.count_nonzero(steady) < FEWEST_PERIODS:
        return None
    return Periods(amplitude[steady], period[steady])


def share_of(periods: Periods, grown: Floats) -> tuple[float, float]:
    """Return the increase of periods over a pendulum's, 1/k^2 for k times the angle; its error."""
    columns = np.column_stack([np.ones(grown.size), grown - 1])
    answer, spread = _robust_line(columns, periods.period)
    return float(answer[1] / answer[0]), float(spread[1] / answer[0])


def gain_of(time: Floats, theta: Floats, count: float) -> tuple[float, float] | None:
    """Return the 95 % interval of reading over angle from the periods of a free run, or None."""
    periods = periods_of(time, theta - (middle_of(time, theta) or 0.0), count)
    if periods is None or float(np.max(periods.amplitude)) > LARGEST_SWING:
        return None
    share, error = share_of(periods, growth(periods.amplitude))
    least, most = share - Z95 * error, share + Z95 * error
    low = 1 / math.sqrt(most) if most > 0 else 0.0
    return low, 1 / math.sqrt(least) if least > 0 else math.inf


def middle_of(time: Floats, theta: Floats) -> float | None:
    """Return the middle of the last quarter of a record, rad; None if it is short or rotates."""
    late = theta[time >= time[0] + 0.75 * (time[-1] - time[0])]
    if late.size < 20:
        return None
    low, high = (float(np.quantile(late, part)) for part in (0.02, 0.98))
    return (low + high) / 2 if (high - low) / 2 < math.pi else None


def factor_of(periods: Periods) -> tuple[float, float]:
    """Return the factor on the readings that gives a pendulum's periods, and its error."""
    best, least = 1.0, math.inf
    for factor in np.geomspace(0.01, 3.0 / float(np.max(periods.amplitude)), 300).tolist():
        away = periods.period / growth(factor * periods.amplitude)
        spread = normal_scale(away - np.median(away)) / float(np.median(away))
        if spread < least:
            best, least = factor, spread
    # The grid has steps of 2 %: Gauss-Newton steps refine its best factor.
    error = 0.02 * best
    for _ in range(4):
        grown = growth(best * periods.amplitude)
        slope = (growth(1.001 * best * periods.amplitude) - grown) / (0.001 * best)
        answer, spreads = _robust_line(np.column_stack([grown, slope]), periods.period)
        step = float(np.clip(answer[1] / answer[0], -0.02 * best, 0.02 * best))
        best, error = best + step, float(spreads[1] / answer[0])
    return best, math.hypot(error, LEAST_ERROR * best)


def growth(amplitude: Floats) -> Floats:
    """Return T(A)/T0, computed by the arithmetic-geometric mean."""
    a, b = np.ones_like(amplitude), np.abs(np.cos(amplitude / 2))
    for _ in range(8):
        a, b = (a + b) / 2, np.sqrt(a * b)
    return np.asarray(1 / a)


def _robust_line(columns: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return coefficients and standard errors of a robust linear fit with Huber weights."""
    weights = np.ones(values.size)
    for _ in range(8):
        root = np.sqrt(weights)[:, None]
        answer = np.linalg.lstsq(columns * root, values * root[:, 0], rcond=None)[0]
        away = np.abs(values - columns @ answer)
        scale = max(normal_scale(away), 1e-12)
        weights = np.minimum(1.0, 1.345 * scale / np.maximum(away, 1e-12))
    inverse = np.linalg.pinv((columns * weights[:, None]).T @ columns)
    return np.asarray(answer, float), scale * np.sqrt(np.diag(inverse))
