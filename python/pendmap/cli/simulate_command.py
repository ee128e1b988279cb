"""``pendmap simulate``: one trajectory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from pendmap.checks import MOST_SAMPLES
from pendmap.cli.model_options import model_from, model_options
from pendmap.cli.options import (
    Outputs,
    output_options,
)
from pendmap.cli.show import show
from pendmap.cli.types import NUMBER, Whole

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["command"]


@click.command("simulate")
@model_options
@click.option("--theta", type=NUMBER, default=1.0, help="Angle at the start, rad.  [default: 1]")
@click.option(
    "--velocity", type=NUMBER, default=0.0, help="Velocity at the start, in SI rad/s.  [default: 0]"
)
@click.option(
    "--until", type=NUMBER, default=100.0, help="Last time, in 1/w0, in SI s.  [default: 100]"
)
@click.option("--tol", type=NUMBER, default=1e-9, help="Error after 5 periods.  [default: 1e-9]")
@click.option(
    "--samples", type=Whole(1, MOST_SAMPLES), help="Samples a period.  [default: 64 or more]"
)
@click.option("--lyapunov", is_flag=True, help="Also the Lyapunov exponent of this stretch.")
@click.option("--quiet", is_flag=True, help="No summary.")
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Integrate one trajectory: time history, phase plane, Poincaré section.

    Writes simulate.nc, simulate.png and simulate.rrd if no output is named. --json alone writes no
    file. --view writes the recording it opens: simulate.rrd, or what --rerun names.
    """
    file = given["model"]
    model = model_from(given)
    outputs = Outputs.take(given, "simulate", reads=[file])

    from pendmap.trajectory import simulate

    start = (given.pop("theta"), given.pop("velocity"), given.pop("until"))
    show(simulate(model, *start, **given), outputs, fields)


def fields(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the JSON object of a trajectory: its end, unwrapped."""
    a = dataset.attrs
    result: dict[str, Any] = {
        "units": a["units"],
        "t": a["until"],
        "theta": float(dataset["theta"].values[-1]),
        "velocity": float(dataset["velocity"].values[-1]),
        "stuck": bool(a["stuck"]),
        "turns": a["turns"],
        "tol": a["tol"],
        "tol_reached": bool(a["reached_error"] <= a["tol"]),
        "reached_error": a["reached_error"],
        "end_error": a["end_error"],
    }
    if a["lyapunov"]:
        names = {"exponent": "exponent", "stderr": "exponent_stderr"}
        names |= {name: name for name in ("exponent_from", "exponent_to")}
        result |= {key: a.get(name) for key, name in names.items()}
    return result
