"""Types of options: numbers, axes and files."""

from __future__ import annotations

import importlib
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from pendmap.errors import MOST_CELLS, InputError, short_repr
from pendmap.files import check_room

if TYPE_CHECKING:
    from collections.abc import Sequence

PICTURES = (".png", ".svg", ".pdf")
"""Suffixes of figures."""
_WITH_PI = re.compile(r"([+-]?)(\d*\.?\d*(?:e[+-]?\d+)?)\*?pi(?:/(\d+\.?\d*))?", re.IGNORECASE)


def _number(text: str) -> float:
    """Read a number; ``pi``, ``-pi``, ``2pi``, ``2*pi``, ``pi/2`` are numbers too."""
    match = _WITH_PI.fullmatch(text.strip())
    if match:
        sign, factor, divisor = match.groups()
        value = (float(factor) if factor else 1.0) * math.pi / float(divisor or 1)
        return -value if sign == "-" else value
    return float(text)


class _Number(click.ParamType[float]):
    name = "number"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        try:
            number = _number(str(value))
        except (ValueError, ZeroDivisionError):
            self.fail(f"{value!r} is not a number (pi is understood)", param, ctx)
        if not math.isfinite(number):
            self.fail(f"must be a finite number, got {value!r}", param, ctx)
        return number


class Whole(click.ParamType[int]):
    """A whole number between two bounds, both included."""

    name = "integer"

    def __init__(self, least: int, most: int) -> None:
        self.least, self.most = least, most

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> int:
        """Refuse anything but a whole number within the bounds."""
        try:
            number = int(str(value))
        except ValueError:
            number = self.least - 1
        if not self.least <= number <= self.most:
            wanted = f"must be a whole number from {self.least} to {self.most}"
            self.fail(f"{wanted}, got {short_repr(value)}", param, ctx)
        return number


class AxisText(NamedTuple):
    """``A:B:N`` as typed."""

    low: float
    high: float
    cells: int


class _Axis(click.ParamType[AxisText]):
    name = "A:B:N"
    says = "N cells between A and B, like -pi:pi:1000"
    counts = "cells"
    single = False
    """Whether A:A:1 is an axis, of one value."""

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> AxisText:
        if isinstance(value, AxisText):
            return value
        wanted = f"must be A:B:N, {self.says}"
        parts = str(value).split(":")
        if len(parts) != 3:  # noqa: PLR2004
            self.fail(f"{wanted}, got {value!r}", param, ctx)
        try:
            low, high, count = _number(parts[0]), _number(parts[1]), int(parts[2])
        except (ValueError, ZeroDivisionError):
            self.fail(f"{wanted}, got {value!r}", param, ctx)
        one = self.single and count == 1 and low == high
        if not (math.isfinite(low) and math.isfinite(high) and (low < high or one)):
            self.fail(f"{value!r}: the bounds must be finite, the lower one first", param, ctx)
        if not 1 <= count <= MOST_CELLS:
            self.fail(
                f"must have 1 to {MOST_CELLS} {self.counts}, got {count}: {value!r}", param, ctx
            )
        return AxisText(low, high, count)


class _Range(_Axis):
    says = "N values from A to B, both included, like 0.5:2:100"
    counts = "values"
    single = True


class _NumberOrRange(click.ParamType[float | AxisText]):
    name = "number|A:B:N"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> float | AxisText:
        if isinstance(value, AxisText) or ":" in str(value):
            return RANGE.convert(value, param, ctx)
        return NUMBER.convert(value, param, ctx)


class _Values(click.ParamType[list[float]]):
    name = "A:B:N"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> list[float]:
        """Return N values from A to B, both included, or the only one."""
        if isinstance(value, list):
            return value
        if ":" not in str(value):
            return [NUMBER.convert(value, param, ctx)]
        low, high, count = RANGE.convert(value, param, ctx)
        if count == 1 and low < high:
            self.fail(f"{value!r}: one value has one bound", param, ctx)
        return [low + (high - low) * k / max(count - 1, 1) for k in range(count)]


