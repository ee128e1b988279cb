"""Files of programs: projects of Tracker, vectors of MATLAB, sheets of Excel and OpenDocument."""

from __future__ import annotations

import cmath
import datetime as dt
import io
import itertools
import math
import struct
import zipfile
import zlib
from typing import TYPE_CHECKING, Any, Final
from xml.etree import ElementTree as ET

import numpy as np

from pendmap.errors import InputError
from pendmap.formatting import listed
from pendmap.tables.findings import finding_of
from pendmap.tables.table import readable, refuse_large

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    import pandas as pd

    from pendmap.signal import Floats
    from pendmap.tables.findings import Finding


TRACKER: Final = b"org.opensourcephysics.cabrillo.tracker.TrackerPanel"
_MASS: Final = "org.opensourcephysics.cabrillo.tracker.PointMass"
_NAMED: Final = ".//property[@name='{}']"


def tracker_frame(data: bytes, where: str) -> tuple[pd.DataFrame, tuple[Finding, ...]]:
    """Return time, x and y (up) of the point mass with the most marks, in the frame of the axes.

    Frame n is at ``t = start + (n - first) dt``. A mark (x, y) in px is at distance ``d = ((x - x0)
    / sx, (y0 - y) / sy)`` from the origin, turned back by the angle of the axes.
    """
    import pandas as pd

    with readable(where, "project of Tracker"):
        project = ET.fromstring(data)  # noqa: S314 (expat limits the growth of entities)
        interval = 1e-3 * float(_property(project, "delta_t", "nan"))
        start = 1e-3 * float(_property(project, "starttime", "0"))
        first = int(_property(project, "startframe", "0"))
        axes = _frames(project, f"{_NAMED.format('coords')}/object")
        masses = project.iterfind(f".//object[@class='{_MASS}']")
        marks = {_property(mass, "name", "?"): _frames(mass, ".") for mass in masses}
    name = max(marks, key=lambda mass: len(marks[mass]), default="")
    if not marks or not marks[name] or not axes or not interval > 0:
        raise InputError(
            f"{where}: must have a point mass with marks, axes and a frame rate: export the table"
            " of the point mass from Tracker as text"
        )
    unit, rows = _property(project, "length_unit", "px"), []
    for frame, mark in sorted(marks[name].items()):
        system = axes[max((k for k in axes if k <= frame), default=min(axes))]
        x = (mark["x"] - system.get("xorigin", 0.0)) / system.get("xscale", 1.0)
        y = (system.get("yorigin", 0.0) - mark["y"]) / system.get("yscale", 1.0)
        place = complex(x, y) * cmath.exp(-1j * math.radians(system.get("angle", 0.0)))
        rows.append((start + (frame - first) * interval, place.real, place.imag))
    others = listed([repr(other) for other in marks if other != name and marks[other]], 3)
    chosen = (finding_of("member-chosen", name=name, others=others),) if others else ()
    return pd.DataFrame(rows, columns=["t [s]", f"x [{unit}]", f"y [{unit}]"]), chosen


def _property(element: ET.Element, name: str, otherwise: str) -> str:
    """Return the text of the first property of a name."""
    return (element.findtext(_NAMED.format(name)) or "").strip() or otherwise


def _frames(element: ET.Element, holder: str) -> Mapping[int, Mapping[str, float]]:
    """Return the numbers of each frame of the ``framedata`` of an object."""
    return {
        int(frame.get("name", "").strip("[]")): {
            str(entry.get("name")): float(entry.text or "nan")
            for entry in frame.iterfind("object/property")
            if entry.get("type") in {"double", "int", "float"}
        }
        for frame in element.iterfind(f"{holder}/property[@name='framedata']/property")
    }


_FEWEST: Final = 5  # Fewest numbers of a column
_HEADER: Final = 128  # Bytes before the first variable
_COMPRESSED: Final = 15  # Type of a compressed variable
_SAVE: Final = "save it as CSV: writematrix([t theta], 'run.csv')"


def matlab_frame(data: bytes, where: str, most: int) -> pd.DataFrame:
    """Return the vectors of the most common length, the longest of these, as columns.

    A matrix is its columns; one alone has no names, so that its first column is the time.
    """
    import pandas as pd

    with readable(where, "MATLAB file"):
        if data.startswith(b"MATLAB 7.3"):
            import h5py

            with h5py.File(io.BytesIO(data)) as file:
                vectors = dict(_vectors("", file))
        else:
            from scipy.io import loadmat

            _refuse_bomb(data, where, most)
            content = loadmat(io.BytesIO(data), simplify_cells=True)
            vectors = dict(_vectors("", {k: v for k, v in content.items() if k[:2] != "__"}))
    sizes = [values.size for values in vectors.values()]
    if not sizes:
        raise InputError(f"{where}: must have vectors of {_FEWEST} numbers or more: {_SAVE}")
    size = max(sizes, key=lambda n: (sizes.count(n), n))
    columns = {name: values for name, values in vectors.items() if values.size == size}
    frame = pd.DataFrame(columns)
    if len({name.rpartition(" ")[0] for name in columns}) == 1 and " " in next(iter(columns)):
        frame.columns = [""] * len(columns)
    return frame


def _vectors(name: str, value: Any) -> Iterator[tuple[str, Floats]]:  # noqa: ANN401 (any variable)
    """Yield the vectors of a variable, with the name of the innermost field."""
    if hasattr(value, "items"):
        for key, part in value.items():
            if not key.startswith("#"):
                yield from _vectors(key, part)
    elif isinstance(value, list):
        for k, part in enumerate(value, 1):
            yield from _vectors(f"{name}{k}", part)
    else:
        array = np.asarray(value).squeeze()
        if array.dtype.kind not in "biuf" or array.ndim not in {1, 2} or max(array.shape) < _FEWEST:
            return
        if array.ndim == 1:
            yield name, array.astype(float)
            return
        rows = array.T if array.shape[0] >= array.shape[1] else array
        yield from ((f"{name} {k}", row.astype(float)) for k, row in enumerate(rows, 1))


def _refuse_bomb(data: bytes, where: str, most: int) -> None:
    """Raise InputError for variables that unpack to too many bytes."""
    tag = struct.Struct("<II" if data[126:128] == b"IM" else ">II")
    place, size = _HEADER, 0
    while place + tag.size <= len(data):
        kind, length = tag.unpack_from(data, place)
        packed, place = data[place + 8 : place + 8 + length], place + 8 + length
        if kind == _COMPRESSED:
            size += len(zlib.decompressobj().decompress(packed, most + 1 - size))
        if size > most:
            raise InputError(f"{where}: unpacks to more than {most / 2**20:.0f} MiB")


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
