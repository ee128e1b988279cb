"""Reading of workbooks up to a largest number of cells: ``.xlsx`` by openpyxl, ``.xls`` by xlrd."""

from __future__ import annotations

import datetime as dt
import io
import zipfile
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError
from pendmap.records.findings import finding_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from pendmap.records.experiment import Finding

    Row = Sequence[object]
    """Values of a row's cells; None where a cell is empty."""

# Reader of a workbook by its first bytes
WORKBOOKS: Final = {b"PK\x03\x04": "openpyxl", b"\xd0\xcf\x11\xe0": "xlrd"}
MOST_CELLS: Final = 5_000_000  # Most cells of all sheets; a row has one more
_MOST_ROWS: Final = 2**20  # Rows that Excel has
_EPOCH: Final = dt.datetime(1970, 1, 1)  # noqa: DTZ001 (workbooks have no time zone)


def sheet_text(data: bytes, where: str, most: int) -> tuple[str, int, list[Finding]]:
    """Return the sheet with the most numbers as text with tabs, its columns, and findings."""
    engine = WORKBOOKS[data[:4]]
    try:
        sheets = _bounded(_xlsx(data, where, most) if engine == "openpyxl" else _xls(data), where)
    except InputError:
        raise
    except ImportError:
        raise InputError(
            f"{where}: an Excel file must be read with {engine}: pip install pendmap[excel]; or"
            " saved as CSV"
        ) from None
    except Exception as error:  # noqa: BLE001 (whatever a damaged file makes of the reader)
        raise InputError(f"{where}: is no Excel file that can be read: {error}") from None
    numbers = {name: sum(sum(map(_is_number, row)) for row in sheets[name]) for name in sheets}
    if not any(numbers.values()):
        raise InputError(f"{where}: a sheet must have rows of numbers, got none")
    name = max(numbers, key=numbers.__getitem__)
    rows = sheets[name]
    filled = sorted({k for row in rows for k, cell in enumerate(row) if cell is not None})
    lines = ("\t".join(_text(row[k]) if k < len(row) else "" for k in filled) for row in rows)
    chosen = finding_of("sheet-chosen", number=len(sheets), sheet=name)
    findings = [chosen] if len(sheets) > 1 else []
    return "\n".join(lines) + "\n", len(filled), findings


def _bounded(
    sheets: Iterable[tuple[str, Iterable[Row]]], where: str
) -> dict[str, list[list[object]]]:
    """Return the rows of each sheet up to their last cells; InputError for too many cells."""
    every: dict[str, list[list[object]]] = {}
    count = 0
    for name, rows in sheets:
        every[name] = []
        for row in rows:
            filled = [k for k, cell in enumerate(row) if cell is not None]
            every[name].append([*row[: filled[-1] + 1]] if filled else [])
            count += 1 + len(every[name][-1])
            if count > MOST_CELLS:
                raise InputError(
                    f"{where}: must have at most {MOST_CELLS} cells, got more: save it as CSV"
                )
    return every


def _xlsx(data: bytes, where: str, most: int) -> Iterator[tuple[str, Iterable[Row]]]:
    """Yield names and rows of the sheets of an ``.xlsx``."""
    import openpyxl

    with zipfile.ZipFile(io.BytesIO(data)) as packed:
        size = sum(part.file_size for part in packed.infolist())
    if size > most:
        most, size = most // 2**20, size // 2**20
        raise InputError(f"{where}: unpacks to {size} MiB: must be at most {most} MiB")
    book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
    for sheet in book.worksheets:
        sheet.reset_dimensions()  # loggers write wrong ones
        rows = sheet.iter_rows(max_row=_MOST_ROWS, values_only=True)
        errors = ("#DIV/0!", "#N/A", "#NAME?", "#NULL!", "#NUM!", "#REF!", "#VALUE!")
        yield sheet.title, ([None if cell in errors else cell for cell in row] for row in rows)


def _xls(data: bytes) -> Iterator[tuple[str, Iterable[Row]]]:
    """Yield names and rows of the sheets of an ``.xls``."""
    import xlrd

    book = xlrd.open_workbook(file_contents=data, on_demand=True, ragged_rows=True)

    def value(kind: int, cell: object) -> object:
        if kind in {xlrd.XL_CELL_EMPTY, xlrd.XL_CELL_BLANK, xlrd.XL_CELL_ERROR}:
            return None
        return xlrd.xldate_as_datetime(cell, book.datemode) if kind == xlrd.XL_CELL_DATE else cell

    for name in book.sheet_names():
        sheet = book.sheet_by_name(name)
        every = range(sheet.nrows)
        yield name, ([*map(value, sheet.row_types(k), sheet.row_values(k))] for k in every)
        book.unload_sheet(name)


def _is_number(cell: object) -> bool:
    """Return whether a cell has a number, a date or a time."""
    kinds = (int, float, dt.datetime, dt.time, dt.timedelta)
    return isinstance(cell, kinds) and not isinstance(cell, bool) and cell == cell  # noqa: PLR0124


def _text(cell: object) -> str:
    """Return a cell as text: numbers in full, times in s."""
    if cell is None or cell != cell:  # noqa: PLR0124 (what is no number or no date)
        return ""
    if isinstance(cell, dt.datetime):
        # timestamp() would apply daylight saving time, which the record does not contain.
        return repr((cell - _EPOCH).total_seconds())
    if isinstance(cell, dt.time):
        return repr(3600 * cell.hour + 60 * cell.minute + cell.second + 1e-6 * cell.microsecond)
    if isinstance(cell, dt.timedelta):
        return repr(cell.total_seconds())
    if isinstance(cell, (int, float)) and not isinstance(cell, bool):
        return repr(float(cell))
    return " ".join(str(cell).split())
