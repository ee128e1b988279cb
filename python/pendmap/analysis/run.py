"""How an analysis is computed: options of a run, numerical choices, attributes of results."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypedDict

import numpy as np

from pendmap import _core
from pendmap.analysis.grid import Grid
from pendmap.engine import FileStore, Store, Work, rounding
from pendmap.errors import (
    MOST_PERIODS,
    MOST_SEED,
    MOST_THREADS,
    InputError,
    check_callable,
    check_flag,
    check_number,
    check_type,
    check_whole,
    instruction_set,
    short_repr,
)
from pendmap.files.variables import FORMAT_VERSION
from pendmap.model import model_text

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr

    from pendmap.model import Pendulum, Rig

Progress = Callable[[int, int], object]  # Called with units of work done and in total

TOL = 1e-6  # Default error of a state after 5 periods; determines the step
_STEPS: Final = 10_000  # Number of progress steps of a part of a computation


class Keywords(TypedDict, total=False):
    """Options of a run as keywords of an analysis."""

    threads: int | None
    seed: int
    progress: Progress | None
    store: str | os.PathLike[str] | None
    resume: bool
    executor: Any


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
        A Zarr store, ``map.zarr``: the result is computed in tiles, and each is kept as it is
        done, in ``map.zarr.part``. An earlier result is there until the new one is complete.
    resume : bool
        Whether to go on with the store of a run that was stopped; the result is the same, bit for
        bit. A store that another request began is refused.
    executor : optional
        Computes the tiles: any executor of :mod:`concurrent.futures`, like those of joblib and
        mpi4py, or a Dask client. Each tile has one thread unless ``threads`` says otherwise.

    Raises
    ------
    InputError
        If a value is outside its range, or ``resume`` is given without a store.

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

    def __post_init__(self) -> None:
        if self.threads is not None:
            threads = check_whole("threads", self.threads, 1, MOST_THREADS)
            object.__setattr__(self, "threads", threads)
        object.__setattr__(self, "seed", check_whole("seed", self.seed, 0, MOST_SEED))
        check_callable("progress", self.progress)
        if self.store is not None:
            _folder(self.store)
        if check_flag("resume", self.resume) and self.store is None:
            raise InputError("resume must be given with a store (.zarr), got none")
        if self.executor is not None and not hasattr(self.executor, "submit"):
            like = "like concurrent.futures.ProcessPoolExecutor or a Dask client"
            raise InputError(
                f"executor must have submit(), {like}, got {short_repr(self.executor)}"
            )

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

    def in_memory(self, what: str) -> RunOptions:
        """Return the options, refused where ``what`` needs the memory of this process."""
        if self.store is not None or self.executor is not None:
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
        compute: Callable[[Work], xr.Dataset],
    ) -> xr.Dataset:
        """Return the result of ``compute``, or of the store if it is complete there."""
        if self.store is None:
            return compute(Work(job, Store(), self.executor, self.progress))
        store = FileStore(_folder(self.store))
        with store.held():
            result = store.begin(_request(name, model, arguments), resume=self.resume)
            if result is None:
                work = Work(job, store, self.executor, self.progress)
                with work.named(store.unfinished):
                    result = compute(work)
                    store.complete(result)
        return result


class Choices(TypedDict):
    """Numerical choices as passed to the core."""

    tol: float
    max_periods: int | None
    threads: int
    seed: int


@dataclasses.dataclass(frozen=True)
class Numerics:
    """Numerical choices of an analysis, checked on construction."""

    run: RunOptions = dataclasses.field(default_factory=RunOptions)
    tol: float = TOL
    max_periods: int | None = None
    began: float = dataclasses.field(default_factory=time.perf_counter, init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "tol", check_number("tol", self.tol))
        bound = optional_whole("max_periods", self.max_periods, 1, MOST_PERIODS)
        object.__setattr__(self, "max_periods", bound)

    @property
    def request(self) -> dict[str, Any]:
        """The choices that determine numbers of a result."""
        return {"tol": self.tol, "max_periods": self.max_periods, "seed": self.run.seed}

    @property
    def core(self) -> Choices:
        """The choices as passed to the core."""
        bound, seed = self.max_periods, self.run.seed
        return {"tol": self.tol, "max_periods": bound, "threads": self.run.workers, "seed": seed}

    def provenance(self) -> dict[str, Any]:
        """Return attributes on how a result was computed, with the time since ``began``."""
        return {
            "tol": self.tol,
            "seconds": time.perf_counter() - self.began,
            "simd": instruction_set(),
            "threads": self.run.here,
            "seed": self.run.seed,
            "pendmap_version": _core.__version__,
            "format_version": FORMAT_VERSION,
        }


def _folder(store: str | os.PathLike[str]) -> Path:
    """Return the folder of a store, which must be named like one."""
    path = Path(store) if isinstance(store, str | os.PathLike) else Path()
    if path.suffix != ".zarr":
        raise InputError(f"store must be a folder NAME.zarr, got {short_repr(store)}")
    return path


def _request(name: str, model: Pendulum | Rig, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Return a request as JSON has it, with the numbers of the model one by one."""
    text = model_text(dataclasses.replace(model, notes={}))
    request: dict[str, Any] = {
        "analysis": name,
        "version of pendmap": _core.__version__,
        "rounding of the processor": rounding(),
    }
    for line in text.splitlines():
        key, _, value = line.partition(" = ")
        request[f"model: {key}"] = value
    return {**request, "model": text, **json.loads(json.dumps(arguments, default=_plain))}


def _plain(value: Any) -> Any:  # noqa: ANN401 (an argument)
    """Return an argument for JSON, an array as its digest."""
    if isinstance(value, np.ndarray):
        return hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
    if isinstance(value, Grid):
        return [value.theta.as_tuple, value.velocity.as_tuple]
    return value.item() if isinstance(value, np.generic) else dict(value)


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
    """Return the progress of rounds of unknown number: after k the share is k / (k + typical)."""
    if progress is None:
        return None
    rounds, last = 0, 0

    def report(done: int, total: int) -> None:
        nonlocal rounds, last
        rounds += done <= last  # a round begins where the work done does not rise
        last = done
        passed = rounds + done / max(total, 1)
        progress(round(_STEPS * passed / (passed + typical)), _STEPS)

    return report


def optional_whole(name: str, value: int | None, least: int, most: int) -> int | None:
    """Return a whole number between two bounds, or None if none is given."""
    return None if value is None else check_whole(name, value, least, most)
