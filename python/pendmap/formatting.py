"""Text of numbers, counts and tables: the only module that formats numbers with errors."""

from __future__ import annotations

import abc
import dataclasses
import html
import json
import math
import re
import textwrap
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    Table = tuple[Sequence[str], Sequence[Sequence[str]]]


DIGITS: Final = 5  # Significant digits of a number of unknown uncertainty
PLACES: Final = 10  # Largest number of decimal places of a number
ERROR_DIGITS: Final = 2  # Significant digits of a standard error
MOST_PLACES: Final = 15  # Largest number of decimal places of an estimate
MINUS: Final = "\N{MINUS SIGN}"  # Minus sign of figures
WIDTH: Final = 80  # Columns of a terminal
_STYLE: Final = re.compile("\x1b\\[[0-9;]*m")  # Bold letters and colours of a terminal
_GLUE: Final = "\N{NO-BREAK SPACE}"
_GLUED: Final = re.compile(r"(?<=\d) (?=%|\+-)|(?<=\+-) |(?<= =) |(?<=\S) (?== )")
LONG_AGO: Final = 1e3  # Time from which six digits are coarser than 1 ms, s


def typographic(text: str) -> str:
    """Return a text of a figure, with minus signs for hyphens and a plus-minus sign for ``+-``."""
    return text.replace("+-", "\N{PLUS-MINUS SIGN}").replace("-", MINUS)


def counted(count: int, noun: str, several: str = "") -> str:
    """Return ``1 period``, ``2 periods``; ``several`` is an irregular plural."""
    return f"{count} {noun}" if count == 1 else f"{count} {several or noun + 's'}"


def duration(seconds: float) -> str:
    """Return ``75 seconds``, ``3 minutes``, ``5 hours``, ``4 days``: two of a unit or more."""
    for size, word in ((86400.0, "day"), (3600.0, "hour"), (60.0, "minute")):
        if seconds >= 2 * size:
            return counted(round(seconds / size), word)
    return counted(max(1, round(seconds)), "second")


def listed(texts: Sequence[str], most: int) -> str:
    """Return the first ``most`` texts joined by commas, with ``, ...`` if there are more."""
    return ", ".join(texts[:most]) + (", ..." if len(texts) > most else "")


def percent(value: float) -> str:
    """Return ``0.123 %``; empty if the value is not finite."""
    return f"{value:.3g} %" if math.isfinite(value) else ""


def span(name: str, low: float, high: float) -> str:
    """Return ``p = 0.4 to 1.25``, or ``p = 0.4`` if both ends are equal, to four digits."""
    return f"{name} = {low:.4g}" + ("" if low == high else f" to {high:.4g}")


def moment(time: float) -> str:
    """Return a time in s to six digits, from 1000 s on to a millisecond."""
    return f"{time:.6g}" if abs(time) < LONG_AGO else f"{round(time, 3):.15g}"


def written(value: float, width: float) -> str:
    """Return a number to two digits of its uncertainty, or five digits if that is 0 (unknown)."""
    if not (math.isfinite(value) and math.isfinite(width)):
        return f"{value:g}"
    if not width:
        return f"{value:.{DIGITS}g}"
    places = max(_places(width), 0)
    if places > PLACES:
        return f"{value:.3g}"
    text = f"{value:.{places}f}"
    return text if float(text) else text.removeprefix("-")  # no minus zero


def with_error(value: float, error: float) -> str:
    """Return ``0.2736 +- 0.0013``; the number to five digits if its error is 0 or unknown."""
    if not (math.isfinite(error) and error > 0):
        return written(value, 0.0)
    return f"{written(value, error)} +- {written(error, error)}"


class Readable(abc.ABC):
    """Base of results whose text and HTML are what their command prints.

    A dataclass of this type has ``repr=False`` and a ``__repr__`` of one line, without arrays.
    """

    @abc.abstractmethod
    def text_parts(self) -> tuple[Sequence[Table], Iterable[str]]:
        """Return tables, each a header and rows, and the lines below them."""

    def __str__(self) -> str:
        tables, lines = self.text_parts()
        return "\n".join([*(columns(*table) for table in tables if table[1]), *map(wrapped, lines)])

    def _repr_html_(self) -> str:
        tables, lines = self.text_parts()
        below = "<br>".join(html.escape(line) for line in lines)
        return "".join(html_table(*table) for table in tables if table[1]) + f"<p>{below}</p>"


