"""Local polynomials fitted to neighbouring samples of a smooth motion.

A quartic through nine well-sampled readings follows any motion: its residual in the middle is
noise, from which outliers, missed counts and the noise of a record are found.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.polynomial import Polynomial

from pendmap.signal.robust import NORMAL_MAD, widened

if TYPE_CHECKING:
    from pendmap.signal import Floats, Indices, Mask


POINTS: Final = 9  # Number of samples in a window
_DEGREE: Final = 4  # Degree of the polynomials that give a velocity
_EVEN: Final = 1e-3  # Offset from even spacing, in intervals, above which a window is uneven
_BLOCK: Final = 4096  # Number of uneven windows solved at a time
_OUTLIER: Final = 4.5  # Size of a residual from which it is left out, standard deviations
_ROUNDS: Final = 4  # Largest number of repetitions of a fit without outliers


@dataclasses.dataclass(frozen=True)
class LocalFit:
    """Residuals and slopes of polynomials through neighbouring samples."""

    middle: Indices  # index of the middle sample of each window, shape (M,)
    residual: Floats  # (reading - polynomial) / noise gain, shape (M,)
    slope: Floats  # derivative in the middle, shape (M,)
    neighbours: int  # samples to each side of a window
    sum_of_squares: float  # M residuals are equivalent to M over this number of independent ones
    shares: Floats  # share of each sample in the variance of a residual, shape (points,); sum 1

    @property
    def rms(self) -> float:
        """Root mean square of the residuals, rad."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def stderr(self) -> float:
        """Standard error of the root mean square of residuals that share samples, rad."""
        return self.rms * math.sqrt(self.sum_of_squares / (2 * self.middle.size))

    def only(self, which: Mask) -> LocalFit:
        """Return the fit restricted to the residuals that a mask selects."""
        return dataclasses.replace(
            self, middle=self.middle[which], residual=self.residual[which], slope=self.slope[which]
        )


def local_fit(
    time: Floats, theta: Floats, *, degree: int = 4, points: int = POINTS, stride: int = 1
) -> LocalFit:
    """Fit a polynomial around every sample; return residuals and slopes in the middle.

    ``points`` is odd and more than ``degree + 1``; a window takes every ``stride``-th sample.
    """
    half = points // 2
    reach = half * stride
    count = time.size - 2 * reach
    weights, slopes = even_weights(degree, points)
    gain = np.sqrt(weights[half])
    shares = (weights / gain) ** 2
    autocorrelation = np.correlate(weights / gain, weights / gain, "full")
    spread = float(np.sum(autocorrelation**2) / np.sum(shares) ** 2)
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
        part = theta[middle + offset] - here  # differences keep the digits of angles of many turns
        residual += weights[k] * part
        slope += slopes[k] * part
        lag = time[middle + offset] - time[middle]
        np.maximum(worst, np.abs(lag / interval - (k - half)), out=worst)
    residual /= gain
    slope /= interval
    uneven = np.flatnonzero(worst > _EVEN)
    # The residual of a polynomial across a gap of many intervals is not noise.
    across = worst > half
    for start in range(0, uneven.size, _BLOCK):
        block = uneven[start : start + _BLOCK]
        rows = middle[block, None] + offsets
        lag = (time[rows] - time[middle[block], None]) / interval
        residual[block], slope[block], _ = _uneven(lag, theta[rows] - here[block, None], degree)
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


def _uneven(lag: Floats, theta: Floats, degree: int) -> tuple[Floats, Floats, Floats]:
    """Return residual over gain, slope at lag 0 and its error, of windows, shape (M, points)."""
    half = theta.shape[1] // 2
    width = np.maximum(np.max(np.abs(lag), axis=1), 1e-12)
    x = lag / width[:, None]
    powers = x[:, :, None] ** np.arange(degree + 1)
    q, r = np.linalg.qr(powers)
    right = np.einsum("mpk,mp->mk", q, theta)
    middle = q[:, half, :]
    gain = np.sqrt(np.maximum(1.0 - np.einsum("mk,mk->m", middle, middle), 1e-6))
    diagonal = np.abs(np.einsum("mkk->mk", r))
    sound = np.min(diagonal, axis=1) > 1e-9 * np.max(diagonal, axis=1)
    slope, stderr = np.full((2, theta.shape[0]), np.nan)
    rows = np.linalg.inv(r[sound])[:, 1, :] / width[sound, None]
    slope[sound] = np.einsum("mk,mk->m", rows, right[sound])
    stderr[sound] = np.linalg.norm(rows, axis=1)
    fitted = np.einsum("mk,mk->m", middle, right)
    return np.where(sound, (theta[:, half] - fitted) / gain, np.nan), slope, stderr


