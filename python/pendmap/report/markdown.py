"""A report as Markdown, as CommonMark and GitHub read it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from pendmap.report.document import Formula, Items, Name, Paragraph, Picture, Strong, Table

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pendmap.report.document import Block, Document, Text

SPECIAL: Final = re.compile(r"([\\`*_{}\[\]<>#|~$&!])")
"""What Markdown would take for a mark."""

AHEAD: Final = re.compile(r"^(\s*\d*)([-+=.)])")
"""What it would take for one where a line begins."""

FENCE: Final = "```"


def as_markdown(document: Document, pictures: Mapping[str, str]) -> str:
    """Return a report as Markdown.

    Parameters
    ----------
    document : Document
        The report.
    pictures : mapping of str to str
        For the name of a figure its file, relative to that of the report; others are left out.
    """
    lines = [f"# {_line(document.title)}", "", _line(document.lead), ""]
    for section in document.sections:
        lines += [f"## {_line(section.title)}", ""]
        for block in section.blocks:
            lines += [*_block(block, pictures), ""]
    return "\n".join(lines).rstrip() + "\n"


def _block(block: Block, pictures: Mapping[str, str]) -> Iterator[str]:
    if isinstance(block, Paragraph):
        yield _line(block.text)
    elif isinstance(block, Formula):
        # A fence: indented lines after a list would belong to its last item.
        yield from (FENCE, *block.text.splitlines(), FENCE)
    elif isinstance(block, Items):
        yield from (f"- {_line(text)}" for text in block.texts)
    elif isinstance(block, Table):
        yield _row(block.head)
        yield "|" + "|".join("---" if words else "--:" for words in block.of_words) + "|"
        yield from (_row(row) for row in block.rows)
    elif isinstance(block, Picture) and block.name in pictures:
        yield f"![{_line(block.caption)}](<{pictures[block.name]}>)"


def _row(cells: tuple[Text, ...]) -> str:
    return "| " + " | ".join(_inline(cell, table=True) for cell in cells) + " |"


def _line(text: Text) -> str:
    """Return a text that stands at the beginning of a line."""
    return AHEAD.sub(r"\1\\\2", _inline(text))


def _inline(text: Text, *, table: bool = False) -> str:
    if isinstance(text, tuple):
        return "".join(_inline(part, table=table) for part in text)
    plain = " ".join((text if isinstance(text, str) else text.text).split("\n"))
    if isinstance(text, Name):
        return _code(plain.replace("|", r"\|") if table else plain)
    escaped = SPECIAL.sub(r"\\\1", plain)
    return f"**{escaped}**" if isinstance(text, Strong) else escaped


def _code(text: str) -> str:
    """Return a span of code, in more backticks than stand in it in a row."""
    most = max((len(run) for run in re.findall("`+", text)), default=0)
    pad = " " if text.startswith("`") or text.endswith("`") else ""
    return f"{'`' * (most + 1)}{pad}{text}{pad}{'`' * (most + 1)}"
