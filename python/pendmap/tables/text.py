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
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import InputError, short_repr
from pendmap.formatting import counted, listed
from pendmap.tables.cells import column_of, counted_since, split, unwrapped, weight
from pendmap.tables.findings import finding_of
from pendmap.tables.units import CHANNELS, TIMES, Heading, name_and_unit, spelling, stated_rate

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pendmap.signal import Floats, Indices
    from pendmap.tables.cells import Column
    from pendmap.tables.findings import Finding

MOST_COLUMNS: Final = 1000  # Most columns of a table
LONGEST_LINE: Final = 40 * MOST_COLUMNS  # Longest line that may be a row, characters
SAMPLE_LINES: Final = 400  # Number of lines, spread over a file, that determine separators
LEAST_ROWS: Final = 0.5  # Least share of lines that are rows of numbers
# Separators with decimal signs, in the order of preference
SEPARATORS: Final = (
    *((";", ","), ("\t", ","), ("\t", "."), (";", "."), (",", "."), ("|", ",")),
    *(("|", "."), (" ", "."), (" ", ","), (",", ",")),
)
_HEADS: Final = 30  # Most lines above the numbers of a short file
TIME: Final = "t_s"  # Heading of times that a record has as dates
LARGEST_READING: Final = 1e18  # Largest reading; larger ones are missing
_POINT: Final = re.compile(r'(?<=:\d\d),(\d{3}|\d{6})(?=[,;\t|"]|$)')  # of s, before a separator
_COMMENT: Final = re.compile(r"^\s*(?:[#%!]+|//+|'(?!.*'))\s*")
_OTHERS: Final = (r"\t", ";", ",", r"\|", r"\s{2,}")  # Separators of names alone
_WORD: Final = re.compile(r"\S+(?:\s+[(\[][^)\]]*[)\]])?")  # with its unit
_FRACTION: Final = re.compile(r"(.*?)(s\w*) \1(n|nano|u|micro)_?\2")
_LETTER: Final = re.compile(r"[^\W\d_]")
_UNIT: Final = re.compile(r"[(\[]?\s*[^\d\s]{0,8}\d?\s*[)\]]?")
_ABOVE: Final = 12  # Most lines above the rows that may hold names
_SET: Final = re.compile(r"(?<=[0-9])[\u00a0\u2009\u202f](?=[0-9]{3}(?![0-9]))")  # of thousands
_SIGNS: Final = str.maketrans("\u2212\u2013\u00a0\u2009\u202f，；：（）", "--   ,;:()")


def ruled(rule: object, default: object = None) -> Any:  # noqa: ANN401 (of any type)
    """Return a field whose value in ``experiment.toml`` follows a rule."""
    return dataclasses.field(default=default, metadata={"rule": rule})


@dataclasses.dataclass(frozen=True)
class Reader:
    """Format of the files, as far as it cannot be inferred from them."""

    delimiter: str | None = ruled(str)
    decimal: str | None = ruled([".", ","])
    skip_rows: int = ruled(range(1_000_000), 0)


