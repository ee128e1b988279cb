"""``pendmap paper``: the paper's figures, by number."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pendmap.cli.parse import options
from pendmap.cli.parse.options import OUTPUT, argument, option
from pendmap.cli.parse.signature import options_of
from pendmap.cli.parse.types import FOLDER, PICTURES, default_file, output_file
from pendmap.cli.show import File, free_name, keep_files, say, table, write_all, write_json

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@options.new_command(
    "paper", "pendmap paper 2", "pendmap paper table1", "pendmap paper all --out figures"
)
@argument("figure", "FIGURE", str, nargs=-1, required=True)
@options_of("paper.figures.draw", "seed")
@options.simd_option
@option(
    "--out",
    FOLDER,
    "Folder for the files, made if it is not there.  [default: the current one]",
    group=OUTPUT,
)
@option(
    "--plot",
    output_file(*PICTURES),
    "File of one figure: .png .svg .pdf; for table1 a picture and a .csv.",
    group=OUTPUT,
)
@options.overwrite_option
@options.printed_options()
def command(  # noqa: PLR0913 (an option each)
    *,
    figure: tuple[str, ...],
    out: Path | None,
    plot: Path | None,
    seed: int,
    overwrite: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Draw a figure of Horton, Wiercigroch & Xu (2008): 1 to 9, table1, or all of these.

    1 shows critical curves and the strange attractors, 2 tumbling chaos at these points, 3 the
    pendulum, its symbols and its equation. The others are made on a virtual rig like the paper's:
    4 a decay with its half cycles, 5 the decrements, 6 the decay by each model, 7 and table1 the
    errors of each, 8 steady states after 2500 s (it takes some minutes), 9 transient tumbling.
    Writes figure_1.png to figure_9.png and table_1.csv, as requested.
    """
    from pendmap.paper import figures

    keys = figures.wanted(" ".join(figure))
    if plot is not None and out is not None:
        raise click.UsageError("one of --plot and --out must be left out, got both")
    if plot is not None and len(keys) > 1:
        raise click.UsageError("--plot must have one figure, it is one file; --out takes a folder")
    if out is not None:
        out.mkdir(exist_ok=True)  # the parent folder must exist, as for every other file
    if plot is not None and not overwrite:
        keep_files([File("plot", plot, "--plot")])
    places = {key: plot or _place(key, out or Path(), overwrite=overwrite) for key in keys}
    written = write_all(_files(places, seed))
    if as_json:
        write_json({"files": written})
    elif not quiet:
        if any(Path(name).suffix == ".csv" for name in written):
            from pendmap.identification.report import methods_table, table1_table

            report = figures.report(seed)
            for rows in (methods_table(report), table1_table(report), figures.printed_table()):
                say(table(*rows))
        written.say()
    written.check()


def _place(key: str, folder: Path, *, overwrite: bool) -> Path:
    """Return the file of a figure; refuse one that cannot be written, before any is computed."""
    name, end = (f"figure_{key}", ".png") if key.isdigit() else ("table_1", ".csv")
    free, _ = free_name(str(folder / name), [end], overwrite=overwrite)
    return default_file(free + end)


def _files(places: dict[str, Path], seed: int) -> Iterator[tuple[Callable[[Path], Path], Path]]:
    """Yield writer and path of each figure; a picture of the table has a .csv beside it."""
    from pendmap.paper import figures

    for key, path in places.items():
        if path.suffix != ".csv":
            yield functools.partial(figures.draw, key, seed=seed), path
        if key == figures.TABLE:
            csv = path.with_suffix(".csv")
            yield lambda to: figures.write_table(figures.report(seed), to), csv
