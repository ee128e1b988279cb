"""Description of an experiment, ``experiment.toml``: its fields and their checks."""

from __future__ import annotations

import dataclasses
import difflib
from typing import TYPE_CHECKING, Any, Final, Literal

from pendmap.errors import (
    InputError,
    check_flag,
    check_number,
    check_whole,
    named,
    short_repr,
    shown_key,
)
from pendmap.files import read_toml
from pendmap.records.units import ANGULAR_ACCELERATIONS, CHANNELS, PIVOT_UNITS, spelling

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from pathlib import Path

    Checks = Mapping[str, Callable[[str, object], Any]]

Kind = Literal["free", "forced"]
Direction = Literal["tangential", "radial", "angular"]

NAME: Final = "experiment.toml"
RATE: Final = "rate_hz"
_DRIVE_LIKE: Final = "drive = { p = 0.2, Omega = 12.1 }"
# Names of dimensional quantities of a drive, which are refused with advice
_MEASURED_DRIVE: Final = (
    *("stroke_mm", "stroke_m", "stroke", "amplitude_mm", "amplitude_m", "amplitude", "Y"),
    *("frequency_hz", "frequency", "f_hz", "f"),
)
_PIVOT_LIKE: Final = 'pivot = { vertical = "acc_y", unit = "m/s2" }'
_MOST_SKIPPED: Final = 1_000_000
_MOST_COUNTS: Final = 10**9
_LARGEST: Final = 1e12  # Greatest magnitude of a number in a description
_FARTHEST: Final = 100.0  # Greatest distance of a sensor from the pivot, m


@dataclasses.dataclass(frozen=True)
class Column:
    """Column of a channel; position of an accelerometer, edge and phase of a trigger."""

    name: str | None = None
    unit: str | None = None
    scale: float | None = None  # SI unit per unit of the column
    zero: float = 0.0  # in the unit of the column
    direction: Direction | None = None
    distance_m: float | None = None
    gravity_removed: bool | None = None
    edge: str | None = None
    phase: float | None = None  # of the drive at the edge, rad


@dataclasses.dataclass(frozen=True)
class Reader:
    """Format of the files, as far as it cannot be inferred from them."""

    delimiter: str | None = None
    decimal: str | None = None
    skip_rows: int = 0


@dataclasses.dataclass(frozen=True)
class RunPlan:
    """Fields of one ``[[run]]``; ``pivot_scale`` is the signed factor from columns to unit."""

    file: str
    kind: Kind = "free"
    lab_time_s: float = 0.0
    from_s: float | None = None
    to_s: float | None = None
    hold_out: bool = False
    drive: Mapping[str, float | None] | None = None
    pivot: Mapping[str, str] | None = None
    pivot_scale: float = 1.0


@dataclasses.dataclass(frozen=True)
class Description:
    """Content of the file; ``rate_hz`` is the sampling rate of records without times, Hz."""

    known: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    columns: Mapping[str, Column] = dataclasses.field(default_factory=dict)
    rate_hz: float | None = None
    reader: Reader = Reader()
    runs: tuple[RunPlan, ...] = ()


def read_description(path: Path) -> Description:
    """Read an ``experiment.toml``; raise InputError, with the path, for invalid content."""
    content = read_toml(path)
    with named(str(path)):
        return _description(content)


def _description(content: dict[str, Any]) -> Description:
    """Return the checked description from the file's tables."""
    _refuse_unknown(
        content, ("rig", "columns", "reader", "run"), "", "[rig], [columns], [reader] and [[run]]"
    )
    runs = content.get("run")
    if not isinstance(runs, list) or not runs:
        raise InputError('must have one [[run]] or more, each with file = "run_00.csv", got none')
    plans = tuple(_run(f"[[run]] {count}", table) for count, table in enumerate(runs, 1))
    columns = _table("[columns]", content.get("columns", {}))
    _refuse_unknown(columns, (*CHANNELS, RATE), "[columns]")
    return Description(
        _checked("[rig]", content.get("rig", {}), _RIG),
        {name: _column(name, value) for name, value in columns.items() if name != RATE},
        _positive(f"[columns]: {RATE}", columns[RATE]) if RATE in columns else None,
        _reader(content.get("reader", {})),
        plans,
    )


