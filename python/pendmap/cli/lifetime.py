"""``pendmap lifetime``: how long transient chaos lives."""

from __future__ import annotations

from typing import Any

import click

from pendmap.cli import price
from pendmap.cli.model_options import begin, model_options
from pendmap.cli.options import (
    draws_option,
    max_periods_option,
    output_options,
    progress_options,
    seed_option,
    tol_option,
)
from pendmap.cli.show import progress_bar, show
from pendmap.cli.types import Whole
from pendmap.errors import MOST_PERIODS

_STARTS = (100, 10_000_000)


@click.command("lifetime")
@model_options
@click.option(
    "--starts",
    type=Whole(*_STARTS),
    default=40_000,
    help="How many are drawn, from -pi to pi and velocities -3 to 3, in SI times w0."
    "  [default: 40000]",
)
@click.option(
    "--from-period",
    type=Whole(0, MOST_PERIODS),
    help="Where the exponential tail begins.  [default: where the data say so]",
)
@max_periods_option(
    "Bound after which a start is given up.  [default: 4000; more where damping"
    " is small, less beside chaos]"
)
@tol_option
@seed_option("Draws the starts, and the models of --draws.")
@draws_option
@progress_options
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Measure how long transient chaos lives, or find that it persists.

    Writes lifetime.nc, lifetime.png and lifetime.rrd if no output is named. --json alone writes no
    file.
    """
    model, outputs = begin(given, "lifetime")

    from pendmap.analysis.lifetime import SCHEMA, lifetime

    if given["max_periods"] is None and not outputs.quiet:
        starts = given["starts"] * (1 + (given["draws"] or 0))
        price.say(model, starts, tol=given["tol"], threads=given["threads"])
    with progress_bar("lifetime", shown=outputs.shows_progress) as progress:
        dataset = lifetime(model, progress=progress, **given)
    show(dataset, outputs, SCHEMA)
