"""``--dry-run``: what a command would take, from timed samples of it."""

from __future__ import annotations

import dataclasses
import tempfile
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.show import write_json
from pendmap.formatting import counted, duration, size_of

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.analysis.planning import Cost
    from pendmap.cli.show import Outputs


def show_cost(
    analysis: partial[xr.Dataset], outputs: Outputs, kind: str, workers: int | None
) -> None:
    """Report the cost of a command; files of the samples are in a temporary folder."""
    from pendmap.analysis.planning import Request, cost

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
    from pendmap.files.dataset import save

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
    sample = f"{counted(found.sample_cells, 'cell')} took {found.sample_seconds:.1f} s"
    memory = f"Memory: about {size_of(found.memory_bytes)}"
    if found.worker_memory_bytes is not None:
        memory += f", and {size_of(found.worker_memory_bytes)} for each worker"
    return [
        f"{cells}{starts}{tiles}; nothing is written.",
        f"Time: about {duration(found.seconds)} on {who} ({sample}).",
        f"{memory}.",
        f"Disk: about {size_of(found.disk_bytes)}.",
    ]
