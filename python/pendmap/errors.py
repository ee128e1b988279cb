"""What can be wrong with a request, and how it is put."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["FitDiverged", "InputError", "NotWrittenError", "core_errors", "one_line"]

MOST = 500
"""Characters of a message."""


def one_line(text: str) -> str:
    """Return a text on one line as a terminal may show it: no control characters, 500 at most.

    Parameters
    ----------
    text : str
        A message; file names, values and what libraries say may stand in it.

    Returns
    -------
    str
        Control characters and marks of direction as escapes; the middle left out where it is long.
    """
    line = " ".join(text[: 100 * MOST].split())
    line = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in line)
    if len(line) <= MOST:
        return line
    return f"{line[: MOST // 2]} ... {line[-(MOST // 2 - 5) :]}"


class InputError(ValueError):
    """A value that was given is not allowed; the message names it and what it must be."""

    def __init__(self, message: object = "") -> None:
        super().__init__(one_line(str(message)))


class FitDiverged(ArithmeticError):  # noqa: N818 (it is no mistake of the caller)
    """A fit is lost: its motion leaves the range of numbers, or its values are no model's."""


class NotWrittenError(OSError):
    """Results were computed that could not be written; the message names them and what was."""


@contextlib.contextmanager
def core_errors(lost: type[Exception] = InputError) -> Iterator[None]:
    """Raise what the core refuses as InputError, and as ``lost`` where a motion diverges."""
    try:
        yield
    except ValueError as error:
        from pendmap import _core  # noqa: PLC0415 (the core is loaded where it works)

        kind = lost if isinstance(error, _core.Diverged) else InputError
        raise kind(str(error)) from None
