"""``pendmap bifurcation``: attractors along one parameter."""

from __future__ import annotations

from typing import Any

import click

from pendmap.cli.model_options import begin, varied_model_options
from pendmap.cli.options import output_options, progress_options, search_options
from pendmap.cli.show import progress_bar, show
from pendmap.cli.types import NUMBER


@click.command("bifurcation")
@varied_model_options
@click.option("--theta", type=NUMBER, help="Angle from which both sweeps start, rad.")
@click.option("--velocity", type=NUMBER, help="Velocity of that start, in SI rad/s.")
@search_options
@progress_options
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Draw stroboscopic points against a parameter: all attractors, and followed up and down.

    One parameter is a range: --vary p 0.9:2:2000, or --p 0.9:2:2000. Writes bifurcation.nc,
    bifurcation.png and bifurcation.rrd if no output is named. --json alone writes no file.
    """
    ranges = given.pop("ranges")
    theta, velocity = given.pop("theta"), given.pop("velocity")
    if (theta is None) != (velocity is None):
        raise click.UsageError("both or neither of --theta and --velocity must be given, got one")
    start = None if theta is None else (theta, velocity)
    model, outputs = begin(given, "bifurcation")

    from pendmap.analysis.bifurcation import SCHEMA, bifurcation

    with progress_bar("bifurcation", shown=outputs.shows_progress) as progress:
        dataset = bifurcation(model, ranges, start=start, progress=progress, **given)
    show(dataset, outputs, SCHEMA)
