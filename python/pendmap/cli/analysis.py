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
from pendmap.cli.parse.model_options import model_from, model_options, varied_model_options
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
from pendmap.cli.show import Outputs, made_here, show
from pendmap.errors import named
from pendmap.files.toml import packaged

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.analysis.grid import Grid
    from pendmap.cli.parse.options import Decorator
    from pendmap.model import Pendulum, Rig


class Entry(NamedTuple):
    """What a command has beside the options of its signature, as ``analyses.toml`` explains."""

    text: str = ""
    examples: Sequence[str] = ()
    example: str = ""
    left_out: Sequence[str] = ()
    window: Sequence[str] = ()
    stored: bool = False


_ENTRIES: Final = {name: Entry(**about) for name, about in packaged("cli/analyses.toml").items()}
_VIEWER: Final = "127.0.0.1:9876"


def _start(angle: str) -> Sequence[Decorator]:
    """Return the options of one start, the first with this help."""
    return (
        option("--theta", types.NUMBER, angle, group=START),
        option("--velocity", types.NUMBER, "Velocity there, in SI rad/s.", group=START),
    )


_FURTHER: Final = {
    "simulate": (
        options_of("analysis.lyapunov.lyapunov", "theta velocity"),
        option(
            "--until",
            types.NUMBER,
            "Last time, in 1/w0, in SI s.",
            100.0,
            group=group("Trajectory", "--until 500"),
        ),
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
    "bifurcation": _start("Angle where both sweeps start, rad."),
    "continue": _start("Angle of the orbit followed, rad."),
    "tongues": (
        option(
            "--omega omegas",
            types.VALUES,
            "Frequencies Omega/w0 of the drive.  [default: 0.5:3:200]",
            group=group("Frequencies", "--omega 0.5:3:200"),
        ),
    ),
}
"""Options by command that its signature does not have."""
_MODEL: Final[dict[str, Decorator]] = {
    **dict.fromkeys(("sweep", "map", "bifurcation"), varied_model_options),
    "continue": functools.partial(varied_model_options, ends=True),
    "tongues": functools.partial(model_options, left_out=("omega", "frequency_hz")),
}
"""Options of the model, where they are not those of other commands."""


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
        reads = [given["model"]]
        pendulum = model_from(given)
        outputs = Outputs.take(given, name, reads, going_on=options.get("resume", False))
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
    parts: list[Decorator] = [_MODEL.get(name, model_options), *_FURTHER.get(name, ())]
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
        given["omega"] = given.pop("omegas")
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
