"""Blocks of an adaptive map: which cells are computed, and which are filled."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.adaptive.audit import (
    COMPUTED,
    FILLED,
    MOST_FRACTAL,
    NEVER,
    NO_TURNS,
    audited,
    drawn_cells,
)
from pendmap.analysis.numerics import part

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pendmap import _core
    from pendmap.analysis.numerics import Progress
    from pendmap.signal import Indices, Mask

    Label = Callable[[Indices], _core.LabelledStarts]
    """Function that labels the starts with these indices."""

SIDE: Final = 40
"""Side of the largest blocks in cells: on rims 40 apart lie 5 % of the cells.

Of 2000 x 2000 cells at p = 0.6, sides of 20, 40 and 80 compute 12, 8 and 6 %; at a partly fractal
boundary (gamma 0.2, p 0.5, torque 0.4) 21, 17 and 16 %, with equal errors. Larger ones miss larger
islands.
"""
LEAST: Final = 5  # Side of the smallest blocks
_STEPS: Final = 7  # Number of times that cells are computed: last rim, by sides, inside, audit
_BLOCKS: Final = 64  # Largest number of blocks that are tried before the map, one in four at most


class Band:
    """Whole rows of a grid that are refined: rows of blocks, with the rim after the last one."""

    def __init__(self, label: Label, first: int, shape: tuple[int, ...], own: int) -> None:
        """Begin with the index of the first cell and the number of cells before the last rim."""
        size = math.prod(shape)
        self._label, self._first, self._shape = label, first, shape
        self.work = 0
        """Number of periods integrated."""
        self.label = np.zeros(size, np.int16)
        self.settle = np.full(size, NEVER, np.int32)
        self.turns = np.full(size, NO_TURNS, np.int32)
        self.computed = np.full(size, FILLED, np.int8)
        """How each label was found, by the numbers of ``HOW``."""
        self._wanted = np.zeros(size, bool)
        self._wanted[own:] = True
        self._compute()
        self.work = 0  # The next rows have the last rim too, and count it.

    def refine(self) -> None:
        """Compute what must be, and fill the rest."""
        side, (tops, lefts) = SIDE, _lattice(self._shape)
        split = self._several(tops, lefts, side)
        tops, lefts = tops[split], lefts[split]
        while side > LEAST:
            inside, y, x = _quarters(tops, lefts, side, self._shape)
            several = np.zeros(inside.shape, bool)
            several[inside] = self._several(y[inside], x[inside], side // 2)
            whole = several.all(axis=1)
            self._want(tops[whole], lefts[whole], _square(side))
            several[whole] = False
            tops, lefts, side = y[several], x[several], side // 2
        self._want(tops, lefts, _square(side))
        self._compute()
        # The first cell of a row is computed, and a filled cell has the label of the cell before.
        known = np.flatnonzero(self.computed)
        self.label = np.repeat(self.label[known], np.diff(known, append=self.label.size))

    def audit(self, drawn: Indices) -> tuple[Indices, NDArray[np.int16]]:
        """Compute the filled ones of some cells; return which, and the labels that they had."""
        cells = drawn[self.computed[drawn] == FILLED]
        filled = self.label[cells]
        self._put(cells)
        self.computed[cells] = audited(self.label[cells], filled)
        return cells, filled

    def _several(self, tops: Indices, lefts: Indices, side: int) -> Mask:
        """Return which blocks have several labels on their rims, or starts without an end there."""
        cells = self._want(tops, lefts, _rim(side))
        self._compute()
        return _several(self.label[cells]) | (self.label[cells[:, 0]] <= 0)

    def _want(self, tops: Indices, lefts: Indices, offsets: tuple[Indices, Indices]) -> Indices:
        """Note cells of blocks to be computed; return their indices, shape (blocks, offsets)."""
        cells = _cells(tops, lefts, offsets, self._shape)
        self._wanted[cells] = True
        return cells

    def _compute(self) -> None:
        self._wanted[self.computed != FILLED] = False
        cells = np.flatnonzero(self._wanted)
        self._put(cells)
        self.computed[cells] = COMPUTED

    def _put(self, cells: Indices) -> None:
        if cells.size:
            found = self._label(cells + self._first)
            self.label[cells], self.settle[cells] = found.label, found.settle
            self.turns[cells] = found.turns
            self.work += found.work


def refined(  # noqa: PLR0913, PLR0917 (a tile of a map)
    plan: _core.BasinPlan,
    first: int,
    last: int,
    shape: tuple[int, ...],
    seed: int,
    progress: Progress | None,
) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Refine and audit the cells ``first`` to before ``last`` of a grid, which are whole rows.

    Returns the cells, and the record of the tile.
    """
    own, row, every = last - first, shape[1], math.prod(shape)
    steps = itertools.count()

    def label(cells: Indices) -> _core.LabelledStarts:
        return plan.label_again(cells, part(progress, min(next(steps), _STEPS - 1), _STEPS))

    rows = (min(last + row, every) - first) // row  # with the first row of the next tile
    band = Band(label, first, (rows, row), own)
    band.refine()
    drawn = drawn_cells(every, seed) - first
    drawn, filled = band.audit(drawn[(drawn >= 0) & (drawn < own)])
    cells: dict[str, NDArray[Any]] = {
        "label": band.label[:own],
        "settle_periods": band.settle[:own],
        "net_turns": band.turns[:own],
        "computed": band.computed[:own],
    }
    undecided = np.count_nonzero(cells["label"] == 0)
    return cells, {"work": band.work, "undecided": undecided, "audited": drawn, "filled": filled}


