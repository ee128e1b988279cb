"""``pendmap diagnose``: which effect the model lacks."""

from __future__ import annotations

import functools
import json
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pendmap.cli.show import plain, progress_bar, write_all, write_table
from pendmap.cli.types import OutputFile, Whole

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pendmap.discrepancy import Discrepancy
    from pendmap.model import Rig

__all__ = ["command"]

NAME = "diagnose.toml"


@click.command("diagnose")
@click.argument("path", type=click.Path(path_type=Path), metavar="EXPERIMENT")
@click.option(
    "--model",
    "model_path",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Model to begin with, in SI: .toml.  [default: viscous damping and Coulomb friction]",
)
@click.option(
    "--max-effects", type=Whole(0, 6), default=3, help="Effects added at most.  [default: 3]"
)
@click.option(
    "--without", multiple=True, metavar="NAME", help="Leave this effect out; may be repeated."
)
@click.option(
    "--effects",
    "effects_path",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Candidates of your own beside the library's: [[formula]] of a .toml.",
)
@click.option("--out", type=OutputFile([".toml"]), help=f"New model: .toml.  [default: {NAME}]")
@click.option("--plot", type=OutputFile([".png", ".svg", ".pdf"]), help="Figure: .png .svg .pdf.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
@click.option("--quiet", is_flag=True, help="No progress, no summary.")
def command(  # noqa: PLR0913 (an option each)
    *,
    path: Path,
    model_path: Path | None,
    max_effects: int,
    without: tuple[str, ...],
    effects_path: Path | None,
    out: Path | None,
    plot: Path | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Find where a model and an experiment disagree, and which effect is missing.

    EXPERIMENT is a file with times and angles, or a folder with an experiment.toml. Every effect of
    the library is scored; the verdict is none, named, partial, ambiguous or unknown. The model with
    the effects found is written to diagnose.toml, for --model of every other command; where no
    output is named, a figure to diagnose.png too.
    """
    # The matrices are tall and narrow: threads for them cost more than they bring.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from pendmap.discrepancy import diagnose
    from pendmap.model import load_formulas
    from pendmap.model.effects import definition
    from pendmap.records import read_experiment

    own = [] if effects_path is None else load_formulas(effects_path)
    for name in without:
        if name not in {formula.name for formula in own}:
            definition(name)
    if out is None and plot is None and not as_json:
        plot = OutputFile([".png"]).convert(f"{Path(NAME).stem}.png", None, None)
    out = out or OutputFile([".toml"]).convert(NAME, None, None)
    model = None if model_path is None else _si(model_path)
    experiment = read_experiment(path)
    shown = sys.stderr.isatty() and not quiet
    with progress_bar("diagnose", shown=shown) as progress:
        found = diagnose(
            experiment,
            model=model,
            max_effects=max_effects,
            without=without,
            effects=own,
            progress=progress,
        )
    written = write_all(_files(found, out, plot, "pendmap " + shlex.join(sys.argv[1:])))
    if as_json:
        from pendmap.discrepancy.summary import as_json as fields

        click.echo(json.dumps(plain(fields(found) | {"model": written[0]}), allow_nan=False))
    elif not quiet:
        _say(found)
        click.echo("Written: " + ", ".join(written))


def _si(path: Path) -> Rig:
    from pendmap.model import Rig

    return Rig.from_toml(path)


def _files(
    found: Discrepancy, out: Path, plot: Path | None, line: str
) -> Iterator[tuple[Callable[[Path], Path], Path]]:
    from pendmap.discrepancy import diagnosed_model
    from pendmap.model import save_model

    yield functools.partial(save_model, diagnosed_model(found, line)), out
    if plot is not None:
        from pendmap import figures

        yield functools.partial(figures.draw_discrepancy, found), plot


def _say(found: Discrepancy) -> None:
    from pendmap.discrepancy.summary import as_text, ranking_table

    for line in as_text(found):
        click.echo(line)
    click.echo()
    write_table(*ranking_table(found))
