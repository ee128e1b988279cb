"""Which column is which channel, in SI."""

from __future__ import annotations

import dataclasses
import difflib
import re
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError, short_repr
from pendmap.model.quantities import GRAVITY
from pendmap.records.experiment import Finding
from pendmap.records.other_angles import position_of
from pendmap.records.rod_sensors import Accelerometer, Place, accelerometer_of
from pendmap.records.units import CHANNELS, PIVOT_UNITS, name_and_unit, plain
from pendmap.records.unused import ask, changes, head_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from pendmap.records.description import Column, Description, RunPlan
    from pendmap.records.text import Table

    Floats = NDArray[np.float64]


_MOST_NAMED: Final = 8
"""Columns that a message lists."""


@dataclasses.dataclass(frozen=True)
class Channels:
    """The channels of a table.

    Parameters
    ----------
    values : mapping of str to ndarray, shape (rows,)
        By channel, in SI; the time is always there.
    columns : mapping of str to str
        The heading of each.
    declared : frozenset of str
        Channels whose unit or scale somebody declared in [columns].
    pivot : mapping of str to ndarray, or None
        The pivot's motion in SI.
    pivot_unit : str or None
        What it is: ``"m/s2"``, ``"m/s"`` or ``"m"``.
    findings : tuple of Finding
        What had to be guessed.
    accelerometer : Accelerometer or None
        Where the acceleration was measured, if that is known ...
    place_missing : str
        ... else the keys of [columns] that would say it.
    edge, phase : str and float, or None
        Which edge of the trigger counts, and the drive's phase there, rad; as [columns] has them.
    unused : tuple of str
        What heads the columns that none of this comes from.
    """

    values: Mapping[str, Floats]
    columns: Mapping[str, str]
    declared: frozenset[str] = frozenset()
    pivot: Mapping[str, Floats] | None = None
    pivot_unit: str | None = None
    findings: tuple[Finding, ...] = ()
    accelerometer: Accelerometer | None = None
    place_missing: str = ""
    edge: str | None = None
    phase: float | None = None
    unused: tuple[str, ...] = ()


def channels_of(  # noqa: C901 (a step each)
    table: Table, description: Description, plan: RunPlan, where: str
) -> Channels:
    """Choose the columns: those that [columns] names, the default names, then names like them.

    Raises
    ------
    InputError
        If a column that is named is not there, or there is no time or nothing of the angle.
    """
    asked = description.columns
    places: dict[str, int] = {}
    for channel, column in asked.items():
        name = column.name or CHANNELS[channel].default
        if column.name is None and name not in table.names:
            continue  # unit, scale or zero of a column that is to be found by its usual names
        places[channel] = _place(name, table, f"{where}: [columns]: {channel}")
    for channel, kind in CHANNELS.items():
        if channel in places or kind.default not in table.names:
            continue
        place = table.names.index(kind.default)
        # [columns] may say that theta_rad holds turning points: then it holds no angles.
        if channel != "angle" or place != places.get("peaks"):
            places[channel] = place
    rate = description.rate_hz
    findings = pictured(table, places, asked)
    findings += guess(table, places, timed=rate is None)
    values, units = {}, {}
    if rate and "time" not in places:
        values["time"], units["time"] = table.order / rate, f"{rate:g} readings a second"
    elif rate:
        text = f"{head_of(table, places['time'])!r} has the times: rate_hz {rate:g} is not used"
        findings.append(Finding("rate-unused", text))
    _check(places, table, where, timed="time" in values)
    for channel, place in places.items():
        given = asked.get(channel)
        values[channel] = _in_si(channel, table, place, given, description, where)
        units[channel] = head_of(table, place)
    declared = {c for c, column in asked.items() if column.unit or column.scale}
    pivot, unit = _pivot(table, plan, where)
    carried = [_place((plan.pivot or {})[way], table, where) for way in pivot or ()]
    unused, questions = ask(table, {*places.values(), *carried}, places, plan)
    findings += questions
    if plan.pivot and "unit" not in plan.pivot:
        text = 'the pivot has no unit: taken for an acceleration, unit = "m/s2"'
        findings.append(Finding("pivot-unit", text))
    sensor, missing = None, ""
    if "acceleration" in places:
        k, said = places["acceleration"], asked.get("acceleration")
        heading, read_in = name_and_unit(table.names[k])
        gravity = float(description.known.get("gravity", GRAVITY))
        given_in = said.unit if said and said.unit else read_in
        spot = said.place if said else Place()
        scaled = said is not None and said.scale is not None
        sensor, missing = accelerometer_of(spot, given_in, heading, gravity, scaled=scaled)
    edges = asked.get("trigger")
    return Channels(
        values,
        units,
        frozenset(declared),
        pivot,
        unit,
        tuple(findings),
        accelerometer=sensor,
        place_missing=missing,
        edge=edges.edge if edges else None,
        phase=edges.phase if edges else None,
        unused=unused,
    )


