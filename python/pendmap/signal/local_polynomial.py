"""What a sample is away from a polynomial through its neighbours.

Nothing is assumed about the pendulum: a quartic through nine samples follows any motion that is
sampled well, and what remains in the middle is noise (diagnosing outliers, missed counts and the
noise floor all start here).
"""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


POINTS: Final = 9
"""Samples a polynomial goes through."""

_EVEN: Final = 1e-3
"""Share of an interval by which samples may miss equal spacing and still count as even."""

_BLOCK: Final = 20_000
"""Windows of uneven samples that are solved at a time: a few megabytes."""


@dataclasses.dataclass(frozen=True)
class LocalFit:
    """Residuals and slopes of polynomials through neighbouring samples.

    Parameters
    ----------
    middle : ndarray of int, shape (M,)
        Which samples the residuals belong to.
    residual : ndarray, shape (M,)
        Reading less polynomial, divided by the noise gain: white noise of standard deviation
        sigma gives residuals of standard deviation sigma.
    slope : ndarray, shape (M,)
        Derivative of the polynomial in the middle.
    neighbours : int
        How far to each side a window reaches, in samples.
    sum_of_squares : float
        Sum of the squared autocorrelations of the residuals of white noise: M residuals are worth
        M over this many independent ones.
    shares : ndarray, shape (points,)
        Parts that the samples of a window have in the variance of a residual; they add up to 1.
    """

    middle: NDArray[np.intp]
    residual: Floats
    slope: Floats
    neighbours: int
    sum_of_squares: float
    shares: Floats


def local_fit(
    time: Floats, theta: Floats, *, degree: int = 4, points: int = POINTS, stride: int = 1
) -> LocalFit:
    """Fit a polynomial around every sample and say what remains of it.

    Parameters
    ----------
    time, theta : ndarray, shape (N,)
        s, increasing; rad.
    degree : int
        Of the polynomials.
    points : int
        Samples of a window, odd and more than ``degree + 1``.
    stride : int
        Every how manieth sample a window takes.
    """
    half = points // 2
    reach = half * stride
    count = time.size - 2 * reach
    weights, slopes = even_weights(degree, points)
    gain = np.sqrt(weights[half])
    spread, shares = _spread(weights / gain), (weights / gain) ** 2
    if count <= 0:
        none = np.empty(0)
        return LocalFit(np.empty(0, np.intp), none, none, reach, spread, shares)
    middle = np.arange(reach, time.size - reach)
    offsets = np.arange(-half, half + 1) * stride
    residual, slope = np.zeros(count), np.zeros(count)
    interval = float(np.median(np.diff(time))) * stride
    worst = np.zeros(count)
    here = theta[middle]
    for k, offset in enumerate(offsets):
        part = theta[middle + offset] - here  # differences: many turns cost no digits
        residual += weights[k] * part
        slope += slopes[k] * part
        lag = time[middle + offset] - time[middle]
        np.maximum(worst, np.abs(lag / interval - (k - half)), out=worst)
    residual /= gain
    slope /= interval
    uneven = np.flatnonzero(worst > _EVEN)
    # A gap of many intervals is no window: a polynomial across it says nothing about noise.
    across = worst > half
    for start in range(0, uneven.size, _BLOCK):
        block = uneven[start : start + _BLOCK]
        rows = middle[block, None] + offsets
        lag = (time[rows] - time[middle[block], None]) / interval
        residual[block], slope[block] = _uneven(lag, theta[rows] - here[block, None], degree)
        slope[block] /= interval
    good = ~across & np.isfinite(residual) & np.isfinite(slope)
    return LocalFit(middle[good], residual[good], slope[good], reach, spread, shares)


@functools.cache
def even_weights(degree: int, points: int) -> tuple[Floats, Floats]:
    """Return the weights of residual and slope in the middle of equally spaced samples."""
    half = points // 2
    x = np.arange(-half, half + 1) / half
    inverse = np.linalg.pinv(np.vander(x, degree + 1, increasing=True))
    weights = -inverse[0]
    weights[half] += 1.0
    return weights, inverse[1] / half


def _spread(weights: Floats) -> float:
    autocorrelation = np.correlate(weights, weights, "full")
    return float(np.sum(autocorrelation**2) / np.sum(weights**2) ** 2)


def _uneven(lag: Floats, theta: Floats, degree: int) -> tuple[Floats, Floats]:
    """Residual over its gain, and slope, of windows (M, points) of their own spacing."""
    half = theta.shape[1] // 2
    width = np.maximum(np.max(np.abs(lag), axis=1), 1e-12)
    x = lag / width[:, None]
    powers = x[:, :, None] ** np.arange(degree + 1)
    q, r = np.linalg.qr(powers)
    middle = q[:, half, :]
    fitted = np.einsum("mk,mpk,mp->m", middle, q, theta)
    gain = np.sqrt(np.maximum(1.0 - np.einsum("mk,mk->m", middle, middle), 1e-6))
    diagonal = np.abs(np.einsum("mkk->mk", r))
    sound = np.min(diagonal, axis=1) > 1e-9 * np.max(diagonal, axis=1)
    slope = np.full(theta.shape[0], np.nan)
    right = np.einsum("mpk,mp->mk", q[sound], theta[sound])
    slope[sound] = np.linalg.solve(r[sound], right[:, :, None])[:, 1, 0] / width[sound]
    residual = np.where(sound, (theta[:, half] - fitted) / gain, np.nan)
    return residual, slope
