"""Who computes tiles: this process, processes beside it, a Dask cluster, or any executor.

The protocol is that of :mod:`concurrent.futures`: ``submit(function, *arguments)`` returns an
object with ``done()``, ``result()`` and ``cancel()``. Executors of the standard library, joblib's
loky, mpi4py.futures and submitit have it, a Dask client gives one by ``get_executor``.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import importlib.util
import logging
import os
import time
from typing import TYPE_CHECKING, Any, Final

from pendmap.errors import MOST_WORKERS, InputError, check_whole, one_line, short_repr

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator

_IN_FLIGHT: Final = 4
"""Tiles in flight for each worker: one runs, the others wait; no scheduler has them all."""
_LEAST_IN_FLIGHT: Final = 16
_TRIES: Final = 20  # Times that a tile is given to another worker after it has lost its own
_POLL: Final = 0.05  # Time between two looks at futures that cannot be waited for, s
_ANSWER: Final = 10.0  # Time in which a scheduler must answer, s
_COUNTED: Final = 5.0  # Time between two counts of the workers, s


@contextlib.contextmanager
def executor_of(
    scheduler: str | None = None, workers: int | None = None, executor: object = None
) -> Iterator[Any]:
    """Yield the executor asked for, None for this process; close what has been opened here.

    Raises InputError for more than one of the three, or what is none.
    """
    if sum(given is not None for given in (scheduler, workers, executor)) > 1:
        raise InputError("only one of scheduler, workers and executor must be given, got more")
    if executor is not None:
        if not hasattr(executor, "submit"):
            raise InputError(
                "executor must have submit(), like concurrent.futures.ProcessPoolExecutor or a "
                f"Dask client, got {short_repr(executor)}"
            )
        yield executor
        return
    if scheduler is None and workers is None:
        yield None
        return
    if importlib.util.find_spec("distributed") is None:
        raise InputError("workers and schedulers need the extra pendmap[dask]")
    import dask  # noqa: PLC0415 (an extra)
    import distributed  # noqa: PLC0415 (an extra)

    with contextlib.ExitStack() as stack:
        stack.enter_context(_silent("distributed"))
        if scheduler is not None:
            _check_scheduler(scheduler)
            target: Any = scheduler
        else:
            count = check_whole("workers", workers, 1, MOST_WORKERS)
            level = "distributed.nanny.pre-spawn-environ.DASK_LOGGING__DISTRIBUTED"
            quiet = {"distributed.worker.memory.terminate": False, level: "critical"}
            stack.enter_context(dask.config.set(quiet))
            # The scheduler's status page listens even when it is off, at 8787 unless told.
            page = "127.0.0.1:0"
            local = {"n_workers": count, "threads_per_worker": 1, "dashboard_address": page}
            try:
                target = stack.enter_context(distributed.LocalCluster(**local))
            except (OSError, RuntimeError) as error:
                raise InputError(f"workers cannot be started: {error}") from error
        yield stack.enter_context(distributed.Client(target, set_as_default=False))


def _check_scheduler(address: str) -> None:
    """Raise InputError unless a scheduler of Dask answers; a client that fails takes a minute."""
    import dask  # noqa: PLC0415 (an extra)
    import distributed  # noqa: PLC0415 (an extra)

    async def answer() -> Any:  # noqa: ANN401 (of Dask)
        async with distributed.rpc(address) as scheduler:
            return await asyncio.wait_for(scheduler.identity(), _ANSWER)

    try:
        with dask.config.set({"distributed.comm.timeouts.connect": f"{_ANSWER} s"}):
            kind = asyncio.run(answer())["type"]
    except Exception as error:  # noqa: BLE001 (of many libraries)
        reason = one_line(str(error)) or f"no answer in {_ANSWER:g} s"
        raise InputError(f"scheduler {short_repr(address)} is not reached: {reason}") from None
    if kind != "Scheduler":
        raise InputError(f"scheduler must be one of Dask, got a {kind} at {short_repr(address)}")


@contextlib.contextmanager
def _silent(name: str) -> Iterator[None]:
    """Silence the loggers of a package: workers or a scheduler that end would fill many lines."""
    known = [key for key in logging.root.manager.loggerDict if key.partition(".")[0] == name]
    before = {key: logging.getLogger(key).level for key in known}
    for key in known:
        logging.getLogger(key).setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for key, level in before.items():
            logging.getLogger(key).setLevel(level)


class WorkersGoneError(RuntimeError):
    """The executor has gone: it takes no tile any more."""


def results(
    executor: Any,  # noqa: ANN401 (the protocol)
    call: Callable[[int], tuple[Any, ...]],
    tiles: Iterable[int],
) -> Generator[tuple[int, Any]]:
    """Yield tiles with their results, in the order in which they are done.

    ``call(tile)`` returns a function and its arguments, before the number of the attempt.

    A tile whose worker is lost is given to another one. Only a few tiles for each worker are in
    flight, and no future is kept. What is in flight is cancelled when the iterator is closed.
    """
    client = executor if hasattr(executor, "get_executor") else None
    # Dask takes equal calls for one: pure=False makes each a call of its own.
    pool = executor if client is None else client.get_executor(pure=False)
    waiting = iter(tiles)
    flying: dict[Any, tuple[int, int]] = {}
    width, counted = 0, -_COUNTED
    try:
        while True:
            if time.monotonic() - counted > _COUNTED:
                width = max(_LEAST_IN_FLIGHT, _IN_FLIGHT * _workers(pool, client))
                counted = time.monotonic()
            while len(flying) < width and (tile := next(waiting, None)) is not None:
                flying[_submitted(pool, call(tile), 0)] = (tile, 0)
            if not flying:
                return
            for future in _finished(flying):
                tile, attempt = flying.pop(future)
                if _lost_worker(future) and attempt < _TRIES:
                    flying[_submitted(pool, call(tile), attempt + 1)] = (tile, attempt + 1)
                else:
                    yield tile, _result(future, tile)
    finally:
        for future in flying:
            future.cancel()


def _submitted(pool: Any, call: tuple[Any, ...], attempt: int) -> Any:  # noqa: ANN401
    try:
        return pool.submit(*call, attempt)
    except Exception as error:  # a closed or broken pool; Dask raises an error of its own kind
        raise WorkersGoneError(str(error)) from error


def _finished(flying: dict[Any, tuple[int, int]]) -> list[Any]:
    """Wait for the first futures to end, and return them."""
    while True:
        if all(isinstance(future, concurrent.futures.Future) for future in flying):
            first = concurrent.futures.FIRST_COMPLETED
            ended = list(concurrent.futures.wait(flying, _COUNTED, first).done)
        else:
            ended = [future for future in flying if future.done()]
            time.sleep(0 if ended else _POLL)
        if ended:
            return ended


def _lost_worker(future: Any) -> bool:  # noqa: ANN401
    """Return whether the workers that had this tile are gone, and others may take it."""
    if not isinstance(future, concurrent.futures.Future) or future.cancelled():
        return False
    return type(future.exception()).__name__ == "KilledWorker"


def _result(future: Any, tile: int) -> Any:  # noqa: ANN401
    try:
        return future.result()
    except (concurrent.futures.CancelledError, concurrent.futures.BrokenExecutor) as error:
        raise WorkersGoneError(f"tile {tile}: {str(error) or 'the scheduler is gone'}") from error


def _workers(pool: Any, client: Any) -> int:  # noqa: ANN401
    """Return the number of tiles that are computed at once, 1 if it is unknown."""
    if client is not None:
        return sum(client.nthreads().values())
    known = getattr(pool, "_max_workers", None)
    return known if isinstance(known, int) else os.cpu_count() or 1
