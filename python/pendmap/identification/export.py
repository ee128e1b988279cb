"""Files of readings, fit and residual for other tools: CSV, Excel, MATLAB."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError
from pendmap.files.atomic import whole_file

if TYPE_CHECKING:
    import os

    from pendmap.identification import IdentificationReport

SUFFIXES: Final = (".csv", ".xlsx", ".mat")
MOST_ROWS: Final = 2**20 - 1  # Rows of a sheet of Excel below its header


def write_readings(report: IdentificationReport, path: str | os.PathLike[str]) -> Path:
    """Write the ``readings`` of a report; ``.mat`` has a variable a column, runs as cells."""
    table, suffix = report.readings, Path(path).suffix.lower()
    if suffix == ".xlsx" and len(table) > MOST_ROWS:
        text = f"must have {MOST_ROWS} readings at most, got {len(table)}: .csv and .mat take all"
        raise InputError(f"{path}: {text}")
    with whole_file(path, SUFFIXES) as part:
        if suffix == ".csv":
            table.to_csv(part, index=False)
        elif suffix == ".xlsx":
            table.to_excel(part, index=False, sheet_name="readings", engine="openpyxl")
        else:
            from scipy.io import savemat  # noqa: PLC0415 (where it is needed)

            columns = {name: values.to_numpy() for name, values in table.items()}
            savemat(part, columns, do_compression=True, oned_as="column")
    return Path(path)
