"""Tables from files: text, Excel, Parquet."""

from __future__ import annotations

import dataclasses
import datetime as dt
import hashlib
import io
import zipfile
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.files import read_whole
from pendmap.records.experiment import Finding
from pendmap.records.text import MOST_BYTES, Table, decoded, parsed, refuse_large

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

    from pendmap.records.description import Reader
    from pendmap.signal import Floats


LARGEST_READING: Final = 1e18  # Largest number of a reading; nanoseconds since 1970 are 2e18
_KNOWN: Final = {
    b"\x1f\x8b": "must be unpacked, it is compressed",
    b"\x89HDF": "must be CSV or Parquet, it is an HDF5 file",
    b"CDF\x01": "must be CSV or Parquet, it is a NetCDF file",
    b"%PDF": "must be CSV or Parquet, it is a PDF file",
    b"MATLAB 5.0": "must be CSV or Parquet, it is a MATLAB file",
}
# Reader of a workbook (.xlsx, .xls) by its first bytes
ENGINES: Final = {b"PK\x03\x04": "openpyxl", b"\xd0\xcf\x11\xe0": "xlrd"}


def read_table(path: Path, reader: Reader) -> tuple[Table, str]:
    """Return the numbers of a file and its SHA-256; raise InputError if there are none."""
    where = str(path)
    if path.is_dir():
        raise InputError(f"{where}: must be a file, it is a folder")
    data = read_whole(path, MOST_BYTES)
    digest = hashlib.sha256(data).hexdigest()
    for mark, what in _KNOWN.items():
        if data.startswith(mark):
            raise InputError(f"{where}: {what}")
    if data[:4] in ENGINES:
        table = read_workbook(data, reader, where)
    elif data.startswith(b"PAR1") or path.suffix.lower() in {".parquet", ".pq"}:
        table = _parquet(data, where)
    else:
        text, findings = decoded(data, where)
        table = parsed(text, reader, where)
        table = dataclasses.replace(table, findings=(*findings, *table.findings))
    table.values[np.abs(table.values) > LARGEST_READING] = np.nan  # noqa: PD011 (no data frame)
    return table, digest


def _parquet(data: bytes, where: str) -> Table:
    """Return the table of a Parquet file."""
    try:
        names, columns = _columns(data, where)
    except InputError:
        raise
    except Exception as error:  # noqa: BLE001 (whatever a damaged file makes of the reader)
        raise InputError(f"{where}: is no Parquet file that can be read: {error}") from None
    if not columns or columns[0].size == 0:
        raise InputError(f"{where}: must be a file with rows of numbers, it is empty")
    values = np.column_stack(columns)
    values[~np.isfinite(values)] = np.nan
    order = np.arange(values.shape[0])
    return Table(names, values, order + 1, order=order)


def _columns(data: bytes, where: str) -> tuple[tuple[str, ...], list[Floats]]:
    """Unpack the columns of a Parquet file within the bounds that it declares."""
    import pandas as pd
    import pyarrow as pa
    from pyarrow import parquet

    file = parquet.ParquetFile(io.BytesIO(data))
    # Sizes come from the row groups: asking a damaged column ends the process.
    groups = [file.metadata.row_group(k) for k in range(file.metadata.num_row_groups)]
    size = sum(max(8 * g.num_rows * g.num_columns, g.total_byte_size) for g in groups)
    refuse_large(where, columns=file.metadata.num_columns, size=size)
    # Dictionaries unpack each text once, however many rows have it.
    kinds = (pa.types.is_string, pa.types.is_large_string, pa.types.is_binary)
    fields = list(file.schema_arrow)
    texts = [field.name for field in fields if any(kind(field.type) for kind in kinds)]
    # Lists have no bound, and are no numbers. An error of a damaged file in a second thread would
    # end the process, too.
    flat = [field.name for field in fields if not pa.types.is_nested(field.type)]
    whole = parquet.ParquetFile(io.BytesIO(data), read_dictionary=texts, pre_buffer=False)
    frame = whole.read(columns=flat, use_threads=False).to_pandas()
    frame = frame.reset_index() if frame.index.name else frame
    columns = []
    for k in range(frame.shape[1]):
        column = frame.iloc[:, k]
        if pd.api.types.is_datetime64_any_dtype(column):
            column = (column - column.iloc[0]).dt.total_seconds() if len(column) else column
        elif pd.api.types.is_timedelta64_dtype(column):
            column = column.dt.total_seconds()
        elif isinstance(column.dtype, pd.CategoricalDtype):
            known = pd.to_numeric(pd.Series(column.cat.categories), errors="coerce")
            column = pd.Series(np.append(known.to_numpy(dtype=float), np.nan)[column.cat.codes])
        else:
            column = pd.to_numeric(column, errors="coerce")
        columns.append(column.to_numpy(dtype=float))
    return tuple(map(str, frame.columns)), columns


def read_workbook(data: bytes, reader: Reader, where: str) -> Table:
    """Return the table of the sheet with most numbers; raise InputError if there is none."""
    import pandas as pd

    engine = ENGINES[data[:4]]
    try:
        if engine == "openpyxl":
            with zipfile.ZipFile(io.BytesIO(data)) as packed:
                refuse_large(where, size=sum(part.file_size for part in packed.infolist()))
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
    numbers = {name: _count_numbers(frame) for name, frame in sheets.items()}
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


def _count_numbers(frame: pd.DataFrame) -> int:
    """Return the number of cells with a number."""
    import pandas as pd

    kinds = (int, float, dt.datetime, dt.time)
    return int(frame.map(lambda cell: isinstance(cell, kinds) and not pd.isna(cell)).sum().sum())


def _cell(cell: object) -> str:
    """Return a cell as text: numbers in full, times in s."""
    if cell is None or cell != cell:  # noqa: PLR0124 (what is no number or no date)
        return ""
    if isinstance(cell, dt.datetime):
        # timestamp() would apply daylight saving time, which is no part of the record.
        return repr((cell - dt.datetime(1970, 1, 1)).total_seconds())  # noqa: DTZ001
    if isinstance(cell, dt.time):
        return repr(3600 * cell.hour + 60 * cell.minute + cell.second + 1e-6 * cell.microsecond)
    if isinstance(cell, dt.timedelta):
        return repr(cell.total_seconds())
    if isinstance(cell, (int, float)) and not isinstance(cell, bool):
        return repr(float(cell))
    return " ".join(str(cell).split())
