"""Workbooks: the sheet with the numbers, as text that is read like any other."""

from __future__ import annotations

import dataclasses
import datetime as dt
import io
import zipfile
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError
from pendmap.records.experiment import Finding
from pendmap.records.text import Table, parsed, refuse_large

if TYPE_CHECKING:
    import pandas as pd

    from pendmap.records.description import Reader

ENGINES: Final = {b"PK\x03\x04": "openpyxl", b"\xd0\xcf\x11\xe0": "xlrd"}
"""What reads a workbook, by how it begins: .xlsx and .xls."""


def read_workbook(data: bytes, reader: Reader, where: str) -> Table:
    """Return the table of a workbook: of the sheet that has most numbers.

    Raises
    ------
    InputError
        If it is damaged, holds no numbers, or what reads it is not installed.
    """
    import pandas as pd

    engine = ENGINES[data[:4]]
    try:
        _check_size(data, where)
        sheets = pd.read_excel(io.BytesIO(data), sheet_name=None, header=None, engine=engine)
    except InputError:
        raise
    except ImportError:
        raise InputError(
            f"{where}: an Excel file must be read with {engine}: pip install pendmap[excel]; or"
            " saved as CSV"
        ) from None
    except Exception as error:  # noqa: BLE001 (whatever a damaged file makes of the reader)
        said = " ".join(str(error).split())
        raise InputError(f"{where}: is no Excel file that can be read: {said}") from None
    numbers = {name: _numbers(frame) for name, frame in sheets.items()}
    if not any(numbers.values()):
        raise InputError(f"{where}: a sheet must have rows of numbers, got none")
    name = max(numbers, key=lambda each: numbers[each])
    frame = sheets[name].dropna(axis="columns", how="all")
    refuse_large(where, columns=frame.shape[1])
    lines = ("\t".join(map(_cell, row)) for row in frame.itertuples(index=False, name=None))
    tabs = dataclasses.replace(reader, delimiter="\t", decimal=reader.decimal or ".")
    table = parsed("\n".join(lines) + "\n", tabs, where)
    if len(sheets) < 2:
        return table
    text = f"of {len(sheets)} sheets {str(name)!r} is read, which has most numbers"
    return dataclasses.replace(table, findings=(Finding("sheet-chosen", text), *table.findings))


def _check_size(data: bytes, where: str) -> None:
    """Refuse what unpacks to more than a record can be."""
    if ENGINES[data[:4]] == "openpyxl":
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            refuse_large(where, size=sum(part.file_size for part in packed.infolist()))


def _numbers(frame: pd.DataFrame) -> int:
    """Return how many cells of a sheet are numbers."""
    import pandas as pd

    kinds = (int, float, dt.datetime, dt.time)
    return int(frame.map(lambda cell: isinstance(cell, kinds) and not pd.isna(cell)).sum().sum())


def _cell(cell: object) -> str:
    """Return a cell as text: numbers in full, times in s."""
    if cell is None or cell != cell:  # noqa: PLR0124 (what is no number or no date)
        return ""
    if isinstance(cell, dt.datetime):
        # Not timestamp(): an hour that a clock was put back is none of the record's.
        return repr((cell - dt.datetime(1970, 1, 1)).total_seconds())  # noqa: DTZ001
    if isinstance(cell, dt.time):
        return repr(3600 * cell.hour + 60 * cell.minute + cell.second + 1e-6 * cell.microsecond)
    if isinstance(cell, dt.timedelta):
        return repr(cell.total_seconds())
    if isinstance(cell, (int, float)) and not isinstance(cell, bool):
        return repr(float(cell))
    return " ".join(str(cell).split())
