"""Names of a table's columns, from the lines above its rows."""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING, Final

from pendmap.records.cells import split
from pendmap.records.units import CHANNELS, name_and_unit, plain

if TYPE_CHECKING:
    from collections.abc import Sequence

_MOST_ABOVE: Final = 12  # Most lines above the rows that may hold names
_COMMENT: Final = re.compile(r"^\s*(?:[#%!]+|//+|'(?!.*'))\s*")
_SEPARATORS: Final = (r"\t", ";", ",", r"\|", r"\s{2,}")
_WORD: Final = re.compile(r"\S+(?:\s+[(\[][^)\]]*[)\]])?")  # with its unit
_LETTER: Final = re.compile(r"[^\W\d_]")
_UNIT: Final = re.compile(r"[(\[]?\s*[^\d\s]{0,8}\d?\s*[)\]]?")
# What loggers set around a name: "Latest: Time (s)", "Time (s) Run #1", "Angle, Ch 1&2 (rad)"
_BEFORE: Final = re.compile(r"^([^:()\[\]]{1,30}:)\s*(?=\S)")
_BEHIND: Final = re.compile(r"(?<=\S)\s+([^\W\d]\w*\s*#?\d+)$")
_CHANNEL: Final = re.compile(r"(?<=\w)(?:,\s*|\s+)Ch\.?\s*\d[\d&, ]*(?=$|[(\[])", re.IGNORECASE)


def headings_of(
    above: Sequence[str], delimiter: str, widths: tuple[int, int], *, numbered: bool
) -> tuple[list[str], int]:
    """Return names with units, and how many the line directly above the rows has if they do not fit.

    The line directly above the rows, or else the one with the most known names, holds the names;
    above a line of units the longest of these. ``numbered``: the first column numbers the rows.
    """
    width = widths[0]
    near, heads = above[-_MOST_ABOVE:][::-1], list[list[str]]()
    for k, line in enumerate(near):
        parts = _parts(line, delimiter, *widths, numbered=numbered)
        close = parts is not None and k < 3
        parts = parts or (_otherwise(line, width) if width > 1 else None)
        if (
            parts
            and any(map(_LETTER.search, parts))
            and (close or any(map(is_known, _bare(parts))))
        ):
            heads.append(_bare(parts))
            if close and k == 0 and not _are_units(heads[0]):
                break
    if not heads:
        first = _trimmed(split(near[0], delimiter)) if near and delimiter != " " else []
        return [""] * width, len(first) if len(first) > 1 and all(map(_LETTER.search, first)) else 0
    units = [""] * width
    if len(heads) > 1 and _are_units(heads[0]):
        units = [part.strip("()[] ") for part in heads.pop(0)]
    rank = [(sum(map(is_known, head)), any(units) * len("".join(head))) for head in heads]
    names = heads[rank.index(max(rank))]
    return [f"{a} [{u}]" if a and u else a for a, u in zip(names, units, strict=True)], 0


def is_known(head: str, channel: str | None = None) -> bool:
    """Return whether a heading has a usual name, or a unit, of a channel or any."""
    name, unit = name_and_unit(head)
    kinds = CHANNELS.values() if channel is None else [CHANNELS[channel]]
    return bool(name) and any(
        re.fullmatch(kind.names, plain(name)) or (channel is None and unit and kind.has(unit))
        for kind in kinds
    )


def _parts(line: str, delimiter: str, width: int, most: int, *, numbered: bool) -> list[str] | None:
    """Return the parts of a line with the separator of the rows, if they give the width."""
    bare = _COMMENT.sub("", line)
    parts = split(bare if delimiter == ";" else bare.lstrip("; "), delimiter)
    names = _trimmed(parts)
    if numbered and len(names) == width - 1:
        return ["", *names]
    # Columns at the end may be empty.
    longer = width < len(names) and (len(names) <= most or delimiter in "\t;|")
    if len(names) == width or longer or len(names) < width <= len(parts):
        return parts[:width]
    return None


def _otherwise(line: str, width: int) -> list[str] | None:
    """Return the parts of a line with the first separator that gives the width."""
    bare = _COMMENT.sub("", line).strip()
    ways = [re.split(rf"\s*{separator}\s*", bare) for separator in _SEPARATORS]
    ways += [_WORD.findall(bare), bare.split()]
    ways = [_trimmed([part.strip('" ') for part in parts]) for parts in ways]
    return next((parts for parts in ways if len(parts) == width and all(parts)), None)


def _trimmed(parts: list[str]) -> list[str]:
    """Return parts without the empty ones at the end."""
    while parts and not parts[-1]:
        parts = parts[:-1]
    return parts


def _bare(parts: list[str]) -> list[str]:
    """Return names without the channel, and without the run that several share."""
    parts = [_CHANNEL.sub(" ", part).strip() for part in parts]
    for pattern in (_BEFORE, _BEHIND):
        matches = [pattern.search(part) for part in parts]
        marks = Counter(match[1] for match in matches if match)
        mark = next((mark for mark in marks if marks[mark] > 1 or "#" in mark), None)
        parts = [
            pattern.sub("", part) if match and match[1] == mark else part
            for part, match in zip(parts, matches, strict=True)
        ]
    return parts


def _are_units(parts: list[str]) -> bool:
    """Return whether parts may be units, and half of them are known."""
    units = [part.strip("()[] ") for part in parts if part]
    known = sum(any(kind.has(unit) for kind in CHANNELS.values()) for unit in units)
    return all(map(_UNIT.fullmatch, parts)) and 2 * known >= len(units) > 0
