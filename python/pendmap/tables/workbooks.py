"""Reading of ``.xlsx`` workbooks by openpyxl and of ``.ods``, up to a largest number of cells."""

from __future__ import annotations

import datetime as dt
import io
import itertools
import zipfile
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError
from pendmap.tables.findings import finding_of
from pendmap.tables.table import readable, refuse_large

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from xml.etree import ElementTree as ET

    from pendmap.tables.findings import Finding

MOST_CELLS: Final = 5_000_000  # Most cells of a sheet; a row has one more
_MISSING: Final = (
    "an Excel file must be read with openpyxl: pip install pendmap[excel]; or saved as CSV"
)
_MOST_ROWS: Final = 2**20  # Rows that Excel has
_NUMBERS: Final = (int, float, dt.datetime, dt.time, dt.timedelta)
_TABLE: Final = "{urn:oasis:names:tc:opendocument:xmlns:table:1.0}"
_OFFICE: Final = "{urn:oasis:names:tc:opendocument:xmlns:office:1.0}"
_CONTENT: Final = "content.xml"  # Part of an ``.ods`` file that has the cells
_MOST_COLUMNS: Final = 2**14  # Columns that Excel has


def is_workbook(data: bytes, where: str) -> bool:
    """Return whether a zip archive is a workbook."""
    with readable(where, "Excel or zip file"):
        names = zipfile.ZipFile(io.BytesIO(data)).namelist()
    return "[Content_Types].xml" in names or {"mimetype", _CONTENT} <= set(names)


def sheet_text(data: bytes, where: str) -> tuple[str, list[Finding]]:
    """Return the sheet with the most numbers as text with tabs, and findings."""
    sheets: dict[str, list[Sequence[object]]] = {}
    count = 0
    with readable(where, "workbook", _MISSING):
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            names = packed.namelist()
            refuse_large(where, size=sum(part.file_size for part in packed.infolist()))
        for name, rows in _open_document(data) if _CONTENT in names else _excel(data):
            sheets[name] = []
            for row in map(_filled, rows):
                sheets[name].append(row)
                count += len(row) + 1
                if count > MOST_CELLS:
                    raise InputError(
                        f"{where}: must have at most {MOST_CELLS} cells, got more: save it as CSV"
                    )
    numbers = {
        name: sum(isinstance(cell, _NUMBERS) for row in rows for cell in row)
        for name, rows in sheets.items()
    }
    if not any(numbers.values()):
        raise InputError(f"{where}: a sheet must have rows of numbers, got none")
    name = max(numbers, key=numbers.__getitem__)
    rows = sheets[name]
    filled = sorted({k for row in rows for k, cell in enumerate(row) if cell is not None})
    refuse_large(where, columns=len(filled))
    lines = ("\t".join(_text(row[k]) if k < len(row) else "" for k in filled) for row in rows)
    chosen = finding_of("sheet-chosen", number=len(sheets), sheet=name)
    findings = [chosen] if len(sheets) > 1 else []
    return "\n".join(lines) + "\n", findings


def _excel(data: bytes) -> Iterator[tuple[str, Iterable[Sequence[object]]]]:
    """Yield the name and the rows of each sheet of an ``.xlsx`` file."""
    import openpyxl

    for sheet in openpyxl.load_workbook(
        io.BytesIO(data), read_only=True, data_only=True
    ).worksheets:
        sheet.reset_dimensions()  # loggers write wrong ones
        yield sheet.title, sheet.iter_rows(max_row=_MOST_ROWS, values_only=True)


def _open_document(data: bytes) -> Iterator[tuple[str, Iterable[Sequence[object]]]]:
    """Yield the name and the rows of each sheet of an ``.ods`` file."""
    from xml.etree import ElementTree as ET

    with zipfile.ZipFile(io.BytesIO(data)) as packed:
        root = ET.fromstring(packed.read(_CONTENT))  # noqa: S314 (expat limits entities)
    for sheet in root.iter(f"{_TABLE}table"):
        yield (
            sheet.get(f"{_TABLE}name", "?"),
            itertools.chain.from_iterable(map(_repeated, sheet.iter(f"{_TABLE}table-row"))),
        )


def _repeated(row: ET.Element) -> Iterator[Sequence[object]]:
    """Yield a row as often as it is repeated; an empty one once."""
    cells = ((_value(cell), cell.get(f"{_TABLE}number-columns-repeated", "1")) for cell in row)
    values = (value for value, times in cells for _ in range(int(times)))
    whole = _filled(list(itertools.islice(values, _MOST_COLUMNS)))
    repeated = int(row.get(f"{_TABLE}number-rows-repeated", "1"))
    return itertools.repeat(whole, repeated if whole else 1)


def _filled(row: Sequence[object]) -> Sequence[object]:
    """Return a row up to its last cell."""
    return row[: max((k for k, cell in enumerate(row, 1) if cell is not None), default=0)]


def _value(cell: ET.Element) -> object:
    """Return the value of a cell of an ``.ods`` file; a duration in s."""
    import pandas as pd

    kind = cell.get(f"{_OFFICE}value-type")
    if kind == "time":
        duration = cell.get(f"{_OFFICE}time-value", "").replace(",", ".")
        return pd.Timedelta(duration).total_seconds()
    if kind in {"float", "percentage", "currency"}:
        return float(cell.get(f"{_OFFICE}value", "nan"))
    return kind and (cell.get(f"{_OFFICE}date-value") or "".join(cell.itertext()))


def _text(cell: object) -> str:
    """Return a cell as text: durations in s, dates as ISO 8601 has them."""
    if isinstance(cell, dt.timedelta):
        return repr(cell.total_seconds())
    return "" if cell is None else " ".join(str(cell).split())
