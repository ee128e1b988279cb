"""``pendmap map``: which attractors exist over two parameters."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pendmap.cli.analysis import analysis_command
from pendmap.cli.parse.model_options import varied_model_options

if TYPE_CHECKING:
    from pendmap.cli.show import Outputs


@analysis_command(
    "map",
    "curves draws starts tol max_periods seed",
    example="--curves",
    examples=(
        "pendmap map --p 0.05:2.5:50 --omega 0.5:3:50 --curves",
        "pendmap map --vary gamma 0.02:0.4:20 --p 0.2:2:20 --json",
    ),
    model=varied_model_options,
    stored=True,
)
def command(_: object, outputs: Outputs, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Map which attractors exist over any two parameters.

    Two parameters are ranges A:B:N, like --p 0.05:2.5:200 --omega 0.5:3:200, or by name:
    --vary quadratic_drag.q 0:0.1:50.
    """
    outputs.check_room(math.prod(span.cells for span in given["ranges"].values()))
    return given
