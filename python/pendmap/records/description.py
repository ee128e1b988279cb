"""``experiment.toml``: the description of an experiment."""

from __future__ import annotations

import dataclasses
import difflib
from typing import TYPE_CHECKING, Any, Final

from pendmap.errors import InputError, check_flag, check_number, check_whole, short_repr
from pendmap.files import read_toml
from pendmap.records.rod_sensors import Place, place_of
from pendmap.records.units import CHANNELS, PIVOT_UNITS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pendmap.records.experiment import Kind

NAME: Final = "experiment.toml"

RATE: Final = "rate_hz"

_LIMITS: Final = ("max_angle", "max_velocity", "max_frequency")
_RIG: Final = ("gravity", "length_m", "w0", "encoder_counts", *_LIMITS)
_TOP: Final = ("rig", "columns", "reader", "run")
_COLUMN: Final = ("name", "unit", "scale", "zero")
_PLACE: Final = ("direction", "distance_m", "gravity_removed")
_TRIGGER: Final = ("edge", "phase")
_EDGES: Final = ("rising", "falling")
_READER: Final = ("delimiter", "decimal", "skip_rows")
_RUN: Final = (
    *("file", "kind", "lab_time_s", "from_s", "to_s"),
    *("hold_out", "drive", "pivot"),
)
_DRIVE: Final = ("p", "Omega", "phi")
_PIVOT: Final = ("vertical", "horizontal", "unit", "scale", "sign")
_DRIVE_LIKE: Final = "drive = { p = 0.2, Omega = 12.1 }"
_MEASURED_DRIVE: Final = (
    *("stroke_mm", "stroke_m", "stroke", "amplitude_mm", "amplitude_m", "amplitude", "Y"),
    *("frequency_hz", "frequency", "f_hz", "f"),
)
"""Names of measured quantities of a drive, which are refused with advice."""
_PIVOT_LIKE: Final = 'pivot = { vertical = "acc_y", unit = "m/s2" }'
_MOST_SKIPPED: Final = 1_000_000
_MOST_COUNTS: Final = 10**9
_LARGEST: Final = 1e12
"""Largest number of a description."""


@dataclasses.dataclass(frozen=True)
class Column:
    """Where a channel is read from: column, unit, scale (SI a unit), zero, place, edge, phase."""

    name: str | None = None
    unit: str | None = None
    scale: float | None = None
    zero: float = 0.0
    place: Place = dataclasses.field(default_factory=Place)
    edge: str | None = None
    phase: float | None = None


@dataclasses.dataclass(frozen=True)
class Reader:
    """How files are written, where they do not show it."""

    delimiter: str | None = None
    decimal: str | None = None
    skip_rows: int = 0


@dataclasses.dataclass(frozen=True)
class RunPlan:
    """One ``[[run]]``; ``pivot_scale`` is the signed pivot unit per unit of its columns."""

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
    """Content of the file; ``rate_hz`` is the clock of records without times, Hz."""

    known: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    columns: Mapping[str, Column] = dataclasses.field(default_factory=dict)
    rate_hz: float | None = None
    reader: Reader = Reader()
    runs: tuple[RunPlan, ...] = ()


ALONE: Final = Description()
"""Description of a file without an ``experiment.toml``."""


def read_description(path: Path) -> Description:
    """Read an ``experiment.toml``; raise InputError, with the path, for what is not allowed."""
    content = read_toml(path)
    try:
        return _description(content)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _description(content: dict[str, Any]) -> Description:
    """Return the description that the tables of the file make."""
    _keys(content, _TOP, "", "[rig], [columns], [reader] and [[run]]")
    runs = content.get("run")
    if not isinstance(runs, list) or not runs:
        raise InputError('must have one [[run]] or more, each with file = "run_00.csv", got none')
    plans = []
    for count, table in enumerate(runs, 1):
        where = f"[[run]] {count}"
        plans.append(_run(_table(table, where), where))
    columns = _table(content.get("columns", {}), "[columns]")
    _keys(columns, (*CHANNELS, RATE), "[columns]")
    return Description(
        _rig(_table(content.get("rig", {}), "[rig]")),
        {name: _column(name, value) for name, value in columns.items() if name != RATE},
        _positive(f"[columns]: {RATE}", columns[RATE]) if RATE in columns else None,
        _reader(_table(content.get("reader", {}), "[reader]")),
        tuple(plans),
    )


