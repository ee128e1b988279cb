"""Results that are computed in tiles: by whom, and in which store they are kept."""

from __future__ import annotations

import contextlib
import dataclasses
from typing import TYPE_CHECKING, Any

from pendmap.cli.parse.types import Address
from pendmap.cli.show import made_here, show
from pendmap.cli.text import say

if TYPE_CHECKING:
    from collections.abc import Iterator
    from functools import partial

    import xarray as xr

    from pendmap.analysis.result import Schema
    from pendmap.cli.show import Outputs


@dataclasses.dataclass(frozen=True)
class Kept:
    """The options of a store and of workers."""

    resume: bool
    count: int | None
    scheduler: str | None

    @property
    def goes_on(self) -> bool:
        """Whether an existing store is not replaced."""
        return self.resume

    @classmethod
    def take(cls, given: dict[str, Any]) -> Kept:
        """Remove these options from ``given``."""
        return cls(**{field.name: given.pop(field.name) for field in dataclasses.fields(cls)})

    def run(
        self, analysis: partial[xr.Dataset], outputs: Outputs, name: str, schema: Schema
    ) -> None:
        """Compute a result, write its files, and show it."""
        store = outputs.store
        if analysis.keywords.get("draws") and not isinstance(store, Address):
            store = None  # draws are written when all are computed
        keep = {"store": store, "resume": self.resume}
        with (
            workers(self.scheduler, self.count, quiet=outputs.quiet) as executor,
            made_here(),
            outputs.progress(name) as progress,
        ):
            dataset = analysis(progress=progress, executor=executor, **keep)
        if store is None:
            show(dataset, outputs, schema)
        else:
            show(dataset, dataclasses.replace(outputs, out=None), schema, [str(store)])


@contextlib.contextmanager
def workers(scheduler: str | None, count: int | None, *, quiet: bool) -> Iterator[Any]:
    """Yield the executor of --scheduler or --workers, or None; say if there are no workers."""
    if scheduler is None and count is None:
        yield None
        return
    from pendmap.engine import executor_of

    with executor_of(scheduler, count) as executor:
        if not quiet and not executor.nthreads():
            say(f"{scheduler} has no workers yet: waiting for them.", err=True)
        yield executor
