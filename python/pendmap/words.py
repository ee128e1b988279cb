"""Words and digits that depend on numbers."""

from __future__ import annotations

import math
from typing import Final

__all__ = ["counted", "moment", "with_error", "written"]

DIGITS: Final = 5
"""Digits of a number whose uncertainty is not known."""

PLACES: Final = 10
"""Places after the point up to which a number is written out."""

LONG_AGO: Final = 1e3
"""Seconds from which six digits are no longer milliseconds."""


def counted(count: int, noun: str, several: str = "") -> str:
    """Return ``1 period``, ``2 periods``; ``several`` is the plural where that takes no s."""
    return f"{count} {noun}" if count == 1 else f"{count} {several or noun + 's'}"


def moment(time: float) -> str:
    """Return a time in s to six digits, of a clock that counts from long ago to milliseconds."""
    return f"{time:.6g}" if abs(time) < LONG_AGO else f"{round(time, 3):.15g}"


def written(value: float, width: float) -> str:
    """Return a number with two digits of its uncertainty, five where that is unknown: 0."""
    if not (math.isfinite(value) and math.isfinite(width)):
        return f"{value:g}"
    if not width:
        return f"{value:.{DIGITS}g}"
    places = max(1 - math.floor(math.log10(width)), 0)
    if places > PLACES:
        return f"{value:.3g}"
    text = f"{value:.{places}f}"
    return text if float(text) else text.removeprefix("-")  # no minus zero


def with_error(value: float, error: float, sign: str = "+-") -> str:
    """Return ``0.2736 +- 0.0013``; the number alone where its error is 0, or not known.

    A number without an error has five digits, however small it is.
    """
    if not (math.isfinite(error) and error > 0):
        return written(value, 0.0)
    return f"{written(value, error)} {sign} {written(error, error)}"
