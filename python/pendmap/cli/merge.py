"""``pendmap merge``: a run in a store is completed."""

from __future__ import annotations

import importlib
from typing import Any

from pendmap.cli.parse.groups import argument, new_command
from pendmap.cli.parse.options import machine_options, output_options, worker_options
from pendmap.cli.show import Outputs, made_here, show
from pendmap.cli.stored import workers


@new_command("merge", "pendmap merge map.zarr", "pendmap merge map.zarr --workers 8 --out map.png")
@argument("store", "STORE", str)
@worker_options
@machine_options
@output_options(())
def command(
    *,
    store: str,
    count: int | None,
    scheduler: str | None,
    threads: int | None,
    **given: Any,  # noqa: ANN401 (the options of the outputs)
) -> None:
    """Complete a run in a store: compute what is missing, and what its tiles exchange.

    STORE is a path or an address that --out of basins, map, bifurcation or lifetime named. A
    complete store is shown as it is.
    """
    outputs = Outputs.take(given, "merge", default=False)

    from pendmap.analysis.stored import merge

    with (
        workers(scheduler, count, quiet=outputs.quiet) as executor,
        made_here(),
        outputs.progress("merge") as progress,
    ):
        dataset = merge(store, executor=executor, threads=threads, progress=progress)
    schema = importlib.import_module(f"pendmap.analysis.{dataset.attrs['kind']}").SCHEMA
    show(dataset, outputs, schema, [store])
