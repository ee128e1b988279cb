"""``pendmap basins``: the basins of attraction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pendmap.cli.analysis import analysis_command
from pendmap.cli.parse.options import take_window, window_options
from pendmap.cli.text import say

if TYPE_CHECKING:
    from pendmap.cli.show import Outputs
    from pendmap.model import Pendulum, Rig


@analysis_command(
    "basins",
    window_options("-pi:pi:1000", "-3:3:1000, in SI times w0"),
    "tol max_periods seed layer_periods draws",
    example="--draws 100",
    examples=(
        "pendmap basins --p 1.7",
        "pendmap basins --p 1 --theta-r 0.05 --grid 400 --out friction.nc",
    ),
    stored=True,
)
def command(model: Pendulum | Rig, outputs: Outputs, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Map the basins of attraction over initial angle and velocity."""
    from pendmap import _core
    from pendmap.analysis.grid import Grid
    from pendmap.analysis.summary import unlimited_rotation
    from pendmap.charts.basins import BYTES_OF_CELL
    from pendmap.model import without_dimensions

    grid = take_window(given, Grid.square(1000, model.units.w0))
    outputs.check_room(grid.cells)
    if outputs.plot or outputs.rerun:
        _core.reckon("cells", grid.cells, BYTES_OF_CELL)
    if outputs.shows_progress:  # the summary repeats it after the computation
        for line in unlimited_rotation(without_dimensions(model)[0]):
            say(line, err=True)
    return {"grid": grid, **given}
