"""``pendmap orbit``: all closed orbits of one period and winding."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.analysis import analysis_command
from pendmap.cli.options import draws_option, seed_option
from pendmap.cli.types import AXIS, Whole
from pendmap.errors import MOST_CELLS

if TYPE_CHECKING:
    from pendmap.model import Pendulum, Rig

_LONGEST = 64


@analysis_command(
    "orbit",
    click.option(
        "--n", type=Whole(1, _LONGEST), default=1, help="Smallest period, in drive's.  [default: 1]"
    ),
    click.option(
        "--w",
        type=Whole(-MOST_CELLS, MOST_CELLS),
        default=0,
        help="Net turns over it, forward positive.  [default: 0]",
    ),
    click.option("--theta", type=AXIS, help="Angles of the box, rad.  [default: -pi:pi:200]"),
    click.option(
        "--velocity",
        type=AXIS,
        help="Velocities of the box, in SI rad/s.  [default: as n, w and p ask]",
    ),
    click.option("--grid", type=Whole(1, MOST_CELLS), help="Cells on each side of the box."),
    draws_option,
    seed_option("Draws the models."),
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
