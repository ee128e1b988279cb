"""Words and digits that depend on numbers."""

from __future__ import annotations

import abc
import dataclasses
import html
import math
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    Table = tuple[Sequence[str], Sequence[Sequence[str]]]
    from collections.abc import Sequence


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


# Results that say themselves: tables and lines, as text and in a notebook.


class Readable(abc.ABC):
    """A result with ``print(result)`` and a notebook's cell as its command prints it.

    Its arrays stay behind its attributes: a dataclass that is one has ``repr=False`` and a
    ``__repr__`` of one line.
    """

    @abc.abstractmethod
    def said(self) -> tuple[Sequence[Table], Iterable[str]]:
        """Return tables, each a head and rows, and the lines below them."""

    def __str__(self) -> str:
        tables, lines = self.said()
        return "\n".join([*(columns(*table) for table in tables if table[1]), *lines])

    def _repr_html_(self) -> str:
        tables, lines = self.said()
        below = "<br>".join(html.escape(line) for line in lines)
        return "".join(_html(*table) for table in tables if table[1]) + f"<p>{below}</p>"


def columns(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in columns as wide as they need, its head first, and an empty line."""
    lines = [head, *rows]
    wide = [max(len(line[k]) for line in lines) for k in range(len(head))]
    padded = ("  ".join(map(str.ljust, line, wide)) for line in lines)
    return "\n".join(line.rstrip() for line in padded) + "\n"


def _html(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    def line(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    body = "".join(line(row, "td") for row in rows)
    return f"<table><thead>{line(head, 'th')}</thead><tbody>{body}</tbody></table>"


# Numbers with their errors, and with as many digits as these leave them.


ERROR_DIGITS: Final = 2
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
    places = ERROR_DIGITS - 1 - math.floor(math.log10(error)) if 0 < error < math.inf else 0
    if places <= 0 or places > 15:  # noqa: PLR2004 (no digits left, or none needed)
        return f"[{low:.6g}, {high:.6g}]"
    return f"[{low:.{places}f}, {high:.{places}f}]"


def estimate_text(estimate: Estimate, *, minus: str = "-") -> str:
    """Return a number with its standard error in the last digits: ``6.2047(12)``, +- 0.0012.

    Pictures write another ``minus``.
    """
    return _estimate_text(estimate).replace("-", minus)


def _estimate_text(estimate: Estimate) -> str:
    value, error = estimate.value, estimate.stderr
    if error is None or not math.isfinite(error) or error <= 0:
        return f"{value:.5g}"
    places = ERROR_DIGITS - 1 - math.floor(math.log10(error))
    if places <= 0 or places > 15:  # noqa: PLR2004 (no digits left, or none needed)
        return f"{value:.5g} +- {error:.2g}"
    return f"{value:.{places}f}({round(error * 10**places)})"


@dataclasses.dataclass(frozen=True)
class Estimate:
    """A number with its uncertainty.

    Parameters
    ----------
    value : float
        In SI.
    stderr : float or None
        Its standard error, where the method gives one.
    ci95 : tuple of float or None
        Its 95 % interval, where the method gives one; it need not be symmetric.
    """

    value: float
    stderr: float | None = None
    ci95: tuple[float, float] | None = None
