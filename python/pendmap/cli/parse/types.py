"""Types of options: numbers, axes and files."""

from __future__ import annotations

import contextlib
import functools
import importlib
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import click
from click.shell_completion import CompletionItem

from pendmap.errors import MOST_CELLS, InputError, MissingExtraError, short_repr
from pendmap.files import check_room

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

T = TypeVar("T")

PICTURES = (".png", ".svg", ".pdf")  # Suffixes of figures
REPORTS = (".html", ".md")  # Suffixes of reports
TABLES = (".csv", ".xlsx", ".mat")  # Suffixes of tables of readings
_WITH_PI = re.compile(r"([+-]?)(\d*\.?\d*(?:e[+-]?\d+)?)\*?pi(?:/(\d+\.?\d*))?", re.IGNORECASE)


class OptionType(click.ParamType[T]):
    """Type of an option, from its name and a function that reads a text or raises InputError.

    ``known`` returns the values that a shell completes.
    """

    def __init__(
        self, name: str, read: Callable[[str], T], known: Callable[[], Iterable[str]] | None = None
    ) -> None:
        self.name, self.read, self._known = name, read, known

    def shell_complete(
        self,
        ctx: click.Context,  # noqa: ARG002
        param: click.Parameter,  # noqa: ARG002
        incomplete: str,
    ) -> list[CompletionItem]:
        """Return the known values that begin with what is typed."""
        known = self._known() if self._known is not None else ()
        return [CompletionItem(value) for value in known if value.startswith(incomplete)]

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> T:
        """Return the value of a text; other values are returned unchanged."""
        if not isinstance(value, str):
            return value  # type: ignore[return-value]
        try:
            return self.read(value)
        except InputError as error:
            self.fail(str(error), param, ctx)


def _value(text: str) -> float:
    """Read a number; ``pi``, ``-pi``, ``2pi``, ``2*pi``, ``pi/2`` are numbers too."""
    match = _WITH_PI.fullmatch(text.strip())
    if match:
        sign, factor, divisor = match.groups()
        value = (float(factor) if factor else 1.0) * math.pi / float(divisor or 1)
        return -value if sign == "-" else value
    return float(text)


def _number(text: str) -> float:
    try:
        number = _value(text)
    except (ValueError, ZeroDivisionError):
        raise InputError(f"{text!r} is not a number (pi is understood)") from None
    if not math.isfinite(number):
        raise InputError(f"must be a finite number, got {text!r}")
    return number


def _whole(text: str) -> int:
    """Read a whole number; the library checks its range."""
    try:
        return int(text)
    except ValueError:
        raise InputError(f"must be a whole number, got {short_repr(text)}") from None


class AxisText(NamedTuple):
    """``A:B:N`` as typed."""

    low: float
    high: float
    cells: int


def _axis(text: str, *, values: bool = False) -> AxisText:
    """Read N cells between two bounds; or N values from one bound to the other, or a single one."""
    wanted = "N values from A to B, both included, like 0.5:2:100"
    wanted = wanted if values else "N cells between A and B, like -pi:pi:1000"
    parts = text.split(":")
    try:
        low, high, count = _value(parts[0]), _value(parts[1]), int(parts[2])
    except (ValueError, ZeroDivisionError, IndexError):
        count = None
    if count is None or len(parts) > 3:  # noqa: PLR2004
        raise InputError(f"must be A:B:N, {wanted}, got {text!r}")
    if values:
        low, high = sorted((low, high))
    rising = low < high or (values and low == high and count <= 1)
    if not (math.isfinite(low) and math.isfinite(high) and rising):
        raise InputError(f"{text!r}: the bounds must be finite, the lower one first")
    if not 1 <= count <= MOST_CELLS:
        kind = "values" if values else "cells"
        raise InputError(f"must have 1 to {MOST_CELLS} {kind}, got {count}: {text!r}")
    return AxisText(low, high, count)


_range = functools.partial(_axis, values=True)


def _values(text: str) -> list[float]:
    """Read N values from one bound to the other, or a single one."""
    if ":" not in text:
        return [_number(text)]
    low, high, count = _range(text)
    if count == 1 and low < high:
        raise InputError(f"{text!r}: one value has one bound")
    return [low + (high - low) * k / max(count - 1, 1) for k in range(count)]


def _ends(text: str) -> AxisText:
    """Read the two ends of a range, in which values are chosen by the computation."""
    with contextlib.suppress(InputError):
        return _range(f"{text}:2" if text.count(":") == 1 else "")
    raise InputError(f"must be A:B, the ends of a range, like 0.5:2, got {text!r}")


