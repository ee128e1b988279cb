"""Clocks: dates of all countries and times of day in text, counts since 1970 and the like."""

from __future__ import annotations

import datetime as dt
import re
from collections import Counter
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pendmap.signal import Floats

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


def is_clock(cell: str) -> bool:
    """Return whether a text is a date, a time of day, or both."""
    return bool(cell) and _CLOCK.fullmatch(cell) is not None


def clock_of(cells: Iterable[str]) -> tuple[Floats, str, int] | None:
    """Return s since the first of times in text, their parts (day, time), and after how many s
    a time of day begins again.

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
    if days is None or (minutes and not any(points) and cells[first][:2] not in {"0:", "00"}):
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
            return (values - good[0]) * factor
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
    span = lambda places: max(places.values(), default=0) - min(places.values(), default=0)
    return min(records, key=span, default=None)


def _ordinal(parts: dict[str, str]) -> int:
    """Return the number of a day by its year, month and day; ValueError for no day."""
    year, month, day = parts["y"], parts["m"].lower(), parts["d"]
    if len(year) not in {2, 4} or len(day) > 2 or (month.isdigit() and len(month) > 2):
        raise ValueError
    number = (
        int(month) if month.isdigit() else _MONTH[month[:4] if month[:4] in _MONTH else month[:3]]
    )
    return dt.date(int(year) + 2000 * (len(year) == 2), number, int(day)).toordinal()


def _seconds(key: tuple[str | None, ...], days: dict[str, int], *, short: bool) -> int:
    """Return a day and a time of day in s."""
    day, *parts, half, zone = key
    hour, minute, second = (int(part or 0) for part in parts)
    if half:
        hour = hour % 12 + 12 * (half in "pP")
    if short and parts[2] is None:
        hour, minute, second = 0, hour, minute
    shift = re.fullmatch(r"([+-])(\d\d):?(\d\d)?", zone or "+00")
    offset = (
        0 if shift is None else int(shift[1] + "60") * (60 * int(shift[2]) + int(shift[3] or 0))
    )
    return _DAY_S * days.get(day or "", 0) + 3600 * hour + 60 * minute + second - offset
