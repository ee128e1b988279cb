"""Long curves, thinned to what a picture can show of them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def envelope(time: Floats, values: Floats, bins: int) -> tuple[Floats, Floats]:
    """Return a curve by the lowest and the highest of its samples in each of ``bins`` bins.

    Both in the order in which they come, with the first and the last sample. A curve of no more
    than two samples a bin is returned as it is.
    """
    count = values.size
    if count <= 2 * bins:
        return time, values
    edges = np.linspace(0, count, bins + 1).astype(np.int64)
    # Bins differ by one sample: filled up to the longest, a bin is a row.
    rows = np.minimum(edges[:-1, None] + np.arange(np.diff(edges).max()), edges[1:, None] - 1)
    of_rows, each = values[rows], np.arange(bins)
    lowest, highest = (rows[each, end(axis=1)] for end in (of_rows.argmin, of_rows.argmax))
    at = np.unique(np.concatenate([[0, count - 1], lowest, highest]))
    return time[at], values[at]
