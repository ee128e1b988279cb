"""Options that several commands share."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.types import (
    AXIS,
    INSTRUCTION_SET,
    NUMBER,
    PART,
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
    kind: click.ParamType[Any] | type[int],
    text: str,
    default: float | None = None,
    **more: Any,  # noqa: ANN401 (of click)
) -> Decorator:
    """Return an option from its names, type and help, to which the default is appended.

    Names are separated by spaces; the parameter's name is the last if it differs.
    """
    if default is not None:
        text += f"  [default: {default:g}]".replace("e-0", "e-")
    return click.option(*names.split(), type=kind, default=default, help=text, **more)


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
)
tol_option = option("--tol", NUMBER, "Error after 5 periods.", 1e-6)
threads_option = option("--threads", whole(1, MOST_THREADS), "Threads.  [default: one a processor]")
quiet_option = click.option("--quiet", is_flag=True, help="No progress, no summary.")
draws_option = option(
    "--draws",
    whole(2, MOST_DRAWS),
    "Number of models drawn from the [covariance] of --model: uncertainty of the result.",
)
rate_option = option(
    "--rate rate_hz",
    NUMBER,
    "Readings a second, for files without a column of times.",
    metavar="HZ",
)
plot_option = option("--plot", output_file(*PICTURES), "Figure: .png .svg .pdf.")
rerun_option = option("--rerun", output_file(".rrd"), "Rerun recording: .rrd.")
view_option = click.option(
    "--view", is_flag=True, help="Write the recording and open the viewer on it."
)


def json_option(further: str = "") -> Decorator:
    """Return the option --json, whose help ends with ``further``."""
    text = "One JSON object on stdout"
    return click.option("--json", "as_json", is_flag=True, help=f"{text}{further}.")


def seed_option(what: str) -> Decorator:
    """Return the option --seed with the help ``what``."""
    return option("--seed", whole(0, MOST_SEED), what, 0)


def max_periods_option(what: str) -> Decorator:
    """Return the option --max-periods with the help ``what``."""
    return option("--max-periods", whole(1, MOST_PERIODS), what)


def added(*options: Decorator) -> Decorator:
    """Return a decorator that adds several options, in the order of --help."""

    def add(function: Command) -> Command:
        for option in reversed(options):
            function = option(function)
        return function

    return add


progress_options = added(threads_option, simd_option, quiet_option)
reading_options = added(rate_option, simd_option, quiet_option)
start_options = added(
    option("--theta", NUMBER, "Angle at the start, rad.", 1.0),
    option("--velocity", NUMBER, "Velocity at the start, in SI rad/s.", 0.0),
)


def window_options(cells: int) -> Decorator:
    """Return the options of a window with this many cells on each side by default."""
    return added(
        option("--theta", AXIS, f"Initial angles, rad.  [default: -pi:pi:{cells}]"),
        option(
            "--velocity",
            AXIS,
            f"Initial velocities, in SI rad/s.  [default: -3:3:{cells}, in SI times w0]",
        ),
        option("--grid", whole(1, MOST_CELLS), "Cells on each side of the window."),
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
    option("--starts", whole(1, MOST_CELLS), "Starts each.", 9),
    tol_option,
    max_periods_option("Bound after which a start is watched.  [default: depends on damping]"),
    seed_option("Shifts the starts, and draws the models of --draws."),
)
"""Options of a search for attractors at each of many parameters."""


drawing_options = added(plot_option, rerun_option, view_option, json_option("; alone, no files"))
store_options = added(
    click.option("--resume", is_flag=True, help="Go on with the unfinished run in --out F.zarr."),
    click.option(
        "--dry-run", is_flag=True, help="Only tell time, memory and disk, from timed samples."
    ),
    option(
        "--part",
        PART,
        "Compute part K of N of the tiles of --out F.zarr; pendmap merge completes it.",
        metavar="K/N",
    ),
    click.option(
        "--mix", is_flag=True, help="Go on with a store begun where numbers are rounded otherwise."
    ),
)
"""Options of analyses that are kept in a store."""
worker_options = added(
    option("--workers count", whole(1, MOST_WORKERS), "Processes of this machine that compute."),
    option("--scheduler", TEXT, "Dask scheduler whose workers compute, like tcp://host:8786."),
)
"""Options of who computes the tiles of a result."""


def output_options(
    suffixes: tuple[str, ...] = RESULTS, what: str = "Result", *, stored: bool = False
) -> Decorator:
    """Return --out with these suffixes, --plot, --rerun, --view and --json.

    What is ``stored`` may be at an address, and is kept tile by tile in a .zarr.
    """
    kinds = " or ".join(suffixes)
    if stored:
        text = (
            f"{what}: {kinds}, a path or an address like s3://; .zarr keeps tiles as they are done."
        )
        return added(option("--out", output_or_address(*suffixes), text), drawing_options)
    out = option("--out", output_file(*suffixes), f"{what}: {kinds}.")
    return added(out, drawing_options)