def tried(plan: _core.BasinPlan, shape: tuple[int, ...], seed: int) -> dict[str, Any]:
    """Return whether a map is refined, by some blocks drawn at random, for the step ``label``."""
    if plan.plane != "basins":
        return {"refined": False}
    rows, columns = (len(range(0, count - 1 - SIDE // 2, SIDE)) for count in shape)
    if not rows * columns:
        return {"refined": True}
    count = max(1, min(_BLOCKS, rows * columns // 4))
    drawn = np.random.default_rng([seed, 0]).integers(rows * columns, size=count)
    tops, lefts = np.array(np.divmod(drawn, columns)) * SIDE
    _, y, x = _quarters(tops, lefts, SIDE, shape)
    cells = _cells(y.ravel(), x.ravel(), _rim(SIDE // 2), shape)
    each, place = np.unique(cells, return_inverse=True)
    labels = plan.label_again(each).label[place].reshape(cells.shape)
    share = float(_several(labels).reshape(count, 4).all(axis=1).mean())
    return {"refined": share <= MOST_FRACTAL, "fractal_blocks": share}


def _several(labels: NDArray[np.int16]) -> Mask:
    """Return which rows have several labels."""
    mixed: Mask = labels.min(axis=1) != labels.max(axis=1)
    return mixed


def _lattice(shape: tuple[int, ...]) -> tuple[Indices, Indices]:
    """Return the first cells of the largest blocks: rows and columns."""
    rows, columns = (np.arange(0, max(count - 1, 1), SIDE) for count in shape)
    tops, lefts = np.meshgrid(rows, columns, indexing="ij")
    return tops.ravel(), lefts.ravel()


def _quarters(
    tops: Indices, lefts: Indices, side: int, shape: tuple[int, ...]
) -> tuple[Mask, Indices, Indices]:
    """Return which quarters of blocks are inside the grid, and their first cells; (blocks, 4)."""
    half = side // 2
    y = tops[:, np.newaxis] + np.array([0, 0, half, half])
    x = lefts[:, np.newaxis] + np.array([0, half, 0, half])
    rows, columns = (max(count - 1, 1) for count in shape)
    return (y < rows) & (x < columns), y, x


def _rim(side: int) -> tuple[Indices, Indices]:
    """Return rows and columns of the rim's cells from the first cell of a block."""
    y, x = _square(side)
    rim = (y % side == 0) | (x % side == 0)
    return y[rim], x[rim]


def _square(side: int) -> tuple[Indices, Indices]:
    """Return rows and columns of all cells, the rim included."""
    y, x = np.divmod(np.arange((side + 1) ** 2), side + 1)
    return y, x


def _cells(
    tops: Indices, lefts: Indices, offsets: tuple[Indices, Indices], shape: tuple[int, ...]
) -> Indices:
    """Return the indices of cells of blocks; those beyond the grid are on its last rows."""
    y = np.minimum(tops[:, np.newaxis] + offsets[0], shape[0] - 1)
    cells: Indices = y * shape[1] + np.minimum(lefts[:, np.newaxis] + offsets[1], shape[1] - 1)
    return cells