@dataclasses.dataclass(frozen=True)
class WindowFit:
    """A polynomial ``sum_j c_j ((t - centre) / half)**j`` fitted to samples of unit weight."""

    centre: float  # middle of the window, s
    half: float  # half width of the window, s
    coefficients: Floats  # rad, shape (degree + 1,)
    covariance: Floats  # of the coefficients for noise of unit variance

    def at(self, time: float, derivative: int = 0) -> tuple[float, float]:
        """Return a derivative and its standard error for unit noise, in rad/s^derivative."""
        s = (time - self.centre) / self.half
        powers = np.maximum(np.arange(self.coefficients.size) - derivative, 0)
        factors = [math.perm(j, derivative) for j in range(self.coefficients.size)]
        row = np.array(factors) * s**powers / self.half**derivative
        variance = max(float(row @ self.covariance @ row), 0.0)
        return float(row @ self.coefficients), math.sqrt(variance)

    def root(self, derivative: int = 0) -> float | None:
        """Return the instant nearest to the centre at which a derivative is zero, s."""
        roots = Polynomial(self.coefficients).deriv(derivative).roots()
        real = roots[np.abs(roots.imag) < 1e-9 * (1 + np.abs(roots.real))].real
        real = real[np.abs(real) < 1]
        if real.size == 0:
            return None
        return self.centre + self.half * float(real[np.argmin(np.abs(real))])


def fit_around(  # noqa: PLR0913 (samples, window, form)
    time: Floats,
    theta: Floats,
    centre: float,
    half: float,
    powers: tuple[int, ...],
    *,
    sigma: float = 0.0,
    begin: float = -math.inf,
) -> WindowFit | None:
    """Fit a polynomial of these powers to the samples within ``half`` of ``centre``, s.

    Samples with residuals of 4.5 ``sigma`` or more are left out and the fit is repeated; 0 keeps
    all. Samples before ``begin`` are not used. Returns None without more samples than powers.
    """
    first, last = np.searchsorted(time, (max(centre - half, begin), centre + half * (1 + 1e-9)))
    s, x = (time[first:last] - centre) / half, theta[first:last]
    if x.size <= len(powers):
        return None
    rows = s[:, None] ** np.array(powers)
    inverse, coefficients, residual = _solve(rows, x)
    for _ in range(_ROUNDS if sigma > 0 else 0):
        if float(np.abs(residual).max()) <= _OUTLIER * sigma:
            break
        scale = max(sigma, float(np.median(np.abs(residual))) / NORMAL_MAD)
        good = np.abs(residual) < _OUTLIER * scale
        if good.all() or good.sum() <= len(powers) + 1:
            break
        rows, x = rows[good], x[good]
        inverse, coefficients, residual = _solve(rows, x)
    every, square = np.zeros(max(powers) + 1), np.zeros((max(powers) + 1,) * 2)
    every[list(powers)] = coefficients
    square[np.ix_(powers, powers)] = inverse
    return WindowFit(centre, half, every, square)


def _solve(rows: Floats, x: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the inverse normal matrix, the solution and the residual."""
    # Different times, scaled to the window, make the matrix far from singular.
    inverse = np.asarray(np.linalg.inv(rows.T @ rows), np.float64)
    coefficients = inverse @ (rows.T @ x)
    return inverse, coefficients, x - rows @ coefficients


def smoothed_velocity(time: Floats, theta: Floats, half: float) -> tuple[Floats, Floats]:
    """Return the velocity by local polynomials, rad/s, and its error for unit noise, 1/s.

    Windows reach ``half`` (s) to both sides, and more where they have too few samples.
    """
    from scipy.signal import savgol_coeffs, savgol_filter  # noqa: PLC0415 (slow to import)

    step = float(np.median(np.diff(time)))
    reach = max(round(half / step), _DEGREE // 2 + 2)
    width = 2 * reach + 1
    if time.size < width:
        raise ValueError(f"{time.size} samples are fewer than a window of {width}")
    # One set of weights serves all windows of evenly spaced samples.
    slope = savgol_filter(theta, width, _DEGREE, deriv=1, delta=step)
    weights = savgol_coeffs(width, _DEGREE, deriv=1, delta=step)
    stderr = np.full(time.size, np.linalg.norm(weights))
    apart = np.append(np.abs(np.diff(time) / step - 1.0) > _EVEN, False)
    uneven = widened(apart, reach)
    uneven[:reach] = uneven[-reach:] = True
    odd = np.flatnonzero(uneven)
    for begin in range(0, odd.size, _BLOCK):
        some = odd[begin : begin + _BLOCK]
        # Samples near an end use the first or the last whole window.
        first = np.clip(some - reach, 0, time.size - width)
        within = first[:, None] + np.arange(width)
        lag = time[within] - time[some, None]
        _, slope[some], stderr[some] = _uneven(lag, theta[within], _DEGREE)
    return slope, stderr
