"""``pendmap orbit``: all closed orbits of one period and winding."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.model_options import model_from, model_options
from pendmap.cli.options import (
    Outputs,
    draws_option,
    output_options,
    progress_options,
    seed_option,
)
from pendmap.cli.show import progress_bar, show
from pendmap.cli.types import AXIS, Whole
from pendmap.errors import MOST_CELLS

if TYPE_CHECKING:
    import xarray as xr


_LONGEST = 64


@click.command("orbit")
@model_options
@click.option(
    "--n", type=Whole(1, _LONGEST), default=1, help="Smallest period, in drive's.  [default: 1]"
)
@click.option(
    "--w",
    type=Whole(-MOST_CELLS, MOST_CELLS),
    default=0,
    help="Net turns over it, forward positive.  [default: 0]",
)
@click.option("--theta", type=AXIS, help="Angles of the box, rad.  [default: -pi:pi:200]")
@click.option(
    "--velocity",
    type=AXIS,
    help="Velocities of the box, in SI rad/s.  [default: as n, w and p ask]",
)
@click.option("--grid", type=Whole(1, MOST_CELLS), help="Cells on each side of the box.")
@draws_option
@seed_option("Draws the models.")
@progress_options
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Find all periodic orbits of period n and w net turns, stable and unstable.

    Writes orbit.nc, orbit.png and orbit.rrd if no output is named. --json alone writes no file.
    """
    file = given["model"]
    model = model_from(given)
    outputs = Outputs.take(given, "orbit", reads=[file])
    n, w = given.pop("n"), given.pop("w")
    theta, velocity, count = (given.pop(name) for name in ("theta", "velocity", "grid"))

    from pendmap.analysis.grid import Axis, Grid
    from pendmap.analysis.orbits import orbit, window

    usual = window(model, n, w)
    low, high, cells = usual.velocity.as_tuple
    cells = count or cells
    grid = Grid(
        Axis(*theta) if theta else Axis(usual.theta.low, usual.theta.high, cells),
        Axis(*velocity) if velocity else Axis(low, high, cells),
    )
    with progress_bar("orbit", shown=outputs.shows_progress) as progress:
        dataset = orbit(model, n, w, grid, progress=progress, **given)
    show(dataset, outputs, fields)


def fields(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the JSON object of a search for orbits."""
    from pendmap.analysis.orbit_table import row

    a = dataset.attrs
    found = [
        row(dataset, "orbit", k)
        | {"stable": bool(dataset["stable"][k]), "residual": float(dataset["residual"][k])}
        for k in range(dataset.sizes["orbit"])
    ]
    return {
        "units": a["units"],
        "orbits": found,
        **{name: a[name] for name in ("n", "w", "cells", "begun", "seconds", "simd", "threads")},
        "summary": a["summary"].split("\n"),
    }
