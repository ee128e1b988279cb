"""``pendmap melnikov``: the homoclinic threshold."""

from __future__ import annotations

from typing import Any

import click

from pendmap.cli.model_options import begin, model_options
from pendmap.cli.options import output_options, simd_option
from pendmap.cli.show import show


@click.command("melnikov")
@model_options
@simd_option
@click.option("--quiet", is_flag=True, help="No summary.")
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Compute the amplitude at which homoclinic tangles begin, by Melnikov's criterion.

    First order, with Coulomb friction and effects. A torque that keeps up a rotation tilts the
    potential: the threshold is that of the loop of upright rest. Writes melnikov.nc, melnikov.png
    and melnikov.rrd if no output is named. --json alone writes no file.
    """
    model, outputs = begin(given, "melnikov")

    from pendmap.analysis.melnikov import SCHEMA, melnikov

    show(melnikov(model), outputs, SCHEMA)
