"""``pendmap paper``: the paper's figures, by number."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pendmap.cli.options import json_option, option, seed_option, simd_option
from pendmap.cli.show import table, write_all, write_json
from pendmap.cli.types import PICTURES, default_file, output_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

_LONG = "8"  # Figure that takes 100 s of a processor (AMD EPYC, family 26)


@click.command("paper")
@click.argument("figure", metavar="FIGURE", nargs=-1, required=True)
@option(
    "--out",
    click.Path(path_type=Path, file_okay=False),
    "Folder for the files, made if it is not there.  [default: the current one]",
    metavar="DIR",
)
@option(
    "--plot",
    output_file(*PICTURES),
    "File of one figure: .png .svg .pdf; for table1 a picture and a .csv.",
)
@seed_option("Of the rig's noise.")
@json_option()
@simd_option
@click.option("--quiet", is_flag=True, help="Do not list the files written.")
def command(  # noqa: PLR0913 (an option each)
    *,
    figure: tuple[str, ...],
    out: Path | None,
    plot: Path | None,
    seed: int,
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
    folder = out or Path()
    for key in keys if plot is None else ():  # before anything is computed
        default_file(folder / _name(key))
    if _LONG in keys and not quiet:
        click.echo(f"Figure {_LONG} takes about 2 minutes.", err=True)
    written = write_all(_files(keys, folder, plot, seed))
    if as_json:
        write_json({"files": written})
    elif not quiet:
        if any(Path(name).suffix == ".csv" for name in written):
            from pendmap.identification.report import methods_table, table1_table

            found = figures.report(seed)
            for each in (methods_table(found), table1_table(found), figures.printed_table()):
                click.echo(table(*each))
        written.say()
    written.check()


def _files(
    keys: Sequence[str], out: Path, plot: Path | None, seed: int
) -> Iterator[tuple[Callable[[Path], Path], Path]]:
    from pendmap.paper import figures

    for key in keys:
        path = plot or out / _name(key)
        if path.suffix != ".csv":
            yield functools.partial(figures.draw, key, seed=seed), path
        if key == figures.TABLE:
            csv = path.with_suffix(".csv")
            yield lambda to: figures.write_table(figures.report(seed), to), csv


def _name(key: str) -> str:
    """Return a figure's file, or that of the table."""
    return "table_1.csv" if key.startswith("table") else f"figure_{key}.png"
