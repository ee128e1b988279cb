"""Tracing of a Python function to the term of a formula, by one call with symbols."""

from __future__ import annotations

import math
import numbers
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import InputError, short_repr

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

_SUM, _PRODUCT, _POWER, _WHOLE = range(4)
"""Precedence of operators; operands of lower precedence are put in brackets."""

_USABLE: Final = (
    "arithmetic and numpy's sqrt, exp, log, sin, cos, tan, tanh, abs, sign, square, minimum, "
    "maximum"
)


class _Text(np.lib.mixins.NDArrayOperatorsMixin):
    """Symbolic operand: the text of a term, and the precedence of its last operator."""

    def __init__(self, text: str, strength: int = _WHOLE) -> None:
        self.text = text
        self.strength = strength

    def at_least(self, strength: int) -> str:
        """Return the text, in brackets if its precedence is lower."""
        return self.text if self.strength >= strength else f"({self.text})"

    def after(self, strength: int) -> str:
        """Return the text as the operand after an operator or a sign."""
        return f"({self.text})" if self.text.startswith("-") else self.at_least(strength)

    def __array_ufunc__(
        self,
        ufunc: np.ufunc,
        method: str,
        *given: Any,  # noqa: ANN401 (whatever numpy hands over)
        **options: Any,  # noqa: ANN401 (likewise)
    ) -> _Text:
        name = ufunc.__name__
        if method != "__call__" or options:
            raise _UnreadableError(f"numpy.{name}.{method}" if method != "__call__" else name)
        if name not in _WRITTEN:
            raise _UnreadableError(f"numpy.{name}")
        return _WRITTEN[name](*(_text(part) for part in given))

    def __array_function__(
        self,
        function: Callable[..., Any],
        types: Iterable[type],
        given: Any,  # noqa: ANN401 (whatever numpy hands over)
        options: Any,  # noqa: ANN401 (likewise)
    ) -> _Text:
        raise _UnreadableError(f"numpy.{function.__name__}")

    def __bool__(self) -> bool:
        raise _UnreadableError("a branch (if, and, or, while)")

    def __float__(self) -> float:
        raise _UnreadableError("float(...) or a function of math")

    def __iter__(self) -> Any:  # noqa: ANN401 (never returns)
        raise _UnreadableError("a loop over an array")


def _joined(sign: str, strength: int, *, left: int = 0, right: int = 0) -> Callable[..., _Text]:
    """Return a writer of an operator; ``left`` and ``right`` raise the precedence of operands."""

    def write(a: _Text, b: _Text) -> _Text:
        return _Text(f"{a.at_least(strength + left)}{sign}{b.after(strength + right)}", strength)

    return write


def _called(name: str) -> Callable[..., _Text]:
    """Return a writer of calls of a function."""
    return lambda *parts: _Text(f"{name}({', '.join(part.text for part in parts)})")


_WRITTEN: Final[dict[str, Callable[..., _Text]]] = {
    "add": _joined("+", _SUM),
    "subtract": _joined("-", _SUM, right=1),
    "multiply": _joined("*", _PRODUCT),
    "divide": _joined("/", _PRODUCT, right=1),
    "power": _joined("^", _POWER, left=1, right=1),
    "float_power": _joined("^", _POWER, left=1, right=1),
    "positive": lambda x: x,
    "negative": lambda x: _Text(f"-{x.after(_PRODUCT)}", _PRODUCT),
    "square": lambda x: _Text(f"{x.at_least(_WHOLE)}^2", _POWER),
    "reciprocal": lambda x: _Text(f"1/{x.after(_POWER)}", _PRODUCT),
    "tan": lambda x: _Text(f"sin({x.text})/cos({x.text})", _PRODUCT),
    "absolute": _called("abs"),
    "fabs": _called("abs"),
    "minimum": _called("min"),
    "fmin": _called("min"),
    "maximum": _called("max"),
    "fmax": _called("max"),
} | {name: _called(name) for name in ("sqrt", "exp", "log", "sin", "cos", "tanh", "sign")}


class _UnreadableError(Exception):
    """An operation that formulas do not have; the message names it."""


def term_of(function: Callable[..., Any], parameters: Iterable[str], name: str) -> str:
    """Return the term that a function computes; arguments as in :meth:`pendmap.Formula.of`."""
    known = {parameter: _Text(parameter) for parameter in parameters}
    variables = [_Text(variable) for variable in ("theta", "v", "t", "phase")]
    try:
        found = _text(function(*variables, known))
    except _UnreadableError as error:
        raise InputError(
            f"function '{name}' uses {error}, which no formula has: it must use {_USABLE}"
        ) from None
    except KeyError as error:
        raise InputError(
            f"function '{name}' must ask for parameters among {', '.join(known)}, got {error}"
        ) from None
    except Exception as error:  # noqa: BLE001 (whatever a user's function may raise)
        said = " ".join(str(error).split())
        raise InputError(
            f"function '{name}' must take theta, v, t, phase, parameters, it fails with "
            f"{type(error).__name__}: {said}"
        ) from None
    return found.text


def _text(value: object) -> _Text:
    if isinstance(value, _Text):
        return value
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if isinstance(value, bool | np.bool_) or not isinstance(value, numbers.Real):
        raise _UnreadableError(f"the value {short_repr(value)}")
    number = float(value)
    if not math.isfinite(number):
        raise _UnreadableError(f"the value {number}")
    text = repr(number).removesuffix(".0")
    return _Text(text) if number >= 0 else _Text(text, _PRODUCT)
