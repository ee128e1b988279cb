"""Text in Markdown (CommonMark with GitHub's tables), and templates whose values become it.

Names of files and columns may contain any character: what a template prints is shown unchanged.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Iterable

    from jinja2 import Environment
    from markupsafe import Markup

SPECIAL: Final = re.compile(r"([\\`*{}<>#~$&!]|\](?=[(\[:])|(?<![^\W_])_|_(?![^\W_]))")
"""Characters with a meaning in Markdown: brackets and underscores have one in some places."""

AHEAD: Final = re.compile(r"^(\s*\d*)([-+=.)])(?!\d)")
"""Characters with a meaning in Markdown at the start of a line."""


def plain(text: str) -> str:
    """Return Markdown that shows a text unchanged."""
    return AHEAD.sub(r"\1\\\2", SPECIAL.sub(r"\\\1", text.replace("\n", " ")))


def code(text: str) -> str:
    """Return a code span, delimited by one more backtick than occurs in a row in the text."""
    text = text.replace("\n", " ")
    marks = "`" * (max((len(run) for run in re.findall("`+", text)), default=0) + 1)
    pad = " " if text.startswith("`") or text.endswith("`") else ""
    return f"{marks}{pad}{text}{pad}{marks}"


def markdown_templates() -> Environment:
    """Return the templates of Markdown, with the filters ``code``, ``head`` and ``row``.

    ``head`` and ``row`` make a line of a table from its cells; a cell that is None is left out.
    """
    from markupsafe import Markup  # noqa: PLC0415 (where it is needed)

    def shown(value: Any) -> Markup:  # noqa: ANN401 (what a template prints)
        return value if isinstance(value, Markup) else Markup(plain(str(value)))  # noqa: S704

    def span(text: str) -> Markup:
        return Markup(code(text))  # noqa: S704 (the page's reader escapes HTML)

    def row(cells: Iterable[Any]) -> Markup:
        texts = [shown(cell).strip().replace("|", r"\|") for cell in cells if cell is not None]
        return Markup("| ") + Markup(" | ").join(texts) + Markup(" |")

    def head(cells: Iterable[Any]) -> Markup:
        names = [cell for cell in cells if cell is not None]
        return row(names) + Markup("\n|") + Markup("---|") * len(names)

    templates = _templates().overlay(finalize=shown)
    templates.filters |= {"code": span, "head": head, "row": row}
    return templates


def as_page(text: str) -> str:
    """Return Markdown as an HTML page, with the first heading as its title."""
    from markdown_it import MarkdownIt  # noqa: PLC0415 (where it is needed)

    reader = MarkdownIt("commonmark", {"html": False, "xhtmlOut": False}).enable("table")
    return _templates().get_template("page.html.jinja").render(body=reader.render(text))


def _templates() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined  # noqa: PLC0415

    return Environment(
        loader=PackageLoader("pendmap.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
