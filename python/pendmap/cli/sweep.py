"""``pendmap sweep``: basins of attraction along one or two parameters."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pendmap.cli.analysis import analysis_command
from pendmap.cli.parse.groups import group
from pendmap.cli.parse.model_options import varied_model_options
from pendmap.cli.parse.options import (
    max_periods_option,
    option,
    seed_option,
    take_window,
    tol_option,
    window_options,
)
from pendmap.cli.parse.types import whole
from pendmap.errors import MOST_PERIODS

if TYPE_CHECKING:
    from pendmap.cli.show import Outputs
    from pendmap.model import Pendulum, Rig


_CELLS = 100  # Default number of cells on each side
_ANALYSIS = group("Analysis", "--layer-periods 10")


@analysis_command(
    "sweep",
    window_options(_CELLS),
    tol_option,
    max_periods_option("Bound after which a start is undecided.  [default: as for basins]"),
    option(
        "--layer-periods",
        whole(1, MOST_PERIODS),
        "Periods of planes without basins.",
        group=_ANALYSIS,
    ),
    seed_option("Shifts the samples."),
    examples=("pendmap sweep --p 0.5:1.7:25 --grid 60",),
    model=varied_model_options,
    stored=True,
)
def command(model: Pendulum | Rig, outputs: Outputs, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Map the basins of attraction along one or two parameters.

    Parameters are ranges A:B:N, like --p 0.5:2:61, or by name: --vary quadratic_drag.q 0:0.1:20.
    Each attractor has one number in all maps.
    """
    grid = take_window(given, _CELLS, model.units.w0)
    models = math.prod(span.cells for span in given["ranges"].values())
    outputs.check_room(models * grid.cells)
    return {"grid": grid, **given}
