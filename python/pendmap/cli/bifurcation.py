"""``pendmap bifurcation``: attractors along one parameter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.model_options import model_from, varied_model_options
from pendmap.cli.options import Outputs, output_options, progress_options, search_options
from pendmap.cli.show import progress_bar, searched, show
from pendmap.cli.types import NUMBER

if TYPE_CHECKING:
    import xarray as xr


@click.command("bifurcation")
@varied_model_options
@click.option("--theta", type=NUMBER, help="Angle from which both sweeps start, rad.")
@click.option("--velocity", type=NUMBER, help="Velocity of that start, in SI rad/s.")
@search_options
@progress_options
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Draw stroboscopic points against a parameter: all attractors, and followed up and down.

    One parameter is a range: --vary p 0.9:2:2000, or --p 0.9:2:2000. Writes bifurcation.nc,
    bifurcation.png and bifurcation.rrd if no output is named. --json alone writes no file.
    """
    file = given["model"]
    ranges = given.pop("ranges")
    theta, velocity = given.pop("theta"), given.pop("velocity")
    if (theta is None) != (velocity is None):
        raise click.UsageError("both or neither of --theta and --velocity must be given, got one")
    start = None if theta is None else (theta, velocity)
    model = model_from(given)
    outputs = Outputs.take(given, "bifurcation", reads=[file])

    from pendmap.analysis.bifurcation import bifurcation

    with progress_bar("bifurcation", shown=outputs.shows_progress) as progress:
        dataset = bifurcation(model, ranges, start=start, progress=progress, **given)
    show(dataset, outputs, fields)


def fields(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the JSON object of a bifurcation diagram."""
    a = dataset.attrs
    kinds = dataset["kind"].values
    rows = zip(
        dataset["branch_kind"].values,
        dataset["branch_w"].values,
        dataset["branch_first"].values,
        dataset["branch_last"].values,
        strict=True,
    )
    branches = [
        {"kind": str(kinds[kind]), "w": int(w), "first": float(first), "last": float(last)}
        for kind, w, first, last in rows
    ]
    return {
        "units": a["units"],
        "varied": a["varied"],
        "branches": branches,
        "points": a["points"],
        **searched(dataset),
    }
