"""Tables in text: lines, their form, the kinds of their columns, rows, and names.

The form (delimiter, decimal sign, width) is that in which most characters of a sample of lines are
numbers or times. A column is of the kind of most of its cells: number, clock or text. A row is a
line of the width with a number; the first has no text in a column of numbers. The lines above the
rows hold the names. Of tables behind each other the longest is read.
"""

from __future__ import annotations

import dataclasses
import itertools
import re
from collections import defaultdict
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError, short_repr
from pendmap.formatting import counted, listed
from pendmap.records.cells import column_of, split, weight
from pendmap.records.dates import counted_since, unwrapped
from pendmap.records.experiment import finding_of
from pendmap.records.headings import headings_of, is_known
from pendmap.records.units import CHANNELS, name_and_unit, spelling

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pendmap.records.cells import Column
    from pendmap.records.description import Reader
    from pendmap.records.experiment import Finding
    from pendmap.signal import Floats, Indices

MOST_COLUMNS: Final = 1000  # Most columns of a table
LONGEST_LINE: Final = 40 * MOST_COLUMNS  # Longest line that may be a row, characters
SAMPLE_LINES: Final = 400  # Number of lines, spread over a file, that determine separators
LEAST_ROWS: Final = 0.5  # Least share of lines that are rows of numbers
# Separators with decimal signs, in the order of preference
SEPARATORS: Final = (
    *((";", ","), ("\t", ","), ("\t", "."), (";", "."), (",", ".")),
    *(("|", ","), ("|", "."), (" ", "."), (" ", ","), (",", ",")),
)
_HEADS: Final = 30  # Most lines above the numbers of a short file
TIME: Final = "t_s"  # Heading of times that a record has as dates
LARGEST_READING: Final = 1e18  # Largest reading; larger ones are missing
_POINT: Final = re.compile(r'(?<=:\d\d),(\d{3}|\d{6})(?=[,;\t|"]|$)')  # of s, before a separator
_ARROW: Final = re.compile(r"^(\d\d:\d\d:\d\d\.\d+) -> ")  # of the Arduino IDE
_SET: Final = re.compile("(?<=[0-9])[\u00a0\u2009\u202f](?=[0-9]{3}(?![0-9]))")  # of thousands
# Signs of other scripts: minus, blanks, punctuation of full width
_SIGNS: Final = str.maketrans(
    "\u2212\u2013\u00a0\u2009\u202f\uff0c\uff1b\uff1a\uff08\uff09", "--   ,;:()"
)


@dataclasses.dataclass(frozen=True)
class Table:
    """Columns of numbers, and their rows in the file."""

    names: tuple[str, ...]  # headings; empty strings without a header
    values: Floats  # shape (rows, columns); NaN for missing numbers
    rows: Indices  # lines of the file, from 1 (of a Parquet file: rows of the table)
    findings: tuple[Finding, ...] = ()
    # Index of each row among the lines that are not empty; unreadable lines leave gaps.
    order: Indices = dataclasses.field(default_factory=lambda: np.empty(0, np.intp))
    dated: tuple[int, ...] = ()  # columns of dates or times of day, in s since the first
    texts: Mapping[int, str] = dataclasses.field(default_factory=dict)  # a cell of each text column

    def __post_init__(self) -> None:
        """Mark readings that are infinite or too large as missing."""
        self.values[~(np.abs(self.values) <= LARGEST_READING)] = np.nan


@dataclasses.dataclass(frozen=True)
class _Form:
    """Delimiter, decimal sign, number of columns, and fewest cells of a row."""

    delimiter: str
    decimal: str
    width: int
    least: int

    def cells(self, line: str) -> list[str] | None:
        """Return the cells of a line, if it may be a row: words may follow, or another table."""
        parts = split(line, self.delimiter)
        if len(parts) == self.width:
            return parts
        if self.least <= len(parts) < self.width:
            return parts + [""] * (self.width - len(parts))
        rest = parts[self.width :]
        if rest and (not rest[0] or not any(weight(part, self.decimal) for part in rest)):
            return parts[: self.width]
        return None


