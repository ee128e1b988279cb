"""The package's exceptions, and checks of arguments that raise them."""

from __future__ import annotations

import contextlib
import difflib
import math
import numbers
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator

MOST: Final = 500  # Largest length of a message, characters


def escaped(text: str) -> str:
    """Return a text whose control characters are escapes, line ends excepted."""
    return "".join(
        c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text
    )


def one_line(text: str) -> str:
    """Return a text on one line of 500 characters at most, control characters as escapes.

    It may contain file names, values and messages of libraries; a longer text lacks its middle.
    """
    line = escaped(" ".join(text[: 100 * MOST].split()))
    if len(line) <= MOST:
        return line
    return f"{line[: MOST // 2]} ... {line[-(MOST // 2 - 5) :]}"


class InputError(ValueError):
    """An argument has a value that is not allowed; the message names it and the allowed values."""

    def __init__(self, message: object = "") -> None:
        super().__init__(one_line(str(message)))


class MissingExtraError(InputError, ImportError):
    """The packages of an extra are not installed; the message names the extra."""


class FitDiverged(ArithmeticError):  # noqa: N818 (it is no mistake of the caller)
    """A fit diverged: its trajectory overflowed, or its values are outside a model's range."""


class ViewerError(RuntimeError):
    """The viewer cannot be started, or no longer answers."""


class NotWrittenError(OSError):
    """Computed results could not be written; the message names them and the files written."""


@contextlib.contextmanager
def named(where: str) -> Iterator[None]:
    """Prefix messages on input and on the viewer with a file or an option."""
    try:
        yield
    except (InputError, ViewerError) as error:
        kind = InputError if isinstance(error, InputError) else ViewerError
        raise kind(f"{where}: {error}") from error


@contextlib.contextmanager
def core_errors(lost: type[Exception] = InputError) -> Iterator[None]:
    """Convert the core's ValueError to InputError, and to ``lost`` if a trajectory diverges."""
    try:
        yield
    except ValueError as error:
        from pendmap import _core  # noqa: PLC0415 (deferred import of the core)

        kind = lost if isinstance(error, _core.Diverged) else InputError
        raise kind(str(error)) from None


MOST_CELLS: Final = 100_000
MOST_DRAWS: Final = 10_000
MOST_PERIODS: Final = 2**31 - 1
MOST_SAMPLES: Final = 10_000
MOST_SEED: Final = 2**63 - 1
MOST_THREADS: Final = 256  # Largest allowed values of arguments

_LONGEST: Final = 60  # Largest length of a value in a message, characters


def short_repr(value: object) -> str:
    """Return the repr of a value for a message: on one line, cut after 60 characters."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # an integer of more digits than Python writes
        return "a number of thousands of digits"
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _bare(value: Any) -> Any:  # noqa: ANN401 (whatever was given)
    """Return numpy scalars and 0-dimensional arrays as Python numbers, others unchanged."""
    return value.item() if getattr(value, "ndim", None) == 0 and hasattr(value, "item") else value


def instruction_set() -> str:
    """Return the instruction set in use; refuse a ``PENDMAP_SIMD`` that is not available."""
    from pendmap import _core  # noqa: PLC0415 (heavy; the command line reads only the bounds)

    with core_errors():
        return _core.simd()


def check_number(name: str, value: object) -> float:
    """Return any finite real number as a float; refuse anything else, ``bool`` included."""
    value = _bare(value)
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise InputError(f"{name} must be a number, got {short_repr(value)}")
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        raise InputError(f"{name} must be a finite number, got {short_repr(value)}")
    return result


def check_whole(name: str, value: object, least: int, most: int) -> int:
    """Return a whole number from ``least`` to ``most`` as an int; refuse 2.0 and ``bool``."""
    given = _bare(value)
    whole = isinstance(given, numbers.Integral) and not isinstance(given, bool)
    if not (whole and least <= int(given) <= most):
        wanted = f"a whole number from {least} to {most}"
        raise InputError(f"{name} must be {wanted}, got {short_repr(given)}")
    return int(given)


def check_keys(
    where: str, given: Iterable[object], known: Collection[str], among: str = ""
) -> None:
    """Raise InputError if a key is not among the known ones; ``where`` begins the message."""
    for key in given:
        if key not in known:
            lower = {name.lower(): name for name in known}
            near = difflib.get_close_matches(str(key).lower(), lower, 1, 0.55)
            perhaps = f", perhaps {lower[near[0]]} is meant" if near else ""
            names = among or ", ".join(known)
            shown = key if isinstance(key, str) and key.isidentifier() else short_repr(key)
            raise InputError(f"{where}{shown} is not known{perhaps}: it must be one of {names}")


def check_flag(name: str, value: object) -> bool:
    """Return True or False; refuse anything else."""
    value = _bare(value)
    if not isinstance(value, bool):
        raise InputError(f"{name} must be True or False, got {short_repr(value)}")
    return value


def check_callable(name: str, value: object, of: str = "two numbers, done and in all") -> None:
    """Raise InputError unless a value is ``None`` or callable; ``of`` names its arguments."""
    if value is not None and not callable(value):
        raise InputError(f"{name} must be a function of {of}, got {short_repr(value)}")


def check_type(name: str, value: object, kind: type, example: str) -> None:
    """Raise InputError unless a value is of a type; the message quotes a valid ``example``."""
    if not isinstance(value, kind):
        article = ("an " if kind.__name__[0] in "AEIOU" else "a ") + kind.__name__
        raise InputError(f"{name} must be {article}, like {example}, got {short_repr(value)}")
