"""``pendmap basins``: the basins of attraction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pendmap.cli.analysis import analysis_command
from pendmap.cli.parse.groups import group
from pendmap.cli.parse.options import (
    draws_option,
    max_periods_option,
    option,
    seed_option,
    take_window,
    tol_option,
    window_options,
)
from pendmap.cli.parse.types import whole
from pendmap.cli.text import say
from pendmap.errors import MOST_PERIODS

if TYPE_CHECKING:
    from pendmap.cli.show import Outputs
    from pendmap.model import Pendulum, Rig


_CELLS = 1000  # Default number of cells on each side
_ANALYSIS = group("Analysis", "--draws 100")


@analysis_command(
    "basins",
    window_options(_CELLS),
    tol_option,
    max_periods_option(
        "Bound after which a start is undecided.  [default: 4000; more where damping"
        " is small, less if chaos coexists]"
    ),
    seed_option("Shifts the samples, and draws the models of --draws."),
    option(
        "--layer-periods",
        whole(1, MOST_PERIODS),
        "Periods of the finite-time layers.",
        group=_ANALYSIS,
    ),
    draws_option(_ANALYSIS),
    examples=(
        "pendmap basins --p 1.7",
        "pendmap basins --p 1 --theta-r 0.05 --grid 400 --out friction.nc",
    ),
    stored=True,
)
def command(model: Pendulum | Rig, outputs: Outputs, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Map the basins of attraction over initial angle and velocity."""
    from pendmap import _core
    from pendmap.analysis.summary import unlimited_rotation
    from pendmap.charts.basins import BYTES_OF_CELL
    from pendmap.model import without_dimensions

    grid = take_window(given, _CELLS, model.units.w0)
    outputs.check_room(grid.cells)
    if outputs.plot or outputs.rerun:
        _core.reckon("cells", grid.cells, BYTES_OF_CELL)
    if outputs.shows_progress:  # the summary repeats it after the computation
        for line in unlimited_rotation(without_dimensions(model)[0]):
            say(line, err=True)
    return {"grid": grid, **given}
