"""Samples of growing size, until one tells what the whole takes.

A sample is a request of fewer starts, or of fewer values in the middle of equal parts of the same
ranges; the last one takes some seconds. The time to label starts, and that of maps over parameters,
grows with the cells; for files a line through two samples tells the fixed part.
"""

from __future__ import annotations

import dataclasses
import math
import sys
import time
from typing import TYPE_CHECKING, Any, Final, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import xarray as xr

    from pendmap.cli.planning.request import Request, Run, Save

T = TypeVar("T")

_FIRST: Final = {"bifurcation": 32, "parameter_map": 64, "lifetime": 500}
"""Cells of the first sample; of others ``_FEW``."""
_FEW: Final = 256
_ENOUGH: Final = 4.0  # Time of a sample that is long enough, s
_AIM: Final = 6.0  # Time of the cells of a further sample, s
_SHARE: Final = 0.1  # Part of the whole time that a sample may take where it is shorter
_GROWTH: Final = 2.0  # Least ratio of the sizes of two samples
_LABELLED: Final = ("basins", "lifetime")
"""Analyses that search first, then label each start."""
_PROCESS: Final = 320 * 2**20  # Memory of a process with all libraries, bytes


@dataclasses.dataclass(frozen=True)
class Estimate:
    """What a request takes on the threads of its samples, and the last of them."""

    dataset: xr.Dataset
    seconds: float
    writing: float
    """Time to write the files that grow with the cells, s."""
    size: float
    """Bytes of these files."""
    imports: float
    """Time of the first sample beyond that of its cells, s."""
    first_peak: int
    """Memory at the peak of the first sample, bytes."""
    cells: int
    """Cells of the sample."""
    sampled: float
    """Time of the sample, s."""


@dataclasses.dataclass(frozen=True)
class Sample:
    """What a request of fewer cells took."""

    cells: int
    seconds: float
    fixed: float = 0.0
    """Time that does not grow with the cells where it is known, s."""
    size: int = 0
    writing: float = 0.0


class _Watch:
    """Progress of a basin map: the time in which starts are labelled."""

    def __init__(self) -> None:
        self.spent, self._since = 0.0, 0.0

    def __call__(self, done: int, total: int) -> None:
        now = time.perf_counter()
        if total and done:
            self.spent += now - self._since
        self._since = now


def estimate(request: Request, run: Run, save: Save, threads: int) -> Estimate:
    """Return what a request takes, and its drawn models, from samples of growing size."""
    cells = _FIRST.get(request.kind, _FEW)
    found: list[Sample] = []
    first_peak = 0
    while True:
        one, watch = request.fewer(cells), _Watch()
        dataset, seconds = timed(run, {**one.arguments, "threads": threads, "progress": watch})
        first_peak = first_peak or peak()
        size, writing = timed(save, dataset)
        fixed = seconds - watch.spent if request.kind in _LABELLED else 0.0
        found.append(Sample(one.cells, seconds, fixed, size, writing))
        grown = seconds - fixed
        told = grown > min(_ENOUGH, _SHARE * _whole(request, found[-1]))
        if one.cells >= request.cells or (told and found[1:]):
            break
        cells = math.ceil(one.cells * max(_GROWTH, _AIM / max(grown, 1e-4)))
    first, last = found[0], found[-1]
    # The first sample imports what the analysis needs.
    second = found[1] if found[1:] else first
    draws = request.arguments.get("draws") or 0
    return Estimate(
        dataset,
        _whole(request, last) + draws * _whole(request, last, check=False),
        extended(request, found, [sample.writing for sample in found]),
        extended(request, found, [sample.size for sample in found]),
        max(first.seconds + first.writing - second.seconds - second.writing, 0.0),
        first_peak,
        last.cells,
        last.seconds,
    )


def _whole(request: Request, last: Sample, *, check: bool = True) -> float:
    """Return the time of one model of a request; those of draws are not checked."""
    cells = request.cells + check * request.checks
    return last.fixed + cells / last.cells * (last.seconds - last.fixed)


def extended(request: Request, samples: Sequence[Sample], values: Sequence[float]) -> float:
    """Return what ``values`` of samples become for all cells, on the line of the last two."""
    last = samples[-1]
    if len(samples) == 1:
        return values[0] * request.cells / last.cells
    step = last.cells - samples[-2].cells
    slope = max((values[-1] - values[-2]) / step, 0.0) if step else 0.0
    return values[-1] + slope * (request.cells - last.cells)


def timed(call: Callable[[Any], T], argument: object) -> tuple[T, float]:
    """Return what a call returns, and its time in s."""
    began = time.perf_counter()
    return call(argument), time.perf_counter() - began


def peak() -> int:
    """Return the largest memory of this process so far, bytes; typical where it is not known."""
    try:
        import resource
    except ImportError:
        return _PROCESS
    found = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return found if sys.platform == "darwin" else 1024 * found
