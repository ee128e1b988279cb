"""``pendmap basins``: the basins of attraction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.analysis import analysis_command
from pendmap.cli.options import draws_option, max_periods_option, option, seed_option, tol_option
from pendmap.cli.types import AXIS, whole
from pendmap.errors import MOST_CELLS, MOST_PERIODS

if TYPE_CHECKING:
    from pendmap.cli.show import Outputs
    from pendmap.model import Pendulum, Rig


@analysis_command(
    "basins",
    option("--theta", AXIS, "Initial angles, rad.  [default: -pi:pi:1000]"),
    option(
        "--velocity", AXIS, "Initial velocities, in SI rad/s.  [default: -3:3:1000, in SI times w0]"
    ),
    option("--grid", whole(1, MOST_CELLS), "Cells on each side of the window."),
    tol_option,
    max_periods_option(
        "Bound after which a start is undecided.  [default: 4000; more where damping"
        " is small, less if chaos coexists]"
    ),
    option("--layer-periods", whole(1, MOST_PERIODS), "Periods of the finite-time layers."),
    seed_option("Shifts the samples, and draws the models of --draws."),
    click.option(
        "--adaptive",
        is_flag=True,
        help="Compute the cells at boundaries alone, and a sample of the others.",
    ),
    draws_option,
    stored=True,
)
def command(model: Pendulum | Rig, outputs: Outputs, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Map the basins of attraction over initial angle and velocity."""
    from pendmap import _core
    from pendmap.analysis.basins import DEFAULT_CELLS
    from pendmap.analysis.grid import Grid
    from pendmap.analysis.summary import unlimited_rotation
    from pendmap.charts.basins import BYTES_OF_CELL
    from pendmap.model import without_dimensions

    theta, velocity, count = (given.pop(name) for name in ("theta", "velocity", "grid"))
    if count is not None and (theta is not None or velocity is not None):
        raise click.UsageError(
            "--grid must be given alone; --theta and --velocity name their own cells"
        )
    usual = Grid.of(count, DEFAULT_CELLS, model.units.w0)
    grid = Grid(theta or usual.theta, velocity or usual.velocity)
    outputs.check_room(grid.cells)
    if outputs.plot or outputs.rerun:
        _core.reckon("cells", grid.cells, BYTES_OF_CELL)
    if outputs.shows_progress:  # the summary repeats it after the computation
        for line in unlimited_rotation(without_dimensions(model)[0]):
            click.echo(line, err=True)
    return {"grid": grid, **given}
