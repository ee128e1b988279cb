"""``pendmap basins``: the basins of attraction."""

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
from pendmap.cli.types import AXIS, Whole
from pendmap.errors import MOST_CELLS, MOST_PERIODS


@click.command("basins")
@model_options
@click.option("--theta", type=AXIS, help="Initial angles, rad.  [default: -pi:pi:1000]")
@click.option(
    "--velocity",
    type=AXIS,
    help="Initial velocities, in SI rad/s.  [default: -3:3:1000, in SI times w0]",
)
@click.option("--grid", type=Whole(1, MOST_CELLS), help="Cells on each side of the window.")
@tol_option
@max_periods_option(
    "Bound after which a start is undecided.  [default: 4000; more where damping"
    " is small, less beside chaos]"
)
@click.option(
    "--layer-periods", type=Whole(1, MOST_PERIODS), help="Periods of the finite-time layers."
)
@seed_option("Shifts the samples, and draws the models of --draws.")
@draws_option
@progress_options
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Map the basins of attraction over initial angle and velocity.

    Writes basins.nc, basins.png and basins.rrd if no output is named. --json alone writes no file.
    --view writes the recording it opens: basins.rrd, or what --rerun names.
    """
    model, outputs = begin(given, "basins")
    theta, velocity, count = (given.pop(name) for name in ("theta", "velocity", "grid"))
    if count is not None and (theta is not None or velocity is not None):
        raise click.UsageError(
            "--grid must be given alone; --theta and --velocity name their own cells"
        )

    from pendmap import _core
    from pendmap.analysis.basins import DEFAULT_CELLS, SCHEMA, basins
    from pendmap.analysis.grid import Axis, Grid
    from pendmap.analysis.summary import unlimited_rotation
    from pendmap.charts.basins import BYTES_OF_CELL
    from pendmap.model import without_dimensions

    usual = Grid.of(count, DEFAULT_CELLS, model.units.w0)
    grid = Grid(
        Axis(*theta) if theta else usual.theta, Axis(*velocity) if velocity else usual.velocity
    )
    outputs.check_room(grid.theta.count * grid.velocity.count)
    if outputs.plot or outputs.rerun:
        _core.reckon("cells", grid.cells, BYTES_OF_CELL)
    if outputs.shows_progress:  # the summary says it too, after all periods have passed
        for line in unlimited_rotation(without_dimensions(model)[0]):
            click.echo(line, err=True)
    if given["max_periods"] is None and not outputs.quiet:
        cells = grid.theta.count * grid.velocity.count * (1 + (given["draws"] or 0))
        price.say(model, cells, tol=given["tol"], threads=given["threads"])
    with progress_bar("basins", shown=outputs.shows_progress) as progress:
        dataset = basins(model, grid, progress=progress, **given)
    show(dataset, outputs, SCHEMA)
