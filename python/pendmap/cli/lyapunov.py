"""``pendmap lyapunov``: the largest exponent of the attractor that a start reaches."""

from __future__ import annotations

from typing import Any

import click

from pendmap.cli.model_options import begin, model_options
from pendmap.cli.options import (
    max_periods_option,
    output_options,
    progress_options,
    seed_option,
    start_options,
    tol_option,
)
from pendmap.cli.show import progress_bar, show
from pendmap.cli.types import NUMBER


@click.command("lyapunov")
@model_options
@start_options
@click.option(
    "--precision",
    type=NUMBER,
    default=1e-3,
    help="Standard error over exponent that chaos is averaged for.  [default: 1e-3]",
)
@tol_option
@max_periods_option(
    "Bound after which the start is undecided, and of each trajectory averaged."
    "  [default: 4000, more where damping is small; and 20000]"
)
@seed_option("Chooses the trajectories.")
@progress_options
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Find the largest Lyapunov exponent of the attractor that a start reaches.

    Writes lyapunov.nc, lyapunov.png and lyapunov.rrd if no output is named. --json alone writes no
    file.
    """
    model, outputs = begin(given, "lyapunov")

    from pendmap.analysis.lyapunov import SCHEMA, lyapunov

    with progress_bar("lyapunov", shown=outputs.shows_progress) as progress:
        dataset = lyapunov(
            model, given.pop("theta"), given.pop("velocity"), progress=progress, **given
        )
    show(dataset, outputs, SCHEMA)
