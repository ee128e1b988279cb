"""What can be wrong with a request."""

from __future__ import annotations

__all__ = ["InputError"]


class InputError(ValueError):
    """A value that was given is not allowed; the message names it and what is allowed."""
