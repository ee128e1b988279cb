"""A report as a structure, written as Markdown (CommonMark and GitHub's) or as one HTML file.

Texts are plain and shown unchanged; names of files and columns may contain any character.
"""

from __future__ import annotations

import base64
import dataclasses
import re
from html import escape
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

STYLE: Final = """
body { max-width: 56rem; margin: 2rem auto; padding: 0 1rem; color: #222; background: #fff;
       font: 1rem/1.5 system-ui, sans-serif; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; }
.lead { font-size: 1.1rem; border-left: .25rem solid #0072b2; padding-left: .8rem; }
code, pre { font: .95em ui-monospace, monospace; } pre { background: #f4f4f4; padding: .7rem;
       overflow-x: auto; }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-size: .92rem; }
th, td { padding: .15rem .8rem .15rem 0; text-align: left; border-bottom: 1px solid #ddd;
       vertical-align: top; } .n { text-align: right; white-space: nowrap; }
figure { margin: 1.2rem 0; } img { max-width: 100%; height: auto; }
figcaption { color: #666; font-size: .9rem; }
"""

SPECIAL: Final = re.compile(r"([\\`*_{}\[\]<>#|~$&!])")
"""Characters that are marks in Markdown."""

AHEAD: Final = re.compile(r"^(\s*\d*)([-+=.)])")
"""Characters that are marks in Markdown at the start of a line."""

FENCE: Final = "```"


@dataclasses.dataclass(frozen=True)
class Name:
    """A name in a program."""

    text: str


@dataclasses.dataclass(frozen=True)
class Strong:
    """Emphasised text."""

    text: str


Text = str | Name | Strong | tuple[str | Name | Strong, ...]


@dataclasses.dataclass(frozen=True)
class Formula:
    """Lines that keep their blanks."""

    text: str


@dataclasses.dataclass(frozen=True)
class Table:
    """A table; the first column and those named in ``words`` hold words, the others numbers."""

    head: tuple[str, ...]
    rows: tuple[tuple[Text, ...], ...]
    words: tuple[str, ...] = ()

    @property
    def of_words(self) -> tuple[bool, ...]:
        """Whether each column holds words."""
        return tuple(k == 0 or name in self.words for k, name in enumerate(self.head))


@dataclasses.dataclass(frozen=True)
class Picture:
    """A figure by its name, and its caption."""

    name: str
    caption: str


Block = Text | list[Text] | Formula | Table | Picture
"""Part of a section; a text is a paragraph, a list of texts a list."""


@dataclasses.dataclass(frozen=True)
class Section:
    """Blocks under a heading."""

    title: str
    blocks: tuple[Block, ...]


@dataclasses.dataclass(frozen=True)
class Document:
    """A report."""

    title: str
    lead: Text  # Its summary in one sentence
    sections: tuple[Section, ...]

    @property
    def pictures(self) -> list[str]:
        """Names of all figures, in order."""
        blocks = (block for section in self.sections for block in section.blocks)
        return [block.name for block in blocks if isinstance(block, Picture)]


def as_markdown(document: Document, pictures: Mapping[str, str]) -> str:
    """Return a report as Markdown.

    Parameters
    ----------
    document : Document
        The report.
    pictures : mapping of str to str
        File of each figure, relative to that of the report; other figures are left out.

    Returns
    -------
    str
        The content of the file.

    Examples
    --------
    >>> from pendmap.report import as_markdown
    >>> from pendmap.report.document import Document, Name, Section
    >>> print(as_markdown(Document("Title", "Lead", (Section("Part", (Name("x"),)),)), {}), end="")
    # Title
    <BLANKLINE>
    Lead
    <BLANKLINE>
    ## Part
    <BLANKLINE>
    `x`
    """
    lines = [f"# {_line(document.title)}", "", _line(document.lead), ""]
    for section in document.sections:
        lines += [f"## {_line(section.title)}", ""]
        for block in section.blocks:
            lines += [*_markdown_block(block, pictures), ""]
    return "\n".join(lines).rstrip() + "\n"


def _markdown_block(block: Block, pictures: Mapping[str, str]) -> Iterator[str]:
    if isinstance(block, Formula):
        # A fence: indented lines after a list would belong to its last item.
        yield from (FENCE, *block.text.splitlines(), FENCE)
    elif isinstance(block, list):
        yield from (f"- {_line(text)}" for text in block)
    elif isinstance(block, Table):
        yield _markdown_row(block.head)
        yield "|" + "|".join("---" if words else "--:" for words in block.of_words) + "|"
        yield from (_markdown_row(row) for row in block.rows)
    elif not isinstance(block, Picture):
        yield _line(block)
    elif block.name in pictures:
        yield f"![{_line(block.caption)}](<{pictures[block.name]}>)"


