"""``pendmap diagnose``: which effect the model lacks."""

from __future__ import annotations

import contextlib
import functools
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pendmap.cli.model_options import rig_from
from pendmap.cli.options import (
    check_view,
    json_option,
    keep_inputs,
    plot_option,
    quiet_option,
    rate_option,
    rerun_option,
    simd_option,
    view_option,
)
from pendmap.cli.show import open_recording, progress_bar, write_all, write_json, write_table
from pendmap.cli.types import OutputFile, ReportFile, Whole, default_file
from pendmap.errors import InputError, instruction_set

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pendmap.diagnosis import Discrepancy


NAME = "diagnose"


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
    "--max-effects",
    type=Whole(0, 6),
    default=3,
    help="Effects added at most, 0 to 6.  [default: 3]",
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
@click.option(
    "--out", type=OutputFile([".toml"]), help=f"New model: .toml.  [default: {NAME}.toml]"
)
@plot_option
@click.option(
    "--report",
    type=ReportFile(),
    metavar="FILE|DIR",
    help="Report: .html with its figures in it, .md with them beside it, or a folder with both.",
)
@rerun_option
@view_option
@json_option("; alone, no file but the model")
@rate_option
@simd_option
@quiet_option
def command(  # noqa: PLR0913 (an option each)
    *,
    path: Path,
    model_path: Path | None,
    max_effects: int,
    without: tuple[str, ...],
    effects_path: Path | None,
    out: Path | None,
    plot: Path | None,
    report: Path | None,
    rerun: Path | None,
    view: bool,
    rate_hz: float | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Find where a model and an experiment disagree, and which effect is missing.

    EXPERIMENT is a file with times and angles, or a folder with an experiment.toml. Every effect of
    the library is scored; the verdict is none, named, partial, ambiguous or unknown. The model with
    the effects found is written to diagnose.toml, for --model of every other command; where no
    output is named, a figure, a report and a recording too: diagnose.png, diagnose.html and
    diagnose.rrd.
    """
    # The matrices are tall and narrow: threads for them cost more than they bring.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from pendmap.diagnosis import diagnose
    from pendmap.diagnosis.candidates import checked_own
    from pendmap.model import load_formulas
    from pendmap.model.effects import definition
    from pendmap.records import files_of, read_experiment

    own = [] if effects_path is None else load_formulas(effects_path)
    with _named(str(effects_path)):
        checked_own(own)
    with _named("--without"):
        named = {formula.name for formula in own}
        for name in without:
            if name not in named:
                definition(name)
    if not (out or plot or report or rerun or view or as_json):
        plot, report, rerun = (default_file(f"{NAME}{end}") for end in (".png", ".html", ".rrd"))
    if view:
        check_view()
        rerun = rerun or default_file(f"{NAME}.rrd")
    outputs = (out or default_file(f"{NAME}.toml"), plot, report, rerun)
    keep_inputs(
        [*files_of(path), model_path, effects_path],
        {
            "--out": [outputs[0]],
            "--plot": [plot],
            "--report": _report_files(report),
            "--rerun": [rerun],
        },
    )
    model = None if model_path is None else rig_from(model_path)
    shown = sys.stderr.isatty() and not quiet
    with progress_bar("read", shown=shown):
        experiment = read_experiment(path, rate_hz=rate_hz)
    with progress_bar("diagnose", shown=shown) as progress:
        found = diagnose(
            experiment,
            model=model,
            max_effects=max_effects,
            without=without,
            effects=own,
            progress=progress,
        )
    with progress_bar("write", shown=shown):
        line = "pendmap " + shlex.join(sys.argv[1:])
        written = write_all(_files(found, outputs, line), keep=True)
    if as_json:
        from pendmap.diagnosis.summary import as_json as fields

        more = {"model": written.name(outputs[0]), "simd": instruction_set()}
        write_json(fields(found) | more)
    elif not quiet:
        _say(found)
        written.say()
    written.check()
    if view and rerun is not None:
        open_recording(rerun)


@contextlib.contextmanager
def _named(where: str) -> Iterator[None]:
    """Name the file or option in a message of refusal."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _report_files(report: Path | None) -> list[Path]:
    """Return the files of a report without its figures; a folder holds one of either kind."""
    if report is None:
        return []
    in_folder = report.is_dir() or not report.suffix
    return [report / "report.html", report / "report.md"] if in_folder else [report]


def _files(
    found: Discrepancy, outputs: tuple[Path, Path | None, Path | None, Path | None], line: str
) -> Iterator[tuple[Callable[[Path], Path], Path]]:
    from pendmap.diagnosis import diagnosed_model
    from pendmap.model import save_model

    out, plot, report, rerun = outputs
    yield lambda path: save_model(diagnosed_model(found, line), path), out
    if plot is not None:
        from pendmap import render

        yield functools.partial(render.draw_discrepancy, found), plot
    if report is not None:
        from pendmap import render

        yield functools.partial(render.write_report, found), report
    if rerun is not None:
        from pendmap import viewer

        yield functools.partial(viewer.record_discrepancy, found), rerun


def _say(found: Discrepancy) -> None:
    from pendmap.diagnosis.result import as_text, ranking_table

    for line in as_text(found):
        click.echo(line)
    click.echo()
    write_table(*ranking_table(found))
