"""A computation in tiles: its steps, and the loop that does them.

A job is a function of its request. It proceeds in steps; a step computes tiles, each from the
step's state and from what earlier steps have stored, never from other tiles of the step. So neither
the number of workers, nor their order, nor an interruption changes a bit of the result.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, Final, Protocol

from pendmap.engine.executors import WorkersGoneError, results
from pendmap.engine.store import MemoryStore
from pendmap.errors import InputError, NotWrittenError, instruction_set
from pendmap.files import COMPLETE
from pendmap.formatting import counted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from pendmap.engine.store import Cells, Store

    Progress = Callable[[int, int], object]

_PARTS: Final = 1000  # Units of progress of a tile
_ROUNDING: Final = {"avx512": "fused", "avx2": "fused"}
"""How instruction sets multiply and add: with one rounding, or with two."""


def rounding() -> str:
    """Return the class of the instruction set in use: equal requests of a class give equal bits."""
    name = instruction_set()
    return _ROUNDING.get(name, name)


@dataclasses.dataclass(frozen=True)
class Tile:
    """The result of a tile."""

    record: bytes
    cells: Cells = dataclasses.field(default_factory=dict)


class Job(Protocol):
    """What the tiles of a computation are; it is sent to workers."""

    @property
    def at_once(self) -> int:
        """Number of tiles that this process computes at once without an executor."""

    def inputs(self, store: Store, step: str, tile: int) -> Any:  # noqa: ANN401 (the job's own)
        """Return what a tile needs of earlier steps."""

    def tile(self, step: str, state: bytes, tile: int, inputs: Any, progress: Any = None) -> Tile:  # noqa: ANN401
        """Compute a tile."""


@dataclasses.dataclass
class Work:
    """A job in progress."""

    job: Job
    store: Store = dataclasses.field(default_factory=MemoryStore)
    executor: Any = None
    progress: Progress | None = None
    tiles_done: int = 0
    """Tiles that are in the store."""
    tiles: int = 0
    step: str = ""
    """Step that is computed."""

    @contextlib.contextmanager
    def named(self, address: str) -> Iterator[None]:
        """Let errors of the disk and interrupts tell what the store at ``address`` keeps."""
        try:
            yield
        except KeyboardInterrupt:
            COMPLETE.append(f"{address} ({self._kept})")
            raise
        except OSError as error:
            if error.errno is None:
                raise NotWrittenError(f"{error}; {self._kept}") from error
            raise OSError(error.errno, f"{error.strerror}; {self._kept}", address) from error

    @property
    def _kept(self) -> str:
        with contextlib.suppress(Exception):  # workers may have stored more than they have told
            self.tiles_done = max(self.tiles_done, len(self.store.done(self.step)))
        return f"{self.tiles_done} of {counted(self.tiles, 'tile')} are kept, --resume goes on"

    def once(self, name: str, make: Callable[[], bytes]) -> bytes:
        """Return a record; make and store it if it is not there."""
        data = self.store.get(name)
        if data is None:
            data = make()
            self.store.put(name, data)
        return data

    def each(self, step: str, state: str, tiles: Iterable[int]) -> Iterator[tuple[int, bytes]]:
        """Yield tiles of a step with their records, computing those that are not there.

        ``state`` names the record that all tiles of the step need.
        """
        done = self.store.done(step)
        wanted, missing = list(tiles), []
        self.tiles, self.tiles_done, self.step = len(wanted), 0, step
        for tile in wanted:
            record = self.store.get(f"{step}/{tile}") if tile in done else None
            if record is None or not self.store.holds(step, tile):
                missing.append(tile)
                continue
            self.tiles_done += 1
            yield tile, record
        self._report(0)
        for tile, record in self._computed(step, state, missing):
            self.tiles_done += 1
            self._report(0)
            yield tile, record

    def _computed(self, step: str, state: str, tiles: list[int]) -> Iterator[tuple[int, bytes]]:
        if self.executor is None:
            yield from self._here(step, state, tiles)
            return
        answers = results(self.executor, self._call(step, state), tiles)
        try:
            for tile, answer in answers:
                if isinstance(answer, Exception):
                    raise answer
                if answer.cells:  # the worker cannot open the store
                    self.store.write(tile, answer.cells)
                if not self.store.shared:
                    self.store.put(f"{step}/{tile}", answer.record)
                yield tile, answer.record
        except WorkersGoneError as error:
            raise NotWrittenError(f"the workers are gone ({error})") from error
        finally:
            answers.close()

    def _here(self, step: str, state: str, tiles: list[int]) -> Iterator[tuple[int, bytes]]:
        """Compute tiles in this process, several at once on threads if the job has one for each."""
        data = self.store.get(state) or b""
        stop = threading.Event()

        def compute(tile: int, _: int = 0) -> Tile:
            def report(done: int, total: int) -> None:
                if stop.is_set():
                    raise KeyboardInterrupt
                if self.job.at_once == 1:
                    self._report(_PARTS * done // max(total, 1))

            inputs = self.job.inputs(self.store, step, tile)
            return self.job.tile(step, data, tile, inputs, report)

        with contextlib.ExitStack() as stack:
            outcomes: Iterable[tuple[int, Tile]] = ((tile, compute(tile)) for tile in tiles)
            if self.job.at_once > 1:
                pool = stack.enter_context(ThreadPoolExecutor(self.job.at_once))
                stack.callback(stop.set)  # before the pool waits for its threads
                outcomes = results(pool, lambda tile: (compute, tile), tiles)
            for tile, one in outcomes:
                if one.cells:
                    self.store.write(tile, one.cells)
                self.store.put(f"{step}/{tile}", one.record)
                yield tile, one.record

    def _call(self, step: str, state: str) -> Callable[[int], tuple[Any, ...]]:
        """Return the function that returns what an executor gets for a tile."""
        job, store, bits = self.job, self.store, rounding()
        data = store.get(state) or b""
        if store.shared:
            known = (state, hashlib.sha256(data).hexdigest())
            return lambda tile: (_in_store, job, store, step, known, bits, tile)
        return lambda tile: (_alone, job, step, data, bits, tile, job.inputs(store, step, tile))

    def _report(self, part: int) -> None:
        if self.progress is not None:
            self.progress(_PARTS * self.tiles_done + min(part, _PARTS), _PARTS * max(self.tiles, 1))


def _alone(  # noqa: PLR0913, PLR0917 (what a worker needs)
    job: Job,
    step: str,
    state: bytes,
    bits: str,
    tile: int,
    inputs: Any,  # noqa: ANN401 (the job's own)
    _: int,
) -> Tile | Exception:
    """Compute a tile; an error is a result, so that every executor treats it alike."""
    if rounding() != bits:
        message = "instruction set of a worker must round like that of the run"
        return InputError(f"{message} ({bits}), got {rounding()}")
    try:
        return job.tile(step, state, tile, inputs)
    except Exception as error:  # noqa: BLE001 (raised in the process that drives)
        return error


def _in_store(  # noqa: PLR0913, PLR0917 (what a worker needs)
    job: Job, store: Store, step: str, state: tuple[str, str], bits: str, tile: int, attempt: int
) -> Tile | Exception:
    """Compute a tile and store it; return its record."""
    try:
        inputs = job.inputs(store, step, tile)
        outcome = _alone(job, step, _state(store, *state), bits, tile, inputs, attempt)
        if isinstance(outcome, Exception):
            return outcome
        store.write(tile, outcome.cells)
        store.put(f"{step}/{tile}", outcome.record)
    except Exception as error:  # noqa: BLE001 (as above)
        return error
    return Tile(outcome.record)


@functools.lru_cache(maxsize=4)
def _state(store: Store, name: str, digest: str) -> bytes:
    """Return the state of a step, read once by each worker."""
    data = store.get(name) or b""
    if hashlib.sha256(data).hexdigest() != digest:
        raise InputError(f"{name} of the store must be that of the run, a worker has got another")
    return data