def _table(where: str, value: object, example: str = "") -> dict[str, Any]:
    """Return a value if it is a table; raise InputError if not."""
    if not isinstance(value, dict):
        like = f" like {example}" if example else ""
        raise InputError(f"{where} must be a table{like}, got {short_repr(value)}")
    return value


def _refuse_unknown(
    table: Mapping[str, Any], known: Iterable[str], where: str, among: str = ""
) -> None:
    """Raise InputError for unknown keys, with the nearest known one."""
    known = list(known)
    for key in table:
        if key in known:
            continue
        near = difflib.get_close_matches(key.lower(), [k.lower() for k in known], 1, 0.55)
        meant = next((k for k in known if near and k.lower() == near[0]), None)
        perhaps = f", perhaps {meant} is meant" if meant else ""
        place = f"{where}: " if where else ""
        names = among or ", ".join(known)
        raise InputError(
            f"{place}{shown_key(key)} is not known{perhaps}: it must be one of {names}"
        )


def _checked(where: str, value: object, checks: Checks, example: str = "") -> dict[str, Any]:
    """Return the checked values of a table, in which each key has a check."""
    table = _table(where, value, example)
    _refuse_unknown(table, checks, where)
    return {key: checks[key](f"{where}: {key}", given) for key, given in table.items()}


def _number(name: str, value: object) -> float:
    number = check_number(name, value)
    if abs(number) > _LARGEST:
        raise InputError(f"{name} must be a number up to {_LARGEST:g}, got {number:g}")
    return number


def _number_that(allowed: Callable[[float], bool], wanted: str) -> Callable[[str, object], float]:
    """Return a check that a number satisfies a condition."""

    def check(name: str, value: object) -> float:
        number = _number(name, value)
        if not allowed(number):
            raise InputError(f"{name} must be {wanted}, got {number:g}")
        return number

    return check


_positive = _number_that(
    lambda number: number >= 1 / _LARGEST, f"more than 0, at least {1 / _LARGEST:g}"
)


def _text(name: str, value: object) -> str:
    if not isinstance(value, str) or not value:
        raise InputError(f"{name} must be a text, got {short_repr(value)}")
    return value


def _one_of(*texts: str) -> Callable[[str, object], str]:
    """Return a check that a value is one of some texts."""
    quoted = [f'"{text}"' for text in texts]
    known = " or ".join(quoted) if len(texts) < 3 else f"one of {', '.join(quoted)}"

    def check(name: str, value: object) -> str:
        if value not in texts:
            raise InputError(f"{name} must be {known}, got {short_repr(value)}")
        return str(value)

    return check


def _delimiter(name: str, value: object) -> str:
    if not isinstance(value, str) or len(value) != 1:
        wanted = 'one character, like ";" or "\\t"'
        raise InputError(f"{name} must be {wanted}, got {short_repr(value)}")
    if value in '"\r\n\0+-.0123456789eE':
        raise InputError(f"{name} must be what numbers do not need, got {short_repr(value)}")
    return value


def _drive(where: str, value: object) -> dict[str, float | None]:
    """Return the checked drive ``p``, ``Omega``, ``phi`` (None: to be fitted)."""
    for name in _MEASURED_DRIVE:
        if name in _table(where, value, _DRIVE_LIKE):
            raise InputError(
                f"{where}: {name} is not known: it must be given as p = Y Omega^2/g, of the"
                " pivot's amplitude Y in m (stroke_mm / 1000), and Omega = 2 pi f in rad/s, of f in"
                " Hz"
            )
    numbers = _checked(where, value, {"p": _number, "Omega": _positive, "phi": _number})
    for name in ("p", "Omega"):
        if name not in numbers:
            raise InputError(f"{where}: {name} must be given, like {_DRIVE_LIKE}")
    return {"phi": None} | numbers


