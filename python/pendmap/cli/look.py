"""``pendmap look``: contents and faults of a record."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pendmap.cli.parse.options import argument, new_command, output_options
from pendmap.cli.parse.signature import options_of
from pendmap.cli.show import Outputs

if TYPE_CHECKING:
    from pathlib import Path


@new_command("look", "pendmap look run.csv", "pendmap look runs --out records.png")
@argument("path", "FILE|FOLDER")
@options_of("records.read.read_experiment", "rate=rate_hz")
@output_options((), recording=False, json="")
def command(*, path: Path, rate_hz: float | None, **given: Any) -> None:  # noqa: ANN401 (outputs)
    """Describe the contents and faults of a record, before anything is fitted.

    A FILE (CSV or other text, Parquet, Excel) has a time and an angle; a FOLDER has an
    experiment.toml, or each of its files is a free run. Channels, rate, noise without a model,
    releases and rest, gaps, outliers, missed counts, units: unambiguous faults are corrected on
    reading and reported. The files are not changed.
    """
    from pendmap.records import files_of, read_experiment
    from pendmap.records.summary import as_json, as_text

    outputs = Outputs.take(given, "look", files_of(path), default=())
    experiment = read_experiment(path, rate_hz=rate_hz)
    written = outputs.write(experiment)
    outputs.finish(written, lambda: as_json(experiment), [as_text(experiment)])
