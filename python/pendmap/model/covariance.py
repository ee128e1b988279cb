"""The table ``[covariance]`` of a model's notes: uncertainty of the fitted parameters."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import InputError, check_number, short_repr

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from numpy.typing import NDArray

MISSES: Final = 1.5  # Ratio of residual to noise above which a model misses its record
_ROUNDING: Final = 1e-9
"""Size of a negative eigenvalue of a correlation matrix, per parameter, taken as rounding."""


@dataclasses.dataclass(frozen=True)
class Covariance:
    """Uncertainty of the fitted parameters, in the model's own units."""

    names: tuple[str, ...]  # w0, EFFECT.PARAMETER, ...
    matrix: NDArray[np.float64]  # the variance between runs included, shape (K, K)

    @property
    def root(self) -> NDArray[np.float64]:
        """Return ``A``, shape (K, K), with ``A A^T`` the matrix."""
        size = np.sqrt(np.maximum(np.diag(self.matrix), 0.0))
        scale = np.where(size > 0, size, 1.0)
        values, vectors = np.linalg.eigh(self.matrix / np.outer(scale, scale))
        if values.size and values.min() < -_ROUNDING * len(size):
            raise InputError(
                f"covariance: matrix must be positive semidefinite, got a correlation matrix with "
                f"the eigenvalue {values.min():.3g}"
            )
        return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def covariance_of(notes: Mapping[str, Any]) -> Covariance | None:
    """Return the covariance in a model's notes, if any, without parameters of runs and sensors.

    ``[covariance]`` has ``names`` and ``matrix``, and may have ``between_runs``, standard
    deviations between runs by name, whose squares are added to the diagonal.
    """
    if "covariance" not in notes:
        return None
    table = notes["covariance"]
    names, rows = table.get("names"), table.get("matrix")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError(f"covariance: names must be a list of names, got {short_repr(names)}")
    try:
        matrix = np.asarray(rows, dtype=np.float64)
    except (TypeError, ValueError):
        matrix = np.full((1, 1), np.nan)
    shape = (len(names), len(names))
    if matrix.shape != shape or not np.isfinite(matrix).all():
        raise InputError(f"covariance: matrix must be {shape[0]} x {shape[1]} finite numbers")
    if not np.allclose(matrix, matrix.T, rtol=1e-6, atol=0.0):
        raise InputError("covariance: matrix must be symmetric")
    matrix = 0.5 * (matrix + matrix.T)
    between = table.get("between_runs", {})
    if not isinstance(between, dict) or not set(between) <= set(names):
        raise InputError(
            f"covariance: between_runs must be a table of names among {', '.join(names)}"
        )
    for name, deviation in between.items():
        matrix[names.index(name), names.index(name)] += check_number(name, deviation) ** 2
    places = [k for k, name in enumerate(names) if "[" not in name and name != "bias"]
    return Covariance(tuple(names[k] for k in places), matrix[np.ix_(places, places)])


def without(notes: Mapping[str, Any], exact: Collection[str]) -> dict[str, Any]:
    """Return notes whose covariance lacks the parameters that are known exactly."""
    known = covariance_of(notes) if exact else None
    if known is None or not set(known.names) & set(exact):
        return dict(notes)
    table, names = notes["covariance"], notes["covariance"]["names"]
    places = [k for k, name in enumerate(names) if name not in exact]
    parts = {
        key: {name: part for name, part in table[key].items() if name not in exact}
        for key in ("ci95", "between_runs")
        if isinstance(table.get(key), dict)
    }
    cut = {
        "names": [names[k] for k in places],
        "matrix": [[table["matrix"][j][k] for k in places] for j in places],
    }
    return {**notes, "covariance": table | cut | parts}


def misses(notes: Mapping[str, Any]) -> float:
    """Return ``rms / noise`` of ``[provenance]`` if it is above ``MISSES``, else nan."""
    table = notes.get("provenance", {})
    rms, noise = (table.get(name) for name in ("rms", "noise"))
    if not all(isinstance(x, int | float) and x > 0 for x in (rms, noise)):
        return math.nan
    ratio = float(rms) / float(noise)
    return ratio if ratio > MISSES else math.nan
