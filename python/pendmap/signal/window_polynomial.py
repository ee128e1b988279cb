"""Polynomials fitted to a few samples around an instant."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


_NORMAL_MAD: Final = 0.674489750196
"""Median of the absolute value of a standard normal variable."""
_OUTLIER: Final = 4.5
_ROUNDS: Final = 4
_EVEN: Final = 1e-3
"""Share of an interval by which samples may miss equal spacing and still count as even."""
_BLOCK: Final = 4096
"""Windows of uneven samples that are solved at a time: some megabytes."""


@dataclasses.dataclass(frozen=True)
class WindowFit:
    """A polynomial ``sum_j c_j ((t - centre) / half)**j`` fitted to samples of unit weight.

    Parameters
    ----------
    centre, half : float
        Middle and half width of the window, s.
    coefficients : array, shape (degree + 1,)
        ``c_j``, rad.
    covariance : array, shape (degree + 1, degree + 1)
        Of the coefficients, for noise of unit variance.
    points : int
        Samples that were used.
    residual : float
        Root of the sum of squared residuals over the degrees of freedom, rad.
    """

    centre: float
    half: float
    coefficients: Floats
    covariance: Floats
    points: int
    residual: float

    def at(self, time: float, derivative: int = 0) -> tuple[float, float]:
        """Return a derivative and its standard error for unit noise, in rad/s^derivative."""
        size = self.coefficients.size
        row = np.zeros(size)
        s = (time - self.centre) / self.half
        for j in range(derivative, size):
            row[j] = math.perm(j, derivative) * s ** (j - derivative) / self.half**derivative
        return float(row @ self.coefficients), math.sqrt(
            max(float(row @ self.covariance @ row), 0.0)
        )

    def turn(self) -> float | None:
        """Return the instant nearest to the centre at which the velocity is zero, s."""
        slopes = self.coefficients[1:] * np.arange(1, self.coefficients.size)
        return self._nearest_root(slopes)

    def zero(self) -> float | None:
        """Return the instant nearest to the centre at which the angle is zero, s."""
        return self._nearest_root(self.coefficients)

    def _nearest_root(self, ascending: Floats) -> float | None:
        # Newton's method from the middle finds it nearly always; all roots are dear.
        found = _newton(ascending.tolist())
        if found is None:
            roots = np.roots(ascending[::-1])
            real = roots[np.abs(roots.imag) < 1e-9 * (1 + np.abs(roots.real))].real
            real = real[np.abs(real) < 1]
            if real.size == 0:
                return None
            found = float(real[np.argmin(np.abs(real))])
        return self.centre + self.half * found


def _newton(ascending: list[float]) -> float | None:
    """A root of a polynomial within half a unit of 0 by Newton's method, if it leads there."""
    s = 0.0
    for _ in range(20):
        value = slope = 0.0
        for c in reversed(ascending):
            slope = slope * s + value
            value = value * s + c
        if slope == 0:
            return None
        step = value / slope
        s -= step
        if abs(s) > 0.5:  # noqa: PLR2004
            return None
        if abs(step) < 1e-13:  # noqa: PLR2004
            return s
    return None


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
    """Fit a polynomial of these powers to the samples within ``half`` of ``centre``.

    Samples that lie 4.5 times the noise off are left out and the fit is repeated, some times over:
    what a missed count or a dropout left behind must not turn a peak.

    Parameters
    ----------
    time, theta : array, shape (N,)
        s, increasing, and rad.
    centre, half : float
        Middle and half width of the window, s.
    powers : tuple of int
        Powers of ``t - centre`` that the polynomial has.
    sigma : float
        Standard deviation of the noise, rad; 0 leaves no sample out.
    begin : float
        Samples before this instant are not used, s.

    Returns
    -------
    WindowFit or None
        ``None`` where there are no more samples than powers.
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
        scale = max(sigma, float(np.median(np.abs(residual))) / _NORMAL_MAD)
        good = np.abs(residual) < _OUTLIER * scale
        if good.all() or good.sum() <= len(powers) + 1:
            break
        rows, x = rows[good], x[good]
        inverse, coefficients, residual = _solve(rows, x)
    every, square = np.zeros(max(powers) + 1), np.zeros((max(powers) + 1,) * 2)
    every[list(powers)] = coefficients
    square[np.ix_(powers, powers)] = inverse
    freedom = x.size - len(powers)
    return WindowFit(
        centre, half, every, square, x.size, math.sqrt(float(residual @ residual) / freedom)
    )


def _solve(rows: Floats, x: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the inverse normal matrix, the solution and what it leaves."""
    # The samples' times differ and are scaled to the window: the matrix is far from singular.
    inverse = np.asarray(np.linalg.inv(rows.T @ rows), np.float64)
    coefficients = inverse @ (rows.T @ x)
    return inverse, coefficients, x - rows @ coefficients