def _instruction_set(text: str) -> str:
    """Refuse an instruction set that this processor lacks."""
    from pendmap import _core

    available = _core.simd_available()
    if text not in available:
        wanted = f"must be one of {', '.join(available)} on this processor"
        raise InputError(f"{wanted}, got {short_repr(text)}")
    return text


def output_file(*suffixes: str) -> OptionType[Path]:
    """Return the type of files to write, whose suffix and folder are checked first of all."""
    return OptionType("file", functools.partial(_output, suffixes))


def _output(suffixes: tuple[str, ...], text: str) -> Path:
    """Refuse a file that cannot be written; it may be written as ``file://`` and the path."""
    path = Path(text.removeprefix("file://"))
    if not path.name:
        raise InputError(f"{text!r}: is a folder, or no file's name")
    if path.suffix.lower() not in suffixes:
        known = " or ".join(suffixes)
        raise InputError(f"{str(path)!r}: suffix must be {known}, got {path.suffix!r}")
    if not path.parent.is_dir():
        raise InputError(f"{str(path)!r}: the folder {str(path.parent)!r} does not exist")
    if path.is_dir() and path.suffix.lower() != ".zarr":
        raise InputError(f"{str(path)!r}: is a folder")
    _import_library(str(path), path.suffix.lower())
    try:
        if path.suffix.lower() == ".zarr":
            from pendmap.files.dataset import check_replaceable

            check_replaceable(path)
        check_room(path)
    except OSError as error:
        why = error.strerror or error
        raise InputError(f"{str(path)!r}: cannot be written there: {why}") from None
    return path


def default_file(name: str | Path) -> Path:
    """Return the path of a file that no option names; refuse it if it cannot be written."""
    return output_file(Path(name).suffix).convert(str(name), None, None)


def _import_library(name: str, suffix: str) -> None:
    module, extra = _LIBRARIES.get(suffix, ("pendmap.files", ""))
    try:
        importlib.import_module(module)
    except MissingExtraError as error:
        raise InputError(f"{name!r}: {error}") from error
    except Exception as error:
        raise InputError(
            f"{name!r}: {suffix} needs {extra}, which cannot be imported "
            f"({type(error).__name__}: {error}): it must be installed, or another output chosen"
        ) from error


_LIBRARIES = {
    **dict.fromkeys((".png", ".svg", ".pdf", ".html", ".md"), ("pendmap.render", "matplotlib")),
    ".rrd": ("pendmap.viewer", "the extra pendmap[viewer]"),
    ".nc": ("netCDF4", "netcdf4"),
    ".xlsx": ("openpyxl", "the extra pendmap[excel]"),
    ".zarr": ("zarr", "the extra pendmap[zarr]"),
}
"""Module that a suffix needs, imported before anything is computed, and its package."""


class _File(click.Path):
    """A path, which may be written as ``file://`` and the path."""

    def __init__(self, name: str) -> None:
        super().__init__(path_type=Path, file_okay=name != "dir")
        self.name = name

    def convert(self, value: Any, *words: Any) -> Any:  # noqa: ANN401 (as click)
        """Return the path."""
        plain = value.removeprefix("file://") if isinstance(value, str) else value
        return super().convert(plain, *words)


def _effects() -> Iterable[str]:
    from pendmap.model.effects import library

    return library()


def _methods() -> Iterable[str]:
    from pendmap.identification import METHODS

    return METHODS


FILE = _File("file")
FOLDER = _File("dir")
INTEGER = OptionType("integer", _whole)
NUMBER = OptionType("number", _number)
AXIS = OptionType("A:B:N", _axis)
RANGE = OptionType("A:B:N", _range)
NUMBER_OR_RANGE = OptionType[float | AxisText](
    "number|A:B:N", lambda text: _range(text) if ":" in text else _number(text)
)
ENDS = OptionType("A:B", _ends)
NUMBER_OR_ENDS = OptionType[float | AxisText](
    "number|A:B", lambda text: _ends(text) if ":" in text else _number(text)
)
TEXT = OptionType("text", str)
COLUMN = OptionType[str | int]("column", lambda text: int(text) if text.isdecimal() else text)
EFFECT = OptionType("name", str, _effects)
METHOD = OptionType("name", str, _methods)
VALUES = OptionType("A:B:N", _values)
INSTRUCTION_SET = OptionType("name", _instruction_set)
