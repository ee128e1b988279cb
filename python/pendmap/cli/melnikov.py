"""``pendmap melnikov``: the homoclinic threshold."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.model_options import model_from, model_options
from pendmap.cli.options import Outputs, output_options, simd_option
from pendmap.cli.show import show

if TYPE_CHECKING:
    import xarray as xr


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
    file = given["model"]
    model = model_from(given)
    outputs = Outputs.take(given, "melnikov", reads=[file])

    from pendmap.analysis.melnikov import melnikov

    show(melnikov(model), outputs, fields)


def fields(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the JSON object of Melnikov's threshold; p_tangency is not computed yet."""
    a = dataset.attrs
    names = ("units", "p_melnikov", "p_tangency", "p_forward", "p_backward", "p_loop", "simd")
    return {**{name: a[name] for name in names}, "summary": a["summary"].split("\n")}
