"""``pendmap identify``: damping from a record, by every method."""

from __future__ import annotations

import functools
import shlex
import sys
from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.options import output_options, quiet_option, rate_option, simd_option
from pendmap.cli.show import Outputs, progress_bar, write_all, write_json, write_table
from pendmap.cli.types import FILE
from pendmap.errors import instruction_set

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.identification import IdentificationReport


SUFFIX = ".toml"


@click.command("identify")
@click.argument("path", type=FILE, metavar="EXPERIMENT")
@click.option(
    "--method", "methods", multiple=True, metavar="NAME", help="Only this method; may be repeated."
)
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="NAME",
    help="Fit this effect of the library too; may be repeated.",
)
@rate_option
@simd_option
@quiet_option
@output_options((SUFFIX,), "Model")
def command(
    *,
    path: Path,
    methods: tuple[str, ...],
    effects: tuple[str, ...],
    rate_hz: float | None,
    **given: Any,  # noqa: ANN401
) -> None:
    """Identify natural frequency, viscous damping and Coulomb friction from free decays.

    EXPERIMENT is a file with times and angles, or a folder with an experiment.toml. The default
    method fits a trajectory to the whole record; the paper's method and others are listed too. In
    brackets: standard errors in the last digits. Writes identify.toml, a model for --model of every
    other command, identify.png and identify.rrd if no output is named. --json alone writes no file.
    """
    from pendmap.errors import InputError
    from pendmap.identification import identified_model, identify_experiment
    from pendmap.model import save_model
    from pendmap.records import files_of, read_experiment

    outputs = Outputs.take(given, "identify", SUFFIX, files_of(path))
    with progress_bar("read", shown=outputs.shows_progress):
        experiment = read_experiment(path, rate_hz=rate_hz)
    with progress_bar("identify", shown=outputs.shows_progress) as progress:
        report = identify_experiment(
            experiment, methods=methods or None, effects=effects, progress=progress
        )
    try:
        model = identified_model(report, "pendmap " + shlex.join(sys.argv[1:]))
    except InputError:
        _show(report, outputs)
        raise
    with progress_bar("write", shown=outputs.shows_progress):
        save = functools.partial(save_model, model)
        files = outputs.files(report, save, "draw_identification", "record_identification")
        written = write_all(files, keep=True)
    _show(report, outputs, written.name(outputs.out))
    if not outputs.as_json and not outputs.quiet:
        written.say()
    written.check()
    outputs.open_viewer()


def _show(report: IdentificationReport, outputs: Outputs, model: str | None = None) -> None:
    if outputs.as_json:
        from pendmap.identification.report import as_json

        fields = as_json(report) | {"model": model, "simd": instruction_set()}
        write_json(fields)
        return
    if outputs.quiet:
        return
    from pendmap.identification.report import as_text, foremost, methods_table, table1_table

    doubts = [f"Warning: {text}" for text in foremost(report)]
    for line in doubts:
        click.echo(line)
    for head, rows in (methods_table(report), table1_table(report)):
        if rows:
            write_table(head, rows)
    for line in as_text(report):
        if line not in doubts:
            click.echo(line)
