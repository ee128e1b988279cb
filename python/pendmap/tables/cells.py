"""Cells of a text table: what is a number or a time, and columns of numbers, times or words."""

from __future__ import annotations

import csv
import dataclasses
import re
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.files.toml import packaged

if TYPE_CHECKING:
    import pandas as pd

    from pendmap.signal import Floats, Indices, Mask

_NOTHING: Final = frozenset(packaged("tables/words.toml")["nothing"])
# Words that loggers write for the levels of a trigger
_LEVELS: Final = {"true": 1.0, "high": 1.0, "on": 1.0, "false": 0.0, "low": 0.0, "off": 0.0}
_PLAIN: Final = {
    ".": r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eEdD][+-]?[0-9]+)?",
    ",": r"[+-]?(?:[0-9]+(?:,[0-9]+)?|,[0-9]+)(?:[eEdD][+-]?[0-9]+)?",
}
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
        rf"[+-]?[1-9][0-9]{{0,2}}(?P<set>[{other}' ])[0-9]{{3}}"
        rf"(?:(?P=set)[0-9]{{3}})*(?P<rest>[{sign}][0-9]*)?"
    )
    for sign, other in (".,", ",.")
}
_NINES: Final = (99, 999, 9999, 99_999, 99.99, 999.9, 999.99)  # Lost, beyond all readings
_DOUBT: Final = 0.9  # Weight of a number like 1,234, which may be 1.234
_DAY: Final = (
    r"\d{4}[-./]\d{1,2}[-./]\d{1,2}|\d{1,2}[-./]\d{1,2}[-./](?:\d{4}|\d\d)"
    r"|\d{1,2}[-./ ]{1,2}[A-Za-z]{3,9}[-., ]{1,2}\d{4}|[A-Za-z]{3,9}\.? \d{1,2},? \d{4}|20\d{6}"
)
_CLOCK: Final = re.compile(
    rf"(?P<day>{_DAY})?(?:(?:^|(?<=\d)[T ,_]+)(?P<clock>(?:\d{{1,3}}:)?\d{{1,3}}:\d\d)"
    r"(?:[.,](?P<point>\d+)|:(?P<ms>\d{2,3}))?(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?"
    r" ?(?P<zone>Z|UTC|[+-]\d\d(?::?\d\d)?)?)?"
)
_DAY_S: Final = 86_400
# Counts since 1904 or 1970 in s, ms, us, ns, in days since 1900 (Excel) or the year 0: range, unit
_SINCE: Final = (
    *((9.4e8 * k, 4.3e9 * k, 1 / k) for k in (1, 1e3, 1e6, 1e9)),
    *((3.6e4, 5.2e4, _DAY_S), (7.3e5, 7.5e5, _DAY_S)),
)
_LONGEST_STEP: Final = 0.9  # Longest usual interval of a record, s: counters of ms have 1 and more
_RISES: Final = 0.9  # Least share of the intervals of a clock that are not negative


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

    def at(self, rows: Indices) -> Column:
        """Return the column at some rows."""
        return dataclasses.replace(self, values=self.values[rows], odd=self.odd[rows])


