"""``pendmap identify``: damping from a record, by every method."""

from __future__ import annotations

import functools
import shlex
import sys
from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.options import output_options, reading_options
from pendmap.cli.show import Outputs, Written, doubts_first, write_all
from pendmap.cli.types import FILE
from pendmap.errors import InputError, instruction_set

if TYPE_CHECKING:
    from pathlib import Path


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
@reading_options
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
    from pendmap.identification import identified_model, identify_experiment
    from pendmap.identification.report import as_json, foremost
    from pendmap.model import save_model
    from pendmap.records import files_of, read_experiment

    outputs = Outputs.take(given, "identify", SUFFIX, files_of(path))
    with outputs.progress("read"):
        experiment = read_experiment(path, rate_hz=rate_hz)
    with outputs.progress("identify") as progress:
        report = identify_experiment(
            experiment, methods=methods or None, effects=effects, progress=progress
        )

    def finish(written: Written) -> None:
        more = {"model": written.name(outputs.out), "simd": instruction_set()}
        lines = doubts_first(report, [f"Warning: {text}" for text in foremost(report)])
        outputs.finish(written, lambda: as_json(report) | more, lines)

    try:
        model = identified_model(report, "pendmap " + shlex.join(sys.argv[1:]))
    except InputError:
        finish(Written())
        raise
    with outputs.progress("write"):
        save = functools.partial(save_model, model)
        files = outputs.files(report, save, "record_identification")
        written = write_all(files, keep=True)
    finish(written)
