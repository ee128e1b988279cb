"""Columns, units, clock and span of records that are given by hand, over a description."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Final, TypedDict

from pendmap.errors import InputError, short_repr
from pendmap.files import toml_text, whole_file
from pendmap.records.by_hand import by_hand
from pendmap.records.description import COLUMN, COUNTS, NUMBER, RATE, RATES, Column, checked
from pendmap.records.units import CHANNELS, spelling

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pendmap.records.description import Description
    from pendmap.records.work import Work


class ByHand(TypedDict, total=False):
    """Keywords that say how records are read; they override an ``experiment.toml``.

    A column is given by its heading, or by its number from 1.

    Parameters
    ----------
    time : str or int
        Column of the times.
    angle : str or int
        Column of the angle.
    velocity : str or int
        Column of an angular velocity; without an angle, this is its integral.
    x, y : str or int
        Column of a coordinate of the bob; without an angle, this is that on the bob's circle.
    time_unit : str
        Unit of the times, like ms.
    angle_unit : str
        Unit of the angle, like deg or counts; of a velocity given alone, the same a second.
    angle_scale : float
        Angle per unit of its column, rad; of a velocity given alone, rad/s.
    rate_hz : float
        Sampling rate, Hz, of records without a column of times in order.
    from_s : float
        First time that is used, s on the clock of the record.
    to_s : float
        Last time that is used, s on the clock of the record.
    counts_per_turn : int
        Counts of the encoder in a turn.
    """

    time: str | int | None
    angle: str | int | None
    velocity: str | int | None
    x: str | int | None
    y: str | int | None
    time_unit: str | None
    angle_unit: str | None
    angle_scale: float | None
    rate_hz: float | None
    from_s: float | None
    to_s: float | None
    counts_per_turn: int | None


# Rules of the values: :func:`pendmap.records.description.checked`
_RULES: Final[Mapping[str, object]] = {
    **dict.fromkeys(("time", "angle", "velocity", "x", "y"), COLUMN),
    **dict.fromkeys(("time_unit", "angle_unit"), str),
    **dict.fromkeys(("angle_scale", "from_s", "to_s"), NUMBER),
    "rate_hz": RATES,
    "counts_per_turn": range(1, 10**9),
}
# Channels from which the angle can come
SOURCES: Final = ("angle", "peaks", "pixel_x", "pixel_y", "velocity", "acceleration")
_CHANNELS: Final = {
    **{name: name for name in ("time", "angle", "velocity")},
    "x": "pixel_x",
    "y": "pixel_y",
}


def overridden(description: Description, reading: ByHand) -> Description:
    """Return a description with what is given by hand; raise InputError for an invalid value."""
    for name in reading:
        if name not in _RULES:
            raise TypeError(f"got an unexpected keyword argument {name!r}")
    given = {
        name: checked(name, value, _RULES[name])
        for name, value in reading.items()
        if value is not None
    }
    known = dict(description.known)
    if "counts_per_turn" in given:
        known["encoder_counts"] = given["counts_per_turn"]
    span = {name: given[name] for name in ("from_s", "to_s") if name in given}
    plans = tuple(dataclasses.replace(plan, **span) for plan in description.runs)
    for plan in plans:
        if plan.from_s >= plan.to_s:
            raise InputError(f"from_s must be less than to_s = {plan.to_s:g}, got {plan.from_s:g}")
    columns, units = _columns(description, given, counts="encoder_counts" in known)
    rate = given.get("rate_hz", description.rate_hz)
    return dataclasses.replace(
        description, known=known, columns=columns, rate_hz=rate, runs=plans, by_hand=units
    )


def _columns(
    description: Description, given: Mapping[str, Any], *, counts: bool
) -> tuple[dict[str, Column], frozenset[str]]:
    """Return the columns with those given by hand, and the channels with a unit by hand."""
    columns, units = dict(description.columns), set[str]()
    named = {channel: given[name] for name, channel in _CHANNELS.items() if name in given}
    if ("x" in given) != ("y" in given):
        raise InputError("x and y must be given together, got one")
    if "angle" not in named and named.keys() & {"velocity", "pixel_x"}:
        # What is given by hand is the only source of the angle.
        columns |= {channel: Column(unused=True) for channel in SOURCES}
    columns |= {channel: Column(name=name) for channel, name in named.items()}
    angle = "velocity" if "velocity" in named and "angle" not in named else "angle"
    for name, channel in (("time_unit", "time"), ("angle_unit", angle)):
        if name in given:
            scaled = name == "angle_unit" and "angle_scale" in given
            unit = given[name] if scaled else _unit(name, given[name], channel, counts=counts)
            column = columns.get(channel, Column())
            columns[channel] = dataclasses.replace(column, unit=unit, scale=None)
            units.add(channel)
    if "angle_scale" in given:
        if given["angle_scale"] == 0:
            raise InputError("angle_scale must be any number but 0, got 0")
        column = columns.get(angle, Column())
        columns[angle] = dataclasses.replace(column, scale=given["angle_scale"])
        units.add(angle)
    return columns, frozenset(units)


def _unit(name: str, unit: str, channel: str, *, counts: bool) -> str:
    """Return a unit of a channel; raise InputError for others."""
    known = CHANNELS[channel].units
    if channel == "velocity" and spelling(unit) not in known:
        unit = f"{unit}/s"
    if spelling(unit) in known or (counts and channel == "angle" and COUNTS.fullmatch(unit)):
        return unit
    further = ", or counts with counts_per_turn" if channel == "angle" else ""
    raise InputError(f"{name} must be one of {', '.join(known)}{further}, got {short_repr(unit)}")


def refuse_unused(work: Work, description: Description) -> None:
    """Raise InputError if a unit is given by hand for a channel that no column has."""
    for channel in description.by_hand - work.columns.keys():
        column, rate = description.columns[channel], work.columns.get("velocity")
        given = {"angle_unit": column.unit, "angle_scale": column.scale}
        given = {name: value for name, value in given.items() if value is not None}
        example = "" if rate is None else f": {by_hand(work.where, velocity=rate, **given)}"
        raise InputError(
            f"{work.where}: {' and '.join(given)} must be that of a column, got no column of the"
            f" {channel}{example or work.other('angle')}"
        )


def as_taken(description: Description, taken: Mapping[str, Mapping[str, str | int]]) -> Description:
    """Return the description of the files that were read, with the columns that all of them have.

    ``taken`` has the column of each channel by file.
    """
    columns = dict(description.columns)
    first, *others = taken.values()
    for channel, name in first.items():
        if all(other.get(channel) == name for other in others):
            columns[channel] = dataclasses.replace(columns.get(channel, Column()), name=name)
    plans = tuple(plan for plan in description.runs if plan.file in taken)
    return dataclasses.replace(description, columns=columns, runs=plans)


def save_description(description: Description, path: Path) -> Path:
    """Write an ``experiment.toml``, which reads back as the same description."""
    columns = {channel: _table(column) for channel, column in description.columns.items()}
    rate = {} if description.rate_hz is None else {RATE: description.rate_hz}
    content = {
        "rig": dict(description.known),
        "columns": columns | rate,
        "reader": _table(description.reader),
        "run": [_table(plan) for plan in description.runs],
    }
    text = toml_text({name: table for name, table in content.items() if table})
    with whole_file(path, (".toml",)) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
    return path


def _table(fields: Any) -> dict[str, Any]:  # noqa: ANN401 (a dataclass of a description)
    """Return the fields of a dataclass that differ from their defaults."""
    values = {
        field.name: (getattr(fields, field.name), field) for field in dataclasses.fields(fields)
    }
    return {
        name: _table(value) if dataclasses.is_dataclass(value) else value
        for name, (value, field) in values.items()
        if value is not None and value != field.default
    }