@dataclasses.dataclass(frozen=True)
class Table:
    """Columns of numbers, and their rows in the file."""

    names: tuple[str, ...]  # headings; empty strings without a header
    values: Floats  # shape (rows, columns); NaN for missing numbers
    rows: Indices  # lines of the file, from 1 (of a Parquet file: rows of the table)
    findings: tuple[Finding, ...] = ()
    # Index of each row among the lines that are not empty; unreadable lines leave gaps.
    order: Indices = dataclasses.field(default_factory=lambda: np.empty(0, np.intp))
    texts: Mapping[int, str] = dataclasses.field(default_factory=dict)  # a cell of each text column
    rate: float | None = None  # sampling rate that lines above the columns state, Hz

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

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line that may be a row, which words or another table may follow."""
        parts = split(line, self.delimiter)
        missing = self.width - len(parts)
        if missing == 0:
            return parts
        if missing > 0:
            return parts + [""] * missing if len(parts) >= self.least else []
        rest = parts[self.width :]
        words = not rest[0].strip() or not any(weight(part, self.decimal) for part in rest)
        return parts[: self.width] if words else []


def parsed(text: str, reader: Reader, where: str, findings: list[Finding]) -> Table:
    """Return the table of a text; raise InputError if there are no rows of numbers."""
    text = text if text.isascii() else _SET.sub("'", text).translate(_SIGNS)
    every = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    places = [k for k, line in enumerate(every, 1) if k > reader.skip_rows and line.strip()]
    if not places:
        raise InputError(f"{where}: must be a file with rows of numbers, it is empty")
    # Lines that are too long are unreadable.
    lines = [line if len(line := every[k - 1]) <= LONGEST_LINE else "?" for k in places]
    form, lines = _form_of(lines, reader, where)
    number, at, flat = np.array(places), list[int](), list[str]()
    for k, line in enumerate(lines):
        cells = form.cells(line)
        if cells:
            at.append(k)
            flat += cells
    columns = [column_of(flat[k :: form.width], form.decimal) for k in range(form.width)]
    begin, keep, tables = _longest(lines, np.array(at), columns, form)
    if not keep.size:
        k = next((k for k, line in enumerate(lines[1:], 1) if re.search("[0-9]", line)), 0)
        raise InputError(
            f"{where}: must be CSV with a time and an angle, got no rows of numbers: line"
            f" {number[k]} is {short_repr(lines[k])}; [reader] of experiment.toml takes delimiter,"
            " decimal and skip_rows"
        )
    columns = [column.at(keep) for column in columns]
    starts, whole = (keep * form.width).tolist(), range(form.width)
    width = max(k + 1 for k in whole if any(flat[i + k].strip() for i in starts))
    read, columns = np.array(at)[keep], columns[:width]
    names = _headings(lines[begin : read[0]], columns, form, where)
    _clocks(columns, names)
    end = len(lines) if tables == 1 else read[-1]
    dropped = number[np.setdiff1d(np.arange(read[0], end), read, assume_unique=True)]
    if dropped.size:
        shown, lost = listed([*map(str, dropped[:4])], 3), counted(dropped.size, "line")
        more = finding_of("unreadable-lines", where=f"line {shown}", lines=lost, width=width)
        findings.append(more)
    if tables > 1:
        ends = f"lines {number[read[0]]} to {number[read[-1]]}"
        findings.append(finding_of("tables-behind", where=ends, tables=tables))
    texts = {}
    for k, column in enumerate(columns):
        if column.kind == "text" and column.odd.any():
            i = int(np.argmax(column.odd))
            texts[k] = f"{short_repr(flat[starts[i] + k])} in line {number[read[i]]}"
    values = np.column_stack([column.values + column.base for column in columns])
    order = read - read[0]
    rate = stated_rate(lines[begin : read[0]][-_ABOVE:])
    return Table(tuple(names), values, number[read], tuple(findings), order, texts, rate)


def _form_of(lines: list[str], reader: Reader, where: str) -> tuple[_Form, list[str]]:
    """Return the form in which most lines are rows, and lines with their clocks set apart."""
    step = max(len(lines) // SAMPLE_LINES, 1)
    # Uneven sampling, since loggers of several sensors alternate rows of each kind.
    sample = [lines[k * step + int(step * (0.618 * k % 1))] for k in range(len(lines) // step)]
    points = [match[1] for line in sample for match in _POINT.finditer(line)]
    if len(points) > LEAST_ROWS * len(sample) and any(point[0] == "0" for point in points):
        return _form_of([_POINT.sub(r".\1", line) for line in lines], reader, where)
    signs = [(reader.delimiter or sign, reader.decimal or decimal) for sign, decimal in SEPARATORS]
    quoted = any('"' in line for line in sample)
    signs = [(a, b) for a, b in dict.fromkeys(signs) if a != b or quoted]
    for numbers in (2, 1):
        scores = [_scored(sample, *pair, numbers) for pair in signs]
        _, count, form = max(scores, key=lambda one: one[0])
        if count < min(LEAST_ROWS * len(sample), len(sample) - _HEADS):
            continue
        if reader.decimal or not _are_fractions(sample, form):
            return form, lines
        if form.width == 2:
            return _Form(";", ",", 1, 1), lines
        raise InputError(f"{where}: decimal commas need another delimiter between columns, like ;")
    return _Form(",", ".", 0, 0), lines


def _scored(
    sample: Sequence[str], delimiter: str, decimal: str, numbers: int
) -> tuple[float, int, _Form]:
    """Return the summed shares of numbers in the lines of one width, their number, and the form."""
    widths = defaultdict[int, list[tuple[float, int]]](list)
    for line in sample:
        parts = split(line, delimiter)
        surely = [(weight(part, decimal), len(part)) for part in parts[:MOST_COLUMNS]]
        good = [k for k, (one, _) in enumerate(surely, 1) if one]
        if len(good) >= numbers and len(parts) <= MOST_COLUMNS and not {*"{}"} & {*line}:
            sizes = [(one, size) for one, size in surely if one is not None]
            share = sum(one * size for one, size in sizes) / sum(size for _, size in sizes)
            widths[len(parts)].append((share, good[-1]))
    if not widths:
        return 0.0, -_HEADS, _Form(delimiter, decimal, 0, 0)
    width, rows = max(widths.items(), key=lambda item: len(item[1]))
    if width == 1:  # a comma or semicolon in a line above is no part of the name
        delimiter = ";" if decimal == "," else ","
    form = _Form(delimiter, decimal, width, max(last for _, last in rows))
    return sum(share for share, _ in rows), len(rows), form


def _are_fractions(sample: Sequence[str], form: _Form) -> bool:
    """Return whether each second whole number has the digits after a comma: some begin with 0."""
    rows = [form.cells(line) for line in sample]
    rows = [row for row in rows if row and all(re.fullmatch("[+-]?[0-9]+", cell) for cell in row)]
    if (form.delimiter, form.decimal) != (",", ".") or form.width % 2 or not rows:
        return False
    signed = any(cell[0] in "+-" for row in rows for cell in row[1::2])
    zeros = [any(re.match("[+-]?0[0-9]", row[k]) for row in rows) for k in range(form.width)]
    return not signed and not any(zeros[::2]) and all(zeros[1::2])


def _longest(
    lines: Sequence[str], at: Indices, columns: list[Column], form: _Form
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
        line = lines[read[k] - 1]
        words = form.cells(line) if line != lines[read[0] - 1] else []
        if len(words) > 1 and all(weight(word, ".") == 0 for word in words):
            edges.append(k)
    low, high = max(itertools.pairwise([*edges, keep.size]), key=lambda ends: ends[1] - ends[0])
    return int(read[low - 1]) + 1 if low else 0, keep[low:high], len(edges)


def _clocks(columns: list[Column], names: list[str]) -> None:
    """Turn times of day, dates and counts since 1970 into s since the first; name a time t_s."""
    days = next((column.values for column in columns if column.parts == "day"), None)
    for k, (head, part) in enumerate(itertools.pairwise(names)):
        if match := _FRACTION.fullmatch(f"{head} {part}"):  # sec and nanosec are one clock
            one, two = columns[k : k + 2]
            parts = (1e-6 if match[3][0] in "um" else 1e-9) * two.values
            whole = one.values - one.values[0] + parts
            columns[k] = dataclasses.replace(one, values=whole, base=0.0)
            columns[k + 1] = dataclasses.replace(two, values=0.0 * parts)
    moving = []
    for k, column in enumerate(columns):
        name, unit = name_and_unit(names[k])
        factor = None if unit is None else TIMES.get(spelling(unit), 0.0)
        since: Floats | None = column.values
        if column.parts == "day":  # without a time of day it is none
            since = np.full(column.values.size, np.nan)
        elif column.parts == "time":
            since = unwrapped(column.values) if days is None else column.values + days
        elif not column.parts:
            since = counted_since(column.values, column.base, factor)
        if since is not None:
            columns[k] = dataclasses.replace(column, values=since, base=0.0)
            names[k] = names[k] if factor in {None, 1.0} else f"{name} [s]"
            moving += [k] if np.any(since > 0) else []
    filled = zip(names, columns, strict=True)
    timed = any(is_known(n, "time") and np.isfinite(c.values).any() for n, c in filled)
    if any(names) and moving and not timed:
        names[moving[0]] = TIME


def _headings(
    above: Sequence[str], columns: Sequence[Column], form: _Form, where: str
) -> list[str]:
    """Return the names of columns with their units; empty ones without names.

    The line directly above the rows holds them, or else that with most known names; above a line of
    units, of equal ones the longest.
    """
    heads, width = list[list[str]](), len(columns)
    for k, line in enumerate(above[: -_ABOVE - 1 : -1]):
        parts = _parts(line, columns, form)
        close = bool(parts) and k < 3
        parts = parts or _otherwise(line, width)
        if any(map(_LETTER.search, parts)) and (close or any(map(is_known, parts))):
            heads.append(parts)
            if close and k == 0 and not _are_units(parts):
                break
    if not heads:
        first = split(above[-1], ",") if above and form.delimiter == "," else []
        if 2 * len(first) == width > 2 and all(map(_LETTER.search, first)):
            raise InputError(
                f"{where}: as many columns must have names as numbers, got {len(first)} with names"
                f" and {width} with numbers; decimal commas need another delimiter, like ;"
            )
        heads = [[column.label for column in columns]]
    units = [column.unit for column in columns]
    if len(heads) > 1 and _are_units(heads[0]):
        units = [part.strip("()[] ") for part in heads.pop(0)]
        heads.sort(key=lambda head: -len("".join(head)))
    names = max(heads, key=lambda head: sum(map(is_known, head)))
    return [
        f"{name} [{unit}]" if name and unit and not name_and_unit(name)[1] else name
        for name, unit in zip(names, units, strict=True)
    ]


def is_known(head: str, channel: str | None = None) -> bool:
    """Return whether a heading has a usual word, or a unit, of a channel or any."""
    heading = Heading.of(head)
    if channel is not None:
        return heading.meaning in CHANNELS[channel].meanings
    words = any(heading.meaning in kind.meanings for kind in CHANNELS.values())
    return bool(heading.name) and (words or heading.unit is not None)


def _parts(line: str, columns: Sequence[Column], form: _Form) -> list[str]:
    """Return the parts of a line with the separator of the rows, if they give the width."""
    width, bare = len(columns), _COMMENT.sub("", line)
    parts = split(bare if form.delimiter == ";" else bare.lstrip("; "), form.delimiter)
    names = _trimmed(parts)
    first = columns[0]
    numbered = line[0] == '"' and np.all(np.diff(first.values) == 1)
    if len(names) == width - 1 > 1 and (first.kind == "text" or numbered):
        return ["", *names]  # as R numbers the rows
    # Columns at the end may be empty, and settings may stand beside the names.
    settings = form.delimiter in "\t;|" or (form.delimiter == "," and width > 1)
    fits = len(parts) >= width and (len(names) <= form.width or settings)
    return [part.strip() for part in parts[:width]] if fits else []


def _otherwise(line: str, width: int) -> list[str]:
    """Return the parts of a line with the first separator that gives the width."""
    bare = _COMMENT.sub("", line).strip()
    ways = [re.split(rf"\s*{separator}\s*", bare) for separator in _OTHERS]
    ways = [_trimmed(parts) for parts in (*ways, _WORD.findall(bare), bare.split())]
    fitting = (parts for parts in ways if len(parts) == width > 1 and all(parts))
    return [part.strip('" ') for part in next(fitting, [])]


def _trimmed(parts: list[str]) -> list[str]:
    """Return parts without the empty ones at the end."""
    return parts[: max((k for k, part in enumerate(parts, 1) if part.strip()), default=0)]


def _are_units(parts: list[str]) -> bool:
    """Return whether parts may be units, and half of them are known."""
    units = [part.strip("()[] ") for part in parts if part]
    known = sum(any(kind.has(unit) for kind in CHANNELS.values()) for unit in units)
    return all(map(_UNIT.fullmatch, parts)) and 2 * known >= len(units) > 0