def _keys(table: Mapping[str, Any], known: tuple[str, ...], where: str, among: str = "") -> None:
    """Refuse unknown keys and suggest the nearest known one."""
    for key in table:
        if key in known:
            continue
        near = difflib.get_close_matches(key.lower(), [k.lower() for k in known], 1, 0.55)
        meant = next((k for k in known if near and k.lower() == near[0]), None)
        perhaps = f", perhaps {meant} is meant" if meant else ""
        shown = key if key.isidentifier() else short_repr(key)
        place = f"{where}: " if where else ""
        raise InputError(
            f"{place}{shown} is not known{perhaps}: it must be one of {among or ', '.join(known)}"
        )


def _table(value: object, where: str, example: str = "") -> dict[str, Any]:
    """Return a value that must be a table."""
    if not isinstance(value, dict):
        like = f" like {example}" if example else ""
        raise InputError(f"{where} must be a table{like}, got {short_repr(value)}")
    return value


def _rig(table: dict[str, Any]) -> dict[str, Any]:
    """Return the checked numbers of ``[rig]``."""
    _keys(table, _RIG, "[rig]")
    return {
        name: check_whole(f"[rig]: {name}", value, 1, _MOST_COUNTS)
        if name == "encoder_counts"
        else _positive(f"[rig]: {name}", value)
        for name, value in table.items()
    }


def _number(name: str, value: object) -> float:
    number = check_number(name, value)
    if abs(number) > _LARGEST:
        raise InputError(f"{name} must be a number up to {_LARGEST:g}, got {number:g}")
    return number


def _positive(name: str, value: object) -> float:
    number = _number(name, value)
    if number < 1 / _LARGEST:
        raise InputError(f"{name} must be more than 0, at least {1 / _LARGEST:g}, got {number:g}")
    return number


def _text(name: str, value: object) -> str:
    if not isinstance(value, str) or not value:
        raise InputError(f"{name} must be a text, got {short_repr(value)}")
    return value


def _column(channel: str, value: object) -> Column:
    """Return the checked column of a channel."""
    where = f"[columns]: {channel}"
    if isinstance(value, str):
        return Column(name=_text(where, value))
    if not isinstance(value, dict):
        like = f'{channel} = {{ name = "...", unit = "..." }}'
        raise InputError(f"{where} must be a table like {like}, got {short_repr(value)}")
    own = {"acceleration": _PLACE, "trigger": _TRIGGER}.get(channel, ())
    _keys(value, (*_COLUMN, *own), where)
    name = _text(f"{where}: name", value["name"]) if "name" in value else None
    unit = _text(f"{where}: unit", value["unit"]) if "unit" in value else None
    scale = None
    if "scale" in value:
        scale = _number(f"{where}: scale", value["scale"])
        if scale == 0:
            raise InputError(f"{where}: scale must be any number but 0, got 0")
    zero = _number(f"{where}: zero", value.get("zero", 0.0))
    place = place_of(value, where) if channel == "acceleration" else Place()
    edge = value.get("edge")
    if edge is not None and edge not in _EDGES:
        known = " or ".join(f'"{each}"' for each in _EDGES)
        raise InputError(f"{where}: edge must be {known}, got {short_repr(edge)}")
    phase = _number(f"{where}: phase", value["phase"]) if "phase" in value else None
    column = Column(name, unit, scale, zero, place, edge, phase)
    if unit is not None and scale is None:
        CHANNELS[channel].factor(unit, where)  # refuses what is not known, before files are read
    return column


def _reader(table: dict[str, Any]) -> Reader:
    """Return the checked ``[reader]``."""
    _keys(table, _READER, "[reader]")
    delimiter, decimal = table.get("delimiter"), table.get("decimal")
    if delimiter is not None and (not isinstance(delimiter, str) or len(delimiter) != 1):
        wanted = 'one character, like ";" or "\\t"'
        raise InputError(f"[reader]: delimiter must be {wanted}, got {short_repr(delimiter)}")
    if decimal not in (None, ".", ","):
        raise InputError(f'[reader]: decimal must be "." or ",", got {short_repr(decimal)}')
    if delimiter is not None and delimiter in '"\r\n\0+-.0123456789eE':
        raise InputError(
            f"[reader]: delimiter must be what numbers do not need, got {short_repr(delimiter)}"
        )
    if delimiter is not None and delimiter == decimal:
        raise InputError(
            f"[reader]: delimiter and decimal must be different, got {decimal!r} for both"
        )
    skip = check_whole("[reader]: skip_rows", table.get("skip_rows", 0), 0, _MOST_SKIPPED)
    return Reader(delimiter, decimal, skip)


