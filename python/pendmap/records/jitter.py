"""Noise that grows with speed: ``sigma^2 = still^2 + (tau v)^2``.

Timing jitter, a random difference of sampling instants and stamps with standard deviation ``tau``,
adds ``tau v`` in quadrature to the sensor's noise ``still``. Both are fitted to squared residuals
of local polynomials by the normal likelihood.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.signal.local_polynomial import even_weights
from pendmap.signal.robust import broad_scale

if TYPE_CHECKING:
    from pendmap.signal import Floats
    from pendmap.signal.local_polynomial import LocalFit

SPEED_REACH: Final = 0.7  # Half-width of the polynomials that give speeds, rad of phase
GAP: Final = 0.4  # Share of one interval in the time of a window from which it is a gap
FALSE_READING: Final = 8.0  # Standard deviations from a median of five that replaces a reading
CERTAIN_GROWTH: Final = 4.0  # Standard errors of ``tau^2`` above which it is significant
LEAST_GROWTH: Final = 0.1  # Least ``(tau v)^2`` at the greatest speed, over ``still^2``
DITHERED: Final = 0.55  # Noise over count below which slow readings do not show the noise
FEWEST_RESIDUALS: Final = 200  # Fewest residuals to which ``still`` and ``tau`` are fitted
ROUNDS: Final = 30  # Most iterations of the weights
BEND_REACH: Final = 0.5  # Half-width of second differences, rad of phase


@dataclasses.dataclass(frozen=True)
class SpeedLaw:
    """Noise as a function of speed, ``sigma^2 = still^2 + (tau v)^2``."""

    still: float  # standard deviation of readings at rest, rad
    tau: float  # standard deviation of the sampling instants, s
    stderr: float  # standard error of tau, s
    fastest: float  # largest phase velocity of the motion, rad/s
    grows_with: str = "speed"

    def __str__(self) -> str:
        """Return the law in words."""
        return (
            f"the noise grows with {self.grows_with}, as if the instants of sampling missed their "
            f"stamps by {1e3 * self.tau:.3g} +- {1e3 * self.stderr:.1g} ms"
        )

    def sigma(self, time: Floats, theta: Floats) -> Floats:
        """Return the standard deviation of each reading of a motion, rad, shape (N,)."""
        return np.hypot(self.still, self.tau * speed_of(time, theta, self.fastest))

    def shift(self, time: Floats, theta: Floats) -> Floats:
        """Return the bias of readings by jitter, ``tau^2 theta'' / 2``, rad, shape (N,)."""
        calm = _calm(theta)
        lag = _lag(time, BEND_REACH / self.fastest)
        if time.size <= 2 * lag:
            return np.zeros(time.size)
        steps = (time[lag:] - time[:-lag], calm[lag:] - calm[:-lag])
        slope = steps[1] / steps[0]
        bend = 2 * (slope[lag:] - slope[:-lag]) / (time[2 * lag :] - time[: -2 * lag])
        return 0.5 * self.tau**2 * np.pad(bend, lag, mode="edge")


def speed_of(time: Floats, theta: Floats, fastest: float) -> Floats:
    """Return the speed at every stamp, rad/s, from slopes of local quartics.

    ``fastest`` is the largest phase velocity, rad/s. The slope's weights are odd about the middle:
    its noise is independent of the residual there. Single outliers are replaced before.
    """
    reach = max(_lag(time, SPEED_REACH / fastest), 3)
    if time.size <= 2 * reach:
        return np.zeros(time.size)
    middle, weights = even_weights(4, 2 * reach + 1)

    def adapted(values: Floats, by: Floats) -> Floats:
        """Return local quartics in the sample number, evaluated with the weights ``by``."""
        padded = np.pad(values, reach, mode="reflect", reflect_type="odd")
        return np.correlate(padded, by, "valid")

    slope = adapted(time, weights)
    speed = adapted(_calm(theta), weights) / slope
    # The fit in the sample number gives the speed at the regular instant, not at the stamp, whose
    # offset is predicted from its neighbours and limited.
    off = np.clip(adapted(time, middle) / middle[reach] / slope, -1.0, 1.0)
    speed = np.asarray(np.abs(speed + off * np.gradient(speed)))
    # Across a gap the time is no polynomial in the sample number: the speed is interpolated.
    steps = np.diff(np.pad(time, reach, mode="reflect", reflect_type="odd"))
    windows = np.lib.stride_tricks.sliding_window_view(steps, 2 * reach)
    sound = windows.max(axis=1) < GAP * windows.sum(axis=1)
    return np.interp(time, time[sound], speed[sound]) if sound.any() else speed


def _calm(theta: Floats) -> Floats:
    """Return readings with single outliers replaced by the median of their neighbours."""
    from scipy.ndimage import median_filter

    middle = median_filter(theta, 5, mode="nearest")
    off = np.abs(theta - middle)
    return np.where(off > FALSE_READING * broad_scale(off), middle, theta)


def _lag(time: Floats, seconds: float) -> int:
    """Return the number of sampling intervals in a duration, at least 1."""
    return max(int(seconds / float(np.median(np.diff(time)))), 1)


def law_of(
    fit: LocalFit, square: Floats, *, fastest: float, count: float = 0.0, interval: float = 0.0
) -> SpeedLaw | None:
    """Return the growth of noise with squared speed, (rad/s)^2; None if not significant."""
    law = _adapted(fit.residual, square, fit.sum_of_squares, count)
    if law is not None and count and law[0] < DITHERED * count:
        # Slow readings that share a count have a common error, absent from residuals.
        quick = square >= (count / interval) ** 2
        law = _adapted(fit.residual[quick], square[quick], fit.sum_of_squares, count)
    return None if law is None else SpeedLaw(*law, fastest)


def _adapted(
    residual: Floats, square: Floats, worth: float, count: float
) -> tuple[float, float, float] | None:
    """Return still, tau and its error by weighted fits of ``E r^2 = a + b v^2``, or None."""
    if residual.size < FEWEST_RESIDUALS:
        return None
    power = residual**2
    unit = float(np.mean(square))
    if unit <= 0:
        return None
    rows = np.column_stack((np.ones(power.size), square / unit))
    least = max(count**2 / 12, 1e-6 * float(np.mean(power)))
    variance = np.full(power.size, max(float(np.mean(power)), 1e-300))
    coefficients = np.zeros(2)
    inverse = np.zeros((2, 2))
    for _ in range(ROUNDS):
        weighted = rows / variance[:, None] ** 2
        inverse = np.asarray(np.linalg.pinv(rows.T @ weighted), np.float64)
        last, coefficients = coefficients, inverse @ (weighted.T @ power)
        if coefficients[0] < least:
            # At the lower bound, set by the count, only the slope is fitted.
            slope = float(weighted[:, 1] @ (power - least)) / float(weighted[:, 1] @ rows[:, 1])
            coefficients = np.array([least, slope])
        coefficients[1] = max(coefficients[1], 0.0)
        variance = rows @ coefficients
        if np.allclose(coefficients, last, rtol=1e-4, atol=0.0):
            break
    still, growth = math.sqrt(coefficients[0]), float(coefficients[1])
    # Standard errors from the observed scatter, as the noise need not be normal.
    weighted = rows / variance[:, None] ** 2
    pull = weighted * (power - variance)[:, None]
    error = math.sqrt(max(float((inverse @ (pull.T @ pull) @ inverse)[1, 1]) * worth, 0.0))
    quickest = float(np.quantile(square, 0.98)) / unit
    if growth <= CERTAIN_GROWTH * error or growth * quickest < LEAST_GROWTH * coefficients[0]:
        return None
    tau = math.sqrt(growth / unit)
    return still, tau, error / unit / (2 * tau)
