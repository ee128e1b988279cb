"""Mathematics as MathML, which browsers show without scripts."""

from __future__ import annotations

import re
from html import escape
from typing import TYPE_CHECKING, Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.util import logging

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.writers.html5 import HTML5Translator

LOGGER = logging.getLogger(__name__)
PRIME = re.compile(r"<msup>(<mi>[^<]*</mi>)<mi>(&#x0203[2-4];)</mi></msup>")
"""A prime is high already: as an exponent browsers raise it twice."""
FUNCTION = re.compile(r"<mi>(?:arccos|arcsin|arctan|cosh|sinh|tanh|cos|sin|tan|exp|log|ln)</mi>")
THIN = '<mspace width="0.17em"/>'


def mathml(node: nodes.math | nodes.math_block) -> str:
    """Return the MathML of a node; an expression that cannot be converted is a warning."""
    display = "block" if isinstance(node, nodes.math_block) else "inline"
    text = node.astext()
    try:
        written = PRIME.sub(r"<mrow>\1<mo>\2</mo></mrow>", convert(text, display=display))
        return FUNCTION.sub(rf"{THIN}\g<0>{THIN}", written)
    except Exception as error:  # noqa: BLE001 (any error of the converter)
        LOGGER.warning("no MathML of %r: %r", text, error, location=node)
        return f"<code>{escape(text)}</code>"


def inline(self: HTML5Translator, node: nodes.math) -> None:
    """Write an expression in a line of text."""
    self.body.append(f'<span class="math">{mathml(node)}</span>')
    raise nodes.SkipNode


def block(self: HTML5Translator, node: nodes.math_block) -> None:
    """Write an expression of its own, with its number if it has one."""
    anchor = f' id="{node["ids"][0]}"' if node["ids"] else ""
    number = f'<span class="eqno">({node["number"]})</span>' if node.get("number") else ""
    self.body.append(f'<div class="math"{anchor}>{mathml(node)}{number}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