def smoothed_velocity(
    time: Floats, theta: Floats, half: float, degree: int = 4
) -> tuple[Floats, Floats]:
    """Return the velocity at every sample by local polynomials, and its error for unit noise.

    Parameters
    ----------
    time, theta : array, shape (N,)
        s, increasing, and rad.
    half : float
        Half width of the window, s.
    degree : int
        Of the polynomial; fewer samples than it needs widen the window.

    Returns
    -------
    velocity, stderr : ndarray, shape (N,)
        rad/s, and 1/s.
    """
    step = float(np.median(np.diff(time)))
    reach = max(round(half / step), degree // 2 + 2)
    width = 2 * reach + 1
    if time.size < width:
        raise ValueError(f"{time.size} samples are fewer than a window of {width}")
    scale = half if half > 0 else 1.0
    slope, stderr = np.empty(time.size), np.empty(time.size)
    # Where samples are evenly spaced one set of weights serves all windows.
    lags = np.arange(-reach, reach + 1) * (step / scale)
    rows = lags[:, None] ** np.arange(degree + 1)
    normal = np.asarray(np.linalg.inv(rows.T @ rows), np.float64)
    inside = slice(reach, time.size - reach)
    slope[inside] = np.correlate(theta, rows @ normal[1], "valid") / scale
    stderr[inside] = math.sqrt(normal[1, 1]) / scale
    odd = np.flatnonzero(~_evenly(time, step, reach))
    for begin in range(0, odd.size, _BLOCK):
        some = odd[begin : begin + _BLOCK]
        slope[some], stderr[some] = _slopes(time, theta, some, width, scale, degree)
    return slope, stderr


def _evenly(time: Floats, step: float, reach: int) -> NDArray[np.bool_]:
    """Return around which samples a window of so many to each side is evenly spaced."""
    even = np.zeros(time.size, bool)
    # All intervals of the window together may be off by no more than one may.
    off = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(time) / step - 1.0) > _EVEN)))
    drift = np.abs(time[2 * reach :] - time[: time.size - 2 * reach] - 2 * reach * step)
    even[reach : time.size - reach] = (off[2 * reach :] == off[: time.size - 2 * reach]) & (
        drift < _EVEN * step * math.sqrt(2 * reach)
    )
    return even


def _slopes(  # noqa: PLR0913, PLR0917 (samples, window, form)
    time: Floats, theta: Floats, at: NDArray[np.intp], width: int, scale: float, degree: int
) -> tuple[Floats, Floats]:
    """Return slopes and their errors at some samples, each from a window of its own spacing."""
    # At the ends the window is the last one that is whole.
    first = np.clip(at - width // 2, 0, time.size - width)
    within = first[:, None] + np.arange(width)
    s, x = (time[within] - time[at, None]) / scale, theta[within]
    sums, moments = np.empty((at.size, 2 * degree + 1)), np.empty((at.size, degree + 1))
    power = np.ones_like(s)
    for k in range(2 * degree + 1):
        sums[:, k] = power.sum(axis=1)
        if k <= degree:
            moments[:, k] = np.einsum("ij,ij->i", power, x)
        power *= s
    order = np.arange(degree + 1)
    normal = np.linalg.inv(sums[:, order[:, None] + order])
    slope = np.sum(normal[:, 1, :] * moments, axis=1) / scale
    return slope, np.sqrt(np.maximum(normal[:, 1, 1], 0.0)) / scale
