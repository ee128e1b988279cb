"""``pendmap basins``: the basins of attraction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from pendmap.cli import price
from pendmap.cli.model_options import model_from, model_options
from pendmap.cli.options import (
    Outputs,
    draws_option,
    output_options,
    progress_options,
    seed_option,
)
from pendmap.cli.show import progress_bar, show
from pendmap.cli.types import AXIS, NUMBER, Whole
from pendmap.errors import MOST_CELLS, MOST_PERIODS

if TYPE_CHECKING:
    import xarray as xr


@click.command("basins")
@model_options
@click.option("--theta", type=AXIS, help="Initial angles, rad.  [default: -pi:pi:1000]")
@click.option(
    "--velocity",
    type=AXIS,
    help="Initial velocities, in SI rad/s.  [default: -3:3:1000, in SI times w0]",
)
@click.option("--grid", type=Whole(1, MOST_CELLS), help="Cells on each side of the window.")
@click.option("--tol", type=NUMBER, default=1e-6, help="Error after 5 periods.  [default: 1e-6]")
@click.option(
    "--max-periods",
    type=Whole(1, MOST_PERIODS),
    help="Bound after which a start is undecided.  [default: 4000; more where damping"
    " is small, less beside chaos]",
)
@click.option(
    "--layer-periods", type=Whole(1, MOST_PERIODS), help="Periods of the finite-time layers."
)
@seed_option("Shifts the samples, and draws the models of --draws.")
@draws_option
@progress_options
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Map the basins of attraction over initial angle and velocity.

    Writes basins.nc, basins.png and basins.rrd if no output is named. --json alone writes no file.
    --view writes the recording it opens: basins.rrd, or what --rerun names.
    """
    file = given["model"]
    model = model_from(given)
    outputs = Outputs.take(given, "basins", reads=[file])
    theta, velocity, count = (given.pop(name) for name in ("theta", "velocity", "grid"))
    if count is not None and (theta is not None or velocity is not None):
        raise click.UsageError(
            "--grid must be given alone; --theta and --velocity name their own cells"
        )

    from pendmap import _core
    from pendmap.analysis.basins import DEFAULT_CELLS, basins
    from pendmap.analysis.grid import Axis, Grid
    from pendmap.analysis.summary import unlimited_rotation
    from pendmap.charts.basins import BYTES_OF_CELL
    from pendmap.model import without_dimensions

    usual = Grid.of(count, DEFAULT_CELLS, model.units.w0)
    grid = Grid(
        Axis(*theta) if theta else usual.theta, Axis(*velocity) if velocity else usual.velocity
    )
    outputs.check_room(grid.theta.count * grid.velocity.count)
    if outputs.plot or outputs.rerun:
        _core.reckon("cells", grid.cells, BYTES_OF_CELL)
    if outputs.shows_progress:  # the summary says it too, after all periods have passed
        for line in unlimited_rotation(without_dimensions(model)[0]):
            click.echo(line, err=True)
    if given["max_periods"] is None and not outputs.quiet:
        cells = grid.theta.count * grid.velocity.count * (1 + (given["draws"] or 0))
        price.say(model, cells, tol=given["tol"], threads=given["threads"])
    with progress_bar("basins", shown=outputs.shows_progress) as progress:
        dataset = basins(model, grid, progress=progress, **given)
    show(dataset, outputs, fields)


def fields(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the JSON object of a basin map."""
    a = dataset.attrs
    names = [
        "undecided",
        "failed",
        "cells",
        "mean_periods",
        "seconds",
        "reached_error",
        "basin_entropy",
        "boundary_basin_entropy",
        "boundary_basin_entropy_stderr",
        "unreliable",
        "labels_sampled",
        "unreliable_half_step",
        "unreliable_mirror",
        "neighbours_agree",
        "neighbours_chance",
        "chaos_bound",
        "searched_starts",
        "plane",
        "layer_periods",
        "steps_per_period",
        "max_periods",
        "tol",
        "simd",
        "threads",
        "seed",
        "pendmap_version",
        "format_version",
    ]
    settled = a["longest_settle"] >= 0
    return {
        "units": a["units"],
        "attractors": [_attractor(dataset, k) for k in range(dataset.sizes["attractor"])],
        **{name: a.get(name) for name in names},
        "log2_criterion": bool(a["log2_criterion"]) if "log2_criterion" in a else None,
        "uncertainty_exponent": _exponent(a),
        "mean_settle": a["mean_settle"] if settled else None,
        "longest_settle": a["longest_settle"] if settled else None,
        "summary": a["summary"].split("\n"),
    }


def _exponent(attrs: dict[Any, Any]) -> dict[str, Any] | None:
    """Of the boundary, with its dimension; none where no boundary was met."""
    if "uncertainty_exponent" not in attrs:
        return None
    value = attrs["uncertainty_exponent"]
    low, high = (attrs[f"uncertainty_exponent_{end}"] for end in ("low", "high"))
    return {
        "value": value,
        "stderr": attrs["uncertainty_exponent_stderr"],
        "ci95": [low, high],
        "dimension": 2 - value,
        "dimension_ci95": [2 - high, 2 - low],
        "eps": [attrs["uncertainty_eps_low"], attrs["uncertainty_eps_high"]],
    }


def _attractor(dataset: xr.Dataset, k: int) -> dict[str, Any]:
    from pendmap.analysis.orbit_table import row

    own = dataset.isel(attractor=k)
    shares = {name: float(own[name]) for name in ("fraction", "stderr")}
    return row(dataset, "attractor", k) | shares
