"""``pendmap lifetime``: the mean lifetime of transient chaos."""

from __future__ import annotations

from typing import Any

from pendmap.cli.analysis import analysis_command


@analysis_command(
    "lifetime",
    "starts from_period max_periods tol seed draws",
    example="--from-period 50 --draws 100",
    examples=(
        "pendmap lifetime --p 1.7",
        "pendmap lifetime --p 1.808 --starts 10000 --json",
    ),
    stored=True,
)
def command(*_: object, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Measure how long transient chaos lives, or find that it persists."""
    return given
