"""Assignment of a table's columns to channels, in SI, and report of unused columns."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import InputError, short_repr
from pendmap.formatting import listed
from pendmap.model.quantities import GRAVITY
from pendmap.records.by_hand import by_hand
from pendmap.records.description import Column
from pendmap.records.guesses import (
    ANGLE_CHANNELS,
    axes_of,
    changes,
    guess,
    head_of,
    in_order,
    likely,
    on_circle,
)
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
MOST_UNUSED: Final = 12  # Most unused columns listed in a message


def channels_of(table: Table, description: Description, plan: RunPlan, where: str) -> Work:
    """Return a record's channels, from columns named in [columns], default or similar names."""
    asked, places = description.columns, _named(table, description.columns, where)
    rate, known = description.rate_hz, description.known
    findings = guess(table, places, timed=rate is None)
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
    _refuse_units(places, table, asked, where)
    for channel, place in places.items():
        column = asked.get(channel, Column())
        values[channel] = _in_si(channel, table, place, column, known, where)
        heads[channel] = head_of(table, place)
    pivot, pivot_unit, carried = _pivot(table, plan, where)
    if plan.kind == "forced" and not (plan.drive or plan.pivot):
        findings.append(finding_of("drive-missing"))
    if plan.pivot and plan.pivot.unit is None:
        findings.append(finding_of("pivot-unit.missing"))
    unused, questions = _unused(table, {*places.values(), *carried}, places, plan)
    findings += questions
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
        edge=asked.get("trigger", Column()).edge,
        pivot_unit=pivot_unit,
    )


def _named(table: Table, asked: Mapping[str, Column], where: str) -> dict[str, int]:
    """Return the columns named in [columns], and those with usual names."""
    places: dict[str, int] = {}
    for channel, column in asked.items():
        name = column.name or CHANNELS[channel].default
        # Without a name it gives unit, scale or zero of a column that is found by its usual names.
        if column.name is not None or name in table.names:
            places[channel] = _place(name, table, f"{where}: {channel}")
    for channel, kind in CHANNELS.items():
        place = table.names.index(kind.default) if kind.default in table.names else -1
        # [columns] may say that theta_rad holds turning points: then it holds no angles.
        peaks = channel == "angle" and place == places.get("peaks")
        if place >= 0 and not peaks and changes(table.values[:, place]):
            places.setdefault(channel, place)
    # A channel without a column is none that is looked for.
    return places | {channel: -1 for channel, column in asked.items() if column.unused}


def _place(name: str | int, table: Table, where: str) -> int:
    """Return the index of a column by its number or its heading, with or without the unit."""
    if isinstance(name, int) and name <= len(table.names):
        return name - 1
    heads = [head_of(table, k) for k in range(len(table.names))]
    for names in (heads, [name_and_unit(head)[0] for head in heads]):
        if names.count(str(name)) == 1:
            return names.index(str(name))
    near = difflib.get_close_matches(str(name), heads, 1, 0.6)
    perhaps = f", perhaps {near[0]!r} is meant" if near else ""
    raise InputError(f"{where} must be one of {_names(table)}, got {short_repr(name)}{perhaps}")


def _refuse_units(
    places: Mapping[str, int], table: Table, asked: Mapping[str, Column], where: str
) -> None:
    """Raise InputError for a column of text, or for a unit that belongs to no column."""
    for channel, place in places.items():
        if place in table.texts:
            others = {name: k for name, k in places.items() if name != channel}
            raise InputError(
                f"{where}: {channel}: column {place + 1} ({head_of(table, place)!r}) must be"
                f" numbers, got {table.texts[place]}{_by_values(table, others, where)}"
            )
    for channel, column in asked.items():
        if (column.unit or column.scale) and channel not in places:
            more = _by_values(table, {}, where)
            if "velocity" in places:
                more = f": {by_hand(where, velocity=places['velocity'] + 1)}"
            raise InputError(f"{where}: no column of {channel} has the unit that is given{more}")


def _names(table: Table) -> str:
    """Return the numbers and headings of a table for a message."""
    names = [f"{k} {name[:40]!r}" if name else str(k) for k, name in enumerate(table.names, 1)]
    return listed(names, _MOST_NAMED)


def _check(places: dict[str, int], table: Table, where: str, *, timed: bool) -> None:
    """Raise InputError for a table without times or angles, or a column with two channels."""
    timed = timed or "time" in places
    if not timed or not any(channel in places for channel in ANGLE_CHANNELS):
        raise InputError(f"{where}: no column of {_missing(table, places, where, timed=timed)}")
    for one, other in (("time", "angle"), ("pixel_x", "pixel_y")):
        if one in places and places[one] == places.get(other):
            name = table.names[places[one]]
            raise InputError(f"{where}: {one} and {other} must be two columns, both are {name!r}")
    if ("pixel_x" in places) != ("pixel_y" in places):
        raise InputError(f"{where}: both or neither of pixel_x and pixel_y must be given, got one")


