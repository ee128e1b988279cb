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
_DATES: Final = (dt.datetime, dt.time, dt.timedelta)


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


def _rows(sheet: Any, where: str) -> list[list[object]]:  # noqa: ANN401 (a sheet of openpyxl)
    """Return the rows of a sheet up to their last cells; InputError for too many cells."""
    sheet.reset_dimensions()  # loggers write wrong ones
    rows, count = list[list[object]](), 0
    for row in sheet.iter_rows(max_row=_MOST_ROWS, values_only=True):
        cells = list(row)
        while cells and cells[-1] is None:
            cells.pop()
        rows.append(cells)
        count += 1 + len(cells)
        if count > MOST_CELLS:
            raise InputError(
                f"{where}: must have at most {MOST_CELLS} cells, got more: save it as CSV"
            )
    return rows


def _text(cell: object) -> str:
    """Return a cell as text: dates and times in s."""
    from openpyxl.utils.datetime import to_excel

    if isinstance(cell, _DATES):
        return repr(round(86400 * to_excel(cell), 6))
    return "" if cell is None else " ".join(str(cell).split())
