"""``pendmap simulate``: one trajectory."""

from __future__ import annotations

from typing import Any

from pendmap.cli.parse.groups import OUTPUT, group, new_command
from pendmap.cli.parse.model_options import model_options
from pendmap.cli.parse.options import option, output_options, simd_option
from pendmap.cli.parse.signature import options_of
from pendmap.cli.parse.types import NUMBER
from pendmap.cli.show import begin, show
from pendmap.errors import named

_ANALYSIS = group("Trajectory", "--until 500 --samples 128")
_VIEWER = "127.0.0.1:9876"


@new_command(
    "simulate",
    "pendmap simulate --p 1.5 --omega 0.87 --theta-r 0.2",
    "pendmap simulate --preset fig2b --until 20000 --lyapunov",
    "pendmap simulate --preset fig2c --theta 1 --until 600 --out chaos.png",
)
@model_options
@options_of("analysis.lyapunov.lyapunov", "theta velocity")
@option("--until", NUMBER, "Last time, in 1/w0, in SI s.", 100.0, group=_ANALYSIS)
@options_of("analysis.trajectory.simulate", "tol samples lyapunov", _ANALYSIS)
@option(
    "--live",
    str,
    f"Show it in a running viewer while it is computed.  [default: {_VIEWER}]",
    is_flag=False,
    flag_value=_VIEWER,
    metavar="[HOST:PORT]",
    group=OUTPUT,
)
@simd_option
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Integrate one trajectory: time history, energy, phase plane, Poincaré section.

    Writes simulate.nc, simulate.png and simulate.rrd if no output is named. --live needs a viewer
    that runs (rerun --bind 127.0.0.1); Ctrl-C then ends the trajectory where it is, and what was
    computed is written.
    """
    address = given.pop("live")
    model, outputs = begin(given, "simulate")
    start = (given.pop("theta"), given.pop("velocity"))
    live = None
    if address is not None:  # connected before anything is computed
        with named("--live"):
            from pendmap import viewer

            live = viewer.Live(model, start, address)

    from pendmap.analysis.trajectory import SCHEMA, simulate

    dataset = simulate(model, *start, given.pop("until"), live=live, **given)
    try:
        if live is not None:
            with named("--live"):
                live.finish(dataset)
    finally:  # without the viewer files are written too
        show(dataset, outputs, SCHEMA)
    if dataset.attrs.get("interrupted"):
        raise KeyboardInterrupt