def parsed(text: str, reader: Reader, where: str, findings: list[Finding]) -> Table:
    """Return the table of a text; raise InputError if there are no rows of numbers."""
    text = text if text.isascii() else _SET.sub("'", text).translate(_SIGNS)
    every = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    places = [k for k, line in enumerate(every, 1) if k > reader.skip_rows and line.strip()]
    if not places:
        raise InputError(f"{where}: must be a file with rows of numbers, it is empty")
    number = np.array(places)
    # Lines that are too long are unreadable.
    lines = [line if len(line := every[k - 1]) <= LONGEST_LINE else "?" for k in places]
    form, lines = _form_of(lines, reader, where)
    if form is None:
        raise _refusal(lines, number, where)
    cells = [form.cells(line) for line in lines]
    at = np.flatnonzero([row is not None for row in cells])
    rows = [row for row in cells if row is not None]
    columns = [column_of([row[k] for row in rows], form.decimal) for k in range(form.width)]
    begin, keep, tables = _longest(lines, cells, at, columns)
    if not keep.size:
        raise _refusal(lines, number, where)
    read = at[keep]
    if tables > 1:
        ends = f"lines {number[read[0]]} to {number[read[-1]]}"
        findings.append(finding_of("tables-behind", where=ends, tables=tables))
    columns = [column.at(keep) for column in columns]
    last = max(k for k in range(form.width) if any(rows[i][k] for i in keep.tolist())) + 1
    columns = columns[:last]
    names = _names(lines[begin : read[0]], columns, form, where, findings)
    end = len(lines) if tables == 1 else read[-1]
    dropped = np.setdiff1d(np.arange(read[0], end), read, assume_unique=True)
    if dropped.size:
        shown = listed([str(k) for k in number[dropped].tolist()], 3)
        lost = counted(dropped.size, "line")
        findings.append(
            finding_of("unreadable-lines", where=f"line {shown}", lines=lost, width=last)
        )
    texts = {
        k: f"{rows[keep[i]][k]!r} in line {number[read[i]]}"
        for k, column in enumerate(columns)
        if column.kind == "text" and (i := int(np.argmax(column.odd))) >= 0
    }
    dated = _clocks(columns, names)
    values = np.column_stack([column.values + column.base for column in columns])
    order = read - read[0]
    return Table(tuple(names), values, number[read], tuple(findings), order, dated, texts)


