"""A diagnosis as a report in Markdown and HTML."""

from __future__ import annotations

from pendmap.report.diagnosis import as_html, as_markdown

__all__ = ["as_html", "as_markdown"]
