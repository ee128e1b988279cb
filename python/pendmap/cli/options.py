"""Options that several commands share."""

from __future__ import annotations

import dataclasses
import os
import sys
from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.types import (
    NUMBER,
    PICTURES,
    InstructionSet,
    OutputFile,
    Whole,
    default_file,
)
from pendmap.errors import MOST_CELLS, MOST_DRAWS, MOST_PERIODS, MOST_SEED, MOST_THREADS
from pendmap.files import check_room

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from pathlib import Path

    Command = Callable[..., Any]
    Decorator = Callable[[Command], Command]

_SIMD = "PENDMAP_SIMD"
"""Environment variable of the instruction set, which every call of the core reads."""


RESULTS = (".nc", ".zarr")
"""Suffixes of files that a dataset is written to."""


def simd_option(function: Command) -> Command:
    """Add the instruction set, which applies until the command has ended."""

    def use(ctx: click.Context, _: click.Parameter, value: str | None) -> None:
        if value is None:
            return
        before = os.environ.get(_SIMD)
        os.environ[_SIMD] = value
        if before is None:
            ctx.call_on_close(lambda: os.environ.pop(_SIMD))
        else:
            ctx.call_on_close(lambda: os.environ.update({_SIMD: before}))

    add = click.option(
        "--simd",
        type=InstructionSet(),
        callback=use,
        expose_value=False,
        help="Instruction set: avx512, avx2, sse or portable.  [default: the quickest here]",
    )
    return add(function)


tol_option = click.option(
    "--tol", type=NUMBER, default=1e-6, help="Error after 5 periods.  [default: 1e-6]"
)
threads_option = click.option(
    "--threads", type=Whole(1, MOST_THREADS), help="Threads.  [default: one a processor]"
)
quiet_option = click.option("--quiet", is_flag=True, help="No progress, no summary.")
draws_option = click.option(
    "--draws",
    type=Whole(2, MOST_DRAWS),
    help="Draw so many models from the [covariance] of --model: the doubt of the result.",
)
rate_option = click.option(
    "--rate",
    "rate_hz",
    type=NUMBER,
    metavar="HZ",
    help="Readings a second, for files without a column of times.",
)
plot_option = click.option("--plot", type=OutputFile(PICTURES), help="Figure: .png .svg .pdf.")
rerun_option = click.option("--rerun", type=OutputFile([".rrd"]), help="Rerun recording: .rrd.")
view_option = click.option(
    "--view", is_flag=True, help="Write the recording and open the viewer on it."
)


def json_option(further: str = "") -> Decorator:
    """Return the option of the JSON object; alone it writes no files, which ``further`` says."""
    text = "One JSON object on stdout"
    return click.option("--json", "as_json", is_flag=True, help=f"{text}{further}.")


def seed_option(what: str) -> Decorator:
    """Return the option of a seed that does ``what``."""
    return click.option("--seed", type=Whole(0, MOST_SEED), default=0, help=f"{what}  [default: 0]")


def max_periods_option(what: str) -> Decorator:
    """Return the option of the bound on periods that does ``what``."""
    return click.option("--max-periods", type=Whole(1, MOST_PERIODS), help=what)


def added(*options: Decorator) -> Decorator:
    """Return what adds several options, in the order of --help."""

    def add(function: Command) -> Command:
        for option in reversed(options):
            function = option(function)
        return function

    return add


progress_options = added(threads_option, simd_option, quiet_option)
start_options = added(
    click.option(
        "--theta", type=NUMBER, default=1.0, help="Angle at the start, rad.  [default: 1]"
    ),
    click.option(
        "--velocity",
        type=NUMBER,
        default=0.0,
        help="Velocity at the start, in SI rad/s.  [default: 0]",
    ),
)
search_options = added(
    click.option(
        "--starts", type=Whole(1, MOST_CELLS), default=9, help="Starts each.  [default: 9]"
    ),
    tol_option,
    max_periods_option("Bound after which a start is watched.  [default: as damping asks]"),
    seed_option("Shifts the starts, and draws the models of --draws."),
)
"""Options of a search for attractors at each of many parameters."""


def output_options(suffixes: tuple[str, ...] = RESULTS, what: str = "Result") -> Decorator:
    """Return --out with these suffixes, --plot, --rerun, --view and --json."""
    kinds = " or ".join(suffixes)
    out = click.option("--out", type=OutputFile(suffixes), help=f"{what}: {kinds}.")
    return added(out, plot_option, rerun_option, view_option, json_option("; alone, no files"))


def check_view() -> None:
    """Refuse --view before anything is computed where no window can open."""
    from pendmap import viewer

    try:
        viewer.check_display()
    except viewer.ViewerError as error:
        raise click.UsageError(f"--view: {error}") from error


@dataclasses.dataclass(frozen=True)
class Outputs:
    """Outputs that a command writes."""

    out: Path | None
    plot: Path | None
    rerun: Path | None
    view: bool
    as_json: bool
    quiet: bool

    @classmethod
    def take(
        cls,
        given: dict[str, Any],
        name: str,
        suffix: str = RESULTS[0],
        reads: Iterable[Path | None] = (),
    ) -> Outputs:
        """Take the output options out of ``given``; without any, three files ``name.*``."""
        fields = {field.name: given.pop(field.name) for field in dataclasses.fields(cls)}
        outputs = cls(**fields)
        asked = (outputs.out, outputs.plot, outputs.rerun, outputs.view, outputs.as_json)
        if not any(asked):
            outputs = dataclasses.replace(
                outputs,
                out=default_file(f"{name}{suffix}"),
                plot=default_file(f"{name}.png"),
                rerun=default_file(f"{name}.rrd"),
            )
        if outputs.view and outputs.rerun is None:
            outputs = dataclasses.replace(outputs, rerun=default_file(f"{name}.rrd"))
        places = {"--out": outputs.out, "--plot": outputs.plot, "--rerun": outputs.rerun}
        keep_inputs(reads, {option: [path] for option, path in places.items()})
        if outputs.view:
            check_view()
        return outputs

    def check_room(self, cells: int) -> None:
        """Refuse a map for which the disk has no space: half a byte a cell at least, compressed."""
        for path in (self.out, self.rerun):
            if path is not None:
                check_room(path, cells // 2)

    @property
    def draws(self) -> bool:
        """Whether a file, a figure or a recording is written."""
        return bool(self.out or self.plot or self.rerun or self.view)

    @property
    def shows_progress(self) -> bool:
        """Whether stderr is a terminal and --quiet is not given."""
        return sys.stderr.isatty() and not self.quiet


def keep_inputs(
    inputs: Iterable[Path | None], outputs: Mapping[str, Iterable[Path | None]]
) -> None:
    """Refuse outputs, by their option, that are inputs, or folders that hold one."""

    def lost(path: Path, output: Path) -> bool:
        places = [path, *path.resolve().parents] if output.is_dir() else [path]
        return any(output.samefile(place) for place in places)

    read = [path for path in inputs if path is not None and path.exists()]
    for option, paths in outputs.items():
        for output in paths:
            if output is not None and output.exists() and any(lost(path, output) for path in read):
                raise click.UsageError(
                    f"Invalid value for '{option}': {str(output)!r}: is an input, which would be "
                    "lost: it must be another file"
                )
