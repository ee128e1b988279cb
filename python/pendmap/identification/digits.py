"""Numbers with their errors, and with as many digits as these leave them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from pendmap.identification.result import Estimate

__all__ = ["interval", "with_error"]

DIGITS: Final = 2
"""Digits of a standard error."""


def interval(estimate: Estimate) -> str:
    """Return the 95 % interval with the digits that the standard error has: ``[6.2022, 6.2071]``.

    Empty where there is none.
    """
    if estimate.ci95 is None:
        return ""
    low, high = estimate.ci95
    error = estimate.stderr
    if error is None or not math.isfinite(error) or error <= 0:
        error = (high - low) / 4
    places = DIGITS - 1 - math.floor(math.log10(error)) if 0 < error < math.inf else 0
    if places <= 0 or places > 15:  # noqa: PLR2004 (no digits left, or none needed)
        return f"[{low:.6g}, {high:.6g}]"
    return f"[{low:.{places}f}, {high:.{places}f}]"


def with_error(estimate: Estimate, *, minus: str = "-") -> str:
    """Return a number with its standard error in the last digits: ``6.2047(12)``, +- 0.0012.

    Pictures write another ``minus``.
    """
    return _with_error(estimate).replace("-", minus)


def _with_error(estimate: Estimate) -> str:
    value, error = estimate.value, estimate.stderr
    if error is None or not math.isfinite(error) or error <= 0:
        return f"{value:.5g}"
    places = DIGITS - 1 - math.floor(math.log10(error))
    if places <= 0 or places > 15:  # noqa: PLR2004 (no digits left, or none needed)
        return f"{value:.5g} +- {error:.2g}"
    return f"{value:.{places}f}({round(error * 10**places)})"
