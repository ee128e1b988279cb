"""Where the results of tiles are kept: what a store is, and one in memory.

A store has cells and records. Cells are arrays with a value for each cell; a tile is a slice of the
first dimension and one chunk of each array. Records are bytes under a name: ``STEP/TILE`` is the
record of a tile, written after its cells. A tile is done if its record and its chunks are there,
with their checksums. No record or chunk is ever written with another content.
"""

from __future__ import annotations

import dataclasses
import io
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Cells = Mapping[str, NDArray[Any]]


def pack(**arrays: Any) -> bytes:  # noqa: ANN401 (array_like)
    """Return arrays as the bytes of an ``.npz`` file."""
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def unpack(data: bytes) -> dict[str, NDArray[Any]]:
    """Return the arrays of :func:`pack`."""
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


@dataclasses.dataclass(frozen=True)
class Layout:
    """The arrays of the cells, and their tiles."""

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    height: int
    """Length of a tile along the first dimension; the last one may be shorter."""
    dtypes: Mapping[str, str]
    """Type of each array."""
    step: str = "cells"
    """Step that writes these cells."""

    @property
    def tiles(self) -> int:
        """Number of tiles."""
        return -(-self.shape[0] // self.height)

    def rows(self, tile: int) -> slice:
        """Return the part of the first dimension that a tile covers."""
        return slice(tile * self.height, min((tile + 1) * self.height, self.shape[0]))


class Store(Protocol):
    """What a store can do; ``shared`` tells whether another process can open it."""

    shared: bool

    def __hash__(self) -> int:
        """Stores of one address are one key of a cache."""

    def create(self, layout: Layout) -> None:
        """Make the arrays of the cells, unless they exist."""

    def write(self, tile: int, cells: Cells) -> None:
        """Write the cells of a tile."""

    def read(self, name: str, rows: slice) -> NDArray[Any]:
        """Return rows of an array of cells."""

    def whole(self, name: str) -> Any:  # noqa: ANN401 (of xarray or numpy)
        """Return an array of cells; a store in files reads it when it is used."""

    def get(self, name: str) -> bytes | None:
        """Return a record, or None if there is none."""

    def put(self, name: str, data: bytes) -> None:
        """Write a record."""

    def done(self, step: str) -> set[int]:
        """Return the tiles of a step whose record exists."""

    def holds(self, step: str, tile: int) -> bool:
        """Return whether the cells that a step has written of a tile are there, undamaged."""


class MemoryStore:
    """A store in this process."""

    shared = False

    def __init__(self) -> None:
        self.layout: Layout | None = None
        self.cells: dict[str, NDArray[Any]] = {}
        self.records: dict[str, bytes] = {}

    def create(self, layout: Layout) -> None:
        """Make the arrays of the cells."""
        self.layout = layout

    def write(self, tile: int, cells: Cells) -> None:
        """Write the cells of a tile; the only tile becomes the arrays themselves."""
        if self.layout is None:
            raise RuntimeError("a store must be created before cells are written")
        for name, values in cells.items():
            if self.layout.tiles == 1:
                self.cells[name] = values.reshape(self.layout.shape)
                continue
            if name not in self.cells:
                self.cells[name] = np.zeros(self.layout.shape, self.layout.dtypes[name])
            part = self.cells[name][self.layout.rows(tile)]
            part[...] = values.reshape(part.shape)

    def read(self, name: str, rows: slice) -> NDArray[Any]:
        """Return rows of an array of cells."""
        return self.cells[name][rows]

    def whole(self, name: str) -> NDArray[Any]:
        """Return an array of cells."""
        return self.cells[name]

    def get(self, name: str) -> bytes | None:
        """Return a record, or None if there is none."""
        return self.records.get(name)

    def put(self, name: str, data: bytes) -> None:
        """Write a record."""
        self.records[name] = data

    def done(self, step: str) -> set[int]:
        """Return the tiles of a step whose record exists."""
        names = (name.rsplit("/", 1) for name in self.records if "/" in name)
        return {int(tile) for folder, tile in names if folder == step}

    def holds(self, step: str, tile: int) -> bool:  # noqa: ARG002 (memory loses nothing)
        """Return whether the cells that a step has written of a tile are there."""
        return True
