"""Words that depend on numbers."""

from __future__ import annotations

__all__ = ["counted"]


def counted(count: int, noun: str) -> str:
    """Return ``1 period``, ``2 periods``."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
