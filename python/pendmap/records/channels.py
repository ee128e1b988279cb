"""Assignment of a table's columns to channels, in SI, and report of unused columns."""

from __future__ import annotations

import difflib
import math
import re
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError, short_repr
from pendmap.formatting import listed
from pendmap.model.quantities import GRAVITY
from pendmap.records.by_hand import by_hand
from pendmap.records.description import Column
from pendmap.records.experiment import finding_of
from pendmap.records.rod_sensors import accelerometer_of
from pendmap.records.units import CHANNELS, PIVOT_UNITS, name_and_unit, plain, spelling
from pendmap.records.work import Work

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from pendmap.records.description import Description, RunPlan
    from pendmap.records.experiment import Finding
    from pendmap.records.tables import Table
    from pendmap.signal import Floats

_MOST_NAMED: Final = 8  # Most columns listed in a message
# Channels from which an angle can be computed
ANGLE_CHANNELS: Final = ("angle", "velocity", "pixel_x", "pixel_y", "acceleration", "peaks")
POSITION_NAME: Final = "pos(ition)?"
POSITION_AGREES: Final = 0.9  # Least correlation of a position with the integrated velocity
MOTOR_NAMES: Final = re.compile(
    r"\b(torques?|drehmoment|couple|tau|currents?|strom|motors?|pwm|duty|effort|actuator|u)\b"
)
MOTOR_UNITS: Final = ("nm", "mnm", "a", "ma")
PIVOT_NAMES: Final = re.compile(
    r"\b(pivot|cart|carriage|trolley|slider?|shaker|stage|base|platform|support|suspension|wagen)\b"
)
# Default unit of a pivot's column by words in its name
PIVOT_KINDS: Final = ((r"\bacc", "m/s2"), (r"\b(vel|speed)", "m/s"), (r"\b(pos|place|x)", "m"))
ANGLE_NAMES: Final = re.compile(r"pos(ition)?|.*(angle|winkel|theta|encoder).*")
MOST_UNUSED: Final = 12  # Most unused columns listed in a message


def channels_of(  # noqa: C901 (a step each)
    table: Table, description: Description, plan: RunPlan, where: str
) -> Work:
    """Return a record's channels, from columns named in [columns], default or similar names."""
    asked = description.columns
    places: dict[str, int] = {}
    for channel, column in asked.items():
        name = column.name or CHANNELS[channel].default
        # Without a name it gives unit, scale or zero of a column that is found by its usual names.
        if column.name is not None or name in table.names:
            places[channel] = _place(name, table, f"{where}: {channel}")
    for channel, kind in CHANNELS.items():
        if channel in places or kind.default not in table.names:
            continue
        place = table.names.index(kind.default)
        # [columns] may say that theta_rad holds turning points: then it holds no angles.
        if channel != "angle" or place != places.get("peaks"):
            places[channel] = place
    # A channel without a column is none that is looked for.
    places |= {channel: -1 for channel, column in asked.items() if column.unused}
    rate, known = description.rate_hz, description.known
    findings = use_pixels(table, places, asked)
    findings += guess(table, places, timed=rate is None)
    places = {channel: place for channel, place in places.items() if place >= 0}
    if rate and "time" in places and not in_order(table.values[:, places["time"]]):
        del places["time"]
    values, heads = {}, {}
    if rate and "time" not in places:
        values["time"], heads["time"] = table.order / rate, f"{rate:g} readings a second"
    elif rate:
        head = head_of(table, places["time"])
        findings.append(finding_of("rate-unused", column=head, rate=rate))
    _check(places, table, where, timed="time" in values)
    for channel, place in places.items():
        column, counts = asked.get(channel, Column()), known.get("encoder_counts")
        raw, head = table.values[:, place], table.names[place]
        values[channel] = _in_si(channel, raw, head, column, counts, f"{where}: {channel}")
        heads[channel] = head_of(table, place)
    pivot, pivot_unit, carried = _pivot(table, plan, where)
    if plan.kind == "forced" and not (plan.drive or plan.pivot):
        findings.append(finding_of("drive-missing"))
    if plan.pivot and plan.pivot.unit is None:
        findings.append(finding_of("pivot-unit.missing"))
    unused, questions = _unused(table, {*places.values(), *carried}, places, plan)
    findings += questions
    sensor, missing = None, ""
    if "acceleration" in places:
        head = table.names[places["acceleration"]]
        gravity = float(known.get("gravity", GRAVITY))
        sensor, missing = accelerometer_of(asked.get("acceleration", Column()), head, gravity)
    time = values.pop("time")
    return Work(
        where=where,
        plan=plan,
        known=known,
        declared=frozenset(c for c, column in asked.items() if column.unit or column.scale),
        time=time,
        theta=values.pop("angle", np.zeros(time.size)),
        rows=table.rows.copy(),
        extra=values,
        pivot=pivot,
        trusted=np.ones(time.size, bool),
        findings=[*table.findings, *findings],
        columns=heads,
        unused=unused,
        places=places,
        accelerometer=sensor,
        place_missing=missing,
        edge=asked.get("trigger", Column()).edge,
        pivot_unit=pivot_unit,
    )


