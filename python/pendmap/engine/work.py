"""A computation in tiles: its steps, who computes them, where their records are kept.

It proceeds in steps; a step computes tiles, each from the step's state and from what earlier steps
have stored, never from other tiles of the step. So neither the number of workers, nor their order,
nor an interruption changes a bit of the result. A record is arrays or bytes under a name; that of a
tile is ``STEP/TILE``. Only the process that drives a run reads and writes records.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import dataclasses
import hashlib
import io
import json
import os
import shutil
import threading
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import InputError, NotWrittenError, instruction_set, one_line, short_repr
from pendmap.files import COMPLETE, dataset
from pendmap.files.atomic import lock
from pendmap.formatting import counted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path

    import xarray as xr
    from numpy.typing import NDArray

    Progress = Callable[[int, int], object]

_REQUEST: Final = "request"  # The first record
_CHECK: Final = 32  # Bytes of a SHA-256, at the beginning of a record in a file
_PARTS: Final = 1000  # Units of progress of a tile


def rounding() -> str:
    """Return the class of the instruction set in use: equal requests of a class give equal bits."""
    name = instruction_set()
    return "fused" if name in {"avx512", "avx2"} else name  # they round once after multiply and add


def pack(**arrays: Any) -> dict[str, NDArray[Any]]:
    """Return arrays as a record."""
    return {name: np.asarray(values) for name, values in arrays.items()}


def unpack(record: Any) -> dict[str, NDArray[Any]]:
    """Return the arrays of a record; one that is read from a file is an ``.npz``."""
    if not isinstance(record, bytes):
        return dict(record)
    with np.load(io.BytesIO(record), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


class Store:
    """Records in the memory of this process."""

    def __init__(self) -> None:
        self._records: dict[str, Any] = {}

    def get(self, name: str) -> Any:
        """Return a record, or None if there is none."""
        return self._records.get(name)

    def put(self, name: str, record: Any) -> None:
        """Write a record."""
        self._records[name] = record


class FileStore(Store):
    """A run at a path: its records are in ``map.zarr.part/records`` until it is complete."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.unfinished = path.with_name(f"{path.name}.part")
        self._folder = self.unfinished.absolute() / "records"
        self._request: dict[str, Any] = {}
        self._begun = True

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Hold the store while a run writes it; InputError if another run does."""
        path = self.path.with_name(f"{self.path.name}.lock").absolute()
        if not path.parent.is_dir():
            raise FileNotFoundError(2, "the folder does not exist", str(self.path.parent))
        with path.open("wb") as file:
            if hasattr(os, "register_at_fork"):  # a child may outlive the run
                os.register_at_fork(after_in_child=file.close)
            try:
                lock(file)
                alone = os.path.samestat(os.fstat(file.fileno()), path.stat())
            except OSError as error:  # without locks nothing keeps two runs apart
                alone = not isinstance(error, BlockingIOError | FileNotFoundError)
            if not alone:
                raise InputError(f"{self.path}: is held by another run, a store has one at a time")
            try:
                yield
            finally:
                path.unlink(missing_ok=True)

    def begin(self, request: dict[str, Any], *, resume: bool) -> xr.Dataset | None:
        """Begin a run or go on with one; return its result if it is complete."""
        self._request = request
        seal = dataset.sealed(self.path) if resume else None
        stored = self.get(_REQUEST)
        if seal is not None and (stored is None or seal[_REQUEST] == request):
            self._check(seal[_REQUEST] or {})
            result: xr.Dataset = dataset.load(self.path)
            self._clear()
            return result
        if stored is not None:
            if not resume:
                goes_on = "is an unfinished run: --resume (resume=True) goes on with it"
                raise InputError(f"{self.unfinished}: {goes_on}; a new run must have another name")
            self._check(json.loads(stored))
        elif any(file.name != _REQUEST for file in self._folder.glob("*")):
            raise InputError(f"{self.unfinished}: is no run, or is damaged: it must be removed")
        else:
            dataset.check_replaceable(self.path)
            self._begun = False
        return None

    def _check(self, stored: dict[str, Any]) -> None:
        """Raise InputError if the request is another than the stored one."""
        for key in {**self._request, **stored}:
            before, now = stored.get(key), self._request.get(key)
            if before != now:
                words = f"{key} = {short_repr(before)}, not {short_repr(now)}"
                raise InputError(f"{self.path}: was begun with {words}")

    def get(self, name: str) -> Any:
        """Return the bytes of a record; None if there is none, or a kill or damage has cut it."""
        path = self._folder / name
        data = path.read_bytes() if path.exists() else b""
        content = data[_CHECK:]
        return content if hashlib.sha256(content).digest() == data[:_CHECK] else None

    def put(self, name: str, record: Any) -> None:
        """Write a record; the first one after the request."""
        if not self._begun:
            self._begun = True
            self.put(_REQUEST, json.dumps(self._request).encode())
        if not isinstance(record, bytes):
            np.savez(stream := io.BytesIO(), **record)
            record = stream.getvalue()
        path = self._folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(hashlib.sha256(record).digest() + record)

    def complete(self, result: xr.Dataset) -> None:
        """Write the result, and remove the records."""
        # The working folder may have changed since the run began.
        dataset.write_store(result, self._folder.parents[1] / self.path.name, self._request)
        self._clear()

    def _clear(self) -> None:
        """Remove the records; other files are left alone."""
        shutil.rmtree(self._folder, ignore_errors=True)
        with contextlib.suppress(OSError):
            self.unfinished.rmdir()


@dataclasses.dataclass
class Work:
    """A job in progress."""

    job: Any
    """What is sent to workers: ``inputs(store, step, tile)``, what a tile needs of earlier steps;
    ``tile(step, state, tile, inputs, progress)``, its record; ``at_once``, tiles at once here."""
    store: Store = dataclasses.field(default_factory=Store)
    executor: Any = None
    progress: Progress | None = None
    tiles_done: int = 0
    tiles: int = 0

    @contextlib.contextmanager
    def named(self, path: Path) -> Iterator[None]:
        """Let errors of the disk and interrupts tell what the store at a path keeps."""
        try:
            yield
        except (KeyboardInterrupt, OSError) as error:
            text = f"{self.tiles_done} of {counted(self.tiles, 'tile')} are kept, --resume goes on"
            if isinstance(error, KeyboardInterrupt):
                COMPLETE.append(f"{path} ({text})")
                raise
            raise NotWrittenError(f"{path}: {error.strerror or error}; {text}") from error

    def once(self, name: str, make: Callable[[], Any]) -> Any:
        """Return a record; make and store it if it is not there."""
        record = self.store.get(name)
        if record is None:
            record = make()
            self.store.put(name, record)
        return record

    def each(self, step: str, state: str, tiles: Iterable[int]) -> Iterator[tuple[int, Any]]:
        """Yield tiles with their records, computed from the record ``state`` if not there yet."""
        wanted, missing = list(tiles), []
        self.tiles, self.tiles_done = len(wanted), 0
        for tile in wanted:
            record = self.store.get(f"{step}/{tile}")
            if record is None:
                missing.append(tile)
                continue
            self.tiles_done += 1
            yield tile, record
        self._report(0)
        for tile, record in self._computed(step, self.store.get(state), missing):
            if isinstance(record, Exception):
                raise record
            self.store.put(f"{step}/{tile}", record)
            self.tiles_done += 1
            self._report(0)
            yield tile, record

    def _computed(self, step: str, state: Any, tiles: list[int]) -> Iterator[tuple[int, Any]]:
        """Yield tiles as they are done: one by one, on threads, or by the executor."""
        stop = threading.Event()

        def check(_done: int, _total: int) -> None:
            if stop.is_set():
                raise KeyboardInterrupt

        def call(tile: int) -> tuple[Any, ...]:
            return self.job, rounding(), step, state, tile, self.job.inputs(self.store, step, tile)

        if self.executor is not None:
            yield from _results(self.executor, tiles, call)
        elif self.job.at_once == 1:
            yield from ((tile, _tile(*call(tile), self._report)) for tile in tiles)
        else:
            with concurrent.futures.ThreadPoolExecutor(self.job.at_once) as pool:
                try:
                    yield from _results(pool, tiles, lambda tile: (*call(tile), check))
                finally:
                    stop.set()  # before the pool waits for its threads

    def _report(self, done: int, total: int = 1) -> None:
        """Report the tiles that are done, and the part done of the one in work."""
        if self.progress is not None:
            part = min(_PARTS * done // max(total, 1), _PARTS)
            self.progress(_PARTS * self.tiles_done + part, _PARTS * max(self.tiles, 1))


def _results(
    executor: Any, tiles: list[int], call: Callable[[int], tuple[Any, ...]]
) -> Iterator[tuple[int, Any]]:
    """Yield tiles with their records as they are done; cancel what is in flight when closed."""
    futures: dict[concurrent.futures.Future[Any], int] = {}
    try:
        if hasattr(executor, "get_executor"):  # Dask takes equal calls for one, unless told
            executor = executor.get_executor(pure=False)
        for tile in tiles:
            futures[executor.submit(_tile, *call(tile))] = tile
        for future in concurrent.futures.as_completed(futures):
            yield futures.pop(future), future.result()
    except Exception as error:  # of many kinds; those of tiles are results
        reason = one_line(str(error)) or type(error).__name__
        raise NotWrittenError(f"the workers are gone ({reason})") from error
    finally:
        for future in futures:
            future.cancel()


def _tile(job: Any, bits: str, *words: Any) -> Any:
    """Compute a tile; an error is a result, so that every executor treats it alike."""
    if rounding() != bits:
        message = "instruction set of a worker must round like that of the run"
        return InputError(f"{message} ({bits}), got {rounding()}")
    try:
        return job.tile(*words)
    except Exception as error:  # noqa: BLE001 (raised in the process that drives)
        return error
