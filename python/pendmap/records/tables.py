"""Reading of tables from files: text in the formats of common loggers, Excel, Parquet."""

from __future__ import annotations

import csv
import dataclasses
import datetime as dt
import hashlib
import io
import re
from collections import Counter
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.files import read_whole
from pendmap.formatting import counted, listed
from pendmap.records.experiment import finding_of
from pendmap.records.units import CHANNELS
from pendmap.records.workbooks import WORKBOOK, sheet_text

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

    from pendmap.records.description import Reader
    from pendmap.records.experiment import Finding
    from pendmap.signal import Floats, Indices

MOST_COLUMNS: Final = 1000  # Most columns of a table
MOST_BYTES: Final = 2**30  # Largest file, and largest table in memory, bytes
LONGEST_LINE: Final = 40 * MOST_COLUMNS  # Longest line that may be a row, characters
SAMPLE_LINES: Final = 400  # Number of lines, spread over a file, that determine separators
LEAST_ROWS: Final = 0.5  # Least share of lines that are rows of numbers
MOST_CONTROLS: Final = 0.02  # Share of control characters above which a file is no text
MOST_NULS: Final = 0.2  # Share of NUL bytes above which a file is no text
# Separators with decimal signs, in the order of preference
SEPARATORS: Final = (
    *((";", ","), ("\t", ","), ("\t", "."), (";", "."), (",", ".")),
    *(("|", "."), (" ", "."), (" ", ","), (",", ",")),
)
_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_NOTHING: Final = frozenset(
    (
        *("", "nan", "na", "n/a", "null", "none", "-", "--", "inf", "+inf", "-inf", "infinity"),
        *("#n/a", "#div/0!", "#name?", "#null!", "#num!", "#ref!", "#value!"),  # of Excel
    )
)
# Words that loggers write for the levels of a trigger
_LEVELS: Final = {
    **dict.fromkeys(("true", "high", "on"), "1"),
    **dict.fromkeys(("false", "low", "off"), "0"),
}
_CONTROLS: Final = re.compile(r"[\x01-\x08\x0b\x0e-\x1f\x7f]")
_HEADS: Final = 30  # Most lines above the numbers of a short file
TIME: Final = "t_s"  # Heading of times that a record has as dates
LARGEST_READING: Final = 1e18  # Largest reading; larger ones (2e18: ns since 1970) are missing
# ISO 8601 at the beginning of a line, as pandas and most loggers write it
_DATE: Final = re.compile(
    r'\s*"?(\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:([.,])\d+)?(?:Z|[+-]\d\d:?\d\d)?)"?(?=\s*[,;|\t])'
)
_KNOWN: Final = {
    b"\x1f\x8b": "must be unpacked, it is compressed",
    b"\x89HDF": "must be CSV or Parquet, it is an HDF5 file",
    b"CDF\x01": "must be CSV or Parquet, it is a NetCDF file",
    b"%PDF": "must be CSV or Parquet, it is a PDF file",
    b"\xd0\xcf\x11\xe0": "must be .xlsx or CSV, it is an Excel file of an old version",
    b"MATLAB 5.0": "must be CSV or Parquet, it is a MATLAB file",
}


@dataclasses.dataclass(frozen=True)
class Table:
    """Columns of numbers, and their rows in the file."""

    names: tuple[str, ...]  # headings; empty strings without a header
    values: Floats  # shape (rows, columns); NaN for missing numbers
    rows: Indices  # lines of the file, from 1 (of a Parquet file: rows of the table)
    findings: tuple[Finding, ...] = ()
    # Index of each row among the lines that are not empty; unreadable lines leave gaps.
    order: Indices = dataclasses.field(default_factory=lambda: np.empty(0, np.intp))

    def __post_init__(self) -> None:
        """Mark readings that are infinite or too large as missing."""
        self.values[~(np.abs(self.values) <= LARGEST_READING)] = np.nan


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
    if data[:4] == b"PAR1" or path.suffix.lower() in {".parquet", ".pq"}:
        return _parquet(data, where), digest
    if data[:4] == WORKBOOK:
        text, columns, findings = sheet_text(data, where, MOST_BYTES)
        refuse_large(where, columns=columns)
        reader = dataclasses.replace(reader, delimiter="\t", decimal=reader.decimal or ".")
    else:
        text, findings = decoded(data, where)
    return parsed(text, reader, where, findings), digest


