"""Least squares on differences of successive peaks: neighbours share a peak and its error."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["chain_covariance", "chain_least_squares"]


def chain_covariance(
    pairs: NDArray[np.intp], left: Floats, right: Floats, variance: Floats
) -> Floats:
    """Return the covariance of ``y_j = left_j e_k + right_j e_{k+1}``, ``k = pairs_j``.

    Parameters
    ----------
    pairs : array of int, shape (Q,)
        Number of the first of the two peaks; increasing.
    left, right : array, shape (Q,)
        Derivatives by the first and the second peak.
    variance : array, shape (P,)
        Of the peaks, which are independent.

    Returns
    -------
    ndarray, shape (2, Q)
        Diagonal, and what is next to it (last entry unused): the form of scipy's banded solvers.
    """
    result = np.zeros((2, pairs.size))
    result[0] = left**2 * variance[pairs] + right**2 * variance[pairs + 1]
    next_ones = np.diff(pairs) == 1
    result[1, :-1] = np.where(next_ones, right[:-1] * left[1:] * variance[pairs[1:]], 0.0)
    return result


def chain_least_squares(
    rows: Floats, y: Floats, covariance: Floats
) -> tuple[Floats, Floats, float]:
    """Fit ``y = rows @ values`` by generalised least squares.

    Parameters
    ----------
    rows : array, shape (Q, M)
        Derivatives by the unknowns.
    y : array, shape (Q,)
        What is measured.
    covariance : array, shape (2, Q)
        As of :func:`chain_covariance`.

    Returns
    -------
    values : ndarray, shape (M,)
        The unknowns.
    covariance : ndarray, shape (M, M)
        Theirs, widened by chi^2 per degree of freedom where that is above 1.
    misfit : float
        chi^2 per degree of freedom.
    """
    factor = (cholesky_banded(covariance, lower=True), True)
    weighted = cho_solve_banded(factor, rows)
    inverse = np.asarray(np.linalg.inv(rows.T @ weighted), np.float64)
    values = inverse @ (weighted.T @ y)
    residual = y - rows @ values
    chi2 = float(residual @ cho_solve_banded(factor, residual))
    misfit = chi2 / max(y.size - values.size, 1)
    return values, inverse * max(misfit, 1.0), misfit
