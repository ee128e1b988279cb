"""Commands of analyses: options from signatures, and what a command adds to its signature."""

from __future__ import annotations

import functools
import importlib
import inspect
import math
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import click

from pendmap import ANALYSES
from pendmap.cli.parse import types
from pendmap.cli.parse.model_options import model_options, varied_model_options
from pendmap.cli.parse.options import (
    OUTPUT,
    START,
    added,
    group,
    new_command,
    option,
    output_options,
    resume_option,
    simd_option,
    take_window,
    window_options,
)
from pendmap.cli.parse.signature import GROUPS, options_of, parameters
from pendmap.cli.show import begin, made_here, show
from pendmap.errors import named

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.analysis.grid import Grid
    from pendmap.cli.parse.options import Decorator
    from pendmap.cli.show import Outputs
    from pendmap.model import Pendulum, Rig


class Entry(NamedTuple):
    """What a command has beside the options of its function's signature."""

    text: str = ""  # its help, by default the description of the analysis
    examples: Sequence[str] = ()  # by default the command alone
    example: str = ""  # of the options of its own group
    left_out: Sequence[str] = ()  # parameters that are no options
    further: Sequence[Decorator] = ()  # other options
    model: Decorator = model_options
    window: tuple[str, str] | None = None  # default of --theta and --velocity, if it has a window
    stored: bool = False  # computed in tiles, which a store keeps