def _parquet(data: bytes, where: str) -> Table:
    """Return the table of a Parquet file, if its declared size is allowed."""
    try:
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
    except InputError:
        raise
    except ModuleNotFoundError:
        raise InputError(
            f"{where}: a Parquet file needs the extra pendmap[viewer] (pyarrow), or must be saved"
            " as CSV"
        ) from None
    except Exception as error:  # noqa: BLE001 (whatever a damaged file makes of the reader)
        raise InputError(f"{where}: is no Parquet file that can be read: {error}") from None


def table_of(frame: pd.DataFrame, where: str) -> Table:
    """Return the numbers of a DataFrame; an index of times, or one with a name, is a column too."""
    import pandas as pd

    index = frame.index
    if isinstance(index, pd.DatetimeIndex | pd.TimedeltaIndex):
        index = index.rename(TIME)
    if index.name is not None and index.name not in frame.columns:
        frame = frame.set_axis(index).reset_index()
    refuse_large(where, columns=frame.shape[1], size=8 * frame.size)
    if frame.size == 0:
        raise InputError(f"{where}: must have rows of numbers, it is empty")
    columns = []
    for k in range(frame.shape[1]):
        column = frame.iloc[:, k]
        if pd.api.types.is_datetime64_any_dtype(column):
            column = column - column.bfill().iloc[0]
        if pd.api.types.is_timedelta64_dtype(column):
            column = column.dt.total_seconds()
        elif isinstance(column.dtype, pd.CategoricalDtype):
            column = column.astype(object)
        numbers = pd.to_numeric(column, errors="coerce")
        if numbers.isna().all():
            dates = pd.to_datetime(column, errors="coerce", format="ISO8601", utc=True)
            numbers = (dates - dates.bfill().iloc[0]).dt.total_seconds()
        columns.append(numbers.to_numpy(dtype=float, na_value=np.nan))
    values = np.column_stack(columns)
    order = np.arange(values.shape[0])
    return Table(tuple(map(str, frame.columns)), values, order + 1, order=order)


def decoded(data: bytes, where: str) -> tuple[str, list[Finding]]:
    """Return the text of a file, without NUL bytes, and findings; InputError for other data."""
    findings: list[Finding] = []
    if not data.strip(b"\0 \t\r\n\xef\xbb\xbf"):
        raise InputError(f"{where}: must be a file with rows of numbers, it is empty")
    nuls = data.count(b"\0")
    many = nuls > MOST_NULS * len(data)
    if data[:2] in {b"\xff\xfe", b"\xfe\xff"}:
        return data.decode("utf-16", errors="replace"), findings
    if many and data[1::2].count(b"\0") > 0.9 * nuls:
        return data.decode("utf-16-le", errors="replace"), findings
    if nuls:
        data = data.replace(b"\0", b"")
        findings.append(finding_of("nul-bytes", number=counted(nuls, "NUL byte")))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if many or len(_CONTROLS.findall(text)) > MOST_CONTROLS * len(text):
        raise InputError(f"{where}: must be CSV (or other text) or Parquet, it is no text")
    return text, findings


def refuse_large(where: str, *, columns: int = 0, size: int = 0) -> None:
    """Raise InputError for a table with too many columns or bytes."""
    if columns > MOST_COLUMNS:
        raise InputError(f"{where}: must have at most {MOST_COLUMNS} columns, got {columns}")
    if size > MOST_BYTES:
        most, got = (f"{value / 2**20:.0f} MiB" for value in (MOST_BYTES, size))
        raise InputError(f"{where}: unpacks to {got}: must be at most {most}")


