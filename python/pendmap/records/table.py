"""Tables from files: text, Excel, Parquet."""

from __future__ import annotations

import dataclasses
import hashlib
import io
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.files import read_whole
from pendmap.records.excel import ENGINES, read_workbook
from pendmap.records.text import MOST_BYTES, Table, decoded, parsed, refuse_large

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from pendmap.records.description import Reader


HUGEST: Final = 1e18
"""Largest number that can be a reading: nanoseconds since 1970 are 2e18, all else is less."""

_KNOWN: Final = {
    b"\x1f\x8b": "must be unpacked, it is compressed",
    b"\x89HDF": "must be CSV or Parquet, it is an HDF5 file",
    b"CDF\x01": "must be CSV or Parquet, it is a NetCDF file",
    b"%PDF": "must be CSV or Parquet, it is a PDF file",
    b"MATLAB 5.0": "must be CSV or Parquet, it is a MATLAB file",
}


def read_table(path: Path, reader: Reader) -> tuple[Table, str]:
    """Read a file; return its numbers and its SHA-256. It is opened for reading alone.

    Raises
    ------
    InputError
        If it is a folder, empty, too large, not text and not Parquet, or has no rows of numbers.
    OSError
        If it cannot be read.
    """
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
    table.values[np.abs(table.values) > HUGEST] = np.nan
    return table, digest


def _parquet(data: bytes, where: str) -> Table:
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


def _columns(data: bytes, where: str) -> tuple[tuple[str, ...], list[NDArray[np.float64]]]:
    """Unpack the columns of a Parquet file, as far as the file says that they are no more."""
    import pandas as pd
    import pyarrow as pa
    from pyarrow import parquet

    file = parquet.ParquetFile(io.BytesIO(data))
    # What the groups say of themselves: to ask a damaged column ends the process.
    groups = [file.metadata.row_group(k) for k in range(file.metadata.num_row_groups)]
    size = sum(max(8 * g.num_rows * g.num_columns, g.total_byte_size) for g in groups)
    refuse_large(where, columns=file.metadata.num_columns, size=size)
    # A text is unpacked once, however many rows have it.
    kinds = (pa.types.is_string, pa.types.is_large_string, pa.types.is_binary)
    fields = list(file.schema_arrow)
    texts = [field.name for field in fields if any(kind(field.type) for kind in kinds)]
    # Lists have no bound, and are no numbers. One thread: what a damaged file raises in another
    # one ends the process, too.
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
