"""``--dry-run``: what a command would take, from timed samples of it.

A sample is a request of fewer starts, or of fewer values in the middle of equal parts of the same
ranges; the last one takes some seconds. The time to label starts, and that of maps over parameters,
grows with the cells. Of a sweep, and for the size of files, a line through two samples tells the
fixed part.
"""

from __future__ import annotations

import dataclasses
import math
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

import click

from pendmap import _core
from pendmap.analysis.basin_tiles import TILE, Starts, tile_of
from pendmap.analysis.grid import Axis, Grid
from pendmap.analysis.sweeps.tiles import SIDES
from pendmap.cli.show import write_json
from pendmap.files.dataset import save
from pendmap.formatting import counted, duration, size_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    import xarray as xr

    from pendmap.cli.show import Outputs

    Run = Callable[[dict[str, Any]], xr.Dataset]
    """Function that computes the result of other arguments."""

T = TypeVar("T")

_FIRST: Final = {"bifurcation": 32, "parameter_map": 64, "lifetime": 500}
"""Cells of the first sample; of others ``_FEW``."""
_FEW: Final = 256
_ENOUGH: Final = 4.0  # Time of a sample that is long enough, s
_AIM: Final = 6.0  # Time of the cells of a further sample, s
_SHARE: Final = 0.1  # Part of the whole time that a sample may take where it is shorter
_GROWTH: Final = 2.0  # Least ratio of the sizes of two samples
_BYTES: Final = {
    "basins": 32,
    "lifetime": 140,
    "basin_sweep": 12,
    "parameter_map": 4096,
    "bifurcation": 8192,
}
"""Memory of a cell at the peak, bytes, measured on cells with few attractors."""
_IN_WORK: Final = {"basins": 4 * TILE}  # Cells in memory at most, where a store has the others
_PROCESS: Final = 320 * 2**20  # Memory of a process with all libraries, bytes
_WORKER: Final = 200 * 2**20  # Memory of a worker without its tile, bytes
_TILES: Final = {"basins": 32 * TILE, "lifetime": 32 * TILE}  # Memory of large tiles, bytes
_LABELLED: Final = ("basins", "lifetime")
"""Analyses that search first, then label each start."""
_BLOCKS: Final = ("parameter_map", "bifurcation", "basin_sweep")
"""Analyses whose tiles have one thread each in a store, those of a sweep always."""
_MAP: Final = 10_000  # Most cells of a map of its first sample
_BLOCK: Final = 16  # Cells along a side of a block of a map over parameters
_CHECKED: Final = 6000  # Starts of the check of labels
_UNCERTAIN: Final = (30_000, 0.125, 150_000)
"""Starts near one another that measure the boundary: least, share of the cells, most."""
_MEASURED: Final = 10_000  # Cells of a map from which on it is measured


@dataclasses.dataclass(frozen=True)
class Sample:
    """What a request of fewer cells took."""

    models: int
    """Number of equal fixed parts: of a sweep the number of models, otherwise 1."""
    cells: int
    seconds: float
    fixed: float = 0.0
    """Time that does not grow with the cells where it is known, s."""


class _Watch:
    """Progress of a basin map: the time in which starts are labelled."""

    def __init__(self) -> None:
        self.spent, self._since = 0.0, 0.0

    def __call__(self, done: int, total: int) -> None:
        now = time.perf_counter()
        if total and done:
            self.spent += now - self._since
        self._since = now


