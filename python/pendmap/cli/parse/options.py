"""Options that several commands share."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import click
import cloup

from pendmap.cli.parse.groups import (
    ACCURACY,
    LONG,
    MACHINE,
    OUTPUT,
    RANDOM,
    RECORD,
    START,
    STARTS,
    WORKERS,
)
from pendmap.cli.parse.types import (
    AXIS,
    INSTRUCTION_SET,
    NUMBER,
    PICTURES,
    TEXT,
    output_file,
    output_or_address,
    whole,
)
from pendmap.errors import (
    MOST_CELLS,
    MOST_DRAWS,
    MOST_PERIODS,
    MOST_SEED,
    MOST_THREADS,
    MOST_WORKERS,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from pendmap.analysis.grid import Grid

    Command = Callable[..., Any]
    Decorator = Callable[[Command], Command]

_SIMD = "PENDMAP_SIMD"
"""Environment variable of the instruction set, which every call of the core reads."""


RESULTS = (".nc", ".zarr")  # Suffixes of files that a dataset is written to


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


def flag(names: str, text: str, *, group: cloup.OptionGroup) -> Decorator:
    """Return an option without a value."""
    return cloup.option(*names.split(), is_flag=True, help=text, group=group)


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
    INSTRUCTION_SET,
    "Instruction set: avx512, avx2, sse, neon or portable.  [default: the quickest here]",
    callback=_use_simd,
    expose_value=False,
    group=MACHINE,
)
tol_option = option("--tol", NUMBER, "Error after 5 periods.", 1e-6, group=ACCURACY)
threads_option = option(
    "--threads", whole(1, MOST_THREADS), "Threads.  [default: one a processor]", group=MACHINE
)
rate_option = option(
    "--rate rate_hz",
    NUMBER,
    "Readings a second, for files without a column of times.",
    metavar="HZ",
    group=RECORD,
)


def overwrite_option(group: cloup.OptionGroup) -> Decorator:
    """Return the option --overwrite."""
    text = (
        "Replace files that exist. Without it a default name gets a number, and a name that is"
        " given is refused."
    )
    return flag("--overwrite", text, group=group)


def draws_option(group: cloup.OptionGroup) -> Decorator:
    """Return the option --draws."""
    text = "Number of models drawn from the [covariance] of --model: uncertainty of the result."
    return option("--draws", whole(2, MOST_DRAWS), text, group=group)


def verbose_option(what: str, group: cloup.OptionGroup) -> Decorator:
    """Return the option --verbose with the help ``what``."""
    return flag("--verbose", what, group=group)


def printed_options(group: cloup.OptionGroup, further: str = "") -> Decorator:
    """Return --json, whose help ends with ``further``, and --quiet."""
    text = f"One JSON object on stdout{further}."
    return added(
        flag("--json as_json", text, group=group),
        flag("--quiet", "No progress, no summary.", group=group),
    )


def seed_option(what: str) -> Decorator:
    """Return the option --seed with the help ``what``."""
    return option("--seed", whole(0, MOST_SEED), what, 0, group=RANDOM)


def max_periods_option(what: str) -> Decorator:
    """Return the option --max-periods with the help ``what``."""
    return option("--max-periods", whole(1, MOST_PERIODS), what, group=ACCURACY)


def added(*options: Decorator) -> Decorator:
    """Return a decorator that adds several options, in the order of --help."""

    def add(function: Command) -> Command:
        for option in reversed(options):
            function = option(function)
        return function

    return add


machine_options = added(threads_option, simd_option)
reading_options = added(rate_option, simd_option)
start_options = added(
    option("--theta", NUMBER, "Angle at the start, rad.", 1.0, group=START),
    option("--velocity", NUMBER, "Velocity at the start, in SI rad/s.", 0.0, group=START),
)


def window_options(cells: int) -> Decorator:
    """Return the options of a window with this many cells on each side by default."""
    return added(
        option("--theta", AXIS, f"Initial angles, rad.  [default: -pi:pi:{cells}]", group=STARTS),
        option(
            "--velocity",
            AXIS,
            f"Initial velocities, in SI rad/s.  [default: -3:3:{cells}, in SI times w0]",
            group=STARTS,
        ),
        option("--grid", whole(1, MOST_CELLS), "Cells on each side of the window.", group=STARTS),
    )


def take_window(given: dict[str, Any], cells: int, w0: float) -> Grid:
    """Remove the options of a window from ``given``; return their grid."""
    from pendmap.analysis.grid import Grid

    theta, velocity, count = (given.pop(name) for name in ("theta", "velocity", "grid"))
    if count is not None and (theta is not None or velocity is not None):
        raise click.UsageError(
            "--grid must be given alone; --theta and --velocity name their own cells"
        )
    usual = Grid.of(count, cells, w0)
    return Grid(theta or usual.theta, velocity or usual.velocity)


search_options = added(
    option("--starts", whole(1, MOST_CELLS), "Starts each.", 9, group=ACCURACY),
    tol_option,
    max_periods_option("Bound after which a start is watched.  [default: depends on damping]"),
    seed_option("Shifts the starts, and draws the models of --draws."),
)
"""Options of a search for attractors at each of many parameters."""


store_options = added(
    flag("--resume", "Go on with the unfinished run in --out F.zarr.", group=LONG),
)
"""Options of analyses that are kept in a store."""
worker_options = added(
    option(
        "--workers count",
        whole(1, MOST_WORKERS),
        "Processes of this machine that compute.",
        group=WORKERS,
    ),
    option(
        "--scheduler",
        TEXT,
        "Dask scheduler whose workers compute, like tcp://host:8786.",
        group=WORKERS,
    ),
)
"""Options of who computes the tiles of a result."""


def output_options(
    suffixes: tuple[str, ...] = RESULTS,
    *,
    recording: bool = True,
    stored: bool = False,
    json: str = "; alone, no files",
) -> Decorator:
    """Return --out, --plot, --rerun, --view, --overwrite, --json and --quiet.

    Suffixes are those of the files of data or text beside figures and recordings. What is
    ``stored`` may be at an address, and is kept tile by tile in a .zarr.
    """
    shown = ".rrd" if recording else ""
    kinds = [*suffixes, *PICTURES, *([shown] if shown else [])]
    text = f"File to write, as its suffix says: {' '.join(kinds)}; may be repeated."
    if stored:
        text += " A .zarr, also at an address like s3://, keeps tiles as they are done."
    kind = output_or_address(*kinds) if stored else output_file(*kinds)
    options = [option("--out", kind, text, multiple=True, group=OUTPUT)]
    figure = "Figure: .png .svg .pdf."
    options.append(option("--plot", output_file(*PICTURES), figure, group=OUTPUT))
    if recording:
        text = "Rerun recording: .rrd."
        options.append(option("--rerun", output_file(".rrd"), text, group=OUTPUT))
        text = "Write the recording and open the viewer on it."
        options.append(flag("--view", text, group=OUTPUT))
    return added(*options, overwrite_option(OUTPUT), printed_options(OUTPUT, json))
