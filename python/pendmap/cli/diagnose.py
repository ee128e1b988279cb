"""``pendmap diagnose``: which effect the model lacks."""

from __future__ import annotations

import functools
import itertools
import os
from typing import TYPE_CHECKING, Any

from pendmap.cli.parse import options
from pendmap.cli.parse.model_options import rig_from
from pendmap.cli.parse.options import argument, option
from pendmap.cli.parse.signature import options_of, reading_options, take_reading
from pendmap.cli.parse.types import EFFECT, FILE, REPORTS, output_file
from pendmap.cli.show import Outputs, command_line, table
from pendmap.errors import instruction_set, named

if TYPE_CHECKING:
    from pathlib import Path


_FIT = options.group("Candidates", "--max-effects 1 --without magnet")


@options.new_command(
    "diagnose",
    "pendmap diagnose hidden",
    "pendmap diagnose hidden --model rig.toml --report report.html",
)
@argument("path", "EXPERIMENT")
@options_of(
    "diagnosis.diagnose.diagnose", "model max_effects without", _FIT, model=FILE, without=EFFECT
)
@option("--effects formulas", FILE, "Further candidates: [[formula]] of a .toml.", group=_FIT)
@reading_options
@options.simd_option
@option(
    "--report",
    output_file(*REPORTS),
    "Report: .html with embedded figures, or .md with separate figures.",
    group=options.OUTPUT,
)
@options.output_options((".toml", ".nc", *REPORTS), json="; alone, no file but the model")
def command(
    *,
    path: Path,
    model: Path | None,
    formulas: Path | None,
    **given: Any,  # noqa: ANN401 (outputs, candidates)
) -> None:
    """Find where a model and an experiment disagree, and which effect is missing.

    EXPERIMENT is a file with times and angles, or a folder with an experiment.toml. Every effect of
    the library is scored; the verdict is none, named, partial, ambiguous or unknown. The model with
    the effects found is written to diagnose.toml, for --model of every other command; where no
    output is named, a figure, a report and a recording too: diagnose.png, diagnose.html and
    diagnose.rrd. A .nc has all of the result, for plot and pendmap.load.
    """
    # The matrices are tall and narrow: threads would cost more than they save.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from pendmap.diagnosis import diagnose, diagnosed_model
    from pendmap.diagnosis.result import as_text
    from pendmap.diagnosis.summary import as_json
    from pendmap.model import load_formulas, save_model
    from pendmap.model.effects import definition
    from pendmap.records import files_of, read_experiment

    effects = [] if formulas is None else load_formulas(formulas)
    with named("--without"):
        for name in {*given["without"]} - {formula.name for formula in effects}:
            definition(name)
    reads = [*files_of(path), model, formulas]
    usual = ("model", "plot", "report", "rerun")
    outputs = Outputs.take(given, "diagnose", reads, default=usual, always=("model",))
    baseline = None if model is None else rig_from(model)
    experiment = read_experiment(path, **take_reading(given))
    with outputs.progress("diagnose") as progress:
        result = diagnose(experiment, model=baseline, effects=effects, progress=progress, **given)
    save = functools.partial(save_model, diagnosed_model(result, command_line()))
    written = outputs.write(result, save, keep=True)
    more = {"model": written.name(outputs.path("model")), "simd": instruction_set()}
    lines = itertools.chain(as_text(result), ["", table(*result.table_cells())])
    outputs.finish(written, lambda: as_json(result) | more, lines)