@dataclasses.dataclass(frozen=True)
class Request:
    """An analysis by its kind, and its arguments."""

    kind: str
    arguments: Mapping[str, Any]

    @property
    def counts(self) -> dict[str, int]:
        """Number of values of each parameter that varies."""
        return {name: span[2] for name, span in self.arguments.get("ranges", {}).items()}

    @property
    def models(self) -> int:
        """Number of models of a sweep, which have a fixed part each; 1 of all others."""
        return math.prod(self.counts.values()) if self.kind == "basin_sweep" else 1

    @property
    def cells(self) -> int:
        """Number of cells of the result: starts, values of parameters, or both."""
        if self.kind == "lifetime":
            return int(self.arguments["starts"])
        grid = self.arguments.get("grid")
        return math.prod(self.counts.values()) * (1 if grid is None else grid.cells)

    @property
    def starts(self) -> int:
        """Number of starts of the result, of drawn models too."""
        each = 1 if self.kind == "lifetime" else int(self.arguments.get("starts", 1))
        return self.cells * each * (1 + (self.arguments.get("draws") or 0))

    @property
    def tiles(self) -> int:
        """Number of tiles in a store, or with workers."""
        counts = [*self.counts.values()]
        if self.kind == "basin_sweep":
            return math.prod(-(-n // s) for n, s in zip(counts, SIDES[len(counts)], strict=True))
        if counts:
            return math.prod(-(-n // _BLOCK) for n in counts)
        grid = self.arguments.get("grid")
        sides = (1, self.cells) if grid is None else (grid.theta.count, grid.velocity.count)
        starts = Starts(((0.0, 1.0, sides[0]), (0.0, 1.0, sides[1])))
        return -(-sides[1] // starts.height(tile_of(self.cells)))

    def fewer(self, cells: int, models: int) -> Request:
        """Return the request with about this number of cells, at least of this many models."""
        own = {**self.arguments, "draws": None} if "draws" in self.arguments else {**self.arguments}
        if self.kind == "basins":
            own["check"] = False
        if "curves" in own:
            own["curves"] = False
        if self.kind == "lifetime":
            own["starts"] = min(cells, self.cells)
        grid = own.get("grid")
        if self.counts:
            wanted = cells if grid is None else max(models, cells // grid.cells)
            counts = _fewer([*self.counts.values()], wanted)
            spans = zip(own["ranges"].items(), counts, strict=True)
            own["ranges"] = {name: _parts(span, count) for (name, span), count in spans}
            cells = -(-cells // math.prod(counts))
        if grid is not None:
            axes = (grid.theta, grid.velocity)
            counts = _fewer([axis.count for axis in axes], cells)
            both = zip(axes, counts, strict=True)
            own["grid"] = Grid(*(Axis(axis.low, axis.high, count) for axis, count in both))
        return Request(self.kind, own)

    @property
    def checks(self) -> int:
        """Number of starts that are labelled again, beside the samples."""
        if self.kind != "basins":
            return 0
        least, share, most = _UNCERTAIN
        measured = min(max(least, int(share * self.cells)), most)
        return min(_CHECKED, 3 * self.cells) + (measured if self.cells >= _MEASURED else 0)

    def samples(self, run: Run, threads: int) -> Iterator[tuple[Sample, xr.Dataset]]:
        """Yield samples of growing size with their results, until one tells enough."""
        models, cells = 1, _FIRST.get(self.kind, _FEW)
        if self.kind == "basin_sweep":  # one search alone among these, as in a block
            models = min(self.models, math.prod(SIDES[len(self.counts)]))
            cells = models * min(self.cells // self.models, _MAP)
        found: list[Sample] = []
        while True:
            one, watch = self.fewer(cells, models), _Watch()
            began = time.perf_counter()
            dataset = run({**one.arguments, "threads": threads, "progress": watch})
            seconds = time.perf_counter() - began
            fixed = seconds - watch.spent if self.kind in _LABELLED else 0.0
            found.append(Sample(one.models, one.cells, seconds, fixed))
            yield found[-1], dataset
            grown = seconds - fixed
            told = grown > min(_ENOUGH, _SHARE * self.seconds(found))
            if one.cells >= self.cells or (told and found[1:]):
                return
            cells = math.ceil(one.cells * max(_GROWTH, _AIM / max(grown, 1e-4)))

    def seconds(self, samples: Sequence[Sample], *, check: bool = True) -> float:
        """Return the time of one model of the request; those of draws are not checked."""
        if self.kind == "basin_sweep":
            return self.extended(samples, [sample.seconds for sample in samples])
        last = samples[-1]
        share = (self.cells + check * self.checks) / last.cells
        return last.fixed + share * (last.seconds - last.fixed)

    def extended(self, samples: Sequence[Sample], values: Sequence[float]) -> float:
        """Return what ``values`` of samples become for all cells, on the line of the last two."""
        sizes = [sample.cells / sample.models for sample in samples]
        each = [value / sample.models for sample, value in zip(samples, values, strict=True)]
        size = self.cells / self.models
        if len(each) == 1:
            return self.models * each[0] * size / sizes[0]
        step = sizes[-1] - sizes[-2]
        slope = max((each[-1] - each[-2]) / step, 0.0) if step else 0.0
        return self.models * (each[-1] + slope * (size - sizes[-1]))


@dataclasses.dataclass(frozen=True)
class Cost:
    """What a request will take, and the sample that tells it."""

    cells: int
    starts: int
    tiles: int
    seconds: float
    threads: int
    memory_bytes: int
    """Memory at the peak; with workers, that of the process that drives."""
    worker_memory_bytes: int | None
    """Memory of each worker."""
    disk_bytes: int
    sample_cells: int
    sample_seconds: float


def cost(  # noqa: PLR0913 (a request, and how it is computed and written)
    request: Request,
    run: Run,
    save: Callable[[xr.Dataset], int],
    draw: Callable[[xr.Dataset], int],
    *,
    workers: int | None,
    stored: bool,
) -> Cost:
    """Return the cost of a request from samples of it.

    ``save`` writes the files that grow with the cells, ``draw`` those that do not; each returns
    their bytes. Samples have as many threads as the run, at most one for each processor.
    """
    begun = time.process_time()  # Python and what it has imported
    here = _core.default_threads()
    threads = workers or request.arguments["threads"] or here
    used = threads if workers is None else min(threads, here)
    if request.kind == "basin_sweep":
        used = 1
    samples: list[Sample] = []
    sizes, times, least = [], [], 0  # least: memory at the peak of the first sample
    for sample, dataset in request.samples(run, used):
        samples.append(sample)
        least = least or _peak()
        size, seconds = _timed(save, dataset)
        sizes.append(size)
        times.append(seconds)
    figures, drawing = _timed(draw, dataset)
    draws = request.arguments.get("draws") or 0
    seconds = request.seconds(samples) + draws * request.seconds(samples, check=False)
    of_one = workers is not None or stored or request.kind == "basin_sweep"
    if of_one and (workers is not None or request.kind in _BLOCKS):  # a tile has one thread
        rounds = -(-request.tiles // threads)
        seconds *= used * rounds / request.tiles
    seconds += request.extended(samples, times) + drawing
    if request.arguments.get("curves"):
        own = {**request.fewer(4, 1).arguments, "curves": True, "starts": 1}
        seconds += _timed(run, {**own, "threads": used})[1]
    # The first sample imports what the analysis needs.
    others = samples[0].seconds + times[0] - samples[1].seconds - times[1] if samples[1:] else 0.0
    seconds += begun + max(others, 0.0)
    peak, cells = _peak(), request.cells - samples[-1].cells
    if stored and request.kind in _IN_WORK:
        peak, cells = least, min(request.cells, _IN_WORK[request.kind])
    return Cost(
        cells=request.cells,
        starts=request.starts,
        tiles=request.tiles,
        seconds=seconds,
        threads=threads,
        memory_bytes=peak + _BYTES[request.kind] * max(cells, 0),
        worker_memory_bytes=None if workers is None else _WORKER + _TILES.get(request.kind, 0),
        disk_bytes=round(request.extended(samples, sizes)) + figures,
        sample_cells=samples[-1].cells,
        sample_seconds=samples[-1].seconds,
    )


def _timed(call: Callable[[Any], T], argument: object) -> tuple[T, float]:
    began = time.perf_counter()
    return call(argument), time.perf_counter() - began


def _peak() -> int:
    """Return the largest memory of this process so far, bytes; typical where it is not known."""
    try:
        import resource
    except ImportError:
        return _PROCESS
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def _fewer(counts: list[int], cells: int) -> list[int]:
    """Return lower counts with about this product, as equal as they may be."""
    found = dict.fromkeys(range(len(counts)), 1)
    for done, k in enumerate(sorted(found, key=counts.__getitem__)):
        side = math.ceil(cells ** (1 / (len(counts) - done)))
        found[k] = max(1, min(counts[k], side))
        cells = -(-cells // found[k])
    return [*found.values()]


def _parts(span: tuple[float, float, int], count: int) -> tuple[float, float, int]:
    """Return the range of the middles of ``count`` equal parts of a range, or the range itself."""
    low, high, had = span
    if count == had:
        return low, high, had
    half = (high - low) / count / 2
    return low + half, (high - half if count > 1 else low + half), count


def show_cost(
    analysis: partial[xr.Dataset], outputs: Outputs, kind: str, workers: int | None
) -> None:
    """Report the cost of a command; files of the samples are in a temporary folder."""

    def run(arguments: dict[str, Any]) -> xr.Dataset:
        return analysis.func(*analysis.args, **arguments)

    with tempfile.TemporaryDirectory(prefix="pendmap-") as folder:
        out = ".zarr" if outputs.store else outputs.out and outputs.out.suffix
        growing = dataclasses.replace(
            outputs,
            out=Path(folder, f"sample{out}") if out else None,
            plot=None,
            rerun=Path(folder, "sample.rrd") if outputs.rerun else None,
        )
        plot = Path(folder, f"sample{outputs.plot.suffix}") if outputs.plot else None
        found = cost(
            Request(kind, analysis.keywords),
            run,
            partial(_written, outputs=growing),
            partial(_written, outputs=type(outputs)(plot=plot)),
            workers=workers,
            stored=outputs.store is not None,
        )
    if outputs.as_json:
        write_json(dataclasses.asdict(found))
    elif not outputs.quiet:
        click.echo("\n".join(_lines(found, outputs, workers)))


def _written(dataset: xr.Dataset, outputs: Outputs) -> int:
    """Write files; return their bytes."""
    size = 0
    for write, path in outputs.files(dataset, partial(save, dataset)):
        write(path)
        every = path.rglob("*") if path.is_dir() else [path]
        size += sum(file.stat().st_size for file in every if file.is_file())
    return size


def _lines(found: Cost, outputs: Outputs, workers: int | None) -> list[str]:
    cells = counted(found.cells, "cell")
    starts = f", {counted(found.starts, 'start')}" if found.starts != found.cells else ""
    tiles = f", {counted(found.tiles, 'tile')}" if outputs.store or workers else ""
    who = counted(found.threads, "thread" if workers is None else "worker")
    sample = f"{counted(found.sample_cells, 'cell')} took {duration(found.sample_seconds)}"
    memory = f"Memory: about {size_of(found.memory_bytes)}"
    if found.worker_memory_bytes is not None:
        memory += f", and {size_of(found.worker_memory_bytes)} for each worker"
    return [
        f"{cells}{starts}{tiles}; nothing is written.",
        f"Time: about {duration(found.seconds)} on {who} ({sample}).",
        f"{memory}.",
        f"Disk: about {size_of(found.disk_bytes)}.",
    ]
