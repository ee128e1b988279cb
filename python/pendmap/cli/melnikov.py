"""``pendmap melnikov``: the homoclinic threshold."""

from __future__ import annotations

from typing import Any

from pendmap.cli.parse.groups import new_command
from pendmap.cli.parse.model_options import model_options
from pendmap.cli.parse.options import output_options, simd_option
from pendmap.cli.show import begin, show


@new_command(
    "melnikov",
    "pendmap melnikov --omega 1 --theta-r 0.02",
    "pendmap melnikov --torque 0.2 --json",
)
@model_options
@simd_option
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Compute the amplitude at which homoclinic tangles begin, by Melnikov's criterion.

    First order, with Coulomb friction and effects. A torque that keeps up a rotation tilts the
    potential: the threshold is that of the loop of upright rest. Writes melnikov.nc, melnikov.png
    and melnikov.rrd if no output is named.
    """
    model, outputs = begin(given, "melnikov")

    from pendmap.analysis.melnikov import SCHEMA, melnikov

    show(melnikov(model), outputs, SCHEMA)
