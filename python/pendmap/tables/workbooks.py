"""Reading of ``.xlsx`` workbooks by openpyxl and of ``.ods``, up to a largest number of cells."""

from __future__ import annotations

import datetime as dt
import io
import re
import zipfile
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError
from pendmap.tables.findings import finding_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from xml.etree import ElementTree as ET

    from pendmap.tables.findings import Finding

MOST_CELLS: Final = 5_000_000  # Most cells of a sheet; a row has one more
_MOST_ROWS: Final = 2**20  # Rows that Excel has
_DATES: Final = (dt.datetime, dt.time, dt.timedelta)
_TABLE: Final = "{urn:oasis:names:tc:opendocument:xmlns:table:1.0}"
_OFFICE: Final = "{urn:oasis:names:tc:opendocument:xmlns:office:1.0}"
_CONTENT: Final = "content.xml"  # Part of an ``.ods`` file that has the cells
_TIME: Final = re.compile(r"PT(\d+)H(\d+)M(\d+(?:[.,]\d+)?)S")


def is_workbook(data: bytes, where: str) -> bool:
    """Return whether a zip archive is a workbook."""
    try:
        names = zipfile.ZipFile(io.BytesIO(data)).namelist()
    except zipfile.BadZipFile as error:
        raise InputError(f"{where}: is no Excel or zip file that can be read: {error}") from None
    return "[Content_Types].xml" in names or {"mimetype", _CONTENT} <= set(names)


def sheet_text(data: bytes, where: str, most: int) -> tuple[str, int, list[Finding]]:
    """Return the sheet with the most numbers as text with tabs, its columns, and findings."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            names = packed.namelist()
            size = sum(part.file_size for part in packed.infolist())
        if size > most:
            most, size = most // 2**20, size // 2**20
            raise InputError(  # noqa: TRY301 (passed on below)
                f"{where}: unpacks to {size} MiB: must be at most {most} MiB"
            )
        sheets = _open_document(data, where) if _CONTENT in names else _excel(data, where)
    except InputError:
        raise
    except ImportError:
        raise InputError(
            f"{where}: an Excel file must be read with openpyxl: pip install pendmap[excel]; or"
            " saved as CSV"
        ) from None
    except Exception as error:  # noqa: BLE001 (whatever a damaged file makes of the reader)
        raise InputError(f"{where}: is no workbook that can be read: {error}") from None
    kinds = (int, float, *_DATES)
    numbers = {
        name: sum(isinstance(cell, kinds) for row in rows for cell in row)
        for name, rows in sheets.items()
    }
    if not any(numbers.values()):
        raise InputError(f"{where}: a sheet must have rows of numbers, got none")
    name = max(numbers, key=numbers.__getitem__)
    rows = sheets[name]
    filled = sorted({k for row in rows for k, cell in enumerate(row) if cell is not None})
    lines = ("\t".join(_text(row[k]) if k < len(row) else "" for k in filled) for row in rows)
    chosen = finding_of("sheet-chosen", number=len(sheets), sheet=name)
    findings = [chosen] if len(sheets) > 1 else []
    return "\n".join(lines) + "\n", len(filled), findings


def _excel(data: bytes, where: str) -> Mapping[str, list[list[object]]]:
    """Return the cells of the sheets of an ``.xlsx`` file."""
    import openpyxl

    book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
    sheets = {}
    for sheet in book.worksheets:
        sheet.reset_dimensions()  # loggers write wrong ones
        sheets[sheet.title] = _rows(sheet.iter_rows(max_row=_MOST_ROWS, values_only=True), where)
    return sheets


def _rows(rows: Iterable[Iterable[object]], where: str) -> list[list[object]]:
    """Return the rows of a sheet up to their last cells; InputError for too many cells."""
    filled, count = list[list[object]](), 0
    for row in rows:
        cells, missing = list[object](), 0
        for cell in row:
            missing += 1
            if cell is not None:
                count += missing
                _refuse_many(count, where)
                cells += [None] * (missing - 1) + [cell]
                missing = 0
        filled.append(cells)
        count += 1
        _refuse_many(count, where)
    return filled


def _refuse_many(count: int, where: str) -> None:
    if count > MOST_CELLS:
        raise InputError(f"{where}: must have at most {MOST_CELLS} cells, got more: save it as CSV")


def _open_document(data: bytes, where: str) -> Mapping[str, list[list[object]]]:
    """Return the cells of the sheets of an ``.ods`` file."""
    from xml.etree import ElementTree as ET

    with zipfile.ZipFile(io.BytesIO(data)) as packed, packed.open(_CONTENT) as content:
        root = ET.parse(content).getroot()  # noqa: S314 (expat limits the growth of entities)
    return {
        sheet.get(f"{_TABLE}name", "?"): _rows(_ods_rows(sheet), where)
        for sheet in root.iter(f"{_TABLE}table")
    }


def _ods_rows(sheet: ET.Element) -> Iterator[Iterable[object]]:
    """Yield the rows of a sheet; an empty row that is repeated once."""
    for row in sheet.iter(f"{_TABLE}table-row"):
        filled = any(cell.get(f"{_OFFICE}value-type") for cell in row)
        repeated = int(row.get(f"{_TABLE}number-rows-repeated", 1)) if filled else 1
        for _ in range(repeated):
            yield (
                value
                for cell in row
                for value in (_value(cell),)
                for _ in range(int(cell.get(f"{_TABLE}number-columns-repeated", 1)))
            )


def _value(cell: ET.Element) -> object:
    """Return the value of a cell of an ``.ods`` file; dates as text in ISO 8601."""
    kind = cell.get(f"{_OFFICE}value-type")
    if kind == "date":
        return cell.get(f"{_OFFICE}date-value")
    if kind == "time":
        parts = _TIME.fullmatch(cell.get(f"{_OFFICE}time-value", ""))
        if parts is None:
            return None
        seconds = float(parts[3].replace(",", "."))
        return dt.timedelta(hours=int(parts[1]), minutes=int(parts[2]), seconds=seconds)
    if kind in {"float", "percentage", "currency"}:
        return float(cell.get(f"{_OFFICE}value", "nan"))
    return None if kind is None else "".join(cell.itertext())


def _text(cell: object) -> str:
    """Return a cell as text: dates and times in s."""
    if isinstance(cell, dt.timedelta):
        return repr(cell.total_seconds())
    if isinstance(cell, _DATES):
        from openpyxl.utils.datetime import to_excel

        return repr(round(86400 * to_excel(cell), 6))
    return "" if cell is None else " ".join(str(cell).split())
