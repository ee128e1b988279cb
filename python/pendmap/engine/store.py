"""Where the results of tiles are kept: in memory, or in a Zarr store that survives a kill.

A store has cells and records. Cells are the arrays of the result with a value for each cell; a tile
is a slice of their first dimension and one chunk of each array. Records are bytes under a name:
``STEP/TILE`` is the record of a tile, written after its cells. A tile whose record exists is done.
Every file is written whole: to another name first, then moved; an object store does so by itself.

A local store ``map.zarr`` is ``map.zarr.part`` until the result is complete, and is moved then. A
store at another address is there from its beginning; its attribute tells whether it is complete.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import importlib.util
import io
import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np

from pendmap.errors import InputError
from pendmap.files import move_folder
from pendmap.files.dataset import MARK, check_replaceable, open_zarr, restored, write_zarr

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    import fsspec
    import xarray as xr
    import zarr
    from numpy.typing import NDArray

    Cells = Mapping[str, NDArray[Any]]

_WORK: Final = "work"  # Folder of the records; removed when the result is complete
_CELLS: Final = "cells"  # Record of the names of the arrays of the cells


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


@dataclasses.dataclass(frozen=True)
class ZarrStore:
    """A Zarr store at a path or any address of fsspec, like ``s3://bucket/map.zarr``."""

    address: str
    shared = True

    def __post_init__(self) -> None:
        for name in ("zarr", "fsspec"):
            if importlib.util.find_spec(name) is None:
                raise InputError(f"{self.address}: a store needs the extra pendmap[zarr]")

    def __getstate__(self) -> dict[str, Any]:
        return {"address": self.address}

    def __setstate__(self, state: dict[str, Any]) -> None:
        object.__setattr__(self, "address", state["address"])

    @functools.cached_property
    def _place(self) -> tuple[fsspec.AbstractFileSystem, str]:
        """The file system, and the path of the complete store in it."""
        import fsspec  # noqa: PLC0415 (an extra)

        try:
            system, path = fsspec.core.url_to_fs(self.address)
        except (ImportError, ValueError) as error:
            raise InputError(f"{self.address}: {error}") from None
        if "file" in np.atleast_1d(system.protocol):
            return system, str(Path(path).resolve())
        return system, path.rstrip("/")

    @functools.cached_property
    def local(self) -> bool:
        """Whether it is a folder of this machine."""
        return "file" in np.atleast_1d(self._place[0].protocol)

    @property
    def _name(self) -> str:
        """Path of a local store as it was given."""
        return self.address.removeprefix("file://")

    @property
    def unfinished(self) -> str:
        """Name of the store until it is complete."""
        return f"{self._name.rstrip('/')}.part" if self.local else self.address

    @property
    def _root(self) -> str:
        """Path of the store until it is complete."""
        return f"{self._place[1]}.part" if self.local else self._place[1]

    @property
    def _url(self) -> str:
        return self._root if self.local else self.address

    @functools.cached_property
    def group(self) -> zarr.Group:
        """The root group of an unfinished store."""
        import zarr  # noqa: PLC0415 (an extra)

        try:
            return zarr.open_group(self._url, mode="r+", zarr_format=3)
        except (FileNotFoundError, ValueError, KeyError) as error:
            raise InputError(f"{self.unfinished}: cannot be read as a store: {error}") from error

    # ---- the mark

    def mark(self) -> dict[str, Any] | None:
        """Return what the run says of its request, that of an unfinished one first; None: no run.

        Raises InputError for what is neither a run nor a result that may be replaced, or for an
        address that cannot be reached, OSError for a missing folder.
        """
        system, path = self._place
        if self.local and not Path(path).parent.is_dir():
            raise FileNotFoundError(2, "the folder does not exist", str(Path(self._name).parent))
        try:
            self.publish()
        except (InputError, OSError):
            raise
        except Exception as error:  # libraries of object stores have their own
            raise InputError(f"{self.address}: cannot be reached: {error}") from error
        if system.exists(self._root):
            if not system.exists(f"{self._root}/zarr.json"):
                if system.isfile(self._root) or system.ls(self._root, detail=False):
                    raise InputError(f"{self.unfinished}: must be new or a store, it is neither")
                return None
            return _mark(self.group)
        return self._finished()

    def _finished(self) -> dict[str, Any] | None:
        """Return the request of a complete local store; None if there is none."""
        import zarr  # noqa: PLC0415 (an extra)

        if not self.local:
            return None
        _, path = self._place
        check_replaceable(self._name)
        if not Path(path, "zarr.json").exists():
            return None
        return _mark(zarr.open_group(path, mode="r"))

    def begin(self, mark: Mapping[str, Any]) -> None:
        """Make an empty store with this mark; a complete one elsewhere than here is removed."""
        import zarr  # noqa: PLC0415 (an extra)

        system, _ = self._place
        if not self.local and system.exists(self._root):
            system.rm(self._root, recursive=True)
        zarr.create_group(self._url, zarr_format=3, attributes={MARK: dict(mark)})
        self.group.create_group(_WORK)

    def abandon(self) -> None:
        """Remove a store in which nothing has been done."""
        system, _ = self._place
        if system.exists(self._root) and all(
            name.endswith("/zarr.json") for name in system.ls(f"{self._root}/{_WORK}", detail=False)
        ):
            system.rm(self._root, recursive=True)

    def go_on(self) -> None:
        """Remove what a killed process has written of the result beside the cells."""
        system, _ = self._place
        cells = unpack(self.get(_CELLS) or pack(names=[]))["names"]
        for name in system.ls(self._root, detail=False):
            if name.rsplit("/", 1)[-1] not in {*cells, _WORK, "zarr.json"}:
                system.rm(name, recursive=True)

    # ---- cells

    def create(self, layout: Layout) -> None:
        """Make the arrays of the cells, unless they exist; InputError if they have other tiles."""
        import zarr  # noqa: PLC0415 (an extra)

        self.put(_CELLS, pack(names=[*layout.dtypes]))
        chunks = (layout.height, *layout.shape[1:])
        for name, dtype in layout.dtypes.items():
            with contextlib.suppress(zarr.errors.ContainsArrayError):
                self.group.create_array(
                    name,
                    shape=layout.shape,
                    chunks=chunks,
                    dtype=dtype,
                    dimension_names=layout.dims,
                    config={"write_empty_chunks": True},
                )
            if (tiles := self._array(name).chunks) != chunks:
                raise InputError(
                    f"{self.unfinished}: was begun with tiles of {tiles}, not {chunks}"
                )

    @functools.cached_property
    def _arrays(self) -> dict[str, zarr.Array[Any]]:
        return {}

    def _array(self, name: str) -> zarr.Array[Any]:
        if name not in self._arrays:
            self._arrays[name] = self.group[name]  # type: ignore[assignment]
        return self._arrays[name]

    def write(self, tile: int, cells: Cells) -> None:
        """Write the cells of a tile, one chunk of each array."""
        import zarr  # noqa: PLC0415 (an extra)

        for name, values in cells.items():
            array = self._array(name)
            first = tile * array.chunks[0]
            last = min(first + array.chunks[0], array.shape[0])
            with zarr.config.set({"array.write_empty_chunks": True}):
                array[first:last] = values.reshape(last - first, *array.shape[1:])

    def read(self, name: str, rows: slice) -> NDArray[Any]:
        """Return rows of an array of cells."""
        return np.asarray(self._array(name)[rows])

    def whole(self, name: str) -> Any:  # noqa: ANN401 (a lazy array of xarray)
        """Return an array of cells that is read when it is used."""
        if name.startswith(_WORK):  # removed at the end
            return np.asarray(self._array(name)[:])
        others = [other for other in self.group.array_keys() if other != name]
        return open_zarr(self._url, drop=others)[name].variable._data  # noqa: SLF001

    # ---- records

    def get(self, name: str) -> bytes | None:
        """Return a record, or None if there is none."""
        try:
            data: bytes = self._place[0].cat_file(f"{self._root}/{_WORK}/{name}")
        except FileNotFoundError:
            return None
        return data

    def put(self, name: str, data: bytes) -> None:
        """Write a record, whole or not at all."""
        target = f"{self._root}/{_WORK}/{name}"
        if not self.local:
            self._place[0].pipe_file(target, data)
            return
        part = Path(f"{target}.{uuid.uuid4().hex}.part")
        part.parent.mkdir(parents=True, exist_ok=True)
        try:
            part.write_bytes(data)
            part.replace(target)
        except OSError:
            part.unlink(missing_ok=True)
            raise

    def done(self, step: str) -> set[int]:
        """Return the tiles of a step whose record exists."""
        system, _ = self._place
        system.invalidate_cache()
        try:
            names = system.ls(f"{self._root}/{_WORK}/{step}", detail=False)
        except FileNotFoundError:
            return set()
        last = (name.rsplit("/", 1)[-1] for name in names)
        return {int(name) for name in last if name.isdigit()}

    # ---- the result

    def complete(
        self, dataset: xr.Dataset, cells: Collection[str], mark: Mapping[str, Any]
    ) -> None:
        """Write all of a result except its cells, then its attributes, and remove the records."""
        before = {MARK: self.group.attrs[MARK]}
        attributes = write_zarr(dataset.drop_vars(cells), self._url, before)
        for name in cells:
            self._array(name).attrs.put(_plain(dataset[name].attrs))
        self.__dict__.pop("group")  # xarray has written to its attributes
        written = self.group.attrs.asdict()  # among them names of coordinates
        self.group.attrs.put({**written, **_plain(attributes), MARK: dict(mark)})
        self.publish()

    def publish(self) -> None:
        """Remove the records of a complete store, and move it to its name; no other is moved.

        A run that is killed here goes on with it.
        """
        system, path = self._place
        name = f"{self._root}/zarr.json"
        if not system.exists(name) or not (_mark(self.group) or {}).get("complete"):
            self.__dict__.pop("group", None)
            return
        self.__dict__.pop("group", None)
        if system.exists(f"{self._root}/{_WORK}"):
            system.rm(f"{self._root}/{_WORK}", recursive=True)
        if not self.local:
            return
        for broken in Path(self._root).rglob("*.partial"):  # of a process killed while it wrote
            broken.unlink(missing_ok=True)
        check_replaceable(self._name)
        move_folder(Path(self._root), Path(path))

    def result(self, chunks: Any = None) -> xr.Dataset:  # noqa: ANN401 (of xarray)
        """Return the complete result, whose variables are read when they are used."""
        place = self._place[1] if self.local else self.address
        dataset = restored(open_zarr(place, chunks=chunks))
        del dataset.attrs[MARK]
        return dataset


def _mark(group: zarr.Group) -> dict[str, Any] | None:
    mark: Any = group.attrs.asdict().get(MARK)
    return mark if isinstance(mark, dict) and "complete" in mark else None


def _plain(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes without numpy's types."""
    numpys = (np.generic, np.ndarray)
    return {k: v.tolist() if isinstance(v, numpys) else v for k, v in attributes.items()}
