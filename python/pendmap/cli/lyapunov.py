"""``pendmap lyapunov``: the largest exponent of the attractor that a start reaches."""

from __future__ import annotations

from typing import Any

from pendmap.cli.analysis import analysis_command
from pendmap.cli.parse.groups import ACCURACY
from pendmap.cli.parse.options import (
    max_periods_option,
    option,
    seed_option,
    start_options,
    tol_option,
)
from pendmap.cli.parse.types import NUMBER


@analysis_command(
    "lyapunov",
    start_options,
    option(
        "--precision",
        NUMBER,
        "Standard error over exponent that chaos is averaged for.",
        1e-3,
        group=ACCURACY,
    ),
    tol_option,
    max_periods_option(
        "Bound after which the start is undecided, and of each trajectory averaged."
        "  [default: 4000, more where damping is small; and 20000]"
    ),
    seed_option("Chooses the trajectories."),
    examples=(
        "pendmap lyapunov --preset fig2b",
        "pendmap lyapunov --p 1.7 --theta 2 --json",
    ),
)
def command(*_: object, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Find the largest Lyapunov exponent of the attractor that a start reaches."""
    return given
