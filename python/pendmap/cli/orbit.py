"""``pendmap orbit``: all closed orbits of one period and winding."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pendmap.cli.analysis import analysis_command
from pendmap.cli.parse.groups import STARTS, group
from pendmap.cli.parse.options import draws_option, option, seed_option
from pendmap.cli.parse.types import AXIS, whole
from pendmap.errors import MOST_CELLS

if TYPE_CHECKING:
    from pendmap.model import Pendulum, Rig

_LONGEST = 64
_ANALYSIS = group("Analysis", "--n 2 --w 0")


@analysis_command(
    "orbit",
    option("--n", whole(1, _LONGEST), "Smallest period, in drive's.", 1, group=_ANALYSIS),
    option(
        "--w",
        whole(-MOST_CELLS, MOST_CELLS),
        "Net turns over it, forward positive.",
        0,
        group=_ANALYSIS,
    ),
    option("--theta", AXIS, "Angles of the box, rad.  [default: -pi:pi:200]", group=STARTS),
    option(
        "--velocity",
        AXIS,
        "Velocities of the box, in SI rad/s.  [default: depends on n, w and p]",
        group=STARTS,
    ),
    option("--grid", whole(1, MOST_CELLS), "Cells on each side of the box.", group=STARTS),
    draws_option(_ANALYSIS),
    seed_option("Draws the models."),
    examples=(
        "pendmap orbit --p 1.3 --n 2 --w 0",
        "pendmap orbit --p 1 --n 1 --w 1 --theta-r 0.05",
    ),
)
def command(model: Pendulum | Rig, _: object, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Find all periodic orbits of period n and w net turns, stable and unstable."""
    from pendmap.analysis.grid import Axis, Grid
    from pendmap.analysis.orbits import window

    theta, velocity, count = (given.pop(name) for name in ("theta", "velocity", "grid"))
    usual = window(model, given["n"], given["w"])
    axes = [
        Axis(*(typed or (axis.low, axis.high, count or usual.velocity.count)))
        for typed, axis in ((theta, usual.theta), (velocity, usual.velocity))
    ]
    return {"grid": Grid(*axes), **given}
