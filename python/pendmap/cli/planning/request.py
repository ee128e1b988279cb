"""An analysis that is asked for, and the same one with fewer cells."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

from pendmap.analysis.basin_tiles import Starts, tile_of
from pendmap.analysis.grid import Axis, Grid
from pendmap.analysis.sweeps.tiles import SIDES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import xarray as xr

    Run = Callable[[dict[str, Any]], xr.Dataset]
    """Function that computes the result of other arguments."""
    Save = Callable[[xr.Dataset], int]
    """Function that writes the files of a result and returns their bytes."""

_BLOCK: Final = 16  # Cells along a side of a block of a map over parameters
_CHECKED: Final = 6000  # Starts of the check of labels
_UNCERTAIN: Final = (30_000, 0.125, 150_000)
"""Starts near one another that measure the boundary: least, share of the cells, most."""
_MEASURED: Final = 10_000  # Cells of a map from which on it is measured


@dataclasses.dataclass(frozen=True)
class Request:
    """An analysis by its kind, and its arguments."""

    kind: str
    arguments: Mapping[str, Any]

    @property
    def counts(self) -> dict[str, int]:
        """Number of values of each parameter that varies."""
        return {name: span[2] for name, span in self.arguments.get("ranges", {}).items()}

    @property
    def cells(self) -> int:
        """Number of cells of the result: starts, values of parameters, or both."""
        if self.kind == "lifetime":
            return int(self.arguments["starts"])
        grid = self.arguments.get("grid")
        return math.prod(self.counts.values()) * (1 if grid is None else grid.cells)

    @property
    def starts(self) -> int:
        """Number of starts of the result, of drawn models too."""
        each = 1 if self.kind == "lifetime" else int(self.arguments.get("starts", 1))
        return self.cells * each * (1 + (self.arguments.get("draws") or 0))

    @property
    def tiles(self) -> int:
        """Number of tiles in a store, or with workers."""
        counts = [*self.counts.values()]
        if self.kind == "basin_sweep":
            return math.prod(-(-n // s) for n, s in zip(counts, SIDES[len(counts)], strict=True))
        if counts:
            return math.prod(-(-n // _BLOCK) for n in counts)
        grid = self.arguments.get("grid")
        sides = (1, self.cells) if grid is None else (grid.theta.count, grid.velocity.count)
        starts = Starts(((0.0, 1.0, sides[0]), (0.0, 1.0, sides[1])))
        return -(-sides[1] // starts.height(tile_of(self.cells)))

    @property
    def checks(self) -> int:
        """Number of starts that are labelled again, beside the samples."""
        if self.kind != "basins":
            return 0
        least, share, most = _UNCERTAIN
        measured = min(max(least, int(share * self.cells)), most)
        return min(_CHECKED, 3 * self.cells) + (measured if self.cells >= _MEASURED else 0)

    def fewer(self, cells: int) -> Request:
        """Return the request with about this number of cells, spread over the same ranges."""
        own = {**self.arguments, "draws": None} if "draws" in self.arguments else {**self.arguments}
        if self.kind == "basins":
            own["check"] = False
        if "curves" in own:
            own["curves"] = False
        if self.kind == "lifetime":
            own["starts"] = min(cells, self.cells)
        if self.counts:
            counts = share([*self.counts.values()], cells)
            spans = zip(own["ranges"].items(), counts, strict=True)
            own["ranges"] = {name: _middles(span, count) for (name, span), count in spans}
        if own.get("grid") is not None:
            own["grid"] = fewer_starts(own["grid"], cells)
        return Request(self.kind, own)


def share(counts: Sequence[int], cells: int) -> list[int]:
    """Return lower counts with about this product, as equal as they may be."""
    found = dict.fromkeys(range(len(counts)), 1)
    for done, k in enumerate(sorted(found, key=counts.__getitem__)):
        side = math.ceil(cells ** (1 / (len(counts) - done)))
        found[k] = max(1, min(counts[k], side))
        cells = -(-cells // found[k])
    return [*found.values()]


def fewer_starts(grid: Grid, cells: int) -> Grid:
    """Return a grid over the same window with about this number of cells."""
    axes = (grid.theta, grid.velocity)
    both = zip(axes, share([axis.count for axis in axes], cells), strict=True)
    return Grid(*(Axis(axis.low, axis.high, count) for axis, count in both))


def _middles(span: tuple[float, float, int], count: int) -> tuple[float, float, int]:
    """Return the range of the middles of ``count`` equal parts of a range, or the range itself."""
    low, high, had = span
    if count == had:
        return low, high, had
    half = (high - low) / count / 2
    return low + half, (high - half if count > 1 else low + half), count