def split(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line; an arrow or brackets set the time of a log apart."""
    line = re.sub(r"^\[([^]]+)\] ", r"\1 -> ", line).replace(" -> ", delimiter, 1)
    if '"' in line:
        line = " ".join(line.split()) if delimiter == " " else line
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    return line.split() if delimiter == " " else line.split(delimiter)


def weight(cell: str, decimal: str) -> float | None:
    """Return how surely a cell is a number or a time, 0 for a text; None if it is missing."""
    cell = cell.strip()
    if _NUMBER[decimal].fullmatch(cell):
        return 1.0
    if cell.lower() in _NOTHING:
        return None
    grouped = _GROUPED[decimal].fullmatch(cell)
    if grouped:
        doubt = _DOUBT * (grouped["set"] != " ")  # 1 234 may be two numbers
        return 1.0 if grouped["rest"] or grouped["set"] == "'" else doubt
    known = _CLOCK.fullmatch(cell) or cell.lower() in _LEVELS or _LABELLED[decimal].fullmatch(cell)
    return 1.0 if known else 0.0


def column_of(cells: list[str], decimal: str) -> Column:
    """Return a column of the kind of most of its cells."""
    import pandas as pd

    texts = pd.Series(cells, dtype=str).str.strip()
    values, base = _numbers(texts, decimal)
    odd = np.isnan(values)
    odd[odd] = ~texts[odd].str.lower().isin(_NOTHING).to_numpy()
    words = texts[odd]
    size, nines = np.abs(values), np.isin(np.abs(values), _NINES)
    others = np.max(size, where=~nines & np.isfinite(size), initial=0.0)
    values[nines & (size / 2 > others)] = np.nan
    if words.empty:
        return Column("number", values, odd, base)
    middle = words.iloc[words.size // 2]
    grouped = _GROUPED[decimal].fullmatch(middle)
    if grouped:
        fits = texts.str.fullmatch(_GROUPED[decimal]).to_numpy(dtype=bool)
        rest = odd & ~fits
        if not rest[int(np.argmax(fits)) :].any():  # below the names
            values, base = _numbers(texts.str.replace(grouped["set"], ""), decimal)
            return Column("number", values, rest, base)
    if 2 * words.size <= np.isfinite(values).sum() + words.size:
        return Column("number", values, odd, base)
    clock = clock_of(texts) if _CLOCK.fullmatch(middle) else None
    if clock is not None:
        since, parts = clock
        return Column("clock", since, odd & np.isnan(since), parts=parts)
    match, label, unit = _LABELLED[decimal].fullmatch(middle), "", ""
    if middle.lower() in _LEVELS:
        values = texts.str.lower().map(_LEVELS).to_numpy(dtype=float)
    elif match:
        label, unit = match["label"], match["unit"]
        values, base = _numbers(texts.str.removeprefix(label).str.removesuffix(unit), decimal)
    if 2 * np.isfinite(values[odd]).sum() > words.size:
        rest = odd & np.isnan(values)
        return Column("number", values, rest, base, label.strip(" \t:="), unit.strip())
    return Column("text", np.full(len(cells), np.nan), odd)


def _numbers(texts: pd.Series[str], decimal: str) -> tuple[Floats, float]:
    """Return plain numbers, NaN for anything else, and the base of whole ones beyond 2^53."""
    import pandas as pd

    if decimal != ".":
        texts = texts.mask(texts.str.contains(".", regex=False), "?")
        texts = texts.str.replace(decimal, ".", regex=False)
    texts = texts.str.translate({ord("D"): "e", ord("d"): "e"})  # of Fortran
    numbers = pd.to_numeric(texts, errors="coerce")
    if numbers.dtype == np.int64 and numbers.size and abs(numbers.iloc[0]) > 2**53:
        return (numbers - numbers.iloc[0]).to_numpy(dtype=float), float(numbers.iloc[0])
    return numbers.to_numpy(dtype=float, copy=True), 0.0


def clock_of(cells: pd.Series[str]) -> tuple[Floats, str] | None:
    """Return s since the first of times, and their parts (day, time).

    A time of day of two parts is minutes and seconds with a fraction. Parts of most cells count.
    """
    import pandas as pd

    parts = cells.str.extract(f"^{_CLOCK.pattern}$")
    forms = parts["day"].notna() * 2 + parts["clock"].notna()
    form = forms[forms > 0].mode()[0]
    good = forms == form
    day, clock, point, ms, half, zone = (parts.loc[good, name] for name in _CLOCK.groupindex)
    short = clock.str.count(":") == 1
    if ms.str.len().max() == 2:  # hundredths of a second, or frames, of which each number occurs
        rate = (frames := ms.astype(float)).nunique()
        ms = (frames / (rate if rate == frames.max() + 1 else 100)).map("{:.6f}".format).str[2:]
    point = point.fillna(ms)
    if len(zone.unique()) > 1 or (short.any() and (form > 1 or point.isna().all())):
        return None
    since = pd.to_timedelta(clock.mask(short, "0:" + clock) + "." + point.fillna("0"))
    noon = pd.Timedelta(hours=12)
    since += noon * (half.str.lower().eq("p").astype(int) - (half.notna() & (since >= noon)))
    if form > 1:
        try:
            since = _days(day) + since.fillna(pd.Timedelta(0))
        except ValueError:
            return None
    values = np.full(cells.size, np.nan)
    values[good] = np.round((since - since.iloc[0]).dt.total_seconds(), 9)
    return values, ("", "time", "day", "daytime")[form]


def _days(texts: pd.Series[str]) -> pd.Series[pd.Timestamp]:
    """Return dates with the day before or behind the month, of the shortest record."""
    import pandas as pd

    names = pd.Series(texts.unique())
    orders = [pd.to_datetime(names, format="mixed", dayfirst=first) for first in (False, True)]
    best = min(orders, key=lambda dates: dates.max() - dates.min())
    return texts.map(best.set_axis(names))


def unwrapped(since: Floats) -> Floats:
    """Return times that go on where a clock begins again: over midnight, noon, or an hour."""
    good, unbroken = np.flatnonzero(np.isfinite(since)), since.copy()
    falls = -np.diff(since[good], prepend=np.nan)
    for wrap in (3600, _DAY_S // 2, _DAY_S):
        unbroken[good] += wrap * np.cumsum((falls > 0.9 * wrap) & (falls < wrap))
    return unbroken


def counted_since(values: Floats, base: float, unit: float | None) -> Floats | None:
    """Return s since the first of times counted since 1970 (or 1904, 1900); None for others.

    ``base`` is added to ``values``; ``unit`` is that of the heading, s, if there is one.
    """
    good = values[np.isfinite(values)]
    steps = np.diff(good)
    if not steps.size or np.mean(steps >= 0) < _RISES or not np.any(steps > 0):
        return None
    usual, middle = float(np.median(steps[steps > 0])), float(np.median(good)) + base
    for low, high, factor in _SINCE:
        if low <= middle <= high and usual * factor < _LONGEST_STEP and unit in {None, factor}:
            return np.asarray((values - good[0]) * factor)
    return None
