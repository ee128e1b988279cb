"""``pendmap lyapunov``: the largest exponent of the attractor that a start reaches."""

from __future__ import annotations

from typing import Any

from pendmap.cli.analysis import analysis_command


@analysis_command(
    "lyapunov",
    "theta velocity precision tol max_periods seed",
    examples=(
        "pendmap lyapunov --preset fig2b",
        "pendmap lyapunov --p 1.7 --theta 2 --json",
    ),
)
def command(*_: object, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Find the largest Lyapunov exponent of the attractor that a start reaches."""
    return given
