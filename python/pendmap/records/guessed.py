"""Which columns are meant where nobody says it: by their names, their place, what they show."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.experiment import Finding
from pendmap.records.other_angles import position_of
from pendmap.records.units import CHANNELS, name_and_unit, plain
from pendmap.records.unused import changes, head_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from pendmap.records.description import Column
    from pendmap.records.text import Table

    Floats = NDArray[np.float64]

__all__ = ["ANGLES", "guess", "pictured"]

ANGLES: Final = ("angle", "velocity", "pixel_x", "pixel_y", "acceleration", "peaks")
"""Channels that tell of the angle, one way or another."""


def pictured(table: Table, places: dict[str, int], asked: Mapping[str, Column]) -> list[Finding]:
    """Take the coordinates of a picture where the angle beside them has nothing to say."""
    found = _by_name(table, {k: v for k, v in places.items() if k != "angle"})
    place = places.get("angle", found.get("angle"))
    both = found | places
    pair: dict[str, int] = {c: both[c] for c in ("pixel_x", "pixel_y") if c in both}
    if place is None or "angle" in asked or len(pair) < 2:
        return []
    if changes(table.values[:, place]) or not changes(table.values[:, pair["pixel_x"]]):
        return []
    places.pop("angle", None)
    places.update(pair)
    x, y = (table.names[k] for k in pair.values())
    text = f"{head_of(table, place)!r} never changes: the angle is made of {x!r} and {y!r}"
    return [Finding("angle-constant", text, mended=True)]


def guess(table: Table, places: dict[str, int], *, timed: bool) -> list[Finding]:
    """Find what is missing by names like the usual ones, or without names by position."""
    if not table.headed:
        return _by_position(table, places, timed=timed)
    guessed = _by_name(table, places)
    if "time" in places and any(channel in places for channel in ANGLES):
        guessed = {c: k for c, k in guessed.items() if c in {"velocity", "trigger"}}
    # A picture's coordinates beside an angle are what the angle was made from.
    pair = all(name in places or name in guessed for name in ("pixel_x", "pixel_y"))
    if "angle" in places or "angle" in guessed or not pair:
        guessed = {c: k for c, k in guessed.items() if not c.startswith("pixel")}
    if "pixel_x" in places:
        guessed.pop("angle", None)
    if not {"angle", "pixel_x", "peaks"} & {*places, *guessed}:
        position = position_of(table, places | guessed)
        guessed |= {} if position is None else {"angle": position}
    if not timed and not any(channel in places or channel in guessed for channel in ANGLES):
        free = [k for k in range(table.values.shape[1]) if k not in guessed.values()]
        guessed |= {"angle": free[0]} if len(free) == 1 else {}
    places.update(guessed)
    if not guessed:
        return []
    said = ", ".join(f"{channel} is {table.names[k]!r}" for channel, k in guessed.items())
    return [Finding("columns-guessed", f"by their names {said}")]


def _by_name(table: Table, places: dict[str, int]) -> dict[str, int]:
    """Return columns for the channels that have none, by names like the usual ones."""
    guessed: dict[str, int] = {}
    split = [name_and_unit(head) for head in table.names]
    for channel, kind in CHANNELS.items():
        if channel in places:
            continue
        taken = {*places.values(), *guessed.values()}
        fitting = [
            k
            for k, (name, unit) in enumerate(split)
            if k not in taken
            and (unit is None or kind.has(unit))
            and any(re.fullmatch(pattern, plain(name)) for pattern in kind.names)
        ]
        if fitting:
            guessed[channel] = _best(channel, fitting, table)
    return guessed


def _best(channel: str, fitting: list[int], table: Table) -> int:
    """Return the axis of a sensor that moves most; of all else the first column."""
    if channel not in {"velocity", "acceleration"} or len(fitting) == 1:
        return fitting[0]
    spread = [np.nan_to_num(np.nanstd(_safe(table.values[:, k]))) for k in fitting]
    return fitting[int(np.argmax(spread))]


def _safe(values: Floats) -> Floats:
    return np.where(np.isfinite(values), values, 0.0)


def _by_position(table: Table, places: dict[str, int], *, timed: bool) -> list[Finding]:
    free = [k for k in range(table.values.shape[1]) if k not in places.values()]
    said = []
    if not timed:  # the rate is known: what counts the readings tells nothing
        free = [k for k in free if np.any(np.diff(table.values[:, k]) != 1)]
    if "time" not in places and free:
        k = next((k for k in free if _rises(table.values[:, k])), None)
        k = free[0] if k is None and timed and _orders(table.values[:, free[0]]) else k
        if k is not None:
            places["time"] = k
            free.remove(k)
            said.append(f"column {k + 1} is the time in s")
    if free and not any(channel in places for channel in ANGLES):
        places["angle"] = free[0]
        said.append(f"column {free[0] + 1} is the angle")
    return [Finding("columns-guessed", f"no line of names: {', '.join(said)}")] if said else []


def _orders(values: Floats) -> bool:
    """Whether numbers may be times that are out of order: in order they are evenly spaced."""
    steps = np.diff(np.sort(values[np.isfinite(values)]))
    usual = float(np.median(steps)) if steps.size else 0.0
    return usual > 0 and bool(np.mean(np.abs(steps - usual) < 0.5 * usual) > 0.5)


def _rises(values: Floats) -> bool:
    steps = np.diff(values[np.isfinite(values)])
    return bool(steps.size and np.mean(steps > 0) > 0.9)
