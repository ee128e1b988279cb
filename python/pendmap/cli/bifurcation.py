"""``pendmap bifurcation``: attractors along one parameter."""

from __future__ import annotations

from typing import Any

import click

from pendmap.cli.analysis import analysis_command
from pendmap.cli.parse.groups import START
from pendmap.cli.parse.model_options import varied_model_options
from pendmap.cli.parse.options import option
from pendmap.cli.parse.types import NUMBER


@analysis_command(
    "bifurcation",
    option("--theta", NUMBER, "Angle from which both sweeps start, rad.", group=START),
    option("--velocity", NUMBER, "Velocity of that start, in SI rad/s.", group=START),
    "starts tol max_periods seed",
    examples=(
        "pendmap bifurcation --vary p 0.9:2:2000",
        "pendmap bifurcation --p 0.9:2:500 --theta-r 0.02 --out bifurcation.pdf",
    ),
    model=varied_model_options,
    stored=True,
)
def command(*_: object, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Draw stroboscopic points against a parameter: all attractors, and followed up and down.

    One parameter is a range: --vary p 0.9:2:2000, or --p 0.9:2:2000.
    """
    start = (given.pop("theta"), given.pop("velocity"))
    if (start[0] is None) != (start[1] is None):
        raise click.UsageError("both or neither of --theta and --velocity must be given, got one")
    return {"start": None if start[0] is None else start, **given}