def _place(name: str | int, table: Table, where: str) -> int:
    """Return the index of a column by its number or its heading, with or without the unit."""
    if isinstance(name, int) and name <= len(table.names):
        return name - 1
    if name in table.names:
        return table.names.index(name)
    bare = [name_and_unit(head)[0] for head in table.names]
    if bare.count(str(name)) == 1:
        return bare.index(str(name))
    near = difflib.get_close_matches(str(name), table.names, 1, 0.6)
    perhaps = f", perhaps {near[0]!r} is meant" if near else ""
    raise InputError(f"{where} must be one of {_names(table)}, got {short_repr(name)}{perhaps}")


def _names(table: Table) -> str:
    """Return the numbers and headings of a table for a message."""
    names = [f"{k} {name[:40]!r}" if name else str(k) for k, name in enumerate(table.names, 1)]
    return listed(names, _MOST_NAMED)


def _check(places: dict[str, int], table: Table, where: str, *, timed: bool) -> None:
    """Raise InputError for a table without times or angles, or a column with two channels."""
    timed = timed or "time" in places
    if not (timed and any(channel in places for channel in ANGLE_CHANNELS)):
        what, wanted = ("angles", "one") if timed else ("times", "one, or the rate in Hz,")
        raise InputError(
            f"{where}: no column of {what}: {wanted} must be given, got {_names(table)}:"
            f" {_example(places, table, where, timed=timed)}"
        )
    for one, other in (("time", "angle"), ("pixel_x", "pixel_y")):
        if one in places and places[one] == places.get(other):
            name = table.names[places[one]]
            raise InputError(f"{where}: {one} and {other} must be two columns, both are {name!r}")
    if ("pixel_x" in places) != ("pixel_y" in places):
        raise InputError(f"{where}: both or neither of pixel_x and pixel_y must be given, got one")


def _example(places: Mapping[str, int], table: Table, where: str, *, timed: bool) -> str:
    """Return the command that reads the columns that are like times and angles."""
    columns = range(len(table.names))
    first = next((k for k in columns if in_order(table.values[:, k])), None)
    time = places.get("time", None if timed else first)
    free = [k for k in columns if k != time and changes(table.values[:, k])]
    rough = {k: _roughness(table.values[:, k]) for k in free}
    angle = next((k for k in free if rough[k] <= 2 * min(rough.values())), None)
    headed = ("angle", "velocity") if any(table.names) else ()
    known: dict[str, int | None] = {c: places[c] for c in headed if c in places}
    given = {"time": time} | (known or {"angle": angle})
    numbers = {channel: place + 1 for channel, place in given.items() if place is not None}
    return by_hand(where, **({} if timed or "time" in numbers else {"rate_hz": 100}), **numbers)


def _roughness(values: Floats) -> float:
    """Return the mean second difference of numbers over their range; infinite if in order."""
    good = values[np.isfinite(values)]
    bend = np.abs(np.diff(good, 2))
    return math.inf if in_order(values) or not bend.size else float(bend.mean() / np.ptp(good))


