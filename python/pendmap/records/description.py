"""Description of an experiment, ``experiment.toml``: its fields and their checks.

Each table of the file is a dataclass, each key one of its fields with a check.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final, Literal, TypeVar

from pendmap.errors import (
    InputError,
    check_flag,
    check_keys,
    check_number,
    check_whole,
    short_repr,
)
from pendmap.tables.text import Reader, ruled
from pendmap.tables.units import CHANNELS, PIVOT_UNITS, spelling

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

T = TypeVar("T")
Kind = Literal["free", "forced"]

NAME: Final = "experiment.toml"
RATE: Final = "rate_hz"
LARGEST: Final = 1e12  # Greatest magnitude of a number in a description
NUMBER: Final = (-LARGEST, LARGEST)
COLUMN: Final = object()  # Rule of a heading, or of the number of a column from 1
POSITIVE: Final = (1 / LARGEST, LARGEST)
RATES: Final = (1e-3, 1e9)  # Sampling rates, Hz


@dataclasses.dataclass(frozen=True)
class Rig:
    """``[rig]``: what is known of the rig."""

    gravity: float | None = ruled(POSITIVE)
    length_m: float | None = ruled(POSITIVE)
    w0: float | None = ruled(POSITIVE)
    encoder_counts: int | None = ruled(range(1, 10**9))
    inertia: float | None = ruled(POSITIVE)  # about the pivot, kg m^2
    mass: float | None = ruled(POSITIVE)  # kg
    length: float | None = ruled(POSITIVE)  # of the pivot from the centre of mass, m


@dataclasses.dataclass(frozen=True)
class Column:
    """Column of a channel; edge of a trigger."""

    name: str | int | None = ruled(COLUMN)  # heading, or number from 1
    unused: bool = ruled(bool, default=False)  # no column has this channel
    unit: str | None = ruled(str)
    scale: float | None = ruled(NUMBER)  # SI unit per unit of the column
    zero: float = ruled(NUMBER, 0.0)  # in the unit of the column
    edge: str | None = ruled(["rising", "falling"])


@dataclasses.dataclass(frozen=True)
class Drive:
    """Drive ``a(t) = p cos(Omega t + phi)``; a ``phi`` of None is fitted."""

    p: float = ruled(NUMBER, dataclasses.MISSING)
    Omega: float = ruled(POSITIVE, dataclasses.MISSING)
    phi: float | None = ruled(NUMBER)


@dataclasses.dataclass(frozen=True)
class Pivot:
    """Columns of the pivot's motion, their unit, and their factor and sign."""

    vertical: str | None = ruled(str)
    horizontal: str | None = ruled(str)
    unit: str | None = ruled([*PIVOT_UNITS])
    scale: float = ruled(POSITIVE, 1.0)
    sign: float = ruled([1, -1], 1.0)


# What a table is like, for messages
EXAMPLES: Final[Mapping[type, str]] = {
    Drive: "drive = { p = 0.2, Omega = 12.1 }, of p = Y Omega^2/g and Omega = 2 pi f",
    Pivot: 'pivot = { vertical = "acc_y", unit = "m/s2" }',
}


@dataclasses.dataclass(frozen=True)
class RunPlan:
    """Fields of one ``[[run]]``."""

    file: str = ruled(str, dataclasses.MISSING)
    kind: Kind = ruled(["free", "forced"], "free")  # noqa: RUF009
    lab_time_s: float = ruled(NUMBER, 0.0)
    from_s: float = ruled(NUMBER, -math.inf)
    to_s: float = ruled(NUMBER, math.inf)
    hold_out: bool = ruled(bool, default=False)
    drive: Drive | None = ruled(Drive)  # noqa: RUF009
    pivot: Pivot | None = ruled(Pivot)  # noqa: RUF009


@dataclasses.dataclass(frozen=True)
class Description:
    """Content of the file; ``rate_hz`` is the sampling rate of records without times, Hz."""

    known: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    columns: Mapping[str, Column] = dataclasses.field(default_factory=dict)
    rate_hz: float | None = None
    reader: Reader = dataclasses.field(default_factory=Reader)
    runs: tuple[RunPlan, ...] = ()


def description_of(content: dict[str, Any]) -> Description:
    """Return the checked description from its tables; raise InputError for invalid ones."""
    tables = "[rig], [columns], [reader] and [[run]]"
    check_keys("", content, ("rig", "columns", "reader", "run"), tables)
    runs = content.get("run")
    if not isinstance(runs, list) or not runs:
        raise InputError('must have one [[run]] or more, each with file = "run_00.csv", got none')
    plans = tuple(_run(f"[[run]] {count}", table) for count, table in enumerate(runs, 1))
    columns = {**_table("[columns]", content.get("columns", {}))}
    check_keys("[columns]: ", columns, (*CHANNELS, RATE))
    rig = dataclasses.asdict(_parsed(Rig, "[rig]", content.get("rig", {})))
    counts = rig["encoder_counts"] is not None
    rate = columns.pop(RATE, None)
    return Description(
        {name: value for name, value in rig.items() if value is not None},
        {name: _column(name, value, counts=counts) for name, value in columns.items()},
        None if rate is None else checked(f"[columns]: {RATE}", rate, RATES),
        _reader(content.get("reader", {})),
        plans,
    )


