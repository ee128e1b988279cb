"""A Zarr store of tiles, which survives a kill.

A local store ``map.zarr`` is ``map.zarr.part`` until the result is complete, and is moved then. A
store at another address is there from its beginning; its attribute tells whether it is complete.
Every file is written whole: to another name first, then moved; an object store does so by itself.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, ParamSpec, TypeVar, cast

import numpy as np

from pendmap.engine.lock import held
from pendmap.engine.store import Layout, pack, unpack
from pendmap.errors import InputError, NotWrittenError, one_line
from pendmap.files import move_folder, sealed
from pendmap.files.dataset import check_replaceable, open_zarr, restored, stored_form, write_zarr
from pendmap.files.sealed import MARK, WORK

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping

    import fsspec
    import xarray as xr
    import zarr
    from numpy.typing import NDArray

    from pendmap.engine.store import Cells
    from pendmap.files.strict import StrictStore

P = ParamSpec("P")
T = TypeVar("T")

_REST: Final = "rest"  # Record of the names of the variables of the result that are no cells
_CHECK: Final = 32  # Bytes of a SHA-256: at the end of a record that of the others


def _reached(method: Callable[P, T]) -> Callable[P, T]:
    """Let errors of an object store name its address and the reason."""

    @functools.wraps(method)
    def call(*words: P.args, **given: P.kwargs) -> T:
        try:
            return method(*words, **given)
        except (InputError, MemoryError, NotWrittenError):
            raise
        except Exception as error:  # libraries of object stores have their own
            store: Any = words[0]
            if store.local:
                raise
            reason = one_line(str(error)) or type(error).__name__
            raise NotWrittenError(f"{store.address}: cannot be reached: {reason}") from error

    return call


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
        return {"address": self.address, "_layouts": self._layouts}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)

    @functools.cached_property
    def _place(self) -> tuple[fsspec.AbstractFileSystem, str]:
        """The file system, and the path of the complete store in it."""
        try:
            return sealed.place(self.address)
        except (ImportError, ValueError) as error:
            raise InputError(f"{self.address}: {error}") from None

    @functools.cached_property
    def local(self) -> bool:
        """Whether it is a folder of this machine."""
        return sealed.is_local(self._place[0])

    @property
    def unfinished(self) -> str:
        """Name of the store until it is complete."""
        return f"{self.address.rstrip('/')}.part" if self.local else self.address

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
        return sealed.opened(self._url)

    # ---- the run that holds it

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Hold the store while a run writes it; raises InputError if another run does."""
        if self.local and not Path(self._place[1]).parent.is_dir():
            folder = str(Path(self.address).parent)
            raise FileNotFoundError(2, "the folder does not exist", folder)
        with contextlib.ExitStack() as stack:
            self.__dict__["_check"] = self._hold(stack)
            stack.callback(self.__dict__.pop, "_check")
            yield

    @_reached
    def _hold(self, stack: contextlib.ExitStack) -> Callable[[], None]:
        system, path = self._place
        return stack.enter_context(held(self.address, system, f"{path}.lock", local=self.local))

    @_reached
    def _check_held(self) -> None:
        """Raise NotWrittenError if another run may hold the store now."""
        self.__dict__["_check"]()

    # ---- the mark

    @_reached
    def mark(self, *, resume: bool) -> dict[str, Any] | None:
        """Return what the run says of its request, that of an unfinished one first; None: no run.

        Without ``resume`` a complete result at a path is none: it will be replaced. Raises
        InputError for what is neither a run nor a result that may be replaced, or is damaged.
        """
        system, path = self._place
        self.publish()
        if system.exists(f"{self._root}/zarr.json"):
            return self._run(self._url)
        if system.isfile(self._root) or [*sealed.strangers(self._url)]:
            raise InputError(f"{self.unfinished}: must be new or a store, it is neither")
        if not self.local:
            return None
        check_replaceable(self.address)
        if not resume or not Path(path, "zarr.json").exists():
            return None
        return self._run(path)

    @_reached
    def finished(self) -> bool:
        """Return whether there is a complete result; nothing of it is checked but its mark."""
        system, path = self._place
        if not system.exists(f"{path}/zarr.json"):
            return False
        mark = sealed.metadata(self.address)[0].get("attributes", {}).get(MARK)
        return isinstance(mark, dict) and mark.get("complete") is True

    def _run(self, url: str) -> dict[str, Any]:
        mark, _ = sealed.checked(url)
        if "analysis" not in mark:
            raise InputError(f"{self.address}: is no store of a run, --overwrite replaces it")
        return mark

    @_reached
    def begin(self, mark: Mapping[str, Any]) -> None:
        """Make an empty store with this mark; a complete one elsewhere than here is removed."""
        import zarr  # noqa: PLC0415 (an extra)

        system, _ = self._place
        self._check_held()
        if not self.local and system.exists(self._root):
            for name in sealed.foreign(self._url):
                raise InputError(f"{self.address}: cannot be replaced, it has {name!r}")
            system.rm(self._root, recursive=True)
        zarr.create_group(self._url, zarr_format=3, attributes={MARK: sealed.signed(mark)})
        sealed.put_whole(system, f"{self._root}/{WORK}/zarr.json", sealed.GROUP)

    def abandon(self) -> None:
        """Remove a store in which nothing has been done."""
        system, _ = self._place
        with contextlib.suppress(NotWrittenError):  # another run has it
            self._check_held()
            files = {name.removeprefix(self._root).lstrip("/") for name in system.find(self._root)}
            if files and files <= {"zarr.json", f"{WORK}/zarr.json"}:
                system.rm(self._root, recursive=True)

    @_reached
    def go_on(self) -> None:
        """Remove what a killed process has written of the result beside the cells."""
        system, _ = self._place
        self._check_held()
        sealed.put_whole(system, f"{self._root}/{WORK}/zarr.json", sealed.GROUP)
        for name in unpack(self.get(_REST) or pack(names=[]))["names"]:
            if system.exists(f"{self._root}/{name}"):
                system.rm(f"{self._root}/{name}", recursive=True)

    # ---- cells

    @functools.cached_property
    def _layouts(self) -> dict[str, Layout]:
        return {}

    @_reached
    def create(self, layout: Layout) -> None:
        """Make the arrays of the cells, unless they exist; InputError if they have other tiles."""
        system, _ = self._place
        self._layouts[layout.step] = layout
        chunks = (layout.height, *layout.shape[1:])
        before = self.get(f"tiles-{layout.step}")
        if before is not None and (tiles := tuple(unpack(before)["chunks"].tolist())) != chunks:
            raise InputError(f"{self.unfinished}: was begun with tiles of {tiles}, not {chunks}")
        self.put(f"tiles-{layout.step}", pack(chunks=chunks))
        for name, dtype in layout.dtypes.items():
            if system.exists(f"{self._root}/{name}/zarr.json"):  # it may be damaged
                system.rm_file(f"{self._root}/{name}/zarr.json")
            self.group.create_array(
                name,
                shape=layout.shape,
                chunks=chunks,
                dtype=dtype,
                compressors=sealed.compressors(),
                dimension_names=layout.dims,
                config={"write_empty_chunks": True},
            )

    @functools.cached_property
    def _arrays(self) -> dict[str, zarr.Array[Any]]:
        return {}

    def _array(self, name: str) -> zarr.Array[Any]:
        if name not in self._arrays:
            self._arrays[name] = self.group[name]  # type: ignore[assignment]
        return self._arrays[name]

    @_reached
    def write(self, tile: int, cells: Cells) -> None:
        """Write the cells of a tile, one chunk of each array."""
        import zarr  # noqa: PLC0415 (an extra)

        for name, values in cells.items():
            array = self._array(name)
            first = tile * array.chunks[0]
            last = min(first + array.chunks[0], array.shape[0])
            with zarr.config.set({"array.write_empty_chunks": True}):
                array[first:last] = values.reshape(last - first, *array.shape[1:])

    @_reached
    def read(self, name: str, rows: slice) -> NDArray[Any]:
        """Return rows of an array of cells."""
        return np.asarray(self._array(name)[rows])

    def holds(self, step: str, tile: int) -> bool:
        """Return whether the cells that a step has written of a tile are there, undamaged."""
        layout = self._layouts.get(step)
        if layout is None:
            return True
        try:
            for name in layout.dtypes:
                self.read(name, layout.rows(tile))
        except (InputError, ValueError, RuntimeError):  # a chunk that is missing, or damaged
            return False
        return self._digest(step, tile) == (self._stored(f"{step}/{tile}") or b"")[-_CHECK:]

    def _digest(self, step: str, tile: int) -> bytes:
        """Return the digest of the chunks of a tile that this process has read or written last."""
        layout = self._layouts.get(step)
        parts: list[bytes] = []
        for name in sorted(layout.dtypes) if layout is not None else ():
            rest = "/0" * (len(layout.shape) - 1)  # type: ignore[union-attr]
            parts.append(self._strict.checks.get(f"{name}/c/{tile}{rest}", b""))
        return hashlib.sha256(b"".join(parts)).digest()

    @property
    def _strict(self) -> StrictStore:
        """The store of zarr behind the group."""
        store: Any = self.group.store
        return cast("StrictStore", store)

    def whole(self, name: str) -> Any:  # noqa: ANN401 (a lazy array of xarray)
        """Return an array of cells that is read when it is used."""
        if name.startswith(WORK):  # removed at the end
            return np.asarray(self._array(name)[:])
        others = [other for other in sealed.metadata(self._url)[1] if other != name]
        return open_zarr(self._url, drop=others)[name].variable._data  # noqa: SLF001

    # ---- records

    @_reached
    def get(self, name: str) -> bytes | None:
        """Return a record, or None if there is none or it is damaged."""
        data = self._stored(name)
        return None if data is None else data[:-_CHECK]

    def _stored(self, name: str) -> bytes | None:
        """Return a record and the digest of its tile's chunks; None if it is damaged."""
        try:
            data: bytes = self._place[0].cat_file(f"{self._root}/{WORK}/{name}")
        except FileNotFoundError:
            return None
        content, check = data[:-_CHECK], data[-_CHECK:]
        return content if hashlib.sha256(content).digest() == check else None

    @_reached
    def put(self, name: str, data: bytes) -> None:
        """Write a record, whole or not at all; that of a tile with a digest of its chunks."""
        step, _, tile = name.rpartition("/")
        data += self._digest(step, int(tile) if tile.isdigit() else 0)
        data += hashlib.sha256(data).digest()
        sealed.put_whole(self._place[0], f"{self._root}/{WORK}/{name}", data)

    @_reached
    def done(self, step: str) -> set[int]:
        """Return the tiles of a step whose record exists."""
        system, _ = self._place
        system.invalidate_cache()
        try:
            names = system.ls(f"{self._root}/{WORK}/{step}", detail=False)
        except FileNotFoundError:
            return set()
        last = (name.rsplit("/", 1)[-1] for name in names)
        return {int(name) for name in last if name.isdigit()}

    # ---- the result

    @_reached
    def complete(
        self, dataset: xr.Dataset, cells: Collection[str], mark: Mapping[str, Any]
    ) -> None:
        """Write all of a result except its cells, then its attributes, and publish it."""
        self._check_held()
        rest = dataset.drop_vars(cells)
        self.put(_REST, pack(names=[*stored_form(rest)[0].variables]))
        attributes = write_zarr(rest, self._url, {MARK: self.group.attrs[MARK]})
        for name in cells:
            self._array(name).attrs.put(_plain(dataset[name].attrs))
        sealed.seal(self._url, {**_plain(attributes), MARK: dict(mark)})
        self.publish(read=False)

    @_reached
    def publish(self, *, read: bool = True) -> None:
        """Remove the records of a complete store, and move it to its name; no other is moved.

        A run that is killed here goes on with it, and reads all of it first.
        """
        system, path = self._place
        self.__dict__.pop("group", None)
        self._arrays.clear()
        beside = system.exists(f"{self._root}/{WORK}")
        if not (self.local or beside) or not system.exists(f"{self._root}/zarr.json"):
            return
        if not sealed.checked(self._url)[0]["complete"]:
            return
        if read:
            sealed.check_chunks(self._url)
        for name in sealed.foreign(self._url):
            if name.startswith(f"{WORK}/"):
                raise InputError(f"{self.unfinished}: has {name!r}, which is no part of the run")
        self._check_held()
        if beside:
            system.rm(f"{self._root}/{WORK}", recursive=True)
        if not self.local:
            return
        sealed.remove_remains(Path(self._root))
        check_replaceable(self.address)
        move_folder(Path(self._root), Path(path))

    @_reached
    def result(self, chunks: Any = None, *, again: bool = False) -> xr.Dataset:  # noqa: ANN401
        """Return the complete result, whose variables are read when they are used.

        One that is shown ``again`` is read whole first: InputError if anything is lost.
        """
        place = self._place[1] if self.local else self.address
        if again:
            sealed.check_chunks(place)
        dataset = restored(open_zarr(place, chunks=chunks))
        del dataset.attrs[MARK]
        return dataset


def _plain(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes without numpy's types."""
    numpys = (np.generic, np.ndarray)
    return {k: v.tolist() if isinstance(v, numpys) else v for k, v in attributes.items()}
