"""How an analysis is computed: threads, random numbers, progress, the store of its tiles."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib.util
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, TypedDict

import numpy as np

from pendmap import _core
from pendmap.analysis.grid import Grid
from pendmap.engine import (
    MemoryStore,
    Work,
    ZarrStore,
    executor_of,
    rounding,
)
from pendmap.errors import (
    MOST_SEED,
    MOST_THREADS,
    InputError,
    check_callable,
    check_flag,
    check_type,
    check_whole,
    short_repr,
)
from pendmap.model import model_text

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr

    from pendmap.model import Pendulum, Rig

    Compute = Callable[[Work], tuple[xr.Dataset, list[str]]]
    """Function that computes a result, and names its variables that are cells of the store."""

Progress = Callable[[int, int], object]  # Called with units of work done and in total

_DIGEST: Final = "sha256 "
_STEPS: Final = 10_000  # Number of progress steps of a part of a computation


class Keywords(TypedDict, total=False):
    """Options of a run as keywords of an analysis."""

    threads: int | None
    seed: int
    progress: Progress | None
    store: str | os.PathLike[str] | None
    resume: bool
    executor: Any
    chunks: Any


@dataclasses.dataclass(frozen=True)
class RunOptions:
    """How an analysis is computed. Of these only ``seed`` changes a number of the result.

    An analysis takes one, ``run=RunOptions(threads=2, seed=1)``, or its options by name,
    ``threads=2, seed=1``.

    Parameters
    ----------
    threads : int, optional
        Number of threads; by default one per processor.
    seed : int
        Shifts the samples of starts, and draws starts and models.
    progress : callable, optional
        Called repeatedly with the units of work done and in total: a :class:`pendmap.ProgressBar`.
    store : str or path, optional
        A Zarr store, a path or an address of fsspec like ``s3://bucket/map.zarr``: the result is
        computed in tiles, and each is stored as it is done. The result reads its cells when they
        are used. A path holds an earlier result until the new one is complete, which is at the path
        with ``.part`` until then; elsewhere an earlier result is removed.
    resume : bool
        Whether to go on with the store of a run that was stopped; the result is the same, bit for
        bit. A store that another request began is refused.
    executor : optional
        Computes the tiles: a Dask client or any executor of :mod:`concurrent.futures`, like those
        of joblib, mpi4py and submitit. Each tile has one thread unless ``threads`` says otherwise.
    chunks : optional
        As for :func:`xarray.open_zarr`: the result of a store has arrays of Dask, ``{}`` with the
        tiles as chunks.

    Raises
    ------
    InputError
        If a value is outside its range, or ``resume`` or ``chunks`` are given without a store.

    Examples
    --------
    >>> import pendmap
    >>> run = pendmap.RunOptions(threads=2, seed=1)
    >>> pendmap.basins(pendmap.Pendulum(p=0.6), 20, run=run).attrs["seed"]
    1
    """

    threads: int | None = None
    seed: int = 0
    progress: Progress | None = None
    store: str | os.PathLike[str] | None = None
    resume: bool = False
    executor: Any = None
    chunks: Any = None

    def __post_init__(self) -> None:
        if self.threads is not None:
            threads = check_whole("threads", self.threads, 1, MOST_THREADS)
            object.__setattr__(self, "threads", threads)
        object.__setattr__(self, "seed", check_whole("seed", self.seed, 0, MOST_SEED))
        check_callable("progress", self.progress)
        if self.store is not None:
            _address(self.store)
        check_flag("resume", self.resume)
        for what in ("resume", "chunks"):
            if self.store is None and getattr(self, what) not in (False, None):
                raise InputError(f"{what} must be given with a store (.zarr), got none")
        if self.chunks is not None and importlib.util.find_spec("dask") is None:
            raise InputError("chunks need the extra pendmap[dask]")

    @classmethod
    def of(cls, run: RunOptions | None, options: Keywords) -> RunOptions:
        """Return what is given for ``run``, by default the defaults, with options by name."""
        run = cls() if run is None else run
        check_type("run", run, cls, "RunOptions(threads=2)")
        return dataclasses.replace(run, **options) if options else run

    @property
    def workers(self) -> int:
        """Number of threads as passed to the core: 0 for one per processor."""
        return self.threads or 0

    @property
    def here(self) -> int:
        """Number of threads of this process."""
        return self.threads or _core.default_threads()

    @property
    def tiled(self) -> bool:
        """Whether the result is computed in tiles."""
        return self.store is not None or self.executor is not None

    def in_memory(self, what: str) -> RunOptions:
        """Return the options, refused where ``what`` needs the memory of this process."""
        if self.tiled:
            raise InputError(f"{what} must be given without a store or an executor, got both")
        return self

    def part(self, number: int, parts: int) -> RunOptions:
        """Return the options of one of ``parts`` equal parts of a computation."""
        return dataclasses.replace(self, progress=part(self.progress, number, parts))

    def tiles(self, count: int) -> tuple[int, int]:
        """Return the threads of each of ``count`` tiles, and how many tiles run at once here."""
        if self.executor is not None:
            return self.threads or 1, 1
        at_once = min(self.here, count)
        return self.here // at_once, at_once

    def complete(
        self,
        name: str,
        model: Pendulum | Rig,
        arguments: Mapping[str, Any],
        job: Any,  # noqa: ANN401 (of the analysis)
        compute: Compute,
    ) -> xr.Dataset:
        """Return the result of ``compute``, or of the store if it is complete there."""
        with executor_of(executor=self.executor) as executor:
            if self.store is None:
                return compute(Work(job, MemoryStore(), executor, self.progress))[0]
            store = ZarrStore(_address(self.store))
            mark = _request(name, model, arguments)
            with store.held():
                if self._begin(store, mark):
                    return store.result(self.chunks, again=True)
                work = Work(job, store, executor, self.progress)
                try:
                    with work.named(store.unfinished):
                        dataset, cells = compute(work)
                        store.complete(dataset, cells, {**mark, "complete": True})
                except BaseException:
                    store.abandon()
                    raise
            return store.result(self.chunks)

    def _begin(self, store: ZarrStore, mark: dict[str, Any]) -> bool:
        """Begin a store or go on with one; return whether it is complete."""
        old = store.mark(resume=self.resume)
        if old is not None and self.resume:
            self._check(store.address, old, mark)
            if not old["complete"]:
                store.go_on()
            return bool(old["complete"])
        if old is not None and not old["complete"]:
            raise InputError(
                f"{store.unfinished}: is an unfinished run: --resume (resume=True) goes on with "
                "it; a new run must have another name"
            )
        store.begin({**mark, "complete": False})
        return False

    def _check(self, address: str, old: Mapping[str, Any], mark: Mapping[str, Any]) -> None:
        """Refuse a store that another request, another version or another arithmetic began."""
        for key, what in (("analysis", "analysis"), ("version", "version of pendmap")):
            if old[key] != mark[key]:
                raise InputError(f"{address}: was begun by {what} {old[key]}, not {mark[key]}")
        before, now = (_flat(one) for one in (old, mark))
        for key in sorted({*before, *now}):
            if before.get(key) != now.get(key):
                stored, given = (short_repr(one.get(key)) for one in (before, now))
                raise InputError(f"{address}: was begun with {key} = {stored}, not {given}")
        if old["rounding"] != mark["rounding"]:
            raise InputError(
                f"{address}: was begun with an instruction set that rounds otherwise "
                f"({old['rounding']}, here {mark['rounding']})"
            )


def _address(store: str | os.PathLike[str]) -> str:
    """Return the address of a store; a folder must be named like one."""
    name = os.fspath(store) if isinstance(store, str | os.PathLike) else ""
    name = name.removeprefix("file://")
    if "://" not in name and not name.rstrip("/").endswith(".zarr"):
        raise InputError(
            "store must be a folder NAME.zarr, or an address like s3://bucket/map.zarr, got "
            f"{short_repr(store)}"
        )
    return name


def _request(name: str, model: Pendulum | Rig, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Return a request as JSON has it."""
    return {
        "analysis": name,
        "version": _core.__version__,
        "rounding": rounding(),
        "model": model_text(dataclasses.replace(model, notes={})),
        "arguments": {key: _plain(value) for key, value in arguments.items()},
    }


