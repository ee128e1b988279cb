"""Reports in Markdown and HTML, both made of one structure."""

from __future__ import annotations

from pendmap.report.diagnosis import diagnosis
from pendmap.report.document import as_html, as_markdown

__all__ = ["as_html", "as_markdown", "diagnosis"]
