"""``pendmap look``: what a record holds."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import click

from pendmap.cli.options import json_option, plot_option, quiet_option, rate_option
from pendmap.cli.show import (
    Written,
    keep_inputs,
    progress_bar,
    shows_progress,
    write_all,
    write_json,
)
from pendmap.cli.types import FILE

if TYPE_CHECKING:
    from pathlib import Path


@click.command("look")
@click.argument("path", type=FILE, metavar="FILE|FOLDER")
@plot_option
@rate_option
@json_option()
@quiet_option
def command(
    *, path: Path, plot: Path | None, rate_hz: float | None, as_json: bool, quiet: bool
) -> None:
    """Say what a record holds and what is odd about it, before anything is fitted.

    A FILE (CSV or other text, Parquet, Excel) has a time and an angle; a FOLDER has an
    experiment.toml, or each of its files is a free run. Channels, rate, noise without a model,
    releases and rest, gaps, outliers, missed counts, units: what is certain is mended as it is
    read, and said. The files stay as they are.
    """
    from pendmap.records import files_of, read_experiment
    from pendmap.records.summary import as_json as fields
    from pendmap.records.summary import as_text

    keep_inputs(files_of(path), {"--plot": [plot]})
    with progress_bar("read", shown=shows_progress(quiet=quiet)):
        experiment = read_experiment(path, rate_hz=rate_hz)
    written = Written()
    if plot is not None:
        from pendmap import render

        written = write_all([(functools.partial(render.draw_record, experiment), plot)])
    if as_json:
        write_json(fields(experiment))
    elif not quiet:
        click.echo(as_text(experiment))
        written.say()
    written.check()
