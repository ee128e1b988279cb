"""``pendmap sweep``: basins of attraction along one or two parameters."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pendmap.cli.analysis import analysis_command
from pendmap.cli.parse.model_options import varied_model_options
from pendmap.cli.parse.options import take_window, window_options

if TYPE_CHECKING:
    from pendmap.cli.show import Outputs
    from pendmap.model import Pendulum, Rig


@analysis_command(
    "sweep",
    window_options("-pi:pi:100", "-3:3:100, in SI times w0"),
    "tol max_periods layer_periods seed",
    example="--layer-periods 10",
    examples=("pendmap sweep --p 0.5:1.7:25 --grid 60",),
    model=varied_model_options,
    stored=True,
)
def command(model: Pendulum | Rig, outputs: Outputs, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Map the basins of attraction along one or two parameters.

    Parameters are ranges A:B:N, like --p 0.5:2:61, or by name: --vary quadratic_drag.q 0:0.1:20.
    Each attractor has one number in all maps.
    """
    from pendmap.analysis.grid import Grid

    grid = take_window(given, Grid.square(100, model.units.w0))
    models = math.prod(span.cells for span in given["ranges"].values())
    outputs.check_room(models * grid.cells)
    return {"grid": grid, **given}