class InstructionSet(click.ParamType[str]):
    """An instruction set of this processor."""

    name = "name"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> str:
        """Refuse an instruction set that this processor lacks."""
        from pendmap import _core

        available = _core.simd_available()
        if value not in available:
            wanted = f"must be one of {', '.join(available)} on this processor"
            self.fail(f"{wanted}, got {short_repr(value)}", param, ctx)
        return str(value)


class OutputFile(click.ParamType[Path]):
    """A file to write: its suffix and folder are checked before anything is computed."""

    name = "file"

    def __init__(self, suffixes: Sequence[str]) -> None:
        self.suffixes = tuple(suffixes)

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> Path:
        """Refuse a file that cannot be written."""
        path = Path(str(value))
        if not path.name:
            self.fail(f"{str(value)!r}: is a folder, or no file's name", param, ctx)
        if path.suffix.lower() not in self.suffixes:
            known = " or ".join(self.suffixes)
            self.fail(f"{str(path)!r}: suffix must be {known}, got {path.suffix!r}", param, ctx)
        if not path.parent.is_dir():
            self.fail(f"{str(path)!r}: the folder {str(path.parent)!r} does not exist", param, ctx)
        if path.is_dir() and path.suffix.lower() != ".zarr":
            self.fail(f"{str(path)!r}: is a folder", param, ctx)
        try:
            _library(path)
            check_room(path)
        except OSError as error:
            why = error.strerror or error
            self.fail(f"{str(path)!r}: cannot be written there: {why}", param, ctx)
        except InputError as error:
            self.fail(str(error), param, ctx)
        return path


def default_file(name: str | Path) -> Path:
    """Return a file that no option names, where it can be written."""
    return OutputFile([Path(name).suffix]).convert(name, None, None)


class ReportFile(OutputFile):
    """A report to write: a file, or a folder that is made where it does not exist."""

    def __init__(self) -> None:
        super().__init__([".html", ".md"])

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> Path:
        """Refuse a file that cannot be written."""
        path = Path(str(value))
        if path.suffix and not path.is_dir():
            return super().convert(value, param, ctx)
        if path.exists() and not path.is_dir():
            self.fail(f"{str(path)!r}: must be a folder, .html or .md, it is a file", param, ctx)
        if not path.parent.is_dir():
            self.fail(f"{str(path)!r}: the folder {str(path.parent)!r} does not exist", param, ctx)
        inside = path / "report.html" if path.is_dir() else path.with_suffix(".html")
        super().convert(inside, param, ctx)
        return path


def _library(path: Path) -> None:
    """Refuse a file that needs a library that is not installed, or a .zarr of something else."""
    suffix = path.suffix.lower()
    module, extra = _LIBRARIES.get(suffix, ("pendmap.files", ""))
    try:
        importlib.import_module(module)
    except Exception as error:
        raise InputError(
            f"{str(path)!r}: {suffix} needs {extra}, which cannot be imported "
            f"({type(error).__name__}: {error}): it must be installed, or another output chosen"
        ) from error
    if suffix == ".zarr":
        from pendmap.files.dataset import check_replaceable

        check_replaceable(path)


_LIBRARIES = {
    **dict.fromkeys((".png", ".svg", ".pdf", ".html", ".md"), ("pendmap.render", "matplotlib")),
    ".rrd": ("pendmap.viewer", "rerun-sdk"),
    ".nc": ("netCDF4", "netcdf4"),
    ".zarr": ("zarr", "the extra pendmap[zarr]"),
}
"""Module that a suffix needs, imported before anything is computed, and its package."""


FILE: click.Path = click.Path(path_type=Path)
NUMBER = _Number()
AXIS = _Axis()
RANGE = _Range()
NUMBER_OR_RANGE = _NumberOrRange()
VALUES = _Values()