def _markdown_row(cells: tuple[Text, ...]) -> str:
    return "| " + " | ".join(_inline(cell, table=True) for cell in cells) + " |"


def _line(text: Text) -> str:
    """Return Markdown of a text at the start of a line."""
    return AHEAD.sub(r"\1\\\2", _inline(text))


def _inline(text: Text, *, table: bool = False) -> str:
    """Return Markdown of a text."""
    if isinstance(text, tuple):
        return "".join(_inline(part, table=table) for part in text)
    plain = " ".join((text if isinstance(text, str) else text.text).split("\n"))
    if isinstance(text, Name):
        return _code(plain.replace("|", r"\|") if table else plain)
    escaped = SPECIAL.sub(r"\\\1", plain)
    return f"**{escaped}**" if isinstance(text, Strong) else escaped


def _code(text: str) -> str:
    """Return a span of code, in one more backtick than it has in a row."""
    most = max((len(run) for run in re.findall("`+", text)), default=0)
    pad = " " if text.startswith("`") or text.endswith("`") else ""
    return f"{'`' * (most + 1)}{pad}{text}{pad}{'`' * (most + 1)}"


def as_html(document: Document, pictures: Mapping[str, bytes]) -> str:
    """Return a report as one HTML file that contains its figures.

    Parameters
    ----------
    document : Document
        The report.
    pictures : mapping of str to bytes
        PNG file of each figure; other figures are left out.

    Returns
    -------
    str
        The content of the file.

    Examples
    --------
    >>> from pendmap.report import as_html
    >>> from pendmap.report.document import Document, Name, Section
    >>> text = as_html(Document("Title", "Lead", (Section("Part", (Name("x"),)),)), {})
    >>> text.splitlines()[-3]
    '<p><code>x</code></p>'
    """
    lines = [
        "<!DOCTYPE html>",
        '<html lang="en">',
        "<head>",
        '<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(document.title)}</title>",
        f"<style>{STYLE}</style>",
        "</head>",
        "<body>",
        f"<h1>{escape(document.title)}</h1>",
        f'<p class="lead">{_html(document.lead)}</p>',
    ]
    for section in document.sections:
        lines.append(f"<h2>{escape(section.title)}</h2>")
        for block in section.blocks:
            lines += _html_block(block, pictures)
    return "\n".join([*lines, "</body>", "</html>", ""])


def _html_block(block: Block, pictures: Mapping[str, bytes]) -> Iterator[str]:
    if isinstance(block, Formula):
        yield f"<pre>{escape(block.text)}</pre>"
    elif isinstance(block, list):
        yield "<ul>"
        yield from (f"<li>{_html(text)}</li>" for text in block)
        yield "</ul>"
    elif isinstance(block, Table):
        yield '<div class="wide"><table>'
        yield _html_row(block.head, block.of_words, "th")
        yield from (_html_row(row, block.of_words, "td") for row in block.rows)
        yield "</table></div>"
    elif not isinstance(block, Picture):
        yield f"<p>{_html(block)}</p>"
    elif block.name in pictures:
        content = base64.b64encode(pictures[block.name]).decode("ascii")
        said = escape(block.caption)
        yield "<figure>"
        yield f'<img src="data:image/png;base64,{content}" alt="{said}">'
        yield f"<figcaption>{said}</figcaption>"
        yield "</figure>"


def _html_row(cells: tuple[Text, ...], of_words: tuple[bool, ...], tag: str) -> str:
    begins = (f"<{tag}>" if words else f'<{tag} class="n">' for words in of_words)
    parts = (f"{b}{_html(cell)}</{tag}>" for b, cell in zip(begins, cells, strict=True))
    return f"<tr>{''.join(parts)}</tr>"


def _html(text: Text) -> str:
    """Return HTML of a text."""
    if isinstance(text, tuple):
        return "".join(_html(part) for part in text)
    if isinstance(text, Name):
        return f"<code>{escape(text.text)}</code>"
    if isinstance(text, Strong):
        return f"<strong>{escape(text.text)}</strong>"
    return escape(text)
