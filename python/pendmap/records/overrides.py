"""What is given by hand, in the place of the tables of an ``experiment.toml``."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final, TypedDict

from pendmap.errors import InputError
from pendmap.files import toml_text, whole_file
from pendmap.records.by_hand import GIVEN, by_hand
from pendmap.records.description import RATE
from pendmap.tables.units import CHANNELS, spelling

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pendmap.records.work import Work

    Taken = dict[str, dict[str, str | int]]  # column of each channel, by file


class ByHand(TypedDict, total=False):
    """Keywords that say how records are read; they override an ``experiment.toml``.

    Parameters
    ----------
    time, angle, velocity, x, y : str or int
        Column of this quantity, by its heading or its number from 1. Where no ``angle`` is given,
        it is the integral of the velocity, or that of x and y on their circle.
    time_unit, angle_unit : str
        Unit of this column, like ms or deg. Of a velocity without an angle it is a second.
    angle_scale : float
        Angle in rad, for a unit of its column.
    rate_hz : float
        Sampling rate, Hz, of records without a column of times in order.
    from_s, to_s : float
        End of the span that is used, s on the clock of the record.
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


_CHANNELS: Final = {
    **{name: name for name in ("time", "angle", "velocity")},
    "x": "pixel_x",
    "y": "pixel_y",
}
# Channels from which the angle can come
_SOURCES: Final = ("angle", "peaks", "pixel_x", "pixel_y", "velocity", "acceleration")


def override(content: dict[str, Any], given: Mapping[str, Any]) -> None:
    """Put what is given by hand into the tables of a description."""
    columns = _columns(content)
    named = {channel: given[name] for name, channel in _CHANNELS.items() if name in given}
    if "angle" not in named and named.keys() - {"time"}:
        columns |= {channel: {"unused": True} for channel in _SOURCES}
    columns |= {channel: {"name": name} for channel, name in named.items()}
    angle = "velocity" if "velocity" in named and "angle" not in named else "angle"
    for name, channel in (("time_unit", "time"), ("angle_unit", angle), ("angle_scale", angle)):
        if name in given:
            columns.setdefault(channel, {}).pop("scale", None)
            columns[channel][name.partition("_")[2]] = given[name]
    unit = given.get("angle_unit", "")
    if angle == "velocity" and unit and spelling(unit) not in CHANNELS[angle].units:
        columns[angle]["unit"] = f"{unit}/s"
    columns |= {name: given[name] for name in given.keys() & {RATE}}
    if "counts_per_turn" in given:
        content.setdefault("rig", {})["encoder_counts"] = given["counts_per_turn"]
    for run in content["run"]:
        run |= {name: given[name] for name in given.keys() & {"from_s", "to_s"}}


def name_columns(content: dict[str, Any], taken: Taken) -> None:
    """Name the columns that were taken from all files, and leave out files that were not read."""
    columns, (first, *others) = _columns(content), taken.values()
    for channel, name in first.items():
        if all(other.get(channel) == name for other in others):
            columns.setdefault(channel, {})["name"] = name
    content["run"] = [run for run in content["run"] if run["file"] in taken]


def by_option(message: str) -> str:
    """Return a message about a key of a description, with the keyword in its place."""
    place = re.match(r"\[+\w+\]+(?: \d+)?: (?:(?:pixel_)?(\w+): )?(\w+)", message)
    if place is None:
        return message
    channel, key = place.groups()
    keyword = key if channel is None else channel if key == "name" else f"{channel}_{key}"
    return keyword + message[place.end() :]


def _columns(content: dict[str, Any]) -> dict[str, Any]:
    """Return the table of columns, each a table of its own in place of its name."""
    columns: dict[str, Any] = content.setdefault("columns", {})
    for channel, column in columns.items():
        named = isinstance(column, dict) or channel == RATE
        columns[channel] = column if named else {"name": column}
    return columns


def save_description(content: Mapping[str, Any], path: Path) -> Path:
    """Write an ``experiment.toml``."""
    text = toml_text({name: table for name, table in content.items() if table})
    with whole_file(path, (".toml",)) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
    return path


def refuse_unused(work: Work) -> None:
    """Raise InputError if the unit of an angle is given by hand that no column has."""
    given = dict(GIVEN.get()[1])
    units = [name for name in ("angle_unit", "angle_scale") if name in given]
    if units and "velocity" not in given and "angle" not in work.columns:
        rate = work.columns.get("velocity")
        line = work.other("angle") if rate is None else f": {by_hand(work.where, velocity=rate)}"
        raise InputError(f"{work.where}: {units[0]} must be that of a column of angles{line}")
