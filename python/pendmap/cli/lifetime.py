"""``pendmap lifetime``: the mean lifetime of transient chaos."""

from __future__ import annotations

from typing import Any

from pendmap.cli.analysis import analysis_command
from pendmap.cli.options import draws_option, max_periods_option, option, seed_option, tol_option
from pendmap.cli.types import whole
from pendmap.errors import MOST_PERIODS

_STARTS = (100, 10_000_000)


@analysis_command(
    "lifetime",
    option(
        "--starts",
        whole(*_STARTS),
        "How many are drawn, from -pi to pi and velocities -3 to 3, in SI times w0.",
        40_000,
    ),
    option(
        "--from-period",
        whole(0, MOST_PERIODS),
        "Where the exponential tail begins.  [default: estimated from the data]",
    ),
    max_periods_option(
        "Bound after which a start is given up.  [default: 4000; more where damping"
        " is small, less if chaos coexists]"
    ),
    tol_option,
    seed_option("Draws the starts, and the models of --draws."),
    draws_option,
    stored=True,
)
def command(*_: object, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Measure how long transient chaos lives, or find that it persists."""
    return given
