"""Results that say themselves: tables and lines, as text and in a notebook."""

from __future__ import annotations

import abc
import html
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    Table = tuple[Sequence[str], Sequence[Sequence[str]]]

__all__ = ["Readable", "columns"]


class Readable(abc.ABC):
    """A result with ``print(result)`` and a notebook's cell as its command prints it.

    Its arrays stay behind its attributes: a dataclass that is one has ``repr=False`` and a
    ``__repr__`` of one line.
    """

    @abc.abstractmethod
    def said(self) -> tuple[Sequence[Table], Iterable[str]]:
        """Return tables, each a head and rows, and the lines below them."""

    def __str__(self) -> str:
        tables, lines = self.said()
        return "\n".join([*(columns(*table) for table in tables if table[1]), *lines])

    def _repr_html_(self) -> str:
        tables, lines = self.said()
        below = "<br>".join(html.escape(line) for line in lines)
        return "".join(_html(*table) for table in tables if table[1]) + f"<p>{below}</p>"


def columns(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in columns as wide as they need, its head first, and an empty line."""
    lines = [head, *rows]
    wide = [max(len(line[k]) for line in lines) for k in range(len(head))]
    padded = ("  ".join(map(str.ljust, line, wide)) for line in lines)
    return "\n".join(line.rstrip() for line in padded) + "\n"


def _html(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    def line(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    body = "".join(line(row, "td") for row in rows)
    return f"<table><thead>{line(head, 'th')}</thead><tbody>{body}</tbody></table>"