def _missing(table: Table, places: Mapping[str, int], where: str, *, timed: bool) -> str:
    """Return what misses in a table, and the command that reads it all the same."""
    why, rate, options = "", dict[str, object](), dict[str, object]()
    places = {**places}
    sensor = places.pop("acceleration", None)
    columns = likely(table, places, timed=not timed)
    if sensor is not None and timed:
        columns = {"angle": sensor}
    free = {*range(len(table.names))} - {*places.values(), *columns.values()}
    if free and not any(channel in ANGLE_CHANNELS for channel in {**places, **columns}):
        columns["angle"] = min(free)
    axes = [] if {*ANGLE_CHANNELS} & {*places} else axes_of(table)
    if axes:
        arc = on_circle(*table.values[:, axes[:2]].T)
        columns |= {"pixel_x": axes[0], "pixel_y": axes[1]} if arc else {"velocity": axes[0]}
        why = ", where a sensor or a place has the axes x, y and z"
        columns.pop("angle", None)
    if not timed:
        known = [c for c in places if c in {"angle", "velocity"} or c.startswith("pixel")]
        pair = [c for c in known if c.startswith("pixel")]
        columns |= {c: places[c] for c in pair or known}
        rate = {} if "time" in columns else {"rate_hz": f"{table.rate or 100:g}"}
    elif "angle" in columns and not axes:
        heading = Heading.of(table.names[columns["angle"]])
        unit = spelling(heading.unit or ("px" if heading.meaning in {"x", "y"} else ""))
        if columns["angle"] == sensor:
            gain = GRAVITY / CHANNELS["acceleration"].units.get(unit, 1.0)
            why = (
                ", where an acceleration across the rod, of small swings, is over g - r w0^2 at r"
                f" from the pivot, here {gain:.4g} {heading.unit or 'm/s2'}"
            )
            options = {"angle_scale": f"{1 / gain:.4g}"}
        elif unit in LENGTHS:
            length = 400 if unit == "px" else 0.4 / LENGTHS[unit]
            why = f", where a place is over its distance from the pivot, here {length:g} {unit}"
            options = {"angle_scale": f"{1 / length:.4g}"}
        elif unit in RAW:
            options = {"angle_scale": 1}
        elif heading.unit is not None:
            why = f", where {heading.unit!r} is not known as a unit"
            options = {"angle_unit": "deg"}
    what = "angles: one" if timed else "times: one, or the rate in Hz,"
    more = by_hand(where, **rate, **_numbers(columns), **options)
    return f"{what} must be given, got {_names(table)}{why}: {more}"


def _by_values(table: Table, places: Mapping[str, int], where: str) -> str:
    """Return the end of a message: the command that takes the columns that are alike, if any."""
    numbers = _numbers(likely(table, places, timed=True))
    return f": {by_hand(where, **numbers)}" if numbers else ""


def _numbers(columns: Mapping[str, int]) -> dict[str, int]:
    """Return columns as keywords by hand with their numbers."""
    return {channel.removeprefix("pixel_"): k + 1 for channel, k in columns.items()}


def _in_si(  # noqa: PLR0913, PLR0917 (what is known of the column)
    channel: str, table: Table, place: int, column: Column, known: Mapping[str, Any], where: str
) -> Floats:
    """Return the values of a column in SI, by its declared scale or its unit."""
    head, raw = table.names[place], table.values[:, place] - column.zero
    unit = column.unit or name_and_unit(head)[1]
    if column.scale is not None or unit is None:
        return raw * (column.scale or 1.0)
    counts = spelling(unit) == "counts"
    if counts and "encoder_counts" in known:
        return np.asarray(raw * 2 * np.pi / known["encoder_counts"])
    if spelling(unit) in CHANNELS[channel].units:
        return np.asarray(raw * CHANNELS[channel].units[spelling(unit)])
    options: dict[str, dict[str, object]] = {
        "time": {"time_unit": "ms"},
        "angle": {"counts_per_turn": 2400} if counts else {"angle_scale": 1},
        "velocity": {"velocity": place + 1, "angle_scale": 1},
    }
    more = f", like {by_hand(where, **options[channel])}" if channel in options else ""
    raise InputError(f"{where}: {channel}: the unit or scale of {head!r} must be given{more}")


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
    heading = Heading.of(head)
    unit = spelling(heading.unit or "")
    driven = {"drive", "motor"} & {*heading.meanings} and "pivot" not in heading.meanings
    if (driven or unit in MOTOR_UNITS) and plan.kind == "free":
        return [finding_of("motor-column", head=head)]
    bare = "angle" not in channels and "peaks" not in channels
    if bare and (heading.meaning in {"angle", "position"} or unit in ANGLES):
        return [finding_of("angle-column", head=head)]
    if "pivot" in heading.meanings and plan.pivot is None:
        unit = unit if unit in PIVOT_UNITS else "m"
        return [finding_of("pivot-column", head=head, unit=unit)]
    return []
