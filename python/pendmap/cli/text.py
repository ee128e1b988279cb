"""Text and JSON on stdout: 80 columns, tables with a bold header."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final

import click

from pendmap.errors import escaped
from pendmap.formatting import columns, json_text, wrapped

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from pendmap.formatting import Readable


_BOLD: Final = re.compile("(\x1b\\[[01]m)")  # What click.style writes


def say(text: str, *, err: bool = False) -> None:
    """Write lines to stdout or stderr; those of more than 80 columns go on below, indented.

    Control characters, which names of files and columns may have, are escaped.
    """
    parts = enumerate(_BOLD.split(text))
    safe = "".join(part if place % 2 else escaped(part) for place, part in parts)
    click.echo(wrapped(safe), err=err)


def write_json(fields: dict[str, Any]) -> None:
    """Write one JSON object to stdout."""
    click.echo(json_text(fields))


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table with a bold header and aligned columns."""
    parts = (part.partition("\n") for part in columns(head, rows).split("\n\n"))
    return "\n\n".join(click.style(first, bold=True) + end + rest for first, end, rest in parts)


def first_of_all(result: Readable, first: Collection[str]) -> Iterator[str]:
    """Yield lines, then the tables and the other lines of a result's text."""
    yield from first
    tables, lines = result.text_parts()
    yield from (table(head, rows) for head, rows in tables if rows)
    yield from (line for line in lines if line not in first)
