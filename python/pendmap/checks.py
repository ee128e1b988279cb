"""What a caller hands over, checked: numbers, whole numbers, switches, and their bounds."""

from __future__ import annotations

import math
import numbers
import operator
from typing import Any, Final

from pendmap.errors import InputError, core_errors

__all__ = [
    "MOST_CELLS",
    "MOST_DRAWS",
    "MOST_PERIODS",
    "MOST_SAMPLES",
    "MOST_SEED",
    "MOST_THREADS",
    "call",
    "flag",
    "instruction_set",
    "number",
    "of_type",
    "shown",
    "whole",
]

MOST_CELLS: Final = 100_000
MOST_DRAWS: Final = 10_000
MOST_PERIODS: Final = 2**31 - 1
MOST_SAMPLES: Final = 10_000
MOST_SEED: Final = 2**63 - 1
MOST_THREADS: Final = 256

_LONGEST = 60


def shown(value: object) -> str:
    """Return a value as messages name it: on one line, cut where it is long."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # an integer of more digits than Python writes
        return "a number of thousands of digits"
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _bare(value: Any) -> Any:  # noqa: ANN401 (whatever was given)
    """Take a number out of numpy's scalars and arrays without dimensions."""
    return value.item() if getattr(value, "ndim", None) == 0 and hasattr(value, "item") else value


def instruction_set() -> str:
    """Return the instruction set that is computed with.

    Raises
    ------
    InputError
        If ``PENDMAP_SIMD`` names none that this processor has.
    """
    from pendmap import _core  # noqa: PLC0415 (heavy; the command line reads only the bounds)

    with core_errors():
        return _core.simd()


def number(name: str, value: object) -> float:
    """Return any finite real number as a float.

    Raises
    ------
    InputError
        For anything else, a ``bool`` included.
    """
    value = _bare(value)
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise InputError(f"{name} must be a number, got {shown(value)}")
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        raise InputError(f"{name} must be a finite number, got {shown(value)}")
    return result


def whole(name: str, value: object, least: int, most: int) -> int:
    """Return a whole number between two bounds, both included, as an int.

    Raises
    ------
    InputError
        For anything else, ``2.0`` and a ``bool`` included.
    """
    value = _bare(value)
    wanted = f"{name} must be a whole number from {least} to {most}"
    if isinstance(value, bool):
        raise InputError(f"{wanted}, got {value}")
    try:
        result = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise InputError(f"{wanted}, got {shown(value)}") from None
    if not least <= result <= most:
        raise InputError(f"{wanted}, got {shown(result)}")
    return result


def flag(name: str, value: object) -> bool:
    """Return a switch.

    Raises
    ------
    InputError
        If it is neither ``True`` nor ``False``.
    """
    value = _bare(value)
    if not isinstance(value, bool):
        raise InputError(f"{name} must be True or False, got {shown(value)}")
    return value


def call(name: str, value: object, of: str = "two numbers, done and in all") -> None:
    """Refuse what is neither ``None`` nor can be called, as a function ``of`` something.

    Raises
    ------
    InputError
        If it is something else.
    """
    if value is not None and not callable(value):
        raise InputError(f"{name} must be a function of {of}, got {shown(value)}")


def of_type(name: str, value: object, kind: type, example: str) -> None:
    """Refuse what is not of a type of pendmap's; ``example`` says how one is made.

    Raises
    ------
    InputError
        If it is of another type.
    """
    if not isinstance(value, kind):
        article = ("an " if kind.__name__[0] in "AEIOU" else "a ") + kind.__name__
        raise InputError(f"{name} must be {article}, like {example}, got {shown(value)}")