def _form_of(lines: list[str], reader: Reader, where: str) -> tuple[_Form | None, list[str]]:
    """Return the form in which most of the lines are rows, and the lines, their clocks set apart."""
    step = max(len(lines) // SAMPLE_LINES, 1)
    # Uneven sampling, since loggers of several sensors alternate rows of each kind.
    places = [k * step + int(step * (0.618 * k % 1)) for k in range(len(lines) // step)]
    sample = [lines[k] for k in places]
    points = [match[1] for line in sample for match in _POINT.finditer(line)]
    if len(points) > LEAST_ROWS * len(sample) and any(point[0] == "0" for point in points):
        return _form_of([_POINT.sub(r".\1", line) for line in lines], reader, where)
    if sum(bool(_ARROW.match(line)) for line in sample) > LEAST_ROWS * len(sample):
        form, _ = _form_of([_ARROW.sub("", line) for line in lines], reader, where)
        if form is None:
            return form, lines
        lines = [_ARROW.sub(rf"\1{form.delimiter}", line) for line in lines]
        return dataclasses.replace(form, width=form.width + 1, least=form.least + 1), lines
    signs = [(reader.delimiter or sign, reader.decimal or decimal) for sign, decimal in SEPARATORS]
    quoted = any('"' in line for line in sample)
    signs = [(a, b) for a, b in dict.fromkeys(signs) if a != b or quoted]
    for numbers in (2, 1):
        scores = [_scored(sample, *pair, numbers) for pair in signs]
        score, count, form = max(scores, key=lambda one: one[0])
        if form is None or count < min(LEAST_ROWS * len(sample), len(sample) - _HEADS):
            continue
        if reader.decimal is None and _are_fractions(sample, form):
            if form.width == 2:
                return _Form(";", ",", 1, 1), lines
            raise InputError(
                f"{where}: decimal commas need another delimiter between columns, like ;"
            )
        return form, lines
    return None, lines


def _scored(
    sample: Sequence[str], delimiter: str, decimal: str, numbers: int
) -> tuple[float, int, _Form | None]:
    """Return the summed shares of numbers in the lines of one width, their number, and the form."""
    widths = defaultdict[int, list[tuple[float, int]]](list)
    for line in sample:
        parts = split(line, delimiter)
        surely = [(weight(part, decimal), len(part)) for part in parts[:MOST_COLUMNS]]
        good = [k for k, (one, _) in enumerate(surely) if one]
        if len(good) >= numbers and len(parts) <= MOST_COLUMNS and not {*"{}"} & {*line}:
            sizes = [(one, size) for one, size in surely if one is not None]
            share = sum(one * size for one, size in sizes) / sum(size for _, size in sizes)
            widths[len(parts)].append((share, good[-1] + 1))
    if not widths:
        return 0.0, 0, None
    width, rows = max(widths.items(), key=lambda item: len(item[1]))
    if width == 1:  # a comma or semicolon in a line above is no part of the name
        delimiter = ";" if decimal == "," else ","
    form = _Form(delimiter, decimal, width, max(last for _, last in rows))
    return sum(share for share, _ in rows), len(rows), form


def _are_fractions(sample: Sequence[str], form: _Form) -> bool:
    """Return whether every second column has the digits after a decimal comma: some begin with 0."""
    rows = [row for line in sample if (row := form.cells(line))]
    rows = [row for row in rows if all(re.fullmatch("[+-]?[0-9]+", cell) for cell in row)]
    if (form.delimiter, form.decimal) != (",", ".") or form.width % 2 or not rows:
        return False
    wholes, digits = ([row[k::2] for row in rows] for k in (0, 1))
    padded = any(re.match("[+-]?0[0-9]", cell) for row in wholes for cell in row)
    parts = all(cell[0] not in "+-" for row in digits for cell in row) and not padded
    zeros = [
        any(re.match("0[0-9]", cell) for cell in column) for column in zip(*digits, strict=True)
    ]
    return parts and all(zeros)


def _refusal(lines: Sequence[str], number: Indices, where: str) -> InputError:
    """Return the error about a text without rows of numbers, with its first line with a digit."""
    k = next((k for k, line in enumerate(lines[1:], 1) if re.search("[0-9]", line)), 0)
    return InputError(
        f"{where}: must be CSV with a time and an angle, got no rows of numbers: line {number[k]} is"
        f" {short_repr(lines[k])}; delimiter, decimal and skip_rows can be given in [reader] of"
        " experiment.toml"
    )


def _longest(
    lines: Sequence[str], cells: Sequence[list[str] | None], at: Indices, columns: list[Column]
) -> tuple[int, Indices, int]:
    """Return where the lines above the longest table begin, its rows, and the number of tables.

    Another table begins where, behind a line of words, the numbers of the first column fall.
    """
    numbers = [column for column in columns if column.kind != "text"]
    filled = np.any([np.isfinite(column.values) for column in numbers], axis=0)
    clear = filled & ~np.any([column.odd for column in numbers], axis=0)
    if not np.any(clear):
        return 0, np.empty(0, np.intp), 0
    keep = np.flatnonzero(filled & (np.arange(at.size) >= np.argmax(clear)))
    read, lead, edges = at[keep], numbers[0].values[keep], [0]
    for k in (np.flatnonzero((np.diff(read) > 1) & (np.diff(lead) < 0)) + 1).tolist():
        words = cells[read[k] - 1] or []
        again = lines[read[k] - 1] == lines[read[0] - 1]
        if len(words) > 1 and all(weight(word, ".") == 0 for word in words) and not again:
            edges.append(k)
    low, high = max(itertools.pairwise([*edges, keep.size]), key=lambda ends: ends[1] - ends[0])
    return int(read[low - 1]) + 1 if low else 0, keep[low:high], len(edges)


def _names(
    above: Sequence[str],
    columns: Sequence[Column],
    form: _Form,
    where: str,
    findings: list[Finding],
) -> list[str]:
    """Return the headings of columns, with the units that stand behind the numbers."""
    width, first = len(columns), columns[0]
    numbered = first.kind == "text" or bool(np.all(np.diff(first.values) == 1))
    names, others = headings_of(above, form.delimiter, (width, form.width), numbered=numbered)
    if form.delimiter == "," and 2 * others == width:
        raise InputError(
            f"{where}: as many columns must have names as numbers, got {others} with names and"
            f" {width} with numbers; decimal commas need another delimiter, like ;"
        )
    if others:
        findings.append(finding_of("names-unused", names=others, columns=width))
    heads = [name or column.label for name, column in zip(names, columns, strict=True)]
    return [
        f"{head} [{column.unit}]" if head and column.unit and not name_and_unit(head)[1] else head
        for head, column in zip(heads, columns, strict=True)
    ]


def _clocks(columns: list[Column], names: list[str]) -> tuple[int, ...]:
    """Turn times of day, dates and counts since 1970 into s since the first; return which."""
    parts = [column.parts for column in columns]
    day = parts.index("day") if "day" in parts and "time" in parts else None
    dated, timed = list[int](), False
    for k, column in enumerate(columns):
        name, unit = name_and_unit(names[k])
        factor = None if unit is None else CHANNELS["time"].units.get(spelling(unit), 0.0)
        since: Floats | None = column.values
        if column.parts == "time":
            more = unwrapped(column.values, column.wrap) if day is None else columns[day].values
            since = more if day is None else column.values + more
        elif not column.parts:
            since = counted_since(column.values, column.base, factor)
        if since is None:
            timed |= is_known(names[k], "time") and bool(np.isfinite(column.values).any())
        else:
            columns[k] = dataclasses.replace(column, values=since, base=0.0)
            names[k] = names[k] if factor in {None, 1.0} else f"{name} [s]"
            dated.append(k)
    if day is not None:
        columns[day] = dataclasses.replace(columns[day], values=columns[day].values * np.nan)
        dated.remove(day)
    moving = [k for k in dated if np.nanmax(columns[k].values) > 0]
    if any(names) and moving and not timed and not any(is_known(names[k], "time") for k in moving):
        names[moving[0]] = TIME
    return tuple(dated)
