"""Reports in Markdown and HTML from one document structure."""

from __future__ import annotations

from pendmap.report.diagnosis import diagnosis
from pendmap.report.document import as_html, as_markdown

__all__ = ["as_html", "as_markdown", "diagnosis"]
