"""``pendmap simulate``: one trajectory."""

from __future__ import annotations

from typing import Any

import click

from pendmap.cli.model_options import begin, model_options
from pendmap.cli.options import option, output_options, simd_option, start_options
from pendmap.cli.show import show
from pendmap.cli.types import NUMBER, whole
from pendmap.errors import MOST_SAMPLES, named

_VIEWER = "127.0.0.1:9876"


@click.command("simulate")
@model_options
@start_options
@option("--until", NUMBER, "Last time, in 1/w0, in SI s.", 100.0)
@option("--tol", NUMBER, "Error after 5 periods.", 1e-9)
@option("--samples", whole(1, MOST_SAMPLES), "Samples a period.  [default: 64 or more]")
@click.option("--lyapunov", is_flag=True, help="Also the Lyapunov exponent of this stretch.")
@click.option(
    "--live",
    is_flag=False,
    flag_value=_VIEWER,
    metavar="[HOST:PORT]",
    help=f"Show it in a running viewer while it is computed.  [default: {_VIEWER}]",
)
@simd_option
@click.option("--quiet", is_flag=True, help="No summary.")
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Integrate one trajectory: time history, energy, phase plane, Poincaré section.

    Writes simulate.nc, simulate.png and simulate.rrd if no output is named. --json alone writes no
    file. --view writes the recording it opens: simulate.rrd, or what --rerun names. --live needs a
    viewer that runs (rerun --bind 127.0.0.1); Ctrl-C then ends the trajectory where it is, and what
    was computed is written.
    """
    address = given.pop("live")
    model, outputs = begin(given, "simulate")
    start = (given.pop("theta"), given.pop("velocity"))
    live = None
    if address is not None:  # connected before anything is computed
        with named("--live"):
            from pendmap import viewer

            live = viewer.Live(model, start, address)

    from pendmap.analysis.trajectory import SCHEMA, simulate

    dataset = simulate(model, *start, given.pop("until"), live=live, **given)
    try:
        if live is not None:
            with named("--live"):
                live.finish(dataset)
    finally:  # without the viewer files are written too
        show(dataset, outputs, SCHEMA)
    if dataset.attrs.get("interrupted"):
        raise KeyboardInterrupt
