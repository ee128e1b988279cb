"""Thinning of long curves for figures."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def envelope(time: Floats, values: Floats, bins: int) -> tuple[Floats, Floats]:
    """Return the lowest and the highest sample of a curve in each of ``bins`` bins.

    The samples are in order of time, with the first and the last one. A curve of at most two
    samples per bin is returned unchanged.
    """
    count = values.size
    if count <= 2 * bins:
        return time, values
    edges = np.linspace(0, count, bins + 1).astype(np.int64)
    # Bins differ by at most one sample: padded to the longest, each bin is a row.
    rows = np.minimum(edges[:-1, None] + np.arange(np.diff(edges).max()), edges[1:, None] - 1)
    of_rows, each = values[rows], np.arange(bins)
    lowest, highest = (rows[each, end(axis=1)] for end in (of_rows.argmin, of_rows.argmax))
    at = np.unique(np.concatenate([[0, count - 1], lowest, highest]))
    return time[at], values[at]
