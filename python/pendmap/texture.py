"""How finely basins are interwoven, box by box."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap import _core
from pendmap.errors import InputError

if TYPE_CHECKING:
    import numpy.typing as npt

    Labels = npt.NDArray[np.int16]

__all__ = ["BOX", "BasinEntropy", "basin_entropy", "numbered", "passes_log2"]

BOX: Final = 5
"""Side of a box in cells, as in the core."""
_SURE: Final = 1.96
_MOST_LABELS: Final = 32_767


@dataclasses.dataclass(frozen=True)
class BasinEntropy:
    """Entropies of the labels in boxes of 5 x 5 cells.

    Attributes
    ----------
    value : float
        Basin entropy: the mean over all boxes.
    boundary : float
        Boundary basin entropy: the mean over the boxes that hold more than one label; 0 without.
    boundary_stderr : float
        Its standard error, from the spread over those boxes; infinite with fewer than two.
    boxes, boundary_boxes : int
        Their numbers.
    """

    value: float
    boundary: float
    boundary_stderr: float
    boxes: int
    boundary_boxes: int

    @property
    def is_fractal(self) -> bool:
        """Whether the log 2 criterion says that the boundary is fractal; see `passes_log2`."""
        return passes_log2(self.boundary, self.boundary_stderr)


def basin_entropy(labels: npt.ArrayLike) -> BasinEntropy:
    """Basin entropy and boundary basin entropy of labels on a grid.

    In a box of 5 x 5 cells ``S_i = -sum p ln p``, ``p`` the shares of the labels in it. Basin
    entropy is ``S_b = sum S_i / N`` over all N boxes, boundary basin entropy
    ``S_bb = sum S_i / N_b`` over the N_b boxes with more than one label. ``S_b`` says how
    unpredictable ends are: 0 in one basin, ``ln K`` where K labels are spread at random. On a
    smooth boundary at most few boxes hold more than two labels, so ``S_bb`` stays below ``ln 2``;
    above it the boundary is fractal. Below it nothing follows: many fractal boundaries are there,
    and all of those between two labels alone.
    Both depend on the size of a cell; compare maps with cells of one size.

    Parameters
    ----------
    labels : array_like of int, shape (M, N)
        Numbers of attractors from 1; 0 and below where the end is not known. Those cells are left
        out, as are cells beyond the last whole box; below 5 cells a side the whole side is a box.
        Attractors that are mirror images of one another count as two.

    Returns
    -------
    BasinEntropy
        Both entropies and the numbers of boxes.

    Raises
    ------
    InputError
        If these are no whole numbers in a plane.

    References
    ----------
    A. Daza, A. Wagemakers, B. Georgeot, D. Guery-Odelin & M. A. F. Sanjuan (2016), Scientific
    Reports 6, 31416.
    """
    cells, _ = numbered(labels)
    found = _core.texture(np.ascontiguousarray(cells).ravel(), cells.shape[1])
    return BasinEntropy(
        value=found["basin_entropy"],
        boundary=found["boundary_basin_entropy"],
        boundary_stderr=found["boundary_stderr"],
        boxes=found["boxes"],
        boundary_boxes=found["boundary_boxes"],
    )


def passes_log2(boundary: float, stderr: float) -> bool:
    """Whether a boundary basin entropy is above ln 2 by more than twice its standard error."""
    return boundary - _SURE * stderr > math.log(2)


def numbered(labels: npt.ArrayLike) -> tuple[Labels, npt.NDArray[np.int64]]:
    """Return labels of a plane as small numbers, 0 where the end is not known, and what they were.

    Raises
    ------
    InputError
        If these are no whole numbers in a plane.
    """
    given = np.asarray(labels)
    if given.ndim != 2 or not given.size:  # noqa: PLR2004 (a plane)
        raise InputError(f"labels must have the shape (M, N), both above 0, got {given.shape}")
    if given.dtype.kind not in "iu":
        raise InputError(f"labels must be whole numbers, got {given.dtype}")
    known, place = np.unique(np.maximum(given, 0), return_inverse=True)
    if known.size > _MOST_LABELS:
        raise InputError(f"labels must be at most {_MOST_LABELS} different ones, got {known.size}")
    first = 0 if known[0] == 0 else 1
    cells = (place.reshape(given.shape) + first).astype(np.int16)
    return cells, known.astype(np.int64)
