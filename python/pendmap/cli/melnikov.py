"""``pendmap melnikov``: the homoclinic threshold."""

from __future__ import annotations

from typing import Any

from pendmap.cli.analysis import analysis_command


@analysis_command(
    "melnikov",
    examples=(
        "pendmap melnikov --omega 1 --theta-r 0.02",
        "pendmap melnikov --torque 0.2 --json",
    ),
)
def command(*_: object, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Compute the amplitude at which homoclinic tangles begin, by Melnikov's criterion.

    First order, with Coulomb friction and effects. A torque that keeps up a rotation tilts the
    potential: the threshold is that of the loop of upright rest.
    """
    return given
