"""Options that mean the same everywhere."""

from __future__ import annotations

import dataclasses
import os
import sys
from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.inputs import keep_inputs
from pendmap.cli.types import NUMBER, InstructionSet, OutputFile, Whole
from pendmap.errors import MOST_CELLS, MOST_DRAWS, MOST_PERIODS, MOST_SEED, MOST_THREADS
from pendmap.files import check_room

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    Command = Callable[..., Any]
    Decorator = Callable[[Command], Command]

_SIMD = "PENDMAP_SIMD"
"""Names the instruction set; the core reads it whenever a call begins."""


def simd_option(function: Command) -> Command:
    """Add the instruction set, which holds until the command has ended."""

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


def progress_options(function: Command) -> Command:
    """Add threads, instruction set and quiet."""
    threads = click.option(
        "--threads", type=Whole(1, MOST_THREADS), help="Threads.  [default: one a processor]"
    )
    quiet = click.option("--quiet", is_flag=True, help="No progress, no summary.")
    return threads(simd_option(quiet(function)))


def rate_option(function: Command) -> Command:
    """Add the rate of records without a column of times."""
    add = click.option(
        "--rate",
        "rate_hz",
        type=NUMBER,
        metavar="HZ",
        help="Readings a second, for files without a column of times.",
    )
    return add(function)


def draws_option(function: Command) -> Command:
    """Add the number of models that are drawn from what the fit knows of its parameters."""
    option = click.option(
        "--draws",
        type=Whole(2, MOST_DRAWS),
        help="Draw so many models from the [covariance] of --model: the doubt of the result.",
    )
    return option(function)


def seed_option(what: str) -> Decorator:
    """Return what adds a seed that does ``what``."""
    return click.option("--seed", type=Whole(0, MOST_SEED), default=0, help=f"{what}  [default: 0]")


def search_options(function: Command) -> Command:
    """Add what the search for attractors at each of many parameters takes."""
    for option in (
        seed_option("Shifts the starts, and draws the models of --draws."),
        click.option(
            "--max-periods",
            type=Whole(1, MOST_PERIODS),
            help="Bound after which a start is watched.  [default: as damping asks]",
        ),
        click.option(
            "--tol", type=NUMBER, default=1e-6, help="Error after 5 periods.  [default: 1e-6]"
        ),
        click.option(
            "--starts", type=Whole(1, MOST_CELLS), default=9, help="Starts each.  [default: 9]"
        ),
    ):
        function = option(function)
    return function


RESULTS = (".nc", ".zarr")
"""The kinds of file that a dataset is written to."""


def output_options(suffixes: tuple[str, ...] = RESULTS, what: str = "Result") -> Decorator:
    """Add --json, --out with these suffixes, --plot, --rerun and --view."""
    kinds = " or ".join(suffixes)
    pictures = OutputFile([".png", ".svg", ".pdf"])

    def add(function: Command) -> Command:
        for option in (
            click.option(
                "--json",
                "as_json",
                is_flag=True,
                help="One JSON object on stdout; alone, no files.",
            ),
            click.option(
                "--view", is_flag=True, help="Write the recording and open the viewer on it."
            ),
            click.option("--rerun", type=OutputFile([".rrd"]), help="Rerun recording: .rrd."),
            click.option("--plot", type=pictures, help="Figure: .png .svg .pdf."),
            click.option("--out", type=OutputFile(suffixes), help=f"{what}: {kinds}."),
        ):
            function = option(function)
        return function

    return add


def check_view() -> None:
    """Refuse --view before anything is computed where no window can open."""
    from pendmap import viewer

    try:
        viewer.check_display()
    except viewer.ViewerError as error:
        raise click.UsageError(f"--view: {error}") from error


@dataclasses.dataclass(frozen=True)
class Outputs:
    """What to write, and where."""

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
        """Take the output options out of ``given``; with none, three files ``name.*``.

        None of them may be one that the command ``reads``.
        """
        fields = {field.name: given.pop(field.name) for field in dataclasses.fields(cls)}
        outputs = cls(**fields)
        asked = (outputs.out, outputs.plot, outputs.rerun, outputs.view, outputs.as_json)
        if not any(asked):
            outputs = dataclasses.replace(
                outputs,
                out=OutputFile([suffix]).convert(f"{name}{suffix}", None, None),
                plot=OutputFile([".png"]).convert(f"{name}.png", None, None),
                rerun=OutputFile([".rrd"]).convert(f"{name}.rrd", None, None),
            )
        if outputs.view and outputs.rerun is None:
            rrd = OutputFile([".rrd"]).convert(f"{name}.rrd", None, None)
            outputs = dataclasses.replace(outputs, rerun=rrd)
        places = {"--out": outputs.out, "--plot": outputs.plot, "--rerun": outputs.rerun}
        keep_inputs(reads, {option: [path] for option, path in places.items()})
        if outputs.view:
            check_view()
        return outputs

    def check_room(self, cells: int) -> None:
        """Refuse a map before it is computed where the disk has no space for its cells.

        No map compresses to less than half a byte a cell; the smoothest ones take 0.7.
        """
        for path in (self.out, self.rerun):
            if path is not None:
                check_room(path, cells // 2)

    @property
    def draws(self) -> bool:
        """Whether anything is drawn, or kept to be drawn from."""
        return bool(self.out or self.plot or self.rerun or self.view)

    @property
    def shows_progress(self) -> bool:
        """Whether stderr is a terminal and nobody asked for silence."""
        return sys.stderr.isatty() and not self.quiet