def parsed(text: str, reader: Reader, where: str, findings: list[Finding]) -> Table:
    """Return the table of a text; raise InputError if there are no rows of numbers."""
    every = enumerate(re.split(r"\r\n|\n|\r", text), 1)
    lines = [(k, line) for k, line in every if line.strip() and k > reader.skip_rows]
    if not lines:
        raise InputError(f"{where}: must be a file with rows of numbers, it is empty")
    # Lines that are too long are unreadable.
    lines = [(k, line if len(line) <= LONGEST_LINE else "?") for k, line in lines]
    lines, dated = without_dates(lines)
    delimiter, decimal, width = _form(lines, reader, where)
    cells, fits = list[str](), list[bool]()
    for _, line in lines:
        row = _row(line, delimiter, decimal, width)
        fits.append(row is not None)
        cells += row or ()
    columns = [cells[k::width] for k in range(width)]
    first = fits.index(True)
    names = _header([line for _, line in lines[:first]], delimiter, width)
    if len(names) != width:
        raise InputError(
            f"{where}: as many columns must have names as numbers, got {len(names)} with names and"
            f" {width} with numbers; decimal commas need another delimiter, like ;"
        )
    dropped = [k for (k, _), fit in zip(lines[first:], fits[first:], strict=True) if not fit]
    if dropped:
        shown = listed([str(k) for k in dropped], 3)
        number, where = counted(len(dropped), "line"), f"line {shown}"
        findings.append(finding_of("unreadable-lines", where=where, lines=number, width=width))
    if dated and any(names) and TIME not in names:
        names = (TIME, *names[1:])
    order = np.flatnonzero(fits)
    numbers = [_numbers(column, decimal) for column in columns]
    places = np.array([lines[k][0] for k in order])
    return Table(names, np.column_stack(numbers), places, tuple(findings), order - first)


def _numbers(column: list[str], decimal: str) -> Floats:
    """Return the numbers of a column; NaN for anything else."""
    import pandas as pd

    texts = pd.Series(column)
    if decimal != ".":
        texts = texts.str.replace(decimal, ".", regex=False)
    numbers = pd.to_numeric(texts, errors="coerce").to_numpy(dtype=float, copy=True)
    if np.isnan(numbers).all():
        words = texts.str.lower().map(_LEVELS)
        numbers = pd.to_numeric(words, errors="coerce").to_numpy(dtype=float, copy=True)
    return np.asarray(numbers)


def _split(line: str, delimiter: str) -> list[str]:
    """Return the parts of a line."""
    if delimiter == " ":
        return line.split()
    if '"' in line:
        return [part.strip() for part in next(csv.reader([line], delimiter=delimiter))]
    return [part.strip() for part in line.split(delimiter)]


def _is_row(parts: list[str], decimal: str) -> int:
    """Return the number of numbers in a line; 0 if any part is neither number nor empty."""
    numbers = 0
    for part in parts if len(parts) <= MOST_COLUMNS else ():
        text = part if decimal == "." else part.replace(decimal, ".", 1) if "." not in part else "?"
        if _NUMBER.fullmatch(text):
            numbers += 1
        elif part.lower() not in _NOTHING and part.lower() not in _LEVELS:
            return 0
    return numbers


