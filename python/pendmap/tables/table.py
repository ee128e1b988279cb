"""Decoding of text, and tables of DataFrames and of records in memory."""

from __future__ import annotations

import contextlib
import re
import sys
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.formatting import counted
from pendmap.tables.findings import finding_of
from pendmap.tables.text import MOST_COLUMNS, TIME, Table
from pendmap.tables.units import name_and_unit

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from pendmap.tables.findings import Finding

MOST_BYTES: Final = 2**30  # Largest file, and largest table in memory, bytes
MOST_CONTROLS: Final = 0.02  # Share of control characters above which a file is no text
MOST_NULS: Final = 0.2  # Share of NUL bytes above which a file is no text
_CHINESE: Final = re.compile(rb"(?:[\x00-\x7f]++|[\xa1-\xd7][\xa1-\xff])*+")  # of GB 2312
_CONTROLS: Final = re.compile(r"[\x01-\x08\x0b\x0e-\x1f\x7f]")


@contextlib.contextmanager
def readable(where: str, kind: str, missing: str = "") -> Iterator[None]:
    """Raise InputError for whatever a damaged file, or a missing package, makes of a reader."""
    try:
        yield
    except InputError:
        raise
    except ImportError:
        raise InputError(f"{where}: {missing}") from None
    except Exception as error:  # noqa: BLE001 (readers raise many kinds)
        raise InputError(f"{where}: is no {kind} that can be read: {error}") from None


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
        chinese = _CHINESE.fullmatch(data)
        text = data.decode("gb18030" if chinese else "latin-1", errors="replace")
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


def frame_of(records: Any, theta: Any = None) -> pd.DataFrame | None:  # noqa: ANN401 (any form)
    """Return arrays, or a table of pandas or xarray, as a DataFrame; None for other records."""
    import pandas as pd

    xarray = sys.modules.get("xarray")  # without it nothing is of its types
    if theta is not None:
        parts = {"t_s": records, "theta_rad": theta}
    elif xarray is not None and isinstance(records, xarray.DataArray | xarray.Dataset):
        if isinstance(records, xarray.DataArray):
            records = records.to_dataset(name=records.name or "theta_rad")
        along = max(records.sizes, key=records.sizes.__getitem__, default="")
        parts = {name: part for name, part in records.variables.items() if part.dims == (along,)}
    elif isinstance(records, pd.Series):
        return records.to_frame(_heading(records, "theta_rad"))
    else:
        return records if isinstance(records, pd.DataFrame) else None
    arrays = [np.asarray(values) for values in parts.values()]
    shapes = [array.shape for array in arrays]
    if any(len(shape) != 1 or shape != shapes[0] for shape in shapes):
        raise InputError(f"times and theta must be of one shape (N,), got {shapes}")
    heads = [_heading(values, str(name)) for name, values in parts.items()]
    return pd.DataFrame(dict(enumerate(arrays))).set_axis(heads, axis=1)


def _heading(values: Any, usual: str) -> str:  # noqa: ANN401 (an array)
    """Return the name of an array, with the unit that its attributes give."""
    name = str(getattr(values, "name", None) or usual)
    unit = str(getattr(values, "attrs", {}).get("units", "")).partition(" since ")[0]
    return f"{name_and_unit(name)[0]} [{unit}]" if unit else name
