"""``pendmap simulate``: one trajectory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.model_options import model_from, model_options
from pendmap.cli.options import (
    Outputs,
    output_options,
    simd_option,
)
from pendmap.cli.show import show
from pendmap.cli.types import NUMBER, Whole
from pendmap.errors import MOST_SAMPLES, InputError

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.model import Pendulum, Rig
    from pendmap.viewer import Live


_VIEWER = "127.0.0.1:9876"


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
@click.option(
    "--live",
    is_flag=False,
    flag_value=_VIEWER,
    metavar="[HOST:PORT]",
    help=f"Show it in a running viewer while it is computed.  [default: {_VIEWER}]",
)
@simd_option
@click.option("--quiet", is_flag=True, help="No summary.")
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Integrate one trajectory: time history, energy, phase plane, Poincaré section.

    Writes simulate.nc, simulate.png and simulate.rrd if no output is named. --json alone writes no
    file. --view writes the recording it opens: simulate.rrd, or what --rerun names. --live needs a
    viewer that runs (rerun --bind 127.0.0.1); Ctrl-C then ends the trajectory where it is, and what
    was computed is written.
    """
    file, address = given["model"], given.pop("live")
    model = model_from(given)
    outputs = Outputs.take(given, "simulate", reads=[file])
    start = (given.pop("theta"), given.pop("velocity"))
    live = None if address is None else _sender(model, start, address)

    from pendmap.analysis.trajectory import simulate

    dataset = simulate(model, *start, given.pop("until"), live=live, **given)
    gone = None if live is None else _finished(live, dataset)
    show(dataset, outputs, fields)
    if gone is not None:
        raise click.ClickException(f"--live: {gone}")
    if dataset.attrs.get("interrupted"):
        raise KeyboardInterrupt


def _sender(model: Pendulum | Rig, start: tuple[float, float], address: str) -> Live:
    """Connect to the viewer before anything is computed."""
    from pendmap import viewer

    try:
        return viewer.Live(model, start, address)
    except (viewer.ViewerError, InputError) as error:
        raise click.UsageError(f"--live: {error}") from error


def _finished(live: Live, dataset: xr.Dataset) -> Exception | None:
    """Send the rest; return why that was not possible, for what was computed is written first."""
    from pendmap import viewer

    try:
        live.finish(dataset)
    except viewer.ViewerError as error:
        return error
    return None


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
        "interrupted": bool(a.get("interrupted", 0)),
        "energy": float(dataset["energy"].values[-1]),
        "simd": a["simd"],
    }
    if a["lyapunov"]:
        names = {"exponent": "exponent", "stderr": "exponent_stderr"}
        names |= {name: name for name in ("exponent_from", "exponent_to")}
        result |= {key: a.get(name) for key, name in names.items()}
    return result