def _pivot(where: str, value: object) -> dict[str, Any]:
    """Return the columns of the pivot and their unit, and the signed factor of the columns."""
    named = _checked(where, value, _PIVOT, _PIVOT_LIKE)
    if not {"vertical", "horizontal"} & set(named):
        raise InputError(f"{where} must name a column, like {_PIVOT_LIKE}, got none")
    factor = named.pop("scale", 1.0) * named.pop("sign", 1.0)
    return {"pivot": named, "pivot_scale": factor}


_RIG: Final[Checks] = {
    **dict.fromkeys(("gravity", "length_m", "w0"), _positive),
    "encoder_counts": lambda name, value: check_whole(name, value, 1, _MOST_COUNTS),
}
_COLUMN: Final[Checks] = {
    "name": _text,
    "unit": _text,
    "scale": _number_that(lambda number: number != 0, "any number but 0"),
    "zero": _number,
}
_COLUMNS: Final[Mapping[str, Checks]] = {
    "acceleration": {
        "direction": _one_of("tangential", "radial", "angular"),
        "distance_m": _number_that(
            lambda number: 0 < number <= _FARTHEST,
            f"more than 0, up to {_FARTHEST:g}, from the pivot to the sensor in m",
        ),
        "gravity_removed": check_flag,
    },
    "trigger": {"edge": _one_of("rising", "falling"), "phase": _number},
}
_READER: Final[Checks] = {
    "delimiter": _delimiter,
    "decimal": _one_of(".", ","),
    "skip_rows": lambda name, value: check_whole(name, value, 0, _MOST_SKIPPED),
}
_RUN: Final[Checks] = {
    "file": _text,
    "kind": _one_of("free", "forced"),
    **dict.fromkeys(("lab_time_s", "from_s", "to_s"), _number),
    "hold_out": check_flag,
    "drive": _drive,
    "pivot": _pivot,
}
_PIVOT: Final[Checks] = {
    **dict.fromkeys(("vertical", "horizontal"), _text),
    "unit": _one_of(*PIVOT_UNITS),
    "scale": _positive,
    "sign": _number_that(lambda number: abs(number) == 1, "1 or -1"),
}


def _column(channel: str, value: object) -> Column:
    """Return the checked column of a channel."""
    where = f"[columns]: {channel}"
    if isinstance(value, str):
        return Column(name=_text(where, value))
    example = f'{channel} = {{ name = "...", unit = "..." }}'
    column = Column(**_checked(where, value, {**_COLUMN, **_COLUMNS.get(channel, {})}, example))
    if column.unit is None or column.scale is not None:
        return column
    angular = spelling(column.unit) in ANGULAR_ACCELERATIONS
    if angular and column.direction in {"tangential", "radial"}:
        raise InputError(
            f"{where}: unit must be m/s2 or g with direction {column.direction!r}, got"
            f' {column.unit!r}, which needs direction = "angular"'
        )
    if column.direction == "angular" and not angular:
        raise InputError(
            f"{where}: unit must be rad/s2 or deg/s2 with direction 'angular', got {column.unit!r}"
        )
    CHANNELS[channel].factor(column.unit, where)  # refuses unknown units before files are read
    return column


def _reader(value: object) -> Reader:
    """Return the checked ``[reader]``."""
    reader = Reader(**_checked("[reader]", value, _READER))
    if reader.delimiter is not None and reader.delimiter == reader.decimal:
        raise InputError(
            f"[reader]: delimiter and decimal must be different, got {reader.decimal!r} for both"
        )
    return reader


def _run(where: str, value: object) -> RunPlan:
    """Return the checked ``[[run]]``."""
    values = _checked(where, value, _RUN)
    if "file" not in values:
        raise InputError(f'{where}: file must be given, like file = "run_00.csv"')
    drive, pivot = values.get("drive"), values.pop("pivot", {})
    kind = values.setdefault("kind", "forced" if drive or pivot else "free")
    if kind == "free" and drive:
        raise InputError(f'{where}: kind must be "forced" where there is a drive, got "free"')
    if drive and pivot:
        raise InputError(f"{where}: one of drive and pivot must be left out, got both")
    low, high = values.get("from_s"), values.get("to_s")
    if low is not None and high is not None and low >= high:
        raise InputError(f"{where}: from_s must be less than to_s = {high:g}, got {low:g}")
    return RunPlan(**values, **pivot)