def _form(lines: list[tuple[int, str]], reader: Reader, where: str) -> tuple[str, str, int]:
    """Return delimiter, decimal sign and number of columns with which most lines are rows."""
    step = max(len(lines) // SAMPLE_LINES, 1)
    # Uneven sampling, since loggers of several sensors alternate rows of each kind.
    places = [k * step + int(step * (0.618 * k % 1)) for k in range(len(lines) // step)]
    sample = [lines[k][1] for k in places]
    form = _common(sample, reader, 2) or _common(sample, reader, 1)
    if form == (",", ".", 2) and reader.decimal is None and _fractions(sample):
        return ";", ",", 1
    least = LEAST_ROWS * len(sample)
    if form is not None:
        fitting = sum(_row(line, *form) is not None for line in sample)
        if fitting >= min(least, len(sample) - _HEADS):
            return form
    for decimal in (".", ","):
        alone = (reader.delimiter or (";" if decimal == "," else ","), decimal, 1)
        if sum(_row(line, *alone) is not None for line in sample) > least:
            return alone
    advice = "; the delimiter can be given in [reader] of experiment.toml" if form else ""
    raise InputError(
        f"{where}: must be CSV with a time and an angle, got no rows of numbers{advice}"
    )


def _fractions(sample: list[str]) -> bool:
    """Return whether the digits after the commas are decimals: some begin with 0."""
    parts = [row for line in sample if (row := _row(line, ",", ".", 2))]
    digits = all(re.fullmatch(r"\s*[+-]?\d+", a) and re.fullmatch(r"\d+\s*", b) for a, b in parts)
    return digits and any(b.startswith("0") and len(b.strip()) > 1 for _, b in parts)


def _common(sample: list[str], reader: Reader, least: int) -> tuple[str, str, int] | None:
    """Return the most common delimiter, decimal sign and width of lines with ``least`` numbers."""
    most, best = 0, None
    quoted = any('"' in line for line in sample)
    signs = [(reader.delimiter or sign, reader.decimal or decimal) for sign, decimal in SEPARATORS]
    for delimiter, decimal in dict.fromkeys(signs):
        if delimiter == decimal and not quoted:
            continue
        widths = Counter(
            len(parts)
            for parts in (_split(line, delimiter) for line in sample)
            if len(parts) > 1 and _is_row(parts, decimal) >= least
        )
        for width, count in widths.most_common(1):
            if count > most:
                most, best = count, (delimiter, decimal, width)
    return best


def _row(line: str, delimiter: str, decimal: str, width: int) -> list[str] | None:
    """Return the parts of a line if it is a row of this width, else None."""
    parts = _split(line, delimiter)
    return parts if len(parts) == width and _is_row(parts, decimal) else None


def _header(lines: list[str], delimiter: str, width: int) -> tuple[str, ...]:
    """Return the column names, with units from a separate line; empty ones without a header."""
    heads = [_split(line.lstrip("#% "), delimiter) for line in lines[-3:]]
    heads = [[part.strip('"') for part in head] for head in heads if len(head) > 1 or width == 1]
    if heads and delimiter == "," and len(heads[-1]) != width and len(heads[-1]) * 2 == width:
        return tuple(heads[-1])  # decimal commas between commas: refused by the caller
    heads = [head for head in heads if len(head) == width and any(head)]
    if not heads:
        return ("",) * width
    names = heads[-1]
    if len(heads) > 1 and all(re.fullmatch(r"[\(\[]?[^\d\s]{0,6}\d?[\)\]]?", n) for n in names):
        units = [name.strip("()[] ") for name in names]
        above = heads[-2]
        known = any(unit and c.has(unit) for unit in units for c in CHANNELS.values())
        if known and any(above):
            names = [f"{a} [{u}]" if u else a for a, u in zip(above, units, strict=True)]
    return tuple(names)


def without_dates(lines: list[tuple[int, str]]) -> tuple[list[tuple[int, str]], bool]:
    """Return lines whose dates, if most begin with one, are s since the first, and whether."""
    dates = [_DATE.match(line) for _, line in lines]
    if sum(date is not None for date in dates) <= LEAST_ROWS * len(lines):
        return lines, False
    first, seconds = None, list[tuple[int, str]]()
    for (number, line), date in zip(lines, dates, strict=True):
        if date is None:
            seconds.append((number, line))
            continue
        try:
            time = dt.datetime.fromisoformat(date[1].replace(",", "."))
            first = first or time
            since = repr((time - first) / dt.timedelta(seconds=1))
        except (ValueError, TypeError):  # the 31st of June; dates with zones and without
            return lines, False
        seconds.append((number, since.replace(".", date[2] or ".") + line[date.end() :]))
    return seconds, True
