"""Cells of a text table: what is a number or a time, and columns of numbers, times or words."""

from __future__ import annotations

import csv
import dataclasses
import datetime as dt
import re
from collections import Counter
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

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
_DAY: Final = (
    r"\d{4}[-./]\d{1,2}[-./]\d{1,2}|\d{1,2}[-./]\d{1,2}[-./](?:\d{4}|\d\d)"
    r"|\d{1,2}[-./ ]{1,2}[^\W\d_]{3,9}[-./, ]{1,2}\d{4}|[^\W\d_]{3,9}\.? \d{1,2},? \d{4}"
)
# Groups: day, hour, minute, second, fraction, ms, a or p, zone, day behind
_CLOCK: Final = re.compile(
    rf"({_DAY})?(?:(?:^|(?<=\d)[T ,_]+)(\d{{1,3}}):(\d\d)(?::(\d\d))?(?:[.,](\d+)|:(\d{{3}}))?"
    r"(?: ?([AaPp])\.?[Mm]\.?)? ?(Z|UTC|[+-]\d\d(?::?\d\d)?)?)?"
    rf"(?:(?<=[\dMm.])[ ,]+({_DAY}))?"
)
# Beginnings of the months in English, German, French, Spanish, Portuguese, Italian, Polish, Dutch
_MONTHS: Final = (
    *("jan gen ene sty", "feb fév lut", "mar mär mrt", "apr avr abr kwi", "may mai maj mag mei"),
    *("jun juin giu cze", "jul juil lug lip", "aug aoû ago sie", "sep set wrz"),
    *("oct okt out ott paź", "nov lis", "dec dez déc dic gru"),
)
_MONTH: Final = {word: k for k, words in enumerate(_MONTHS, 1) for word in words.split()}
_DAY_S: Final = 86_400
# Counts since 1904 or 1970 in ms, us, ns, in days since 1900 (Excel) or the year 0: range, unit
_SINCE: Final = (
    *((9.4e8 * k, 4.3e9 * k, 1 / k) for k in (1e3, 1e6, 1e9)),
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
    wrap: int = 0  # s after which a clock begins again

    def at(self, rows: Indices) -> Column:
        """Return the column at some rows."""
        return dataclasses.replace(self, values=self.values[rows], odd=self.odd[rows])


def split(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line."""
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
    if words.empty:
        return Column("number", values, odd, base)
    middle = words.iloc[words.size // 2]
    for pattern, drop, insert in _respelled(decimal):
        if re.fullmatch(pattern, middle):
            fits = texts[odd | ~np.isnan(values)].str.fullmatch(pattern).to_numpy(dtype=bool)
            if fits[int(np.argmax(fits)) :].all():  # below the names
                values, base = _numbers(texts.str.replace(drop, insert, regex=True), decimal)
                return Column("number", values, odd & np.isnan(values), base)
    if 2 * words.size <= np.isfinite(values).sum() + words.size:
        return Column("number", values, odd, base)
    clock = clock_of(texts) if _CLOCK.fullmatch(middle) else None
    if clock is not None:
        since, parts, wrap = clock
        return Column("clock", since, odd & np.isnan(since), parts=parts, wrap=wrap)
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
    numbers = pd.to_numeric(texts, errors="coerce")
    if numbers.dtype == np.int64 and numbers.size and abs(numbers.iloc[0]) > 2**53:
        return (numbers - numbers.iloc[0]).to_numpy(dtype=float), float(numbers.iloc[0])
    return numbers.to_numpy(dtype=float, copy=True), 0.0


def _respelled(decimal: str) -> list[tuple[str, str, str]]:
    """Return spellings of all cells of a column: pattern, what is replaced, and by what."""
    sign, whole = re.escape(decimal), "[+-]?[1-9][0-9]{0,2}"
    short = rf"[+-]?[0-9]{{1,3}}(?:{sign}[0-9]*)?"
    groups = (_OTHER[decimal], "'", " ")
    spellings = [(rf"{short}|{whole}(?:{g}[0-9]{{3}})+(?:{sign}[0-9]*)?", g, "") for g in groups]
    return [(_PLAIN[decimal], "[dD]", "e"), *spellings]


def clock_of(cells: Iterable[str]) -> tuple[Floats, str, int] | None:
    """Return s since the first of times, their parts (day, time), and the s after which they wrap.

    Of the orders of day, month and year that all dates allow, that of the shortest record counts.
    """
    keys, codes, points = dict[tuple[str | None, ...], int](), list[int](), list[float]()
    none = (None,) * 9
    for match in map(_CLOCK.fullmatch, cells):
        day, hour, minute, second, point, ms, half, zone, behind = match.groups() if match else none
        key = (day or behind, hour, minute, second, half, zone)
        codes.append(keys.setdefault(key, len(keys)))
        points.append(float(f"0.{point or ms or 0}"))
    forms = [(key[0] is not None, key[1] is not None, key[5] is not None) for key in keys]
    form = Counter(form for form in forms if any(form)).most_common(1)[0][0]
    good = np.array([one == form for one in forms])[codes]
    first = int(np.argmax(good))
    days = _places({key[0] for key in keys if key[0]})
    short = not form[0] and not any(key[4] for key in keys)  # two parts are minutes and seconds
    minutes = short and all(key[3] is None for key in keys)
    begin = [*keys][codes[first]][1]
    if days is None or (minutes and not any(points) and int(begin or 0)):
        return None
    whole = np.array([_seconds(key, days, short=short) for key in keys])[codes]
    since = np.round(whole - whole[first] + (np.array(points) - points[first]), 9)
    since[~good] = np.nan
    hours = {int(key[1] or 0) for key in keys if key[1]}
    twelve = not any(key[4] for key in keys) and hours <= {*range(1, 13)}
    wrap = 3600 if minutes else _DAY_S // 2 if twelve else _DAY_S
    return since, "day" * form[0] + "time" * form[1], wrap


def unwrapped(since: Floats, wrap: int) -> Floats:
    """Return times that go on where a clock begins again: over midnight, noon, or an hour."""
    good = np.flatnonzero(np.isfinite(since))
    falls = np.diff(since[good], prepend=np.nan) < -0.9 * wrap
    since = since.copy()
    since[good] += wrap * np.cumsum(falls)
    return since


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


def _places(days: set[str]) -> dict[str, int] | None:
    """Return the numbers of days by their texts, in the order of the shortest record."""
    parts = {day: re.findall(r"\d+|[^\W\d_]+", day) for day in days}
    records = []
    for order in ("ymd", "dmy", "mdy"):
        try:
            records.append(
                {day: _ordinal(dict(zip(order, parts[day], strict=True))) for day in days}
            )
        except (KeyError, ValueError):
            continue
    return min(records, key=lambda one: np.ptp([*(one.values() or [0])]), default=None)


def _ordinal(parts: dict[str, str]) -> int:
    """Return the number of a day by its year, month and day; ValueError for no day."""
    year, month, day = parts["y"], parts["m"].lower(), parts["d"]
    if len(year) not in {2, 4} or len(day) > 2 or (month.isdigit() and len(month) > 2):
        raise ValueError
    number = int(month) if month.isdigit() else _MONTH.get(month[:4]) or _MONTH[month[:3]]
    return dt.date(int(year) + 2000 * (len(year) == 2), number, int(day)).toordinal()


def _seconds(key: tuple[str | None, ...], days: dict[str, int], *, short: bool) -> int:
    """Return a day and a time of day in s."""
    day, *parts, half, zone = key
    hour, minute, second = (int(part or 0) for part in parts)
    if half:
        hour = hour % 12 + 12 * (half in "pP")
    if short and parts[2] is None:
        hour, minute, second = 0, hour, minute
    shift = re.fullmatch(r"([+-]\d\d):?(\d\d)?", zone or "+00")
    hour -= int(shift[1]) if shift else 0
    minute -= int(f"{zone[0]}{shift[2]}") if zone and shift and shift[2] else 0
    return _DAY_S * days.get(day or "", 0) + 3600 * hour + 60 * minute + second
