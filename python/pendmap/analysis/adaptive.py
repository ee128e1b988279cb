"""Adaptive basin maps: blocks of cells inside which every label follows from those around it.

A block is a square of the grid's cells with its rim, whose cells it shares with its neighbours; its
side, the distance between opposite rims, is 40 cells first. Where all cells of the rim have one
label, the cells inside get it: they are filled. Else the block is split into four, down to a side
of 5 cells, of which all cells are computed. So are those of a block whose four quarters have
several labels on their rims each: a smooth boundary that crosses a block misses one of its
quarters. What is undecided or failed is never filled. (Rims before insides: the algorithm of
Mariani & Silver; A. K. Dewdney 1989, Scientific American 260 (2), 108.)

Blocks begin at multiples of 40 cells from the first cell of the grid, and what is computed in one
depends on its own cells alone: not on tiles, if those begin with a row of blocks.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from scipy.special import betaincinv

from pendmap.analysis.numerics import part
from pendmap.analysis.result import Field, Found
from pendmap.files import facts
from pendmap.formatting import percent

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    import xarray as xr
    from numpy.typing import NDArray

    from pendmap import _core
    from pendmap.analysis.numerics import Progress
    from pendmap.signal import Indices, Mask

    Label = Callable[[Indices], _core.LabelledStarts]
    """Function that labels the starts with these indices."""

SIDE: Final = 40
"""Side of the largest blocks in cells: on rims 40 apart lie 5 % of the cells."""
LEAST: Final = 5  # Side of the smallest blocks
_STEPS: Final = 7  # Number of times that cells are computed: last rim, by sides, inside, audit
_BLOCKS: Final = 64  # Largest number of blocks that are tried before the map, one in four at most
MOST_FRACTAL: Final = 0.5  # Share of blocks computed whole above which all cells are computed
_AUDIT: Final = 10_000  # Number of cells drawn for the audit, one in 32 at most
FILLED, COMPUTED, RIGHT, WRONG = range(4)
HOW: Final = {
    FILLED: "filled",
    COMPUTED: "computed",
    RIGHT: "audited",
    WRONG: "audited_where_filled_wrong",
}
"""How the label of a cell was found."""
NO_TURNS: Final = int(np.iinfo(np.int32).min)  # Net turns of a cell that was not computed
NEVER: Final = -1  # Settling time of a cell that was not captured, or not computed


def _told(dataset: xr.Dataset) -> dict[str, Any] | None:
    """Return what an adaptive map computed and audited for the JSON object."""
    a = facts(dataset)
    if "adaptive" not in a:
        return None
    low, high = a["label_error_low"], a["label_error_high"]
    return {
        "computed": a["computed_share"],
        "fractal_blocks": a.get("fractal_blocks"),
        "audited": a["audited"],
        "audited_wrong": a["audited_wrong"],
        "label_error": {"value": a["label_error"], "ci95": [low, high]},
    }


FIELDS: Final = (
    Field("adaptive", "", "cells computed, and the error of those filled", None, read=_told),
    Found("computed_share", "1", "share of the cells that were computed", None, json=False),
    Found(
        "fractal_blocks",
        "1",
        "share of blocks tried whose quarters all have several labels on their rims; above one "
        "half all cells are computed",
        None,
        json=False,
    ),
    Found("audited", "1", "filled cells drawn at random and computed", None, json=False),
    Found("audited_wrong", "1", "those filled with a wrong label", None, json=False),
    Found("label_error", "1", "share of cells with a wrong label, by the audit", None, json=False),
    Found("label_error_low", "1", "lower end of its 95 % interval", None, json=False),
    Found("label_error_high", "1", "upper end of its 95 % interval", None, json=False),
)
"""Facts of an adaptive map."""
FACTS: Final = tuple(field.name for field in FIELDS)


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
        self.computed[cells] = _audited(self.label[cells], filled)
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
    audited, filled = band.audit(drawn[(drawn >= 0) & (drawn < own)])
    cells: dict[str, NDArray[Any]] = {
        "label": band.label[:own],
        "settle_periods": band.settle[:own],
        "net_turns": band.turns[:own],
        "computed": band.computed[:own],
    }
    undecided = np.count_nonzero(cells["label"] == 0)
    return cells, {"work": band.work, "undecided": undecided, "audited": audited, "filled": filled}


def audit_again(
    cells: Mapping[str, NDArray[Any]],
    moves: Iterable[NDArray[np.int16]],
    record: Mapping[str, NDArray[Any]],
) -> None:
    """Compare audited cells of a tile anew, after later steps; ``moves`` have renamed labels."""
    if "audited" in record:
        filled = record["filled"]
        for moved in moves:
            filled = moved[filled - 1]
        cells["computed"][record["audited"]] = _audited(cells["label"][record["audited"]], filled)


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


def drawn_cells(cells: int, seed: int) -> Indices:
    """Return the indices of the cells of a grid that are audited if they are filled, rising."""
    draw = np.random.default_rng([seed, 1])
    return np.unique(draw.integers(cells, size=min(_AUDIT, cells // 32)))


def _audited(label: NDArray[np.int16], filled: NDArray[np.int16]) -> NDArray[np.int8]:
    """Return how cells were found whose computed and filled labels these are."""
    return np.where(label == filled, RIGHT, WRONG).astype(np.int8)


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


class Tally:
    """Counts of the cells of a map: how they were found, and when they settled."""

    def __init__(self) -> None:
        self._cells = np.zeros(len(HOW), np.int64)
        self._settled = np.zeros(len(HOW), np.int64)
        self._periods = np.zeros(len(HOW), np.int64)
        self.longest = NEVER
        """Longest settling time; -1 if no start settled."""

    def add(self, cells: Mapping[str, NDArray[Any]]) -> None:
        """Add some cells; without ``computed`` all have been."""
        settle, how = cells["settle_periods"], cells.get("computed")
        for k, own in self._parts(settle, how):
            known = own[own >= 0]
            self._cells[k] += own.size
            self._settled[k] += known.size
            self._periods[k] += int(known.sum(dtype=np.int64))
            self.longest = max(self.longest, int(known.max(initial=NEVER)))

    @staticmethod
    def _parts(
        settle: NDArray[Any], how: NDArray[Any] | None
    ) -> Iterator[tuple[int, NDArray[Any]]]:
        if how is None:
            yield COMPUTED, settle
            return
        for k in HOW:
            yield k, settle[how == k]

    @property
    def mean_settle(self) -> float:
        """Mean settling time, where audited cells stand for the filled ones; -1 if none settled."""
        rest, drawn = self._cells[FILLED], self._cells[RIGHT:].sum()
        weight = 1 + rest / drawn if rest and drawn else 1
        number, total = (
            own[COMPUTED].item() + weight * own[RIGHT:].sum().item()
            for own in (self._settled, self._periods)
        )
        return float(total / number) if number else -1.0

    def facts(self, record: Mapping[str, NDArray[Any]]) -> dict[str, float]:
        """Return what was tried and computed, and the share of wrong labels with its 95 % interval.

        The interval is exact for a binomial count (Clopper & Pearson 1934, Biometrika 26, 404).
        """
        drawn, wrong = self._cells[RIGHT:].sum().item(), self._cells[WRONG].item()
        rest = (self._cells[FILLED] / self._cells.sum()).item()
        low = betaincinv(wrong, drawn - wrong + 1, 0.025) if wrong else 0.0
        high = betaincinv(wrong + 1, drawn - wrong, 0.975) if wrong < drawn else 1.0
        return {
            "adaptive": 1,
            "computed_share": 1 - rest,
            "audited": drawn,
            "audited_wrong": wrong,
            "label_error": rest * wrong / max(drawn, 1),
            "label_error_low": rest * float(low),
            "label_error_high": rest * float(high),
            **{name: record[name].item() for name in record if name in FACTS},
        }


def said(a: Mapping[str, Any]) -> list[str]:
    """Return summary lines of an adaptive map from its facts."""
    if "adaptive" not in a:
        return []
    if a["plane"] != "basins":
        return ["All cells were computed: without labels there is nothing to refine."]
    if a.get("fractal_blocks", 0) > MOST_FRACTAL:
        blocks = percent(100 * a["fractal_blocks"])
        line = (
            "The boundary is fractal everywhere at this resolution, and all cells were computed: "
            f"{blocks} of the blocks tried have several labels in each quarter."
        )
        return [line]
    share, low, high = (
        percent(100 * a[name]) for name in ("computed_share", "label_error_low", "label_error_high")
    )
    if a["computed_share"] == 1:
        return ["All cells were computed: each is at a boundary."]
    lines = [f"{share} of the cells were computed; the others are inside blocks of one label."]
    if a["audited"]:
        lines.append(
            f"Of {a['audited']} of these, drawn at random and computed, {a['audited_wrong']} had "
            f"another label: {low} to {high} of the map's labels are wrong (95 %)."
        )
    return lines
