"""Times that a text file gives as dates."""

from __future__ import annotations

import datetime as dt
import re
from typing import Final

# ISO 8601 at the beginning of a line, as pandas and most loggers write it
_DATE: Final = re.compile(
    r'\s*"?(\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:([.,])\d+)?(?:Z|[+-]\d\d:?\d\d)?)"?(?=\s*[,;|\t])'
)
_LEAST: Final = 0.5  # Least share of lines that begin with a date


def without_dates(lines: list[tuple[int, str]]) -> tuple[list[tuple[int, str]], bool]:
    """Return lines whose dates, if most begin with one, are s since the first, and whether."""
    found = [_DATE.match(line) for _, line in lines]
    if sum(one is not None for one in found) <= _LEAST * len(lines):
        return lines, False
    first, seconds = None, list[tuple[int, str]]()
    for (number, line), one in zip(lines, found, strict=True):
        if one is None:
            seconds.append((number, line))
            continue
        try:
            time = dt.datetime.fromisoformat(one[1].replace(",", "."))
            first = first or time
            since = repr((time - first) / dt.timedelta(seconds=1))
        except (
            ValueError,
            TypeError,
        ):  # no date, like the 31st of June; dates with zones and without
            return lines, False
        seconds.append((number, since.replace(".", one[2] or ".") + line[one.end() :]))
    return seconds, True
