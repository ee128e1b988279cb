"""Formats of files: text, workbooks, Parquet, MATLAB, Tracker, archives of these."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import zipfile
from pathlib import PurePath
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError
from pendmap.files import read_whole
from pendmap.formatting import listed
from pendmap.tables.findings import finding_of
from pendmap.tables.programs import TRACKER, is_workbook, matlab_frame, sheet_text, tracker_frame
from pendmap.tables.table import MOST_BYTES, decoded, readable, refuse_large, table_of
from pendmap.tables.text import parsed
from pendmap.tables.units import Heading

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.tables.text import Reader, Table

_TEXTS: Final = (".csv", ".tsv", ".txt", ".dat")
_BINARY: Final = (".parquet", ".pq", ".xlsx", ".ods", ".mat", ".trk", ".trz", ".zip")
# Suffixes of the files that are records in a folder without a description
TABLES: Final = (*_TEXTS, *_BINARY)
_ANGLES: Final = ("angle", "velocity", "pixel_x")  # Wanted, best first
_ZIP: Final = b"PK\x03\x04"
_MOST_MEMBERS: Final = 200  # Most members of an archive
_MISSING: Final = (
    "a Parquet file needs the extra pendmap[viewer] (pyarrow), or must be saved as CSV"
)
_OTHERS: Final = {
    b"\x1f\x8b": "must be unpacked, it is compressed",
    b"\x89HDF": "must be CSV or Parquet, it is an HDF5 file",
    b"CDF\x01": "must be CSV or Parquet, it is a NetCDF file",
    b"%PDF": "must be CSV or Parquet, it is a PDF file",
    b"\xd0\xcf\x11\xe0": "must be .xlsx or CSV, it is an Excel file of an old version",
}


def read_table(path: Path, reader: Reader) -> tuple[Table, str]:
    """Return the numbers of a file and its SHA-256; raise InputError if there are none."""
    if path.is_dir():
        raise InputError(f"{path}: must be a file, it is a folder")
    data = read_whole(path, MOST_BYTES)
    return _table(data, path.suffix.lower(), reader, str(path)), hashlib.sha256(data).hexdigest()


def _table(data: bytes, suffix: str, reader: Reader, where: str) -> Table:
    """Return the numbers of a file by its first bytes, or by its suffix."""
    if data.startswith(b"MATLAB"):
        return table_of(matlab_frame(data, where, MOST_BYTES), where)
    for mark, what in _OTHERS.items():
        if data.startswith(mark):
            raise InputError(f"{where}: {what}")
    if data[:4] == b"PAR1" or suffix in {".parquet", ".pq"}:
        return _parquet(data, where)
    if TRACKER in data[:1000]:
        frame, finding = tracker_frame(data, where)
        return dataclasses.replace(table_of(frame, where), findings=finding)
    if data[:4] == _ZIP and not is_workbook(data, where):
        return _member(data, reader, where)
    if data[:4] == _ZIP:
        text, findings = sheet_text(data, where)
        reader = dataclasses.replace(reader, delimiter="\t", decimal=reader.decimal or ".")
    else:
        text, findings = decoded(data, where)
    return parsed(text, reader, where, findings)


def _member(data: bytes, reader: Reader, where: str) -> Table:
    """Return the table of an archive with a time and an angle, or a rate; of these the longest."""
    tables, refused = [], ""
    with zipfile.ZipFile(io.BytesIO(data)) as packed:
        names = [info for info in packed.infolist() if PurePath(info.filename).suffix in TABLES]
        size = sum(info.file_size for info in names)
        if size > MOST_BYTES or len(names) > _MOST_MEMBERS:
            refuse_large(where, size=size)
            raise InputError(f"{where}: must have at most {_MOST_MEMBERS} files, got {len(names)}")
        for name in (info.filename for info in names):
            try:
                table = _table(packed.read(name), PurePath(name).suffix, reader, f"{where}: {name}")
            except Exception as error:  # noqa: BLE001 (whatever a damaged file makes of a reader)
                refused = refused or f", the first refused: {error}"
                continue
            heads = [Heading.of(head) for head in table.names]
            good = {c for c in (*_ANGLES, "time") for head in heads if head.rank(c) is not None}
            angles = [k for k, channel in enumerate(_ANGLES) if channel in good]
            rank = min(angles) if angles and "time" in good else len(_ANGLES)
            tables.append(((rank, -table.rows.size), name, table))
    if not tables:
        raise InputError(f"{where}: must contain a table of numbers, got none{refused}")
    _, name, table = min(tables, key=lambda entry: entry[0])
    others = listed([repr(other) for _, other, _ in tables if other != name], 3)
    chosen = [finding_of("member-chosen", name=name, others=others)] if len(tables) > 1 else []
    return dataclasses.replace(table, findings=(*chosen, *table.findings))


def _parquet(data: bytes, where: str) -> Table:
    """Return the table of a Parquet file, if its declared size is allowed."""
    with readable(where, "Parquet file", _MISSING):
        import pyarrow as pa
        from pyarrow import parquet

        # An error of a damaged file in a second thread would crash the process.
        file = parquet.ParquetFile(io.BytesIO(data), pre_buffer=False)
        # Sizes are read from the row groups: reading a damaged column's may crash the process.
        groups = [file.metadata.row_group(k) for k in range(file.metadata.num_row_groups)]
        size = sum(max(8 * g.num_rows * g.num_columns, g.total_byte_size) for g in groups)
        refuse_large(where, columns=file.metadata.num_columns, size=size)
        # Texts and nested columns are unbounded.
        kind = pa.types
        is_number = (kind.is_integer, kind.is_floating, kind.is_boolean, kind.is_temporal)
        names = [f.name for f in file.schema_arrow if any(is_of(f.type) for is_of in is_number)]
        return table_of(file.read(columns=names, use_threads=False).to_pandas(), where)
