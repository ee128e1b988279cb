"""What is given by hand, over the tables of an ``experiment.toml``; commands that give it."""

from __future__ import annotations

import re
import shlex
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Final, TypedDict

from pendmap.files import toml_text, whole_file
from pendmap.tables.units import CHANNELS, spelling

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from pendmap.records.experiment import Run


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
        First and last time that are used, s on the clock of the record.
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


FRAME: Final = "DataFrame"  # Name of a record that has no file
GIVEN: Final = ContextVar[tuple[str, "Mapping[str, Any]"]]("given", default=("", {}))
"""Folder whose description is read, if any, and the options given, which commands repeat."""
# Channels from which the angle can come
_SOURCES: Final = ("angle", "peaks", "pixel_x", "pixel_y", "velocity", "acceleration")
_OF_ANGLE: Final = ("angle_unit", "angle_scale")
_PLACES: Final = {
    **{name: f"[columns]: {name}: name" for name in ("time", "angle", "velocity")},
    **{name: f"[columns]: pixel_{name}: name" for name in ("x", "y")},
    "time_unit": "[columns]: time: unit",
    **{name: f"[columns]: angle: {name[6:]}" for name in _OF_ANGLE},
    "rate_hz": "[columns]: rate_hz",
    "counts_per_turn": "[rig]: encoder_counts",
    **{name: f"[[run]]: {name}" for name in ("from_s", "to_s")},
}
"""Keys of a description in the place of the keywords, those of columns before their units."""


def by_hand(where: str, **options: object) -> str:
    """Return the command with which a file is read by hand, to end a message; of a table the call.

    >>> by_hand("run 1.csv", time=1, angle="theta 2", angle_unit="deg")
    "pendmap look 'run 1.csv' --time 1 --angle 'theta 2' --angle-unit deg"
    """
    place, given = GIVEN.get()
    options = {**given, **options}
    if where == FRAME:
        call = ", ".join(f"{name}={value!r}" for name, value in options.items())
        return f"pendmap.read_experiment({where}, {call})"
    words = ["pendmap", "look", place or where]
    for name, value in options.items():
        option = name.removesuffix("_s").removesuffix("_hz").replace("_", "-")
        words += [f"--{option}", f"{value:.12g}" if isinstance(value, float) else str(value)]
    return shlex.join(words)


def _places(given: Mapping[str, Any]) -> dict[str, str]:
    """Return where each keyword stands in a description, in the words of its messages."""
    if "velocity" in given and "angle" not in given:
        return _PLACES | {name: f"[columns]: velocity: {name[6:]}" for name in _OF_ANGLE}
    return _PLACES


def override(content: dict[str, Any], given: Mapping[str, Any]) -> None:
    """Put what is given by hand into the tables of a description."""
    columns = _columns(content)
    if "angle" not in given and given.keys() & {"velocity", "x", "y"}:
        columns |= {channel: {"unused": True} for channel in _SOURCES}
    for name, place in _places(given).items():
        value: Any = given.get(name)
        match [part for part in place.split(": ") if value is not None]:
            case ["[columns]", channel, "name"]:
                columns[channel] = {"name": value}
            case ["[columns]", channel, key]:
                rate = channel == "velocity" and key == "unit"
                per_s = rate and spelling(value) not in CHANNELS[channel].units
                column = columns.setdefault(channel, {})
                column.pop("scale", None)
                column[key] = f"{value}/s" if per_s else value
            case ["[columns]", key]:
                columns[key] = value
            case ["[rig]", key]:
                content.setdefault("rig", {})[key] = value
            case ["[[run]]", key]:
                for run in content["run"]:
                    run[key] = value


def by_keyword(message: str, given: Mapping[str, Any]) -> str:
    """Return a message about a key of a description, with the keyword in its place."""
    message = re.sub(r"^\[\[run\]\] \d+", "[[run]]", message)
    for name, place in _places(given).items():
        message = message.replace(f"{place} ", f"{name} ", 1)
    return message


def name_columns(content: dict[str, Any], runs: Sequence[Run]) -> None:
    """Name the columns that all runs have taken, and leave out files that were not read."""
    columns = _columns(content)
    for channel, head in runs[0].channels.items():
        by_rate = channel == "time" and "rate_hz" in columns
        if not by_rate and all(run.channels.get(channel) == head for run in runs):
            columns.setdefault(channel, {})["name"] = head
    files = {run.file for run in runs}
    content["run"] = [run for run in content["run"] if run["file"] in files]


def _columns(content: dict[str, Any]) -> dict[str, Any]:
    """Return the table of columns, each a table of its own in place of its name."""
    columns: dict[str, Any] = content.setdefault("columns", {})
    for channel, column in columns.items():
        named = isinstance(column, dict) or channel == "rate_hz"
        columns[channel] = column if named else {"name": column}
    return columns


def save_description(content: Mapping[str, Any], path: Path) -> Path:
    """Write an ``experiment.toml``."""
    text = toml_text({name: table for name, table in content.items() if table})
    with whole_file(path, (".toml",)) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
    return path
