"""``pendmap lifetime``: how long transient chaos lives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from pendmap.cli import price
from pendmap.cli.model_options import model_from, model_options
from pendmap.cli.options import Outputs, draws_option, output_options, progress_options, seed_option
from pendmap.cli.show import progress_bar, show
from pendmap.cli.types import NUMBER, Whole
from pendmap.errors import MOST_PERIODS

if TYPE_CHECKING:
    import xarray as xr


_STARTS = (100, 10_000_000)


@click.command("lifetime")
@model_options
@click.option(
    "--starts",
    type=Whole(*_STARTS),
    default=40_000,
    help="How many are drawn, from -pi to pi and velocities -3 to 3, in SI times w0."
    "  [default: 40000]",
)
@click.option(
    "--from-period",
    type=Whole(0, MOST_PERIODS),
    help="Where the exponential tail begins.  [default: where the data say so]",
)
@click.option(
    "--max-periods",
    type=Whole(1, MOST_PERIODS),
    help="Bound after which a start is given up.  [default: 4000; more where damping"
    " is small, less beside chaos]",
)
@click.option("--tol", type=NUMBER, default=1e-6, help="Error after 5 periods.  [default: 1e-6]")
@seed_option("Draws the starts, and the models of --draws.")
@draws_option
@progress_options
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Measure how long transient chaos lives, or find that it persists.

    Writes lifetime.nc, lifetime.png and lifetime.rrd if no output is named. --json alone writes no
    file.
    """
    file = given["model"]
    model = model_from(given)
    outputs = Outputs.take(given, "lifetime", reads=[file])

    from pendmap.analysis.lifetime import lifetime

    if given["max_periods"] is None and not outputs.quiet:
        starts = given["starts"] * (1 + (given["draws"] or 0))
        price.say(model, starts, tol=given["tol"], threads=given["threads"])
    with progress_bar("lifetime", shown=outputs.shows_progress) as progress:
        dataset = lifetime(model, progress=progress, **given)
    show(dataset, outputs, fields)


def fields(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the JSON object of a lifetime."""
    a = dataset.attrs
    names = [
        "mean_periods",
        "stderr",
        "persistent",
        "transient_chaos",
        "from_period",
        "mean_time",
        "mean_time_stderr",
        "escape_rate",
        "exponent",
        "exponent_stderr",
        "exponent_per_period",
        "entropy",
        "saddle_dimension",
        "tail_captured",
        "tail_weibull",
        "tail_steady",
        "tail_mean_periods",
        "starts",
        "captured",
        "censored",
        "failed",
        "chaotic_share",
        "max_periods",
        "chaos_bound",
        "tol",
        "reached_error",
        "steps_per_period",
        "seconds",
        "simd",
        "threads",
        "seed",
        "pendmap_version",
        "format_version",
    ]
    own = [
        {"name": str(name), "fraction": float(share), "captured": int(count)}
        for name, share, count in zip(
            dataset["attractor"].values,
            dataset["fraction"].values,
            dataset["captured"].values[:, -1],
            strict=True,
        )
    ]
    return {
        "units": a["units"],
        **{name: a[name] for name in names},
        "persistent": bool(a["persistent"]),
        "transient_chaos": bool(a["transient_chaos"]),
        "from_period": None if a["from_period"] < 0 else a["from_period"],
        "attractors": own,
        "summary": a["summary"].split("\n"),
    }
