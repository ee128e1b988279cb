"""``pendmap compare``: a model against records that it was not fitted to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.model_options import rig_from
from pendmap.cli.options import (
    json_option,
    option,
    plot_option,
    quiet_option,
    rate_option,
    seed_option,
    simd_option,
    threads_option,
)
from pendmap.cli.show import Outputs, progress_bar, write_all, write_json, write_table
from pendmap.cli.types import FILE, NUMBER, Whole
from pendmap.errors import instruction_set

if TYPE_CHECKING:
    from pathlib import Path


@click.command("compare")
@click.argument("model", type=FILE, metavar="MODEL")
@click.argument("path", type=FILE, metavar="EXPERIMENT")
@plot_option
@option("--members", Whole(20, 100_000), "Ensemble members for each forced run.", 400)
@option("--spread", NUMBER, "Their spread about the measured start, rad, and over w0.", 0.01)
@seed_option("Draws them.")
@threads_option
@json_option("; alone, no files")
@rate_option
@simd_option
@quiet_option
def command(  # noqa: PLR0913 (an option each)
    *,
    model: Path,
    path: Path,
    members: int,
    spread: float,
    seed: int,
    threads: int | None,
    rate_hz: float | None,
    **given: Any,  # noqa: ANN401 (outputs)
) -> None:
    """Simulate a MODEL beside every run of an EXPERIMENT.

    MODEL is a model file in SI, as identify writes it; nothing of it is adapted. For a free decay
    the rms is over the whole record, from the start that minimises it; periods and peaks are those
    of a motion from the first measured peak, in percent of the measured ones, as in the paper's
    table 1. A forced run is compared with an ensemble from a neighbourhood of its start: by wells
    visited, escapes, angle covered, time to settle and greatest velocity, and by the steady state
    that it ends on. Writes compare.png if no figure is named. --json alone writes no file.
    """
    from pendmap.comparison import Ensemble, compare
    from pendmap.comparison.experiment import as_json as fields
    from pendmap.records import files_of, read_experiment
    from pendmap.records.summary import doubt_lines

    outputs = Outputs.take(given, "compare", reads=[model, *files_of(path)])
    rig = rig_from(model)
    ensemble = Ensemble(members, spread, seed)
    with progress_bar("compare", shown=outputs.shows_progress) as progress:
        experiment = read_experiment(path, rate_hz=rate_hz)
        comparison = compare(rig, experiment, ensemble=ensemble, threads=threads, progress=progress)
    written = write_all(outputs.files(comparison, None, "draw_comparison"), keep=True)
    if outputs.as_json:
        more = {"model": str(model), "simd": instruction_set()}
        write_json(fields(comparison) | more)
    elif not outputs.quiet:
        tables, lines = comparison.text_parts()
        doubts = list(doubt_lines(experiment, *(one.run for one in comparison.every)))
        for line in doubts:
            click.echo(line)
        for table in tables:
            write_table(*table)
        for line in lines:
            if line not in doubts:
                click.echo(line)
        written.say()
    written.check()
