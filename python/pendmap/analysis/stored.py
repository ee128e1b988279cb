"""Runs that are kept in a store: what they were asked for, how they go on."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib.util
import os
from typing import TYPE_CHECKING, Any, Final

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
from pendmap.errors import InputError, check_flag, short_repr
from pendmap.model import model_text

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import xarray as xr

    from pendmap.analysis.numerics import Numerics, Progress
    from pendmap.model import Pendulum, Rig

    Compute = Callable[[Work], tuple[xr.Dataset, list[str]]]
    """Function that computes a result, and names its variables that are cells of the store."""

_DIGEST: Final = "sha256 "


@dataclasses.dataclass(frozen=True)
class Kept:
    """Where a result is kept, and who computes it."""

    store: str | os.PathLike[str] | None = None
    resume: bool = False
    executor: Any = None
    chunks: Any = None

    def __post_init__(self) -> None:
        if self.store is not None:
            _address(self.store)
        check_flag("resume", self.resume)
        for what in ("resume", "chunks"):
            if self.store is None and getattr(self, what) not in (False, None):
                raise InputError(f"{what} must be given with a store (.zarr), got none")
        if self.chunks is not None and importlib.util.find_spec("dask") is None:
            raise InputError("chunks need the extra pendmap[dask]")

    @property
    def tiled(self) -> bool:
        """Whether the result is computed in tiles."""
        return self.store is not None or self.executor is not None

    def refuse(self, name: str) -> None:
        """Refuse an argument that needs a result in the memory of this process."""
        if self.tiled:
            raise InputError(f"{name} must be given without a store or an executor, got both")

    @staticmethod
    def threads_of_tiles(numerics: Numerics) -> tuple[tuple[float, int | None, int], int]:
        """Return limits of a tile with one thread, and how many tiles this process has at once."""
        tol, bound, threads = numerics.limits
        return (tol, bound, 1), threads or _core.default_threads()

    def threads(self, threads: int | None) -> int | None:
        """Return the threads of a tile that an executor computes: by default one."""
        return None if self.executor is None else threads or 1

    def complete(  # noqa: PLR0913, PLR0917 (a request and how it is computed)
        self,
        name: str,
        model: Pendulum | Rig,
        arguments: Mapping[str, Any],
        job: Any,  # noqa: ANN401 (of the analysis)
        compute: Compute,
        progress: Progress | None,
    ) -> xr.Dataset:
        """Return the result of ``compute``, or of the store if it is complete there."""
        with executor_of(executor=self.executor) as executor:
            if self.store is None:
                return compute(Work(job, MemoryStore(), executor, progress))[0]
            store = ZarrStore(_address(self.store))
            mark = _request(name, model, arguments)
            with store.held():
                if self._begin(store, mark):
                    return store.result(self.chunks, again=True)
                work = Work(job, store, executor, progress)
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
                said, given = (short_repr(one.get(key)) for one in (before, now))
                raise InputError(f"{address}: was begun with {key} = {said}, not {given}")
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
