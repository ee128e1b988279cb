"""Steps of a reading, and slips of its clock.

Around an instant, a free swing is fitted by harmonics of a chirp whose amplitude changes,
``sum_m A_m(u) exp(i m (w u + b u^2))``, with a zero that changes by ``step``, and a time that
changes by ``slip``: ``u = t + slip``. A reading that is false leaves both at zero.

Where readings are lost while the stamps continue, the reading jumps by the velocity times the lost
time ``d``: a term ``d v`` from a sample on, beside a local polynomial.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.noise import fastest
from pendmap.signal.local_polynomial import even_weights
from pendmap.signal.robust import normal_scale

if TYPE_CHECKING:
    from pendmap.signal import Floats, Indices, Mask

PERIODS: Final = 2.25  # Periods on each side that are fitted
FEWEST: Final = 10  # Fewest readings on each side
MOST: Final = 150  # Most readings on each side that are fitted
FREQUENCIES: Final = np.linspace(0.7, 1.5, 65)  # Starts of the fit, over the estimated frequency
ROUNDS: Final = 8  # Gauss-Newton steps
FALSE: Final = 5.0  # Standard deviations of a reading that is false
WORST: Final = 0.1  # Greatest residual over the rms swing of a motion that is followed


@dataclasses.dataclass(frozen=True)
class Sides:
    """Change of a motion from before an instant to after it."""

    step: float  # of the zero, rad, if there is no slip
    step_error: float
    slip: float  # of the time, s, if there is no step
    slip_error: float
    steps: float  # decrease of chi squared by a step, beside a slip
    slips: float  # decrease of chi squared by a slip, beside a step
    both: float  # decrease of chi squared by both
    false: Mask  # readings between the sides that follow neither of them
    at: int  # first reading after the change


def sides_of(time: Floats, theta: Floats, good: Mask, between: slice, count: float) -> Sides | None:
    """Return the change of a swing over the readings ``between``; None if no swing is followed."""
    frequency = fastest(time, theta, count)[1]
    centre, reach = time[between].mean(), 2 * math.pi * PERIODS / frequency
    low, high = np.searchsorted(time, (centre - reach, centre + reach))
    rows = np.arange(low, high)
    outside = good[rows] & ((rows < between.start) | (rows >= between.stop))
    parts = [rows[outside & side] for side in (rows < between.start, rows >= between.stop)]
    if min(part.size for part in parts) < FEWEST:
        return None
    used = np.concatenate([part[:: max(part.size // MOST, 1)] for part in parts])
    scale = (time[used] - centre) / reach
    fit = _fitted(scale, theta[used], (used >= between.stop) * 1.0, frequency * reach)
    if fit is None or fit.sigma > WORST * float(np.std(theta[used])):
        return None
    sigma = max(fit.sigma, count / math.sqrt(12), 1e-9)
    inverse = np.linalg.pinv(fit.normal) * sigma**2
    (step, slip), a, b, c = fit.unknown[[1, -1]], inverse[1, 1], inverse[1, -1], inverse[-1, -1]
    if not min(a, c) > 0:  # the readings cannot tell the two apart
        return None
    alone = max(a * c - b * b, 1e-300)
    # Readings between the sides belong to the one before up to a place, and to the other after.
    inner = np.arange(between.start, between.stop)
    off = np.abs(
        [theta[inner] - fit.model((time[inner] - centre) / reach, side) for side in (0.0, 1.0)]
    )
    limit = FALSE * sigma + count
    cost = np.minimum(off, limit)
    splits = [cost[0, :k].sum() + cost[1, k:].sum() for k in range(inner.size + 1)]
    split = int(np.argmin(splits))
    far = np.where(np.arange(inner.size) < split, off[0], off[1]) > limit
    false = np.zeros(time.size, bool)
    false[inner[far]] = True
    return Sides(
        step=step - b / c * slip,
        step_error=math.sqrt(alone / c),
        slip=(slip - b / a * step) * reach,
        slip_error=math.sqrt(alone / a) * reach,
        steps=step**2 / a,
        slips=slip**2 / c,
        both=(c * step**2 - 2 * b * step * slip + a * slip**2) / alone,
        false=false,
        at=between.start + split,
    )


@dataclasses.dataclass
class _Fit:
    """Unknowns: zero, step, harmonics; frequency, chirp, slip."""

    unknown: Floats
    normal: Floats = dataclasses.field(default_factory=lambda: np.empty((0, 0)))
    sigma: float = math.inf

    def columns(self, time: Floats, after: Floats | float) -> Floats:
        """Return the derivatives of the model by the unknowns."""
        frequency, chirp, slip = self.unknown[-3:]
        after = np.broadcast_to(after, time.shape)
        u = time + slip * after
        phase = frequency * u + chirp * u * u
        waves = [u**k * np.exp(1j * m * phase) for m, k in _TERMS]
        linear = [np.ones_like(u), after * 1.0, *(f(w) for w in waves for f in (np.real, np.imag))]
        pairs = self.unknown[2:-3].reshape(-1, 2)
        speed = sum(
            m * (b * w.real - a * w.imag)
            for (m, _), w, (a, b) in zip(_TERMS, waves, pairs, strict=True)
        )
        slope = speed * (frequency + 2 * chirp * u)
        return np.column_stack([*linear, speed * u, speed * u * u, slope * after])

    def model(self, time: Floats, after: Floats | float) -> Floats:
        """Return the readings of the model."""
        return np.asarray(self.columns(time, after)[:, :-3] @ self.unknown[:-3])

    def settle(self, time: Floats, theta: Floats, after: Floats) -> None:
        """Set the unknowns that are linear, and the deviation of the readings."""
        linear = self.columns(time, after)[:, :-3]
        self.unknown[:-3] = np.linalg.lstsq(linear, theta, rcond=1e-9)[0]
        left = theta - linear @ self.unknown[:-3]
        self.sigma = float(np.linalg.norm(left)) / math.sqrt(max(time.size - self.unknown.size, 1))


_TERMS: Final = ((1, 0), (1, 1), (1, 2), (2, 0), (3, 0))  # Harmonic and power of the time


def _fitted(time: Floats, theta: Floats, after: Floats, frequency: float) -> _Fit | None:
    """Return the fit of the motion, without false readings; None if it does not converge."""
    size = 2 + 2 * len(_TERMS) + 3
    starts = [_Fit(np.append(np.zeros(size - 3), [x * frequency, 0.0, 0.0])) for x in FREQUENCIES]
    for fit in starts:
        fit.settle(time, theta, after)
    fit = min(starts, key=lambda fit: fit.sigma)
    for _ in range(2):
        for _ in range(ROUNDS):
            columns = fit.columns(time, after)
            left = theta - columns[:, :-3] @ fit.unknown[:-3]
            fit.unknown = fit.unknown + np.linalg.lstsq(columns, left, rcond=1e-9)[0]
            if not np.all(np.abs(fit.unknown) < 1e9):
                return None
            fit.settle(time, theta, after)
        away = np.abs(theta - fit.model(time, after))
        worth = math.sqrt(time.size / max(time.size - size, 1))
        right = away <= FALSE * worth * max(normal_scale(away), 1e-12)
        if right.sum() < size + 3:
            return None
        if not right.all():
            time, theta, after = time[right], theta[right], after[right]
            fit.settle(time, theta, after)
    columns = fit.columns(time, after)
    fit.normal = columns.T @ columns
    # Neighbours that are wrong together are worth fewer readings.
    left = theta - columns[:, :-3] @ fit.unknown[:-3]
    alike = min(max(float(left[1:] @ left[:-1]) / float(left @ left), 0.0), 0.9)
    fit.normal *= (1 - alike) / (1 + alike)
    return fit


SLIP_DEGREE: Final = 7  # Degree of the polynomials with which slips are detected
SLIP_PHASE: Final = 2.0  # Half-width of the polynomials, rad of phase; their error is below 6e-3
SHORTEST_SIDE: Final = 8  # Fewest samples on either side of a slip, for both velocities
LONGEST_SIDE: Final = 150  # Most samples on either side of a slip
FEWEST_SLIPS: Final = 3  # Fewest slips by whole intervals for which the clock is corrected
CERTAIN_SLIP: Final = (7.0, 7.0, 6.0, 6.0, 6.0)  # Least slip in each pass, standard errors
MOST_INTERVALS: Final = 4  # Longest slip, intervals
SLOW_POWER: Final = 1e-3  # Power over its median below which motion is too slow to detect a slip
OFF_INTERVAL: Final = 0.25  # Relative tolerance for slips by whole intervals
MOST_OTHER_JUMPS: Final = 0.2  # Greatest share of jumps that are not slips
_BLOCK: Final = 4000  # Windows that are solved at a time


@dataclasses.dataclass(frozen=True)
class Slips:
    """Slips of a clock: corrected times, positions, and mean slip per interval."""

    time: Floats  # corrected, s
    places: Indices  # first sample after each slip
    slip: float  # mean size per interval, s
    stderr: float  # standard error of the mean size, s


def slips_of(time: Floats, theta: Floats, fewest: int = FEWEST_SLIPS) -> Slips | None:
    """Return the slips of a clock by whole intervals; None if the readings show none."""
    from scipy.interpolate import CubicSpline

    if not np.all(np.isfinite(theta)):
        return None
    interval = float(np.median(np.diff(time)))
    reach = min(int(SLIP_PHASE / (fastest(time, theta, 0.0)[0] * interval)), LONGEST_SIDE)
    if reach < SHORTEST_SIDE or time.size < 20 * reach:
        return None
    # Apparent sizes of slips of 1, 2, ... intervals, biased since a jump perturbs the velocity.
    place = np.arange(-3 * reach, 3 * reach + 1)
    tried = [_tried(place + k * (place >= 0.0), reach) for k in range(1, MOST_INTERVALS + 1)]
    shown = np.array([gain[3 * reach] / power[3 * reach] for gain, power in tried])
    mended, places = time.copy(), list[int]()
    slip = stderr = 0.0
    for limit in CERTAIN_SLIP:
        grid = np.arange(mended[0], mended[-1] + interval / 2, interval)
        at, lag = _found(CubicSpline(mended, theta)(grid), reach, limit)
        number = 1 + np.argmin(np.abs(lag[:, None] - shown), axis=1)
        size = lag / shown[number - 1]
        good = np.abs(size - 1) < OFF_INTERVAL
        if not places:
            if np.count_nonzero(good) < fewest or np.mean(~good) > MOST_OTHER_JUMPS:
                return None
            slip = interval * float(np.mean(size[good]))
            stderr = interval * float(np.std(size[good])) / math.sqrt(np.count_nonzero(good))
        if not good.any():
            break
        starts = np.searchsorted(mended, grid[at[good]] - interval / 2).tolist()
        for k, count in zip(starts, number[good].tolist(), strict=True):
            mended[k:] += count * interval
        places += starts
    return Slips(mended, np.unique(places), slip, stderr)


def _found(values: Floats, reach: int, limit: float) -> tuple[Indices, Floats]:
    """Return the first samples after slips, and the apparent sizes in intervals."""
    from scipy.ndimage import maximum_filter1d

    gain, power = _tried(values, reach)
    inside = slice(2 * reach, -2 * reach)
    resolved = power > SLOW_POWER * float(np.median(power[inside]))
    resolved[: 2 * reach] = resolved[-2 * reach :] = False
    score = np.where(resolved, np.abs(gain) / np.sqrt(np.maximum(power, 1e-300)), 0.0)
    noise = normal_scale(gain[resolved] / np.sqrt(power[resolved]))
    highest = maximum_filter1d(score, 2 * reach + 1, mode="nearest")
    at = np.flatnonzero((score > limit * noise) & (score >= highest) & resolved)
    return at, gain[at] / power[at]


def _tried(values: Floats, reach: int) -> tuple[Floats, Floats]:
    """Return numerator and denominator of the least-squares slip before each sample."""
    _, weights = even_weights(SLIP_DEGREE, 2 * reach + 1)
    speed = np.zeros(values.size)
    speed[reach:-reach] = np.correlate(values, weights, "valid")
    gain, power = np.zeros(values.size), np.ones(values.size)
    offset = np.arange(-reach, reach + 1)
    basis = np.linalg.qr(np.vander(offset / reach, SLIP_DEGREE + 1))[0]
    for low in range(2 * reach, values.size - 2 * reach, _BLOCK):
        rows = np.arange(low, min(low + _BLOCK, values.size - 2 * reach))
        around = rows[:, None] + offset
        late = speed[around] * (offset >= 0)
        late -= (late @ basis) @ basis.T
        gain[rows] = np.einsum("kj,kj->k", late, values[around] - values[rows, None])
        power[rows] = np.einsum("kj,kj->k", late, late)
    return gain, power