_STRETCH: Final = group("Trajectory", "--until 500")
_VIEWER: Final = "127.0.0.1:9876"
_ENTRIES: Final = {
    "simulate": Entry(
        """Integrate one trajectory: time history, energy, phase plane, Poincaré section.

        --live needs a viewer that runs (rerun --bind 127.0.0.1); Ctrl-C then ends the trajectory
        where it is, and what was computed is written.
        """,
        (
            "pendmap simulate --p 1.5 --omega 0.87 --theta-r 0.2",
            "pendmap simulate --preset fig2b --until 20000 --lyapunov",
            "pendmap simulate --preset fig2c --theta 1 --until 600 --out chaos.png",
        ),
        example="--samples 128",
        left_out=("until",),
        further=(
            options_of("analysis.lyapunov.lyapunov", "theta velocity"),
            option("--until", types.NUMBER, "Last time, in 1/w0, in SI s.", 100.0, group=_STRETCH),
            option(
                "--live",
                str,
                f"Show it in a running viewer while it is computed.  [default: {_VIEWER}]",
                is_flag=False,
                flag_value=_VIEWER,
                metavar="[HOST:PORT]",
                group=OUTPUT,
            ),
        ),
    ),
    "basins": Entry(
        "Map the basins of attraction over initial angle and velocity.",
        (
            "pendmap basins --p 1.7",
            "pendmap basins --p 1 --theta-r 0.05 --grid 400 --out friction.nc",
        ),
        example="--draws 100",
        left_out=("check",),
        window=("-pi:pi:1000", "-3:3:1000, in SI times w0"),
        stored=True,
    ),
    "sweep": Entry(
        """Map the basins of attraction along one or two parameters.

        Parameters are ranges A:B:N, like --p 0.5:2:61, or by name: --vary quadratic_drag.q
        0:0.1:20. Each attractor has one number in all maps.
        """,
        ("pendmap sweep --p 0.5:1.7:25 --grid 60",),
        example="--layer-periods 10",
        left_out=("check",),
        model=varied_model_options,
        window=("-pi:pi:100", "-3:3:100, in SI times w0"),
        stored=True,
    ),
    "map": Entry(
        """Map which attractors exist over any two parameters.

        Two parameters are ranges A:B:N, like --p 0.05:2.5:200 --omega 0.5:3:200, or by name:
        --vary quadratic_drag.q 0:0.1:50.
        """,
        (
            "pendmap map --p 0.05:2.5:50 --omega 0.5:3:50 --curves",
            "pendmap map --vary gamma 0.02:0.4:20 --p 0.2:2:20 --json",
        ),
        example="--curves",
        model=varied_model_options,
        stored=True,
    ),
    "bifurcation": Entry(
        """Draw stroboscopic points against a parameter: all attractors, and followed up and down.

        One parameter is a range: --vary p 0.9:2:2000, or --p 0.9:2:2000.
        """,
        (
            "pendmap bifurcation --vary p 0.9:2:2000",
            "pendmap bifurcation --p 0.9:2:500 --theta-r 0.02 --out bifurcation.pdf",
        ),
        further=(
            option("--theta", types.NUMBER, "Angle where both sweeps start, rad.", group=START),
            option("--velocity", types.NUMBER, "Velocity there, in SI rad/s.", group=START),
        ),
        model=varied_model_options,
        stored=True,
    ),
    "continue": Entry(
        """Follow periodic orbits along a parameter: branches, folds, doublings, and their ends.

        One parameter is a range: --vary p 0.3:1.6, or --p 0.3:1.6.
        """,
        (
            "pendmap continue --vary p 0.3:1.6 --n 1 --w 1",
            "pendmap continue --vary p 0.1:1 --n 2 --theta-r 0.05 --omega 1.8 --json",
        ),
        example="--n 1 --w 1",
        further=(
            option("--theta", types.NUMBER, "Angle of the orbit followed, rad.", group=START),
            option("--velocity", types.NUMBER, "Velocity there, in SI rad/s.", group=START),
        ),
        model=functools.partial(varied_model_options, ends=True),
    ),
    "orbit": Entry(
        "Find all periodic orbits of period n and w net turns, stable and unstable.",
        ("pendmap orbit --p 1.3 --n 2 --w 0", "pendmap orbit --p 1 --n 1 --w 1 --theta-r 0.05"),
        example="--n 2 --w 0",
        window=("-pi:pi:200", "depends on n, w and p"),
    ),
    "lyapunov": Entry(
        "Find the largest Lyapunov exponent of the attractor that a start reaches.",
        ("pendmap lyapunov --preset fig2b", "pendmap lyapunov --p 1.7 --theta 2 --json"),
    ),
    "lifetime": Entry(
        "Measure how long transient chaos lives, or find that it persists.",
        ("pendmap lifetime --p 1.7", "pendmap lifetime --p 1.808 --starts 10000 --json"),
        example="--from-period 50 --draws 100",
        stored=True,
    ),
    "tongues": Entry(
        """Find where rest, hanging and inverted, is stable: critical curves of eq. 1.3, exact.

        Also without damping; folds of the oscillation born there; curves by perturbation. For
        files, frequencies are added where curves turn back; --json lists the requested ones.
        """,
        (
            "pendmap tongues --omega 0.5:3:200 --p-max 6",
            "pendmap tongues --gamma 0 --plane e-alpha2 --out mathieu.pdf",
        ),
        example="--p-max 6 --plane e-alpha2",
        left_out=("inverted", "refine"),
        further=(
            option(
                "--omega omegas",
                types.VALUES,
                "Frequencies Omega/w0 of the drive.  [default: 0.5:3:200]",
                group=group("Frequencies", "--omega 0.5:3:200"),
            ),
        ),
        model=functools.partial(model_options, left_out=("omega", "frequency_hz")),
    ),
    "melnikov": Entry(
        """Compute the amplitude at which homoclinic tangles begin, by Melnikov's criterion.

        First order, with Coulomb friction and effects. A torque that keeps up a rotation tilts the
        potential: the threshold is that of the loop of upright rest.
        """,
        ("pendmap melnikov --omega 1 --theta-r 0.02", "pendmap melnikov --torque 0.2 --json"),
    ),
}
"""By command; an analysis without an entry has what its signature and its description say."""


