"""``pendmap look``: contents and faults of a record."""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING, Any

from pendmap.cli.parse.options import OUTPUT, argument, flag, new_command, output_options
from pendmap.cli.parse.signature import reading_options, take_reading
from pendmap.cli.show import File, Outputs, keep_files

if TYPE_CHECKING:
    from pathlib import Path


@new_command(
    "look",
    "pendmap look run.csv",
    "pendmap look run.txt --time 1 --angle 3 --angle-unit deg --write-experiment",
    "pendmap look runs --out records.png",
)
@argument("path", "FILE|FOLDER")
@reading_options
@output_options((), recording=False, json="")
@flag(
    "--write-experiment",
    "Write experiment.toml beside the record, from which its folder is read in the same way.",
    group=OUTPUT,
)
def command(*, path: Path, write_experiment: bool, **given: Any) -> None:  # noqa: ANN401 (outputs)
    """Describe the contents and faults of a record, before anything is fitted.

    A FILE (CSV or other text, Parquet, Excel) has a time and an angle; a FOLDER has an
    experiment.toml, or each of its files is a free run. Channels, rate, noise without a model,
    releases and rest, gaps, outliers, missed counts, units: unambiguous faults are corrected on
    reading and reported. The files are not changed.
    """
    from pendmap.records import files_of
    from pendmap.records.by_hand import save_description
    from pendmap.records.description import NAME
    from pendmap.records.read import read_described
    from pendmap.records.summary import as_json, as_text

    overwrite = given["overwrite"]
    outputs = Outputs.take(given, "look", files_of(path), default=())
    if write_experiment:
        place = (path if path.is_dir() else path.parent) / NAME
        file = File("model", place, "--write-experiment")
        keep_files([] if overwrite else [file])
        outputs = dataclasses.replace(outputs, files=(*outputs.files, file))
    experiment, description = read_described(path, None, take_reading(given))
    written = outputs.write(experiment, functools.partial(save_description, description))
    outputs.finish(written, lambda: as_json(experiment), [as_text(experiment)])