def _table(where: str, value: object, example: str = "") -> dict[str, Any]:
    """Return a value if it is a table; raise InputError if not."""
    if not isinstance(value, dict):
        raise InputError(f"{where} must be a table{example}, got {short_repr(value)}")
    return value


def _parsed(kind: type[T], where: str, value: object, without: Iterable[str] = ()) -> T:
    """Return a table as a dataclass, each of whose fields has a check."""
    example = f" like {EXAMPLES[kind]}" if kind in EXAMPLES else ""
    table = _table(where, value, example)
    every = dataclasses.fields(kind)  # type: ignore[arg-type]
    fields = {field.name: field for field in every if field.name not in without}
    names = ", ".join(fields) + (example and f",{example}")
    check_keys(f"{where}: ", table, fields, names)
    for name, field in fields.items():
        if field.default is dataclasses.MISSING and name not in table:
            raise InputError(f"{where}: {name} must be given{example}")
    rules = {name: fields[name].metadata["rule"] for name in table}
    return kind(**{name: checked(f"{where}: {name}", table[name], rules[name]) for name in table})


def checked(name: str, value: object, rule: Any) -> Any:  # noqa: ANN401 (of any type)
    """Return a value that is of a type, a dataclass, in a range, or one of a list."""
    if isinstance(rule, type) and dataclasses.is_dataclass(rule):
        return _parsed(rule, name, value)
    if rule is COLUMN:
        rule = str if isinstance(value, str) else range(1, 1001)
    if rule is bool:
        return check_flag(name, value)
    if isinstance(rule, range):
        return check_whole(name, value, rule[0], rule[-1])
    if isinstance(rule, list):
        if isinstance(value, bool) or value not in rule:
            known = [f'"{one}"' if isinstance(one, str) else str(one) for one in rule]
            raise InputError(f"{name} must be {' or '.join(known)}, got {short_repr(value)}")
        return value
    if rule is str:
        if not isinstance(value, str) or not value:
            raise InputError(f"{name} must be a text, got {short_repr(value)}")
        return value
    (low, high), number = rule, check_number(name, value)
    if not low <= number <= high:
        raise InputError(f"{name} must be {low:g} to {high:g}, got {number:g}")
    return number


def _reader(value: object) -> Reader:
    """Return the checked ``[reader]``."""
    reader = _parsed(Reader, "[reader]", value)
    taken = '"\r\n\0+-.0123456789eE' + (reader.decimal or "")
    if reader.delimiter is not None and (len(reader.delimiter) != 1 or reader.delimiter in taken):
        raise InputError(
            "[reader]: delimiter must be one character that numbers do not need, like"
            f' ";" or "\\t", got {short_repr(reader.delimiter)}'
        )
    return reader


def _column(channel: str, value: object, *, counts: bool) -> Column:
    """Return the checked column of a channel."""
    where = f"[columns]: {channel}"
    value = {"name": value} if isinstance(value, str | int) else value
    column = _parsed(Column, where, value, () if channel == "trigger" else ("edge",))
    if column.scale == 0:
        raise InputError(f"{where}: scale must be any number but 0, got 0")
    if column.unit is None or column.scale is not None:
        return column
    if counts and channel == "angle" and spelling(column.unit) == "counts":
        return column
    CHANNELS[channel].factor(column.unit, where)  # refuses unknown units before files are read
    return column


def _run(where: str, value: object) -> RunPlan:
    """Return the checked ``[[run]]``."""
    plan = _parsed(RunPlan, where, value)
    if plan.drive and plan.pivot:
        raise InputError(f"{where}: one of drive and pivot must be left out, got both")
    if plan.pivot and not (plan.pivot.vertical or plan.pivot.horizontal):
        raise InputError(f"{where}: pivot must name a column, like {EXAMPLES[Pivot]}, got none")
    if (plan.drive or plan.pivot) and "kind" not in _table(where, value):
        plan = dataclasses.replace(plan, kind="forced")
    if plan.kind == "free" and plan.drive:
        raise InputError(f'{where}: kind must be "forced" where there is a drive, got "free"')
    if plan.from_s >= plan.to_s:
        low, high = plan.from_s, plan.to_s
        raise InputError(f"{where}: from_s must be less than to_s = {high:g}, got {low:g}")
    return plan
