"""``pendmap orbit``: all closed orbits of one period and winding."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pendmap.cli.analysis import analysis_command
from pendmap.cli.parse.options import take_window, window_options

if TYPE_CHECKING:
    from pendmap.model import Pendulum, Rig


@analysis_command(
    "orbit",
    "n w",
    window_options("-pi:pi:200", "depends on n, w and p"),
    example="--n 2 --w 0",
    examples=(
        "pendmap orbit --p 1.3 --n 2 --w 0",
        "pendmap orbit --p 1 --n 1 --w 1 --theta-r 0.05",
    ),
)
def command(model: Pendulum | Rig, _: object, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Find all periodic orbits of period n and w net turns, stable and unstable."""
    from pendmap.analysis.orbits import window

    return {"grid": take_window(given, window(model, given["n"], given["w"])), **given}
