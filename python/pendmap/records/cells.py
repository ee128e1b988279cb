"""Cells of a text table: what is a number, and columns of numbers, times or words."""

from __future__ import annotations

import csv
import dataclasses
import re
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.dates import clock_of, is_clock

if TYPE_CHECKING:
    import pandas as pd

    from pendmap.signal import Floats, Indices, Mask

_NOTHING: Final = frozenset(
    (
        *("", "nan", "na", "n/a", "null", "none", "-", "--", "inf", "+inf", "-inf", "infinity"),
        *("#n/a", "#div/0!", "#name?", "#null!", "#num!", "#ref!", "#value!"),  # of Excel
    )
)
# Words that loggers write for the levels of a trigger
_LEVELS: Final = {
    **dict.fromkeys(("true", "high", "on"), 1.0),
    **dict.fromkeys(("false", "low", "off"), 0.0),
}
_PLAIN: Final = {
    ".": r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eEdD][+-]?[0-9]+)?",
    ",": r"[+-]?(?:[0-9]+(?:,[0-9]+)?|,[0-9]+)(?:[eEdD][+-]?[0-9]+)?",
}
_OTHER: Final = {".": ",", ",": r"\."}
_NUMBER: Final = {sign: re.compile(plain) for sign, plain in _PLAIN.items()}
# A number between a label and a unit, as in "t = 0.04 s"
_LABELLED: Final = {
    sign: re.compile(
        rf"(?P<label>(?:[^\W\d][^:=]{{0,30}}[:=]\s*)?){plain}"
        r"(?P<unit>(?:\s*(?:[^\W\d_]|[°%])[^\s,;:|=]*)?)"
    )
    for sign, plain in _PLAIN.items()
}
# A number with its thousands set apart
_GROUPED: Final = {
    sign: re.compile(
        rf"[+-]?[1-9][0-9]{{0,2}}(?:(?P<set>{_OTHER[sign]}|[' ])[0-9]{{3}})"
        rf"(?:(?P=set)[0-9]{{3}})*(?P<rest>{re.escape(sign)}[0-9]*)?"
    )
    for sign in _PLAIN
}
_DOUBT: Final = 0.9  # Weight of a number like 1,234, which may be 1.234


@dataclasses.dataclass(frozen=True)
class Column:
    """Readings of a column; ``base`` is to be added to the values."""

    kind: str  # number, clock or text
    values: Floats  # NaN for anything else
    odd: Mask  # cells that are neither missing nor of the kind
    base: float = 0.0
    label: str = ""  # text before each number
    unit: str = ""  # text behind each number
    parts: str = ""  # of a clock: day, time
    wrap: int = 0  # s after which a clock begins again

    @property
    def filled(self) -> Mask:
        """Cells that are not missing."""
        return self.odd | np.isfinite(self.values)

    def at(self, rows: Indices) -> Column:
        """Return the column at some rows."""
        return dataclasses.replace(self, values=self.values[rows], odd=self.odd[rows])


def split(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line."""
    if '"' in line:
        line = " ".join(line.split()) if delimiter == " " else line
        return [part.strip() for part in next(csv.reader([line], delimiter=delimiter))]
    if delimiter == " ":
        return line.split()
    return [part.strip() for part in line.split(delimiter)]


def weight(cell: str, decimal: str) -> float | None:
    """Return how surely a cell is a number or a time, 0 for a text; None if it is missing."""
    if _NUMBER[decimal].fullmatch(cell):
        return 1.0
    if cell.lower() in _NOTHING:
        return None
    grouped = _GROUPED[decimal].fullmatch(cell)
    if grouped:
        return 1.0 if grouped["rest"] or grouped["set"] in "' " else _DOUBT
    known = is_clock(cell) or cell.lower() in _LEVELS or _LABELLED[decimal].fullmatch(cell)
    return 1.0 if known else 0.0


def column_of(cells: list[str], decimal: str) -> Column:
    """Return a column of the kind of most of its cells."""
    import pandas as pd

    texts = pd.Series(cells, dtype=str)
    values, base = _numbers(texts, decimal)
    odd = np.isnan(values)
    odd[odd] = ~texts[odd].str.lower().isin(_NOTHING).to_numpy()
    if not odd.any():
        return Column("number", values, odd, base)
    present = texts[odd | ~np.isnan(values)]
    for pattern, drop, insert in _respelled(decimal):
        fits = present.str.fullmatch(pattern).to_numpy(dtype=bool)
        if fits[int(np.argmax(fits)) :].all():  # below the names
            values, base = _numbers(texts.str.replace(drop, insert, regex=True), decimal)
            return Column("number", values, odd & np.isnan(values), base)
    if 2 * odd.sum() <= present.size:
        return Column("number", values, odd, base)
    words = texts[odd]
    some = words[:: max(words.size // 50, 1)]
    clock = clock_of(cells) if 2 * some.map(is_clock).sum() > some.size else None
    if clock is not None:
        since, parts, wrap = clock
        return Column("clock", since, odd & np.isnan(since), parts=parts, wrap=wrap)
    levels = words.str.lower().map(_LEVELS).to_numpy(dtype=float)
    if 2 * np.isfinite(levels).sum() > words.size:
        values[odd] = levels
        return Column("number", values, odd & np.isnan(values))
    match = _LABELLED[decimal].fullmatch(words.iloc[words.size // 2])
    if match:
        label, unit = match["label"], match["unit"]
        bare = texts.str.removeprefix(label).str.removesuffix(unit)
        values, base = _numbers(bare, decimal)
        if 2 * np.isnan(values[odd]).sum() <= words.size:
            return Column(
                *("number", values, odd & np.isnan(values), base),
                *(label.strip(" \t:="), unit.strip()),
            )
    return Column("text", np.full(len(cells), np.nan), odd)


def _numbers(texts: pd.Series[str], decimal: str) -> tuple[Floats, float]:
    """Return plain numbers, NaN for anything else, and the base of whole ones beyond 2^53."""
    import pandas as pd

    if decimal != ".":
        texts = texts.mask(texts.str.contains(".", regex=False), "?")
        texts = texts.str.replace(decimal, ".", regex=False)
    numbers = pd.to_numeric(texts, errors="coerce")
    if numbers.dtype == np.int64 and numbers.size and abs(numbers.iloc[0]) > 2**53:
        return (numbers - numbers.iloc[0]).to_numpy(dtype=float), float(numbers.iloc[0])
    return numbers.to_numpy(dtype=float, copy=True), 0.0


def _respelled(decimal: str) -> list[tuple[str, str, str]]:
    """Return spellings of all cells of a column: pattern, what is replaced, and by what."""
    short = rf"[+-]?[0-9]{{1,3}}(?:{re.escape(decimal)}[0-9]*)?"
    spellings = [(_PLAIN[decimal], "[dD]", "e")]
    for sign in (_OTHER[decimal], "'", " "):
        grouped = rf"[+-]?[1-9][0-9]{{0,2}}(?:{sign}[0-9]{{3}})+(?:{re.escape(decimal)}[0-9]*)?"
        spellings.append((f"(?:{short}|{grouped})", sign, ""))
    return spellings
