"""``pendmap orbit``: all closed orbits of one period and winding."""

from __future__ import annotations

from typing import Any

import click

from pendmap.cli.model_options import begin, model_options
from pendmap.cli.options import draws_option, output_options, progress_options, seed_option
from pendmap.cli.show import progress_bar, show
from pendmap.cli.types import AXIS, Whole
from pendmap.errors import MOST_CELLS

_LONGEST = 64


@click.command("orbit")
@model_options
@click.option(
    "--n", type=Whole(1, _LONGEST), default=1, help="Smallest period, in drive's.  [default: 1]"
)
@click.option(
    "--w",
    type=Whole(-MOST_CELLS, MOST_CELLS),
    default=0,
    help="Net turns over it, forward positive.  [default: 0]",
)
@click.option("--theta", type=AXIS, help="Angles of the box, rad.  [default: -pi:pi:200]")
@click.option(
    "--velocity",
    type=AXIS,
    help="Velocities of the box, in SI rad/s.  [default: as n, w and p ask]",
)
@click.option("--grid", type=Whole(1, MOST_CELLS), help="Cells on each side of the box.")
@draws_option
@seed_option("Draws the models.")
@progress_options
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Find all periodic orbits of period n and w net turns, stable and unstable.

    Writes orbit.nc, orbit.png and orbit.rrd if no output is named. --json alone writes no file.
    """
    model, outputs = begin(given, "orbit")
    n, w = given.pop("n"), given.pop("w")
    theta, velocity, count = (given.pop(name) for name in ("theta", "velocity", "grid"))

    from pendmap.analysis.grid import Axis, Grid
    from pendmap.analysis.orbits import SCHEMA, orbit, window

    usual = window(model, n, w)
    low, high, cells = usual.velocity.as_tuple
    cells = count or cells
    grid = Grid(
        Axis(*theta) if theta else Axis(usual.theta.low, usual.theta.high, cells),
        Axis(*velocity) if velocity else Axis(low, high, cells),
    )
    with progress_bar("orbit", shown=outputs.shows_progress) as progress:
        dataset = orbit(model, n, w, grid, progress=progress, **given)
    show(dataset, outputs, SCHEMA)