def _plain(value: Any) -> Any:  # noqa: ANN401 (an argument)
    match value:
        case Grid():
            return [list(value.theta.as_tuple), list(value.velocity.as_tuple)]
        case np.ndarray():
            return _DIGEST + hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
        case dict():
            return {str(key): _plain(part) for key, part in value.items()}
        case tuple() | list():
            return [_plain(part) for part in value]
        case np.generic():
            return value.item()
    return value


def _flat(mark: Mapping[str, Any]) -> dict[str, Any]:
    """Return arguments and lines of the model of a request by their names."""
    lines = (line.partition(" = ") for line in mark["model"].splitlines())
    return {**{f"model: {k}": v for k, _, v in lines}, **mark["arguments"]}


def part(progress: Progress | None, number: int, parts: int) -> Progress | None:
    """Return the progress of one of ``parts`` equal parts of a computation; it never falls."""
    if progress is None:
        return None
    furthest = 0.0

    def report(done: int, total: int) -> None:
        nonlocal furthest
        furthest = max(furthest, done / max(total, 1))
        progress(round(_STEPS * (number + furthest)), _STEPS * parts)

    return report


def in_rounds(progress: Progress | None, typical: int) -> Progress | None:
    """Return the progress of rounds whose number is not known: it rises with each, and never falls.

    A round begins where the work done does not rise. After k rounds the share is k / (k +
    ``typical``).
    """
    if progress is None:
        return None
    rounds, last = 0, 0

    def report(done: int, total: int) -> None:
        nonlocal rounds, last
        rounds += done <= last
        last = done
        passed = rounds + done / max(total, 1)
        progress(round(_STEPS * passed / (passed + typical)), _STEPS)

    return report