def in_order(values: Floats) -> bool:
    """Return whether numbers never fall, and rise."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(np.any(steps > 0) and np.all(steps >= 0))


def _in_si(  # noqa: PLR0913, PLR0917 (what is known of the column)
    channel: str, raw: Floats, head: str, column: Column, counts: int | None, where: str
) -> Floats:
    """Return the values of a column in SI, by its declared scale or its unit."""
    if column.scale is not None:
        return (raw - column.zero) * column.scale
    unit = column.unit
    if unit is None:
        name, unit = name_and_unit(head)
        # The name of a column "volts" or "counts" is its unit.
        unit = unit or (name if re.fullmatch("volts?|counts?|adc", plain(name)) else None)
    if unit is None:
        return raw - column.zero
    if counts and re.fullmatch("counts?|ticks?", plain(unit)):
        return (raw - column.zero) * 2 * np.pi / counts
    return (raw - column.zero) * CHANNELS[channel].factor(unit, where)


def _pivot(
    table: Table, plan: RunPlan, where: str
) -> tuple[dict[str, Floats], str | None, list[int]]:
    """Return the pivot's channels in SI, their unit, and the indices of their columns."""
    if plan.pivot is None:
        return {}, None, []
    unit, factor = PIVOT_UNITS[plan.pivot.unit or "m/s2"]
    factor *= plan.pivot.scale * plan.pivot.sign
    names = {"vertical": plan.pivot.vertical, "horizontal": plan.pivot.horizontal}
    places = {k: _place(v, table, f"{where}: pivot: {k}") for k, v in names.items() if v}
    motion = {way: table.values[:, place] * factor for way, place in places.items()}
    return motion, unit, list(places.values())


def use_pixels(table: Table, places: dict[str, int], asked: Mapping[str, Column]) -> list[Finding]:
    """Assign the pixel coordinates of a table whose angle column is constant."""
    guessed = _by_name(table, {k: v for k, v in places.items() if k != "angle"})
    place = places.get("angle", guessed.get("angle"))
    both = guessed | places
    pair: dict[str, int] = {c: both[c] for c in ("pixel_x", "pixel_y") if c in both}
    if place is None or "angle" in asked or len(pair) < 2:
        return []
    if changes(table.values[:, place]) or not changes(table.values[:, pair["pixel_x"]]):
        return []
    places.pop("angle", None)
    places.update(pair)
    x, y = (table.names[k] for k in pair.values())
    return [finding_of("angle-constant", angle=head_of(table, place), x=x, y=y)]


def guess(table: Table, places: dict[str, int], *, timed: bool) -> list[Finding]:
    """Assign missing channels by common column names, or by position without names."""
    if not any(table.names):
        return _by_position(table, places, timed=timed)
    guessed = _by_name(table, places)
    if "time" in places and any(channel in places for channel in ANGLE_CHANNELS):
        guessed = {c: k for c, k in guessed.items() if c in {"velocity", "trigger"}}
    # An angle given with pixel coordinates was computed from them.
    pair = all(name in places or name in guessed for name in ("pixel_x", "pixel_y"))
    if "angle" in places or "angle" in guessed or not pair:
        guessed = {c: k for c, k in guessed.items() if not c.startswith("pixel")}
    if "pixel_x" in places:
        guessed.pop("angle", None)
    if not {"angle", "pixel_x", "peaks"} & {*places, *guessed}:
        position = position_of(table, places | guessed)
        guessed |= {} if position is None else {"angle": position}
    if not timed and not any(channel in places or channel in guessed for channel in ANGLE_CHANNELS):
        free = [k for k in range(table.values.shape[1]) if k not in guessed.values()]
        guessed |= {"angle": free[0]} if len(free) == 1 else {}
    places.update(guessed)
    names = ", ".join(f"{channel} is {table.names[k]!r}" for channel, k in guessed.items())
    return [finding_of("columns-guessed", names=names)] if guessed else []


def _by_name(table: Table, places: dict[str, int]) -> dict[str, int]:
    """Return columns with common names for channels without; of axes, that which varies most."""
    guessed: dict[str, int] = {}
    for channel, kind in CHANNELS.items():
        taken = {*places.values(), *guessed.values()}
        fitting = [k for k in _fitting(table, channel, kind.names) if k not in taken]
        if channel in places or not fitting:
            continue
        columns = table.values[:, fitting]
        spread = np.std(np.where(np.isfinite(columns), columns, 0.0), axis=0)
        axes = channel in {"velocity", "acceleration"} and len(fitting) > 1
        guessed[channel] = fitting[int(np.argmax(spread)) if axes else 0]
    return guessed


