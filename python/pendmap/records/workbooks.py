"""Reading of ``.xlsx`` workbooks by openpyxl, up to a largest number of cells."""

from __future__ import annotations

import datetime as dt
import io
import zipfile
from typing import TYPE_CHECKING, Any, Final

from pendmap.errors import InputError
from pendmap.records.experiment import finding_of

if TYPE_CHECKING:
    from pendmap.records.experiment import Finding

WORKBOOK: Final = b"PK\x03\x04"  # First bytes of a workbook
MOST_CELLS: Final = 5_000_000  # Most cells of a sheet; a row has one more
_MOST_ROWS: Final = 2**20  # Rows that Excel has
_EPOCH: Final = dt.datetime(1970, 1, 1)  # noqa: DTZ001 (workbooks have no time zone)
_ERRORS: Final = ("#DIV/0!", "#N/A", "#NAME?", "#NULL!", "#NUM!", "#REF!", "#VALUE!")


def sheet_text(data: bytes, where: str, most: int) -> tuple[str, int, list[Finding]]:
    """Return the sheet with the most numbers as text with tabs, its columns, and findings."""
    try:
        import openpyxl

        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            size = sum(part.file_size for part in packed.infolist())
        if size > most:
            most, size = most // 2**20, size // 2**20
            raise InputError(  # noqa: TRY301 (passed on below)
                f"{where}: unpacks to {size} MiB: must be at most {most} MiB"
            )
        book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
        sheets = {sheet.title: _rows(sheet, where) for sheet in book.worksheets}
    except InputError:
        raise
    except ImportError:
        raise InputError(
            f"{where}: an Excel file must be read with openpyxl: pip install pendmap[excel]; or"
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


def _rows(sheet: Any, where: str) -> list[list[object]]:  # noqa: ANN401 (a sheet of openpyxl)
    """Return the rows of a sheet up to their last cells; InputError for too many cells."""
    sheet.reset_dimensions()  # loggers write wrong ones
    rows, count = list[list[object]](), 0
    for row in sheet.iter_rows(max_row=_MOST_ROWS, values_only=True):
        cells = [None if cell in _ERRORS else cell for cell in row]
        while cells and cells[-1] is None:
            cells.pop()
        rows.append(cells)
        count += 1 + len(cells)
        if count > MOST_CELLS:
            raise InputError(
                f"{where}: must have at most {MOST_CELLS} cells, got more: save it as CSV"
            )
    return rows


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
