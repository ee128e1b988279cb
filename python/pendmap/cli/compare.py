"""``pendmap compare``: a model against records that it was not fitted to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pendmap.cli.parse.model_options import rig_from
from pendmap.cli.parse.options import argument, group, new_command, output_options, simd_option
from pendmap.cli.parse.signature import options_of, reading_options, take_reading
from pendmap.cli.show import Outputs, first_of_all
from pendmap.errors import instruction_set

if TYPE_CHECKING:
    from pathlib import Path

_ENSEMBLE = group("Ensemble", "--members 1000 --spread 0.02")


@new_command(
    "compare",
    "pendmap compare identify.toml decay",
    "pendmap compare rig.toml shaken --members 1000 --spread 0.02 --json",
)
@argument("model", "MODEL")
@argument("path", "EXPERIMENT")
@options_of("comparison.forced.Ensemble", "members spread seed", _ENSEMBLE)
@options_of("comparison.experiment.compare", "threads")
@reading_options
@simd_option
@output_options((".nc",), recording=False)
def command(
    *,
    model: Path,
    path: Path,
    threads: int | None,
    **given: Any,  # noqa: ANN401 (outputs, ensemble)
) -> None:
    """Simulate a MODEL beside every run of an EXPERIMENT.

    MODEL is a model file in SI, as identify writes it; nothing of it is adapted. For a free decay
    the rms is over the whole record, from the start that minimises it; periods and peaks are those
    of a motion from the first measured peak, in percent of the measured ones, as in the paper's
    table 1. A forced run is compared with an ensemble from a neighbourhood of its start: by wells
    visited, escapes, angle covered, time to settle and greatest velocity, and by the steady state
    that it ends on. Writes compare.nc and compare.png if no output is named.
    """
    from pendmap.comparison import Ensemble, compare
    from pendmap.comparison.experiment import as_json, in_short
    from pendmap.records import files_of, read_experiment

    reads = [model, *files_of(path)]
    outputs = Outputs.take(given, "compare", reads, default=("out", "plot"))
    rig = rig_from(model)
    reading = take_reading(given)
    ensemble = Ensemble(**given)
    with outputs.progress("compare") as progress:
        experiment = read_experiment(path, **reading)
        comparison = compare(rig, experiment, ensemble=ensemble, threads=threads, progress=progress)
    written = outputs.write(comparison, keep=True)
    more = {"model": str(model), "simd": instruction_set()}
    lines = first_of_all(comparison, [*in_short(comparison), ""])
    outputs.finish(written, lambda: as_json(comparison) | more, lines)