def _fitting(table: Table, channel: str, names: str) -> list[int]:
    """Return the columns whose name matches and whose unit, if any, is one of the channel's."""
    split = [name_and_unit(head) for head in table.names]
    return [
        k
        for k, (name, unit) in enumerate(split)
        if (unit is None or CHANNELS[channel].has(unit)) and re.fullmatch(names, plain(name))
    ]


def _by_position(table: Table, places: dict[str, int], *, timed: bool) -> list[Finding]:
    """Assign time and angle in a table without headings."""
    free = [k for k in range(table.values.shape[1]) if k not in places.values()]
    guesses = []
    if not timed:  # the rate is known: ignore columns that number the readings
        free = [k for k in free if np.any(np.diff(table.values[:, k]) != 1)]
    if "time" not in places and free:
        steps = np.diff(table.values[:, free], axis=0)
        rises = np.sum(steps > 0, axis=0) > 0.9 * np.sum(np.isfinite(steps), axis=0)
        if rises.any():
            k = places["time"] = free.pop(int(np.argmax(rises)))
            guesses.append(f"column {k + 1} is the time in s")
    if free and not any(channel in places for channel in ANGLE_CHANNELS):
        places["angle"] = free[0]
        guesses.append(f"column {free[0] + 1} is the angle")
    finding = finding_of("columns-guessed.places", names=", ".join(guesses))
    return [finding] if guesses else []


def position_of(table: Table, places: Mapping[str, int]) -> int | None:
    """Return the column named position, unless it contradicts a velocity; else None."""
    from scipy.signal import detrend

    taken = places.values()
    fitting = [k for k in _fitting(table, "angle", POSITION_NAME) if k not in taken]
    if len(fitting) != 1 or "velocity" not in places:
        return fitting[0] if len(fitting) == 1 else None
    both = table.values[:, [fitting[0], places["velocity"]]]
    both = both[np.isfinite(both).all(axis=1)]
    if both.shape[0] < 5:
        return None
    one, other = detrend(both[:, 0]), detrend(np.cumsum(both[:, 1]))
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return fitting[0] if size > 0 and float(one @ other) > POSITION_AGREES * size else None


def head_of(table: Table, place: int) -> str:
    """Return the heading of a column."""
    return table.names[place] or f"column {place + 1}"


def changes(values: Floats) -> bool:
    """Return whether a column has at least two different values."""
    seen = values[np.isfinite(values)]
    return bool(seen.size) and float(np.ptp(seen)) > 0


def _unused(
    table: Table, used: Collection[int], channels: Collection[str], plan: RunPlan
) -> tuple[tuple[str, ...], list[Finding]]:
    """Return the headings of unused columns, and the findings about them."""
    rest = [k for k in range(table.values.shape[1]) if k not in used]
    rest = [k for k in rest if table.names[k] or np.isfinite(table.values[:, k]).any()]
    names = tuple(head_of(table, k) for k in rest)
    if not rest:
        return (), []
    findings = [finding_of("columns-unused", names=listed([*map(repr, names)], MOST_UNUSED))]
    for k in rest:
        if changes(table.values[:, k]):
            findings += _suggestion(head_of(table, k), channels, plan)
    seen = {finding.what: finding for finding in reversed(findings)}  # the first of each kind
    return names, list(reversed(seen.values()))


def _suggestion(head: str, channels: Collection[str], plan: RunPlan) -> list[Finding]:
    """Return the finding that a heading suggests: a motor, an angle or a pivot."""
    name, unit = name_and_unit(head)
    name, unit = plain(name), spelling(unit or "")
    words = plain(head)
    if (MOTOR_NAMES.search(name) or unit in MOTOR_UNITS) and plan.kind == "free":
        return [finding_of("motor-column", head=head)]
    bare = "angle" not in channels and "peaks" not in channels
    if bare and (ANGLE_NAMES.fullmatch(name) or unit in {"rad", "deg", "°"}):
        return [finding_of("angle-column", head=head)]
    if PIVOT_NAMES.search(words) and plan.pivot is None:
        kind = next((u for pattern, u in PIVOT_KINDS if re.search(pattern, words)), "m")
        unit = unit if unit in PIVOT_UNITS else kind
        return [finding_of("pivot-column", head=head, unit=unit)]
    return []
