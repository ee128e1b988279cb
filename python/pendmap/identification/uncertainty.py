"""Propagation of errors: standard errors and intervals of derived quantities."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.linalg import cho_solve_banded, cholesky_banded

from pendmap.formatting import Estimate
from pendmap.signal.robust import Z95

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pendmap.signal import Floats, Indices


def jacobian(function: Callable[[Floats], Floats], values: Floats, steps: Floats) -> Floats:
    """Return derivatives by central differences, shape (M, N), with increments ``steps``.

    A tenth of a standard error is a good increment. A column with increment 0 is 0.
    """
    base = function(values)
    result = np.zeros((base.size, values.size))
    for j in np.flatnonzero(steps):
        shift = np.zeros(values.size)
        shift[j] = steps[j]
        result[:, j] = (function(values + shift) - function(values - shift)) / (2 * steps[j])
    return result


def propagated(function: Callable[[Floats], Floats], values: Floats, stderr: Floats) -> Floats:
    """Return the covariance of a function of independent values, by the delta method."""
    slopes = jacobian(function, values, stderr / 10)
    return np.asarray(slopes * stderr**2 @ slopes.T)


def computed_from(
    given: Mapping[str, Estimate],
    joint: tuple[Sequence[str], Floats] | None,
    quantities: Callable[[dict[str, float]], dict[str, float]],
) -> dict[str, Estimate]:
    """Return the finite quantities of estimates with errors by the delta method.

    Without a ``joint`` covariance the estimates are independent. One that is held at the end of its
    interval moves one end of the interval of what depends on it, which then has no standard error.
    """
    names = [*given]
    values = np.array([e.value for e in given.values()])
    errors = np.array([e.stderr or 0.0 for e in given.values()])

    def computed(row: Floats) -> Floats:
        return np.array([*quantities(dict(zip(names, row.tolist(), strict=True))).values()])

    covariance = np.diag(errors**2)
    if joint is not None:
        table = pd.DataFrame(joint[1], [*joint[0]], [*joint[0]])
        covariance = table.reindex(index=names, columns=names, fill_value=0.0).to_numpy()
    with np.errstate(all="ignore"):
        best, slopes = computed(values), jacobian(computed, values, errors / 10)
        error = np.sqrt(np.diag(slopes @ covariance @ slopes.T))
        down = up = Z95 * error
        for k, e in enumerate(given.values()):
            if e.stderr is None and e.ci95 is not None:
                moved = computed(np.where(np.arange(len(names)) == k, e.ci95[1], values)) - best
                down, up = down - np.minimum(moved, 0), up + np.maximum(moved, 0)
    made = {}
    for k, name in enumerate(quantities(dict(zip(names, values.tolist(), strict=True)))):
        value, low, high = float(best[k]), float(best[k] - down[k]), float(best[k] + up[k])
        known = low < high and math.isfinite(high - low)
        stderr = float(error[k]) if known and down[k] == up[k] else None
        if math.isfinite(value):
            made[name] = Estimate(value, stderr, (low, high) if known else None)
    return made


def bootstrap(function: Callable[[Floats], Floats], values: Floats, stderr: Floats) -> Floats:
    """Return a function of normally distributed values, shape (1000, M); NaN where it fails.

    The parametric bootstrap is valid for functions that are nonlinear within the errors, unlike
    the delta method.
    """
    rng = np.random.default_rng(0)
    scattered = values + stderr * rng.standard_normal((1000, values.size))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.array([function(row) for row in scattered])


def least_squares_line(x: Floats, y: Floats, stderr: Floats) -> tuple[Floats, Floats, float]:
    """Return coefficients, covariance and misfit of a weighted fit ``y = c_0 + c_1 x``.

    The misfit is chi^2 per degree of freedom; the covariance is multiplied by it if it is above 1.
    """
    rows = np.column_stack((np.ones_like(x), x))
    return chain_least_squares(rows, y, np.stack((stderr**2, np.zeros(x.size))))


def chain_covariance(pairs: Indices, left: Floats, right: Floats, variance: Floats) -> Floats:
    """Return the covariance of ``left_j e_k + right_j e_{k+1}``, ``k = pairs_j``, shape (2, Q).

    Differences of successive peaks share a peak and its error; ``variance``, shape (P,), is that of
    the peaks, which are independent. The rows are the diagonal and the subdiagonal (last entry
    unused), in the format of scipy's banded solvers.
    """
    result = np.zeros((2, pairs.size))
    result[0] = left**2 * variance[pairs] + right**2 * variance[pairs + 1]
    next_ones = np.diff(pairs) == 1
    result[1, :-1] = np.where(next_ones, right[:-1] * left[1:] * variance[pairs[1:]], 0.0)
    return result


def chain_least_squares(
    rows: Floats, y: Floats, covariance: Floats
) -> tuple[Floats, Floats, float]:
    """Return values, covariance and misfit of ``y = rows @ values`` by generalized least squares.

    ``covariance`` is from :func:`chain_covariance`. The misfit is chi^2 per degree of freedom; the
    covariance of the values, shape (M, M), is multiplied by it if it is above 1.
    """
    factor = (cholesky_banded(covariance, lower=True), True)
    weighted = cho_solve_banded(factor, rows)
    inverse = np.asarray(np.linalg.inv(rows.T @ weighted), np.float64)
    values = inverse @ (weighted.T @ y)
    residual = y - rows @ values
    chi2 = float(residual @ cho_solve_banded(factor, residual))
    misfit = chi2 / max(y.size - values.size, 1)
    return values, inverse * max(misfit, 1.0), misfit
