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
from pendmap.records.guesses import ANGLE_CHANNELS, changes, guess, head_of, use_pixels
from pendmap.records.rod_sensors import accelerometer_of
from pendmap.records.work import Work
from pendmap.tables.findings import finding_of
from pendmap.tables.units import (
    ANGLES,
    CHANNELS,
    LENGTHS,
    PIVOT_UNITS,
    RAW,
    Heading,
    name_and_unit,
    plain,
    spelling,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from pendmap.records.description import Description, RunPlan
    from pendmap.signal import Floats
    from pendmap.tables.findings import Finding
    from pendmap.tables.text import Table

_MOST_NAMED: Final = 8  # Most columns listed in a message
MOTOR_UNITS: Final = ("nm", "mnm", "a", "ma")
# Default unit of a pivot's column by words in its name
PIVOT_KINDS: Final = ((r"\bacc", "m/s2"), (r"\b(vel|speed)", "m/s"), (r"\b(pos|place|x)", "m"))
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
    # An empty column gives way to another.
    columns = zip(table.names, table.values.T, strict=True)
    filled = [name if np.isfinite(values).any() else "" for name, values in columns]
    for channel, kind in CHANNELS.items():
        if channel in places or kind.default not in filled:
            continue
        place = filled.index(kind.default)
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
        _refuse_text(table, place, places, f"{where}: {channel}")
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


def _refuse_text(table: Table, place: int, places: Mapping[str, int], where: str) -> None:
    """Raise InputError for a column of text, with the command that takes another."""
    if place not in table.texts:
        return
    taken, channel = {*places.values(), *table.texts}, where.rpartition(" ")[2]
    free = [k + 1 for k in range(len(table.names)) if k not in taken]
    file = where.rpartition(": ")[0]
    more = f"; {by_hand(file, **{channel: free[0]})} takes another" if free else ""
    head = f"column {place + 1} ({head_of(table, place)!r})"
    raise InputError(f"{where}: {head} must be numbers, got {table.texts[place]}{more}")


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
    if not timed:
        raise InputError(
            f"{where}: no column of times: one, or the rate in Hz, must be given, got"
            f" {_names(table)}: {_example(places, table, where, timed=timed)}"
        )
    if not any(channel in places for channel in ANGLE_CHANNELS):
        raise InputError(f"{where}: no column of angles: {_missing_angle(table, places, where)}")
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


def _missing_angle(table: Table, places: Mapping[str, int], where: str) -> str:
    """Return what is no angle in a table, and the command that reads it all the same."""
    free = [k for k in range(len(table.names)) if k not in places.values()]
    for k, head in ((k, Heading.of(table.names[k])) for k in free):
        unit = spelling(head.unit or "px")
        if unit in LENGTHS and (head.unit or head.meaning in {"x", "y"}):
            length = 400 if unit == "px" else 0.4 / LENGTHS[unit]
            more = by_hand(where, angle=k + 1, angle_scale=f"{1 / length:.4g}")
            return (
                f"{table.names[k]!r} is a length: x and y must be given, or the distance from the"
                f" pivot, as here of {length:g} {head.unit or 'px'}: {more}"
            )
        if head.unit is not None and {"angle", "velocity"} & {*head.meanings}:
            more = by_hand(where, angle=k + 1, angle_unit="deg")
            return f"{head.unit!r} is not known as a unit of {table.names[k]!r}: {more}"
    more = _example(places, table, where, timed=True)
    return f"one must be given, got {_names(table)}: {more}"


def _in_si(  # noqa: PLR0913, PLR0917 (what is known of the column)
    channel: str, raw: Floats, head: str, column: Column, counts: int | None, where: str
) -> Floats:
    """Return the values of a column in SI, by its declared scale or its unit."""
    if column.scale is not None:
        return (raw - column.zero) * column.scale
    unit = column.unit or name_and_unit(head)[1]
    if unit is None:
        return raw - column.zero
    if counts and spelling(unit) == "counts":
        return (raw - column.zero) * 2 * np.pi / counts
    if spelling(unit) in RAW and channel in {"angle", "velocity"} and column.unit is None:
        name, value = ("counts_per_turn", 2400) if "count" in spelling(unit) else ("angle_scale", 1)
        more = by_hand(where.removesuffix(f": {channel}"), **{name: value})
        raise InputError(f"{where}: the scale of {head!r} must be given, like {more}")
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
    heading, words = Heading.of(head), plain(head)
    unit = spelling(heading.unit or "")
    driven = {"drive", "motor"} & {*heading.meanings} and "pivot" not in heading.meanings
    if (driven or unit in MOTOR_UNITS) and plan.kind == "free":
        return [finding_of("motor-column", head=head)]
    bare = "angle" not in channels and "peaks" not in channels
    if bare and (heading.meaning in {"angle", "position"} or unit in ANGLES):
        return [finding_of("angle-column", head=head)]
    if "pivot" in heading.meanings and plan.pivot is None:
        kind = next((u for pattern, u in PIVOT_KINDS if re.search(pattern, words)), "m")
        unit = unit if unit in PIVOT_UNITS else kind
        return [finding_of("pivot-column", head=head, unit=unit)]
    return []