@functools.cache
def command_of(name: str) -> click.Command:
    """Return the command of an analysis of :data:`pendmap.ANALYSES`."""
    kind, function, short = next(
        (kind, functions[0], text)
        for kind, (which, functions, text) in ANALYSES.items()
        if which == name
    )
    path, entry = f"analysis.{kind}.{function}", _ENTRIES.get(name, Entry())
    declared = parameters(path)

    def run(**given: Any) -> None:  # noqa: ANN401 (the options)
        names = [key for key in ("threads", "seed", "resume") if key in given]
        options: dict[str, Any] = {key: given.pop(key) for key in names}
        pendulum, outputs = begin(given, name, going_on=options.get("resume", False))
        arguments = _arguments(name, pendulum, outputs, given)
        module = importlib.import_module(f"pendmap.analysis.{kind}")
        store = outputs.store if entry.stored else None
        if arguments.get("draws"):
            store = None  # draws are written when all are computed
        with made_here(), outputs.progress(name) as progress:
            if "run" in declared:
                from pendmap.analysis.run import RunOptions

                arguments["run"] = RunOptions(progress=progress, store=store, **options)
            dataset = getattr(module, function)(pendulum, **arguments)
        try:
            if arguments.get("live"):
                with named("--live"):
                    arguments["live"].finish(dataset)
        finally:  # without the viewer files are written too
            show(dataset, outputs, module.SCHEMA, store)
        if dataset.attrs.get("interrupted"):
            raise KeyboardInterrupt

    names = [n for n, one in declared.items() if one.is_option and n not in entry.left_out]
    first = next((n for n in names if n not in GROUPS), None)
    example = entry.example or f"--{first} {declared[first].default}" if first else ""
    parts = [entry.model, *entry.further]
    if entry.window:
        parts.append(window_options(*entry.window))
    parts.append(options_of(path, " ".join(names), group("Analysis", example)))
    if entry.stored:
        parts.append(resume_option)
    if "run" in declared:
        parts.append(options_of("analysis.run.RunOptions", "threads seed"))
    decorate = added(*parts, simd_option, output_options(stored=entry.stored))
    files = f"Writes {name}.nc, {name}.png and {name}.rrd if no output is named."
    text = f"{inspect.cleandoc(entry.text) or short}\n\n{files}"
    return new_command(name, *(entry.examples or [f"pendmap {name}"]), text=text)(decorate(run))


def _arguments(
    name: str, model: Pendulum | Rig, outputs: Outputs, given: dict[str, Any]
) -> dict[str, Any]:
    """Return the keyword arguments of an analysis from the options of its command."""
    cells = math.prod(span.cells for span in given.get("ranges", {}).values())
    if "grid" in given:
        given["grid"] = take_window(given, _usual(name, model, given))
        cells *= given["grid"].cells
    if name in {"bifurcation", "continue"}:
        start = (given.pop("theta"), given.pop("velocity"))
        if (start[0] is None) != (start[1] is None):
            raise click.UsageError(
                "both or neither of --theta and --velocity must be given, got one"
            )
        given["start"] = None if start[0] is None else start
    if given.get("live"):  # connected before anything is computed
        with named("--live"):
            from pendmap import viewer

            given["live"] = viewer.Live(model, (given["theta"], given["velocity"]), given["live"])
    if name == "tongues":
        given |= {"omega": given.pop("omegas"), "refine": bool(outputs.files)}
    if name == "basins" and (outputs.path("plot") or outputs.path("rerun")):
        from pendmap import _core
        from pendmap.charts.basins import BYTES_OF_CELL

        _core.reckon("cells", cells, BYTES_OF_CELL)
    return given


def _usual(name: str, model: Pendulum | Rig, given: dict[str, Any]) -> Grid:
    """Return the default window of a command."""
    from pendmap.analysis.grid import Grid

    if name == "orbit":
        from pendmap.analysis.orbits import window

        return window(model, given["n"], given["w"])
    return Grid.square(100 if name == "sweep" else 1000, model.units.w0)