def _run(table: dict[str, Any], where: str) -> RunPlan:
    """Return the checked ``[[run]]``."""
    _keys(table, _RUN, where)
    if "file" not in table:
        raise InputError(f'{where}: file must be given, like file = "run_00.csv"')
    drive = _drive(table["drive"], where) if "drive" in table else None
    pivot, factor = _pivot(table["pivot"], where) if "pivot" in table else (None, 1.0)
    kind = table.get("kind", "forced" if drive or pivot else "free")
    if kind not in ("free", "forced"):  # whatever it is, a list too
        raise InputError(f'{where}: kind must be "free" or "forced", got {short_repr(kind)}')
    if kind == "free" and drive:
        raise InputError(f'{where}: kind must be "forced" where there is a drive, got "free"')
    if drive and pivot:
        raise InputError(f"{where}: one of drive and pivot must be left out, got both")
    limits = {}
    for name in ("from_s", "to_s"):
        limits[name] = _number(f"{where}: {name}", table[name]) if name in table else None
    low, high = limits["from_s"], limits["to_s"]
    if low is not None and high is not None and low >= high:
        raise InputError(f"{where}: from_s must be less than to_s = {high:g}, got {low:g}")
    return RunPlan(
        file=_text(f"{where}: file", table["file"]),
        kind=kind,
        lab_time_s=_number(f"{where}: lab_time_s", table.get("lab_time_s", 0.0)),
        from_s=low,
        to_s=high,
        hold_out=check_flag(f"{where}: hold_out", table.get("hold_out", False)),
        drive=drive,
        pivot=pivot,
        pivot_scale=factor,
    )


def _drive(value: object, where: str) -> dict[str, float | None]:
    """Return the checked drive ``p``, ``Omega``, ``phi`` (None: to be fitted)."""
    table = _table(value, f"{where}: drive", _DRIVE_LIKE)
    for name in _MEASURED_DRIVE:
        if name in table:
            raise InputError(
                f"{where}: drive: {name} is not known: it must be given as p = Y Omega^2/g, of the"
                " pivot's amplitude Y in m (stroke_mm / 1000), and Omega = 2 pi f in rad/s, of f in"
                " Hz"
            )
    _keys(table, _DRIVE, f"{where}: drive")
    for name in ("p", "Omega"):
        if name not in table:
            raise InputError(f"{where}: drive: {name} must be given, like {_DRIVE_LIKE}")
    numbers: dict[str, float | None] = {
        name: _number(f"{where}: drive: {name}", value) for name, value in table.items()
    }
    _positive(f"{where}: drive: Omega", numbers["Omega"])
    return {"phi": None} | numbers


def _pivot(value: object, where: str) -> tuple[dict[str, str], float]:
    """Return names of columns and unit of the pivot, and the factor of the columns."""
    table = _table(value, f"{where}: pivot", _PIVOT_LIKE)
    _keys(table, _PIVOT, f"{where}: pivot")
    if not {"vertical", "horizontal"} & set(table):
        raise InputError(f"{where}: pivot must name a column, like {_PIVOT_LIKE}, got none")
    scale = _positive(f"{where}: pivot: scale", table.get("scale", 1.0))
    sign = _number(f"{where}: pivot: sign", table.get("sign", 1))
    if abs(sign) != 1:
        raise InputError(f"{where}: pivot: sign must be 1 or -1, got {sign:g}")
    named = {
        key: _text(f"{where}: pivot: {key}", text)
        for key, text in table.items()
        if key not in {"scale", "sign"}
    }
    if named.get("unit", "m/s2") not in PIVOT_UNITS:
        shown = short_repr(named["unit"])
        known = ", ".join(PIVOT_UNITS)
        raise InputError(f"{where}: pivot: unit must be one of {known}, got {shown}")
    return named, sign * scale
