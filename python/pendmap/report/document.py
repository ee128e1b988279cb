"""Reports as blocks of Markdown (CommonMark with GitHub's tables), with output as Markdown or HTML.

Names of files and columns may contain any character: they pass through :func:`plain` or
:func:`code`, which show them unchanged.
"""

from __future__ import annotations

import base64
import dataclasses
import re
from html import escape
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

STYLE: Final = """
body { max-width: 56rem; margin: 2rem auto; padding: 0 1rem; color: #222; background: #fff;
       font: 1rem/1.5 system-ui, sans-serif; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; }
h1 + p { font-size: 1.1rem; border-left: .25rem solid #0072b2; padding-left: .8rem; }
code, pre { font: .95em ui-monospace, monospace; } pre { background: #f4f4f4; padding: .7rem;
       overflow-x: auto; } pre code { font-size: 1em; }
table { display: block; overflow-x: auto; border-collapse: collapse; font-size: .92rem; }
th, td { padding: .15rem .8rem .15rem 0; text-align: left; border-bottom: 1px solid #ddd;
       vertical-align: top; } [style] { white-space: nowrap; }
figure { margin: 1.2rem 0; } img { max-width: 100%; height: auto; }
figcaption { color: #666; font-size: .9rem; }
"""

SPECIAL: Final = re.compile(r"([\\`*_{}\[\]<>#~$&!])")
"""Characters with a meaning in Markdown."""

AHEAD: Final = re.compile(r"^(\s*\d*)([-+=.)])(?!\d)")
"""Characters with a meaning in Markdown at the start of a line."""


@dataclasses.dataclass(frozen=True)
class Picture:
    """Name and caption of a figure."""

    name: str
    caption: str


@dataclasses.dataclass(frozen=True)
class Document:
    """A report: a plain title, and Markdown blocks with headings of the second level or below."""

    title: str
    blocks: tuple[str | Picture, ...]

    @property
    def pictures(self) -> list[str]:
        """Names of all figures, in order."""
        return [block.name for block in self.blocks if isinstance(block, Picture)]


def plain(text: str) -> str:
    """Return Markdown that shows a text unchanged."""
    return AHEAD.sub(r"\1\\\2", SPECIAL.sub(r"\\\1", text.replace("\n", " ")))


def code(text: str) -> str:
    """Return a code span, delimited by one more backtick than occurs in a row in the text."""
    text = text.replace("\n", " ")
    marks = "`" * (max((len(run) for run in re.findall("`+", text)), default=0) + 1)
    pad = " " if text.startswith("`") or text.endswith("`") else ""
    return f"{marks}{pad}{text}{pad}{marks}"


def bullets(texts: Iterable[str]) -> str:
    """Return a bulleted list."""
    return "\n".join(f"- {text}" for text in texts)


def table(head: Sequence[str], rows: Iterable[Sequence[str]], words: Sequence[str] = ()) -> str:
    """Return a table; the first column and those in ``words`` are text, the others numbers."""
    ends = ["---" if not k or name in words else "--:" for k, name in enumerate(head)]
    lines = [" | ".join(cell.replace("|", r"\|") for cell in cells) for cells in (head, *rows)]
    first, *others = (f"| {line} |" for line in lines)
    return "\n".join([first, f"|{'|'.join(ends)}|", *others])


def as_markdown(document: Document, pictures: Mapping[str, str]) -> str:
    """Return a report as Markdown.

    Parameters
    ----------
    document : Document
        The report.
    pictures : mapping of str to str
        File of each figure, relative to that of the report; figures without one are left out.

    Returns
    -------
    str
        The content of the file.

    Examples
    --------
    >>> from pendmap.report import as_markdown
    >>> from pendmap.report.document import Document, code
    >>> print(as_markdown(Document("Title", ("Lead", "## Part", code("x"))), {}), end="")
    # Title
    <BLANKLINE>
    Lead
    <BLANKLINE>
    ## Part
    <BLANKLINE>
    `x`
    """
    blocks = [f"# {plain(document.title)}"]
    for block in document.blocks:
        if not isinstance(block, Picture):
            blocks.append(block)
        elif block.name in pictures:
            blocks.append(f"![{plain(block.caption)}](<{pictures[block.name]}>)")
    return "\n\n".join(blocks) + "\n"


def as_html(document: Document, pictures: Mapping[str, bytes]) -> str:
    """Return a report as one HTML file that contains its figures.

    Parameters
    ----------
    document : Document
        The report.
    pictures : mapping of str to bytes
        PNG file of each figure; figures without one are left out.

    Returns
    -------
    str
        The content of the file.

    Examples
    --------
    >>> from pendmap.report import as_html
    >>> from pendmap.report.document import Document, code
    >>> as_html(Document("Title", ("Lead", "## Part", code("x"))), {}).splitlines()[-3]
    '<p><code>x</code></p>'
    """
    from markdown_it import MarkdownIt  # noqa: PLC0415 (where it is needed)

    reader = MarkdownIt("commonmark", {"html": False}).enable("table")
    parts = [
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
    ]
    for block in document.blocks:
        if not isinstance(block, Picture):
            parts.append(reader.render(block).rstrip())
        elif block.name in pictures:
            content = base64.b64encode(pictures[block.name]).decode("ascii")
            caption = escape(block.caption)
            parts += [
                "<figure>",
                f'<img src="data:image/png;base64,{content}" alt="{caption}">',
                f"<figcaption>{caption}</figcaption>",
                "</figure>",
            ]
    return "\n".join([*parts, "</body>", "</html>", ""])
