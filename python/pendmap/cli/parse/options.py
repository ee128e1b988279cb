"""Options and arguments of commands, the groups in which ``--help`` shows them, and commands."""

from __future__ import annotations

import copy
import dataclasses
import os
from typing import TYPE_CHECKING, Any, Final

import click
import cloup

from pendmap.cli.parse import types
from pendmap.cli.parse.types import PICTURES
from pendmap.errors import MOST_CELLS, check_whole
from pendmap.formatting import WIDTH

if TYPE_CHECKING:
    from collections.abc import Callable

    from pendmap.analysis.grid import Grid

    Function = Callable[..., Any]
    Decorator = Callable[[Function], Function]

_SIMD = "PENDMAP_SIMD"
"""Environment variable of the instruction set, which every call of the core reads."""
RESULTS = (".nc", ".zarr")  # Suffixes of files that a dataset is written to


def group(title: str, example: str) -> cloup.OptionGroup:
    """Return a group of options with an example of their use."""
    return cloup.OptionGroup(title, help=f"Example: {example}")


MODEL: Final = group("Model", "--p 1.7 --theta-r 0.05")
SI: Final = group("Model in SI", "--model rig.toml --tr 0.08")
STARTS: Final = group("Starts", "--theta=-pi:pi:400 --velocity=-3:3:200")
START: Final = group("Start", "--theta 2.5 --velocity 0")
ACCURACY: Final = group("Accuracy", "--tol 1e-8")
RANDOM: Final = group("Random numbers", "--seed 1")
LONG: Final = group("Long runs", "--out map.zarr --resume")
MACHINE: Final = group("Machine", "--simd portable")
OUTPUT: Final = group("Output", "--json > result.json")
RECORD: Final = group("Records", "--time 1 --angle theta --angle-unit deg --from 5.6")


def option(
    names: str,
    kind: Any,  # noqa: ANN401 (of click)
    text: str,
    default: Any = None,  # noqa: ANN401 (of click)
    *,
    group: cloup.OptionGroup,
    **more: Any,  # noqa: ANN401 (of click)
) -> Decorator:
    """Return an option from its names, type and help, to which the default is appended.

    Names are separated by spaces; the parameter's name is the last if it differs.
    """
    if default is not None:
        shown = f"{default:g}" if isinstance(default, float | int) else str(default)
        text += f"  [default: {shown}]".replace("e-0", "e-")
    return cloup.option(*names.split(), type=kind, default=default, help=text, group=group, **more)


def flag(names: str, text: str, *, group: cloup.OptionGroup, default: bool = False) -> Decorator:
    """Return an option without a value, which turns the default."""
    more: dict[str, Any] = {"flag_value": not default, "default": default, "help": text}
    return cloup.option(*names.split(), is_flag=True, group=group, **more)


def added(*options: Decorator) -> Decorator:
    """Return a decorator that adds several options, in the order of --help."""

    def add(function: Function) -> Function:
        for option in reversed(options):
            function = option(function)
        return function

    return add


def _use_simd(ctx: click.Context, _: click.Parameter, value: str | None) -> None:
    """Use an instruction set until the command ends."""
    if value is None:
        return
    before = os.environ.get(_SIMD)
    os.environ[_SIMD] = value
    if before is None:
        ctx.call_on_close(lambda: os.environ.pop(_SIMD))
    else:
        ctx.call_on_close(lambda: os.environ.update({_SIMD: before}))


simd_option = option(
    "--simd",
    types.INSTRUCTION_SET,
    "Instruction set: avx512, avx2, sse, neon or portable.  [default: the quickest here]",
    callback=_use_simd,
    expose_value=False,
    group=MACHINE,
)


overwrite_option = flag(
    "--overwrite",
    "Replace files that exist. Without it a default name gets a number, and a name that is given is"
    " refused.",
    group=OUTPUT,
)


def printed_options(further: str = "") -> Decorator:
    """Return --json, whose help ends with ``further``, and --quiet."""
    return added(
        flag("--json as_json", f"One JSON object on stdout{further}.", group=OUTPUT),
        flag("--quiet", "No progress, no summary.", group=OUTPUT),
    )


def window_options(theta: str, velocity: str) -> Decorator:
    """Return the options of a window, with the default of each axis."""
    text = "Velocities of the starts, in SI rad/s."
    return added(
        option(
            "--theta", types.AXIS, f"Angles of the starts, rad.  [default: {theta}]", group=STARTS
        ),
        option("--velocity", types.AXIS, f"{text}  [default: {velocity}]", group=STARTS),
        option("--grid", types.INTEGER, "Cells on each side of the default window.", group=STARTS),
    )


def take_window(given: dict[str, Any], usual: Grid) -> Grid:
    """Remove the options of a window from ``given``; return their grid, else the usual one."""
    theta, velocity, count = (given.pop(name) for name in ("theta", "velocity", "grid"))
    if count is not None and (theta is not None or velocity is not None):
        raise click.UsageError(
            "--grid must be given alone; --theta and --velocity name their own cells"
        )
    if count is not None:
        check_whole("grid", count, 1, MOST_CELLS)
        theta, velocity = (
            dataclasses.replace(axis, count=count) for axis in (usual.theta, usual.velocity)
        )
    return type(usual)(theta or usual.theta, velocity or usual.velocity)


resume_option = flag("--resume", "Go on with the unfinished run in --out F.zarr.", group=LONG)


def output_options(
    suffixes: tuple[str, ...] = RESULTS,
    *,
    recording: bool = True,
    stored: bool = False,
    json: str = "; alone, no files",
) -> Decorator:
    """Return --out, --plot, --rerun, --view, --overwrite, --json and --quiet.

    Suffixes are those of the files of data or text beside figures and recordings. What is
    ``stored`` is kept tile by tile in a .zarr.
    """
    kinds = [*suffixes, *PICTURES, *([".rrd"] if recording else [])]
    text = f"File to write, as its suffix says: {' '.join(kinds)}; may be repeated."
    if stored:
        text += " A .zarr keeps tiles as they are done."
    viewed = (
        option("--rerun", types.output_file(".rrd"), "Rerun recording: .rrd.", group=OUTPUT),
        flag("--view", "Write the recording and open the viewer on it.", group=OUTPUT),
    )
    return added(
        option("--out", types.output_file(*kinds), text, multiple=True, group=OUTPUT),
        option("--plot", types.output_file(*PICTURES), "Figure: .png .svg .pdf.", group=OUTPUT),
        *(viewed if recording else ()),
        overwrite_option,
        printed_options(json),
    )


def argument(
    name: str,
    metavar: str,
    kind: click.ParamType[Any] | type = types.FILE,
    **more: Any,  # noqa: ANN401 (of click)
) -> Decorator:
    """Return an argument, a file by default."""
    return click.argument(name, metavar=metavar, type=kind, **more)


class Command(cloup.Command):
    """Command whose options stand in groups."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:  # noqa: ANN401 (of click)
        super().__init__(*args, **kwargs)
        # A group is shared by commands, its options are not.
        self.option_groups = [copy.copy(group) for group in self.option_groups]


def new_command(
    name: str, *examples: str, text: str | None = None
) -> Callable[[Function], Command]:
    """Return a decorator that makes a command; ``text`` is its help, by default the docstring."""
    settings = cloup.Context.settings(
        formatter_settings=cloup.HelpFormatter.settings(max_width=WIDTH, col1_max_width=28)
    )
    epilog = "\n".join(["\b", "Examples:", *(f"  {line}" for line in examples)])
    return cloup.command(name, cls=Command, context_settings=settings, help=text, epilog=epilog)
