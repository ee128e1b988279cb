"""``pendmap lyapunov``: the largest exponent of the attractor that a start reaches."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.model_options import model_from, model_options
from pendmap.cli.options import Outputs, output_options, progress_options
from pendmap.cli.show import progress_bar, show
from pendmap.cli.types import NUMBER, Whole
from pendmap.errors import MOST_PERIODS, MOST_SEED

if TYPE_CHECKING:
    import xarray as xr


@click.command("lyapunov")
@model_options
@click.option("--theta", type=NUMBER, default=1.0, help="Angle at the start, rad.  [default: 1]")
@click.option(
    "--velocity", type=NUMBER, default=0.0, help="Velocity at the start, in SI rad/s.  [default: 0]"
)
@click.option(
    "--precision",
    type=NUMBER,
    default=1e-3,
    help="Standard error over exponent that chaos is averaged for.  [default: 1e-3]",
)
@click.option("--tol", type=NUMBER, default=1e-6, help="Error after 5 periods.  [default: 1e-6]")
@click.option(
    "--max-periods",
    type=Whole(1, MOST_PERIODS),
    help="Bound after which the start is undecided, and of each trajectory averaged."
    "  [default: 4000, more where damping is small; and 20000]",
)
@click.option(
    "--seed", type=Whole(0, MOST_SEED), default=0, help="Chooses the trajectories.  [default: 0]"
)
@progress_options
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Find the largest Lyapunov exponent of the attractor that a start reaches.

    Writes lyapunov.nc, lyapunov.png and lyapunov.rrd if no output is named. --json alone writes no
    file.
    """
    file = given["model"]
    model = model_from(given)
    outputs = Outputs.take(given, "lyapunov", reads=[file])

    from pendmap.analysis.lyapunov import lyapunov

    with progress_bar("lyapunov", shown=outputs.shows_progress) as progress:
        dataset = lyapunov(
            model, given.pop("theta"), given.pop("velocity"), progress=progress, **given
        )
    show(dataset, outputs, fields)


def fields(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the JSON object of an exponent."""
    from pendmap.analysis.orbit_table import row

    a = dataset.attrs
    reached = dataset.sizes["attractor"] > 0
    names = [
        "units",
        "exponent",
        "stderr",
        "per_period",
        "per_period_stderr",
        "second_exponent",
        "exponent_sum",
        "kaplan_yorke_dimension",
        "end",
    ]
    further = [
        "trajectories",
        "periods",
        "dropped_periods",
        "lost",
        "precision",
        "tol",
        "reached_error",
        "steps_per_period",
        "max_periods",
        "chaos_bound",
        "seconds",
        "simd",
        "threads",
        "seed",
        "pendmap_version",
        "format_version",
    ]
    return {
        **{name: a[name] for name in names},
        "attractor": row(dataset, "attractor", 0) if reached else None,
        "transient_periods": None if a["transient_periods"] < 0 else a["transient_periods"],
        **{name: a[name] for name in further},
        "summary": a["summary"].split("\n"),
    }
