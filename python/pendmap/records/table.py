"""A file, read: CSV and other text, or Parquet."""

from __future__ import annotations

import hashlib
import io
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.records.text import Table, decoded, parsed

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.records.description import Reader

__all__ = ["read_table"]

MOST_BYTES: Final = 2**30
"""Largest file that is read: an hour at 100 kHz."""

HUGEST: Final = 1e18
"""Largest number that can be a reading: nanoseconds since 1970 are 2e18, all else is less."""

_KNOWN: Final = {
    b"PK\x03\x04": "a ZIP or Excel file: allowed is CSV, saved from it",
    b"\xd0\xcf\x11\xe0": "an old Excel file: allowed is CSV, saved from it",
    b"\x1f\x8b": "compressed: allowed is the file unpacked",
    b"\x89HDF": "an HDF5 file: allowed are CSV and Parquet",
    b"CDF\x01": "a NetCDF file: allowed are CSV and Parquet",
    b"%PDF": "a PDF file: allowed are CSV and Parquet",
    b"MATLAB 5.0": "a MATLAB file: allowed are CSV and Parquet",
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
        raise InputError(f"{where}: is a folder: allowed is a file")
    if not path.is_file() and path.exists():
        raise InputError(f"{where}: is no file")
    if path.stat().st_size > MOST_BYTES:
        raise InputError(f"{where}: is larger than 1 GiB: allowed are smaller files")
    data = path.read_bytes()
    digest = hashlib.sha256(data).hexdigest()
    for mark, what in _KNOWN.items():
        if data.startswith(mark):
            raise InputError(f"{where}: is {what}")
    if data.startswith(b"PAR1") or path.suffix.lower() in {".parquet", ".pq"}:
        table = _parquet(data, where)
    else:
        text, findings = decoded(data, where)
        table = parsed(text, reader, where)
        table = Table(
            table.names, table.values, table.rows, (*findings, *table.findings), table.headed
        )
    table.values[np.abs(table.values) > HUGEST] = np.nan
    return table, digest


def _parquet(data: bytes, where: str) -> Table:
    import pandas as pd

    try:
        frame = pd.read_parquet(io.BytesIO(data))
    except Exception as error:  # noqa: BLE001 (whatever a damaged file makes of the reader)
        reason = " ".join(str(error).split())[:100]
        raise InputError(f"{where}: is no Parquet file that can be read: {reason}") from None
    if frame.shape[0] == 0 or frame.shape[1] == 0:
        raise InputError(f"{where}: is empty: allowed is a file with rows of numbers")
    frame = frame.reset_index() if frame.index.name else frame
    columns = []
    for k in range(frame.shape[1]):
        column = frame.iloc[:, k]
        if pd.api.types.is_datetime64_any_dtype(column):
            seconds = (column - column.iloc[0]).dt.total_seconds()
            columns.append(seconds.to_numpy(dtype=float))
        elif pd.api.types.is_timedelta64_dtype(column):
            columns.append(column.dt.total_seconds().to_numpy(dtype=float))
        else:
            columns.append(pd.to_numeric(column, errors="coerce").to_numpy(dtype=float))
    values = np.column_stack(columns)
    values[~np.isfinite(values)] = np.nan
    if values.shape[1] < 2:
        raise InputError(f"{where}: has one column: allowed are a time and an angle")
    return Table(tuple(map(str, frame.columns)), values, np.arange(1, values.shape[0] + 1))