def wrapped(text: str, width: int = WIDTH) -> str:
    """Break lines longer than ``width`` columns between words; what follows is indented by two."""
    lines = []
    for line in text.split("\n"):
        if len(_STYLE.sub("", line)) <= width:
            lines.append(line)
            continue
        start = line[: len(line) - len(line.lstrip())]
        whole = _GLUED.sub(_GLUE, line.strip())  # a number and its unit stay together
        further: dict[str, Any] = {"break_long_words": False, "break_on_hyphens": False}
        parts = textwrap.wrap(
            whole, width, initial_indent=start, subsequent_indent=f"{start}  ", **further
        )
        lines += [part.replace(_GLUE, " ") for part in parts]
    return "\n".join(lines)


def columns(head: Sequence[str], rows: Sequence[Sequence[str]], width: int = WIDTH) -> str:
    """Return a table as text with aligned columns: header, rows, a final newline.

    What is wider than ``width`` continues in further tables, which repeat the first column. A
    column without an entry is left out.
    """
    lines = [head, *rows]
    wide = [max(len(line[k]) for line in lines) for k in range(len(head))]
    parts: list[list[int]] = [[0]]
    for k in range(1, len(head)):
        if rows and not any(row[k] for row in rows):
            continue
        if len(parts[-1]) > 1 and sum(wide[j] + 2 for j in parts[-1]) + wide[k] > width:
            parts.append([0])
        parts[-1].append(k)

    def written(part: list[int]) -> str:
        padded = ("  ".join(line[k].ljust(wide[k]) for k in part) for line in lines)
        return "\n".join(line.rstrip() for line in padded) + "\n"

    return "\n".join(map(written, parts))


def html_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in HTML."""

    def line(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    body = "".join(line(row, "td") for row in rows)
    return f"<table><thead>{line(head, 'th')}</thead><tbody>{body}</tbody></table>"


def json_text(fields: dict[str, Any]) -> str:
    """Return one JSON object; numbers of numpy become Python's, those not finite become null."""

    def plain(value: Any) -> Any:  # noqa: ANN401 (any part of the object)
        if isinstance(value, dict):
            return {str(key): plain(part) for key, part in value.items()}
        if isinstance(value, list | tuple):
            return [plain(part) for part in value]
        if hasattr(value, "item"):
            value = value.item()
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return json.dumps(plain(fields), allow_nan=False)


def interval(estimate: Estimate) -> str:
    """Return the 95 % interval to the digits of the error, ``[6.2022, 6.2071]``, or no text."""
    if estimate.ci95 is None:
        return ""
    low, high = estimate.ci95
    error = estimate.stderr or 0.0
    error = error if 0 < error < math.inf else (high - low) / 4
    places = _places(error) if 0 < error < math.inf else 0
    if not 0 < places <= MOST_PLACES:
        return f"[{low:.6g}, {high:.6g}]"
    return f"[{low:.{places}f}, {high:.{places}f}]"


def estimate_text(estimate: Estimate) -> str:
    """Return a number with its error in the last digits, ``6.2047(12)`` for +- 0.0012.

    A number that is held at the end of its interval has the other end: ``0 (below 0.0012)``.
    """
    value, error = estimate.value, estimate.stderr
    if error is None and estimate.ci95 is not None and estimate.ci95[0] == value:
        return f"{value:.{DIGITS}g} (below {estimate.ci95[1]:.{ERROR_DIGITS}g})"
    text = f"{value:.{DIGITS}g}"
    if error is not None and 0 < error < math.inf:
        places = _places(error)
        if 0 < places <= MOST_PLACES:
            return f"{value:.{places}f}({round(error * 10**places)})"
        text += f" +- {error:.{ERROR_DIGITS}g}"
    return text


def _places(error: float) -> int:
    """Return the number of decimal places that shows two digits of an error."""
    return ERROR_DIGITS - 1 - math.floor(math.log10(error))


@dataclasses.dataclass(frozen=True)
class Estimate:
    """A number with its uncertainty.

    Parameters
    ----------
    value : float
        In SI.
    stderr : float or None
        Its standard error, if the method gives one.
    ci95 : tuple of float or None
        Its 95 % interval, if the method gives one; it need not be symmetric.
    """

    value: float
    stderr: float | None = None
    ci95: tuple[float, float] | None = None
