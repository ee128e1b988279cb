"""``pendmap lifetime``: the mean lifetime of transient chaos."""

from __future__ import annotations

from typing import Any

from pendmap.cli.analysis import analysis_command
from pendmap.cli.parse.groups import group
from pendmap.cli.parse.options import (
    draws_option,
    max_periods_option,
    option,
    seed_option,
    tol_option,
)
from pendmap.cli.parse.types import whole
from pendmap.errors import MOST_PERIODS

_STARTS = (100, 10_000_000)
_ANALYSIS = group("Analysis", "--starts 100000 --from-period 50")


@analysis_command(
    "lifetime",
    option(
        "--starts",
        whole(*_STARTS),
        "How many are drawn, from -pi to pi and velocities -3 to 3, in SI times w0.",
        40_000,
        group=_ANALYSIS,
    ),
    option(
        "--from-period",
        whole(0, MOST_PERIODS),
        "Where the exponential tail begins.  [default: estimated from the data]",
        group=_ANALYSIS,
    ),
    max_periods_option(
        "Bound after which a start is given up.  [default: 4000; more where damping"
        " is small, less if chaos coexists]"
    ),
    tol_option,
    seed_option("Draws the starts, and the models of --draws."),
    draws_option(_ANALYSIS),
    examples=(
        "pendmap lifetime --p 1.7",
        "pendmap lifetime --p 1.808 --starts 10000 --json",
    ),
    stored=True,
)
def command(*_: object, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Measure how long transient chaos lives, or find that it persists."""
    return given
