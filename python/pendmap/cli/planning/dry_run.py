"""``--dry-run``: what a command would take."""

from __future__ import annotations

import dataclasses
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pendmap import _core
from pendmap.analysis.basin_tiles import TILE
from pendmap.cli.planning import samples, sweep
from pendmap.cli.planning.request import Request
from pendmap.cli.text import say, write_json
from pendmap.files.dataset import save
from pendmap.formatting import counted, duration, size_of

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.cli.planning.request import Run, Save
    from pendmap.cli.show import Outputs

_BYTES: Final = {
    "basins": 32,
    "lifetime": 140,
    "basin_sweep": 12,
    "parameter_map": 4096,
    "bifurcation": 8192,
}
"""Memory of a cell at the peak, bytes, measured on cells with few attractors."""
_IN_WORK: Final = {"basins": 4 * TILE}  # Cells in memory at most, where a store has the others
_WORKER: Final = 200 * 2**20  # Memory of a worker without its tile, bytes
_TILES: Final = {"basins": 32 * TILE, "lifetime": 32 * TILE}  # Memory of large tiles, bytes
_BLOCKS: Final = ("parameter_map", "bifurcation")
"""Analyses whose tiles have one thread each in a store."""


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
    request: Request, run: Run, save: Save, draw: Save, *, workers: int | None, stored: bool
) -> Cost:
    """Return the cost of a request from samples of it.

    ``save`` writes the files that grow with the cells, ``draw`` those that do not. Samples have as
    many threads as the run, at most one for each processor.
    """
    begun = time.process_time()  # Python and what it has imported
    here = _core.default_threads()
    threads = workers or request.arguments["threads"] or here
    used = threads if workers is None else min(threads, here)
    if request.kind == "basin_sweep":
        each = 1 if workers else max(threads // request.tiles, 1)
        found = sweep.estimate(request, run, save, threads, each)
    else:
        found = samples.estimate(request, run, save, used)
    figures, drawing = samples.timed(draw, found.dataset)
    seconds = found.seconds
    of_one = workers is not None or (stored and request.kind in _BLOCKS)
    if of_one and request.kind != "basin_sweep":  # a tile has one thread
        rounds = -(-request.tiles // threads)
        seconds *= used * rounds / request.tiles
    seconds += found.writing + drawing
    if request.arguments.get("curves"):
        own = {**request.fewer(4).arguments, "curves": True, "starts": 1}
        seconds += samples.timed(run, {**own, "threads": used})[1]
    peak, cells = samples.peak(), request.cells - found.cells
    if stored and request.kind in _IN_WORK:
        peak, cells = found.first_peak, min(request.cells, _IN_WORK[request.kind])
    return Cost(
        cells=request.cells,
        starts=request.starts,
        tiles=request.tiles,
        seconds=begun + found.imports + seconds,
        threads=threads,
        memory_bytes=peak + _BYTES[request.kind] * max(cells, 0),
        worker_memory_bytes=None if workers is None else _WORKER + _TILES.get(request.kind, 0),
        disk_bytes=round(found.size) + figures,
        sample_cells=found.cells,
        sample_seconds=found.sampled,
    )


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
        say("\n".join(_lines(found, outputs, workers)))


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
