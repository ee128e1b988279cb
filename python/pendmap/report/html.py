"""A report as one HTML file that needs no other."""

from __future__ import annotations

import base64
from html import escape
from typing import TYPE_CHECKING, Final

from pendmap.report.document import Formula, Items, Name, Paragraph, Picture, Strong, Table

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pendmap.report.document import Block, Document, Text

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


def as_html(document: Document, pictures: Mapping[str, bytes]) -> str:
    """Return a report as HTML with its figures in it.

    Parameters
    ----------
    document : Document
        The report.
    pictures : mapping of str to bytes
        For the name of a figure the content of its PNG file; others are left out.
    """
    return "\n".join([*_head(document.title), *_body(document, pictures), "</body>", "</html>", ""])


def _head(title: str) -> Iterator[str]:
    yield "<!DOCTYPE html>"
    yield '<html lang="en">'
    yield "<head>"
    yield '<meta charset="utf-8">'
    yield '<meta name="viewport" content="width=device-width, initial-scale=1">'
    yield f"<title>{escape(title)}</title>"
    yield f"<style>{STYLE}</style>"
    yield "</head>"
    yield "<body>"


def _body(document: Document, pictures: Mapping[str, bytes]) -> Iterator[str]:
    yield f"<h1>{escape(document.title)}</h1>"
    yield f'<p class="lead">{_inline(document.lead)}</p>'
    for section in document.sections:
        yield f"<h2>{escape(section.title)}</h2>"
        for block in section.blocks:
            yield from _block(block, pictures)


def _block(block: Block, pictures: Mapping[str, bytes]) -> Iterator[str]:
    if isinstance(block, Paragraph):
        yield f"<p>{_inline(block.text)}</p>"
    elif isinstance(block, Formula):
        yield f"<pre>{escape(block.text)}</pre>"
    elif isinstance(block, Items):
        yield "<ul>"
        yield from (f"<li>{_inline(text)}</li>" for text in block.texts)
        yield "</ul>"
    elif isinstance(block, Table):
        yield '<div class="wide"><table>'
        yield _row(block.head, block.of_words, "th")
        yield from (_row(row, block.of_words, "td") for row in block.rows)
        yield "</table></div>"
    elif isinstance(block, Picture) and block.name in pictures:
        content = base64.b64encode(pictures[block.name]).decode("ascii")
        said = escape(block.caption)
        yield "<figure>"
        yield f'<img src="data:image/png;base64,{content}" alt="{said}">'
        yield f"<figcaption>{said}</figcaption>"
        yield "</figure>"


def _row(cells: tuple[Text, ...], of_words: tuple[bool, ...], tag: str) -> str:
    begins = (f"<{tag}>" if words else f'<{tag} class="n">' for words in of_words)
    parts = (f"{b}{_inline(cell)}</{tag}>" for b, cell in zip(begins, cells, strict=True))
    return f"<tr>{''.join(parts)}</tr>"


def _inline(text: Text) -> str:
    if isinstance(text, tuple):
        return "".join(_inline(part) for part in text)
    if isinstance(text, Name):
        return f"<code>{escape(text.text)}</code>"
    if isinstance(text, Strong):
        return f"<strong>{escape(text.text)}</strong>"
    return escape(text)
