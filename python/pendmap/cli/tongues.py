"""``pendmap tongues``: critical curves of rest, hanging and inverted."""

from __future__ import annotations

from typing import Any

import click

from pendmap.cli.model_options import begin, model_options_without
from pendmap.cli.options import draws_option, output_options, progress_options, seed_option
from pendmap.cli.show import progress_bar, show
from pendmap.cli.types import NUMBER, VALUES


@click.command("tongues")
@model_options_without("omega", "frequency_hz")
@click.option(
    "--omega",
    "omegas",
    type=VALUES,
    help="Frequencies Omega/w0 of the drive.  [default: 0.5:3:200]",
)
@click.option("--p-max", type=NUMBER, default=6.0, help="Largest amplitude.  [default: 6]")
@click.option(
    "--plane",
    type=click.Choice(["omega-p", "e-alpha2"]),
    default="omega-p",
    help="What is drawn: that of eq. 1.2, or of eq. 1.4 with e = p/omega^2, alpha^2 = 1/omega^2.",
)
@draws_option
@seed_option("Draws the models.")
@progress_options
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Find where rest, hanging and inverted, is stable: critical curves of eq. 1.3, exact.

    Also without damping; folds of the oscillation born there; curves by perturbation beside. For
    files, frequencies are added where curves turn, end or bend; --json lists those asked for.

    Writes tongues.nc, tongues.png and tongues.rrd if no output is named. --json alone writes no
    file.
    """
    model, outputs = begin(given, "tongues")
    omegas = given.pop("omegas")

    from pendmap.analysis.tongues import SCHEMA, tongues

    with progress_bar("tongues", shown=outputs.shows_progress) as progress:
        dataset = tongues(model, omegas, refine=outputs.draws, progress=progress, **given)
    show(dataset, outputs, SCHEMA)
