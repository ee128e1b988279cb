"""Text and JSON on stdout: 80 columns, tables with a bold header."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from pendmap.formatting import columns, json_text, wrapped

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from pendmap.formatting import Readable


def say(text: str) -> None:
    """Write lines to stdout; those of more than 80 columns go on below, indented."""
    click.echo(wrapped(text))


def write_json(fields: dict[str, Any]) -> None:
    """Write one JSON object to stdout."""
    click.echo(json_text(fields))


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table with a bold header and aligned columns."""
    parts = (part.partition("\n") for part in columns(head, rows).split("\n\n"))
    return "\n\n".join(click.style(first, bold=True) + end + rest for first, end, rest in parts)


def first_of_all(found: Readable, first: Collection[str]) -> Iterator[str]:
    """Yield lines, then the tables and the other lines of a result's text."""
    yield from first
    tables, lines = found.text_parts()
    yield from (table(head, rows) for head, rows in tables if rows)
    yield from (line for line in lines if line not in first)