def _place(name: str, table: Table, where: str) -> int:
    if name in table.names:
        return table.names.index(name)
    bare = [name_and_unit(head)[0] for head in table.names]
    if bare.count(name) == 1:
        return bare.index(name)
    if not table.headed:
        raise InputError(f"{where}: {short_repr(name)}: the file has no line of names")
    near = difflib.get_close_matches(name, table.names, 1, 0.6)
    perhaps = f", perhaps {near[0]!r} is meant" if near else ""
    raise InputError(
        f"{where}: no column {short_repr(name)}{perhaps}: it must be one of {_listed(table)}"
    )


def _listed(table: Table) -> str:
    names = [name[:40] or "(no name)" for name in table.names]
    more = f", ... ({len(names)} in all)" if len(names) > _MOST_NAMED else ""
    return ", ".join(map(repr, names[:_MOST_NAMED])) + more


def _check(places: dict[str, int], table: Table, where: str, *, timed: bool) -> None:
    advice = "experiment.toml names others in [columns]"
    if "time" not in places and not timed:
        raise InputError(
            f"{where}: no column of times: there must be one like t_s, or a rate: --rate 1000 or"
            f" rate_hz = 1000 in [columns] of experiment.toml (Hz); got columns {_listed(table)}"
        )
    if not any(channel in places for channel in ANGLES):
        raise InputError(
            f"{where}: no column of angles: there must be theta_rad or one like it; there are"
            f" {_listed(table)}; {advice}"
        )
    for one, other in (("time", "angle"), ("pixel_x", "pixel_y")):
        if one in places and places[one] == places.get(other):
            name = table.names[places[one]]
            raise InputError(f"{where}: {one} and {other} must be two columns, both are {name!r}")
    if ("pixel_x" in places) != ("pixel_y" in places):
        raise InputError(f"{where}: both or neither of pixel_x and pixel_y must be given, got one")


def _in_si(  # noqa: PLR0913, PLR0917 (what is known of the column)
    channel: str,
    table: Table,
    place: int,
    column: Column | None,
    description: Description,
    where: str,
) -> Floats:
    raw = table.values[:, place]
    kind = CHANNELS[channel]
    where = f"{where}: {channel}"
    zero = column.zero if column else 0.0
    if column and column.scale is not None:
        return np.asarray((raw - zero) * column.scale)
    unit = column.unit if column else None
    if unit is None:
        name, unit = name_and_unit(table.names[place])
        # A column called "volts" or "counts" says its unit by its name.
        unit = unit or (name if re.fullmatch("volts?|counts?|adc", plain(name)) else None)
    if unit is None:
        return np.asarray(raw - zero)
    counts = description.known.get("encoder_counts")
    if counts and re.fullmatch("counts?|ticks?", plain(unit)):
        return np.asarray((raw - zero) * 2 * np.pi / counts)
    return np.asarray((raw - zero) * kind.factor(unit, where))


def _pivot(table: Table, plan: RunPlan, where: str) -> tuple[dict[str, Floats] | None, str | None]:
    if plan.pivot is None:
        return None, None
    unit, factor = PIVOT_UNITS[plan.pivot.get("unit", "m/s2")]
    found = {}
    for way in ("vertical", "horizontal"):
        if way in plan.pivot:
            place = _place(plan.pivot[way], table, f"{where}: pivot: {way}")
            found[way] = np.asarray(table.values[:, place] * factor * plan.pivot_scale)
    return found, unit


# Which columns are meant where nobody says it: by their names, their place, what they show.


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
