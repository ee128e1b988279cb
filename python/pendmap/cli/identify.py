"""``pendmap identify``: damping from a record, by every method."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

from pendmap.cli.parse import options
from pendmap.cli.parse.options import argument, flag
from pendmap.cli.parse.signature import options_of, reading_options, take_reading
from pendmap.cli.parse.types import EFFECT, METHOD, TABLES
from pendmap.cli.show import Outputs, Written, command_line, first_of_all
from pendmap.errors import InputError, instruction_set

if TYPE_CHECKING:
    from pathlib import Path


@options.new_command(
    "identify",
    "pendmap identify run.csv",
    "pendmap identify decay --effect quadratic_drag --out rig.toml --out rig.pdf",
    "pendmap identify decay --verbose",
)
@argument("path", "EXPERIMENT")
@options_of(
    "identification.experiment.identify",
    "method=methods effect=effects",
    options.group("Fit", "--effect quadratic_drag"),
    methods=METHOD,
    effects=EFFECT,
)
@reading_options
@options.simd_option
@options.output_options((".toml", ".nc", *TABLES))
@flag(
    "--plot-all",
    "The figure has all panels of all methods: half cycles, decrements, errors, table.",
    group=options.OUTPUT,
)
@flag(
    "--verbose",
    "Also the tables of all methods, intervals, and what was noticed.",
    group=options.OUTPUT,
)
def command(
    *,
    path: Path,
    methods: tuple[str, ...],
    effects: tuple[str, ...],
    verbose: bool,
    **given: Any,  # noqa: ANN401
) -> None:
    """Identify natural frequency, viscous damping and Coulomb friction from free decays.

    EXPERIMENT is a file with times and angles, or a folder with an experiment.toml. The default
    method fits a trajectory to the whole record; --verbose lists the paper's method and others too.
    In brackets: standard errors in the last digits. Writes identify.toml, a model for --model of
    every other command, identify.png (record, fit, residual, envelope) and identify.rrd if no
    output is named. A .nc has all of the result, for plot and pendmap.load; a .csv, .xlsx or .mat
    has time, reading, fit, residual and run of every reading.
    """
    from pendmap.charts.registry import ALL
    from pendmap.identification import identified_model, identify
    from pendmap.identification.report import as_json, in_short
    from pendmap.model import save_model
    from pendmap.records import files_of, read_experiment

    layer = ALL if given.pop("plot_all") else None
    outputs = Outputs.take(given, "identify", files_of(path), default=("model", "plot", "rerun"))
    experiment = read_experiment(path, **take_reading(given))
    with outputs.progress("identify") as progress:
        report = identify(experiment, methods=methods or None, effects=effects, progress=progress)

    def finish(written: Written) -> None:
        more = {"model": written.name(outputs.path("model")), "simd": instruction_set()}
        short = [*in_short(report)]
        lines = first_of_all(report, [*short, ""]) if verbose else short
        outputs.finish(written, lambda: as_json(report) | more, lines)

    try:
        model = identified_model(report, command_line())
    except InputError:
        finish(Written())
        raise
    save = functools.partial(save_model, model)
    written = outputs.write(report, save, keep=True, layer=layer)
    finish(written)
