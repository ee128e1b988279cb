"""Assignment of a table's columns to channels, in SI, and report of unused columns."""

from __future__ import annotations

import dataclasses
import difflib
import itertools
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
from pendmap.records.units import ANGLES, CHANNELS, LENGTHS, PIVOT_UNITS, RAW, Heading, name_and_unit, plain, spelling
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
POSITION_AGREES: Final = 0.9  # Least correlation of a position with the integrated velocity
MOTOR_UNITS: Final = ("nm", "mnm", "a", "ma")
# Default unit of a pivot's column by words in its name
PIVOT_KINDS: Final = ((r"\bacc", "m/s2"), (r"\b(vel|speed)", "m/s"), (r"\b(pos|place|x)", "m"))
RISING: Final = 0.9  # Least share of rising steps of a clock
DECAYED: Final = 0.9  # Greatest spread of a decayed last quarter, over that of the first
ON_ARC: Final = 0.1  # Greatest distance from a circle, over that from a line, of places on an arc
COPIED: Final = 0.9999  # Least correlation of the readings of a copy in another unit
BY_UNIT: Final = 4  # Rank of a heading that fits by its unit alone
UNNAMED: Final = 9  # Rank of a heading that says nothing
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
            places[channel] = _place(name, table, f"{where}: [columns]: {channel}")
    for channel, kind in CHANNELS.items():
        if channel in places or kind.default not in table.names:
            continue
        place = table.names.index(kind.default)
        # [columns] may say that theta_rad holds turning points: then it holds no angles.
        if channel != "angle" or place != places.get("peaks"):
            places[channel] = place
    rate, known = description.rate_hz, description.known
    findings = use_pixels(table, places, asked)
    findings += guess(table, places, where, timed=rate is None)
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
        accelerometer=sensor,
        place_missing=missing,
        edge=asked.get("trigger", Column()).edge,
        pivot_unit=pivot_unit,
    )


def _place(name: str, table: Table, where: str) -> int:
    """Return the index of a column by its heading, with or without the unit."""
    if name in table.names:
        return table.names.index(name)
    bare = [name_and_unit(head)[0] for head in table.names]
    if bare.count(name) == 1:
        return bare.index(name)
    if not any(table.names):
        raise InputError(f"{where}: {short_repr(name)}: the file has no line of names")
    near = difflib.get_close_matches(name, table.names, 1, 0.6)
    perhaps = f", perhaps {near[0]!r} is meant" if near else ""
    raise InputError(
        f"{where}: no column {short_repr(name)}{perhaps}: it must be one of {_names(table)}"
    )


def _names(table: Table) -> str:
    """Return the headings of a table for a message."""
    return listed([repr(name[:40] or "(no name)") for name in table.names], _MOST_NAMED)


def _check(places: dict[str, int], table: Table, where: str, *, timed: bool) -> None:
    """Raise InputError for a table without times or angles, or a column with two channels."""
    if "time" not in places and not timed:
        raise InputError(
            f"{where}: no column of times: there must be one like t_s, or a rate: --rate 1000 or"
            f" rate_hz = 1000 in [columns] of experiment.toml (Hz); got columns {_names(table)}:"
            f" {by_hand(where, time=1)} reads the first"
        )
    if not any(channel in places for channel in ANGLE_CHANNELS):
        raise InputError(f"{where}: no column of angles: {_missing_angle(table, places, where)}")
    for one, other in (("time", "angle"), ("pixel_x", "pixel_y")):
        if one in places and places[one] == places.get(other):
            name = table.names[places[one]]
            raise InputError(f"{where}: {one} and {other} must be two columns, both are {name!r}")
    if ("pixel_x" in places) != ("pixel_y" in places):
        raise InputError(f"{where}: both or neither of pixel_x and pixel_y must be given, got one")


def _missing_angle(table: Table, places: Mapping[str, int], where: str) -> str:
    """Return what is no angle in a table, and the command that reads it all the same."""
    free = [k for k in range(len(table.names)) if k not in places.values()]
    for k in free:
        head = Heading.of(table.names[k])
        unit = spelling(head.unit or "px")
        if unit in LENGTHS and (head.unit or head.meaning in {"x", "y"}):
            length = 400 if unit == "px" else 0.4 / LENGTHS[unit]
            return (
                f"{table.names[k]!r} is a length: x and y of the bob must be given, or the distance"
                f" from the pivot, here of {length:g} {head.unit or 'in the unit of the column'}, as"
                f" {by_hand(where, angle=k + 1, angle_scale=f'{1 / length:.4g}')}"
            )
        if head.unit is not None and {"angle", "velocity"} & {*head.meanings}:
            more = by_hand(where, angle=k + 1, angle_unit="deg")
            return f"{head.unit!r} is not known as a unit of it, of {table.names[k]!r}: {more}"
    more = by_hand(where, angle=free[-1] + 1 if free else 2)
    return f"there must be theta_rad or one like it; there are {_names(table)}: {more} takes one"


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
        path = where.removesuffix(f": {channel}")
        more = {"counts_per_turn": 2400} if spelling(unit) == "counts" else {"angle_scale": 1.2}
        what = "the counts of a turn" if spelling(unit) == "counts" else "the rad of one unit"
        raise InputError(
            f"{where}: {head!r} has no unit of an angle: {what} must be given, like"
            f" {by_hand(path, **more)}"
        )
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
    guessed, _ = _by_name(table, {k: v for k, v in places.items() if k != "angle"}, timed=False)
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


def guess(table: Table, places: dict[str, int], where: str, *, timed: bool) -> list[Finding]:
    """Assign missing channels by the words and units of headings, or by position without names."""
    if not any(table.names):
        return _by_position(table, places, where, timed=timed)
    guessed, rivals = _by_name(table, places, timed=timed)
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
    if not any(channel in places or channel in guessed for channel in ANGLE_CHANNELS):
        rivals = _others(table, places | guessed, timed=timed)
        guessed |= {"angle": _swinging(table, rivals)} if rivals else {}
    places.update(guessed)
    names = ", ".join(f"{channel} is {table.names[k]!r}" for channel, k in guessed.items())
    findings = [finding_of("columns-guessed", names=names)] if guessed else []
    return findings + (_rivalry(table, guessed["angle"], rivals, where) if "angle" in guessed else [])


def _by_name(
    table: Table, places: dict[str, int], *, timed: bool
) -> tuple[dict[str, int], list[int]]:
    """Return columns whose headings fit channels without; all that fit the angle equally well."""
    guessed: dict[str, int] = {}
    rivals: list[int] = []
    heads = [Heading.of(name) for name in table.names]
    for channel in CHANNELS:
        taken = {*places.values(), *guessed.values()}
        free = [k for k in range(len(heads)) if k not in taken and channel not in places]
        ranks = {k: rank for k in free if (rank := heads[k].rank(channel)) is not None}
        if channel == "time":
            weak = [k for k in free if ranks.get(k, UNNAMED) >= BY_UNIT]
            weak = [k for k in weak if k in ranks or (timed and _nameless(heads[k], "x"))]
            ranks |= dict.fromkeys(weak, UNNAMED)
            ranks = {k: r for k, r in ranks.items() if k not in weak or rises(table.values[:, k])}
        moving = [k for k in ranks if changes(table.values[:, k])] or [*ranks]
        best = [k for k in moving if ranks[k] == min(ranks[m] for m in moving)]
        if not best:
            continue
        columns = table.values[:, best]
        spread = np.std(np.where(np.isfinite(columns), columns, 0.0), axis=0)
        axes = channel in {"velocity", "acceleration"}
        guessed[channel] = best[int(np.argmax(spread)) if axes else 0]
        if channel == "angle":
            guessed[channel], rivals = _swinging(table, best, widest=True), best
    rate = heads[guessed["velocity"]].rank("velocity") if "velocity" in guessed else None
    if "angle" in guessed and rate is not None and rate < BY_UNIT:
        rank = heads[guessed["angle"]].rank("angle")
        if rank is not None and rank > BY_UNIT:  # volts, or a motor's angle, beside a gyroscope
            del guessed["angle"]
    return guessed, rivals


def _nameless(head: Heading, *letters: str) -> bool:
    """Return whether a heading says nothing, as "value 1" or some letters."""
    return head.unit is None and head.meaning in {"", "plain", "smooth", *letters}


def _others(table: Table, places: Mapping[str, int], *, timed: bool) -> list[int]:
    """Return the columns of which one may be the angle where no heading says so."""
    free = [k for k in range(table.values.shape[1]) if k not in places.values()]
    if not timed and len(free) == 1:
        return free
    # Beside a column "X" of times "Y" is no place.
    clock = table.names[places["time"]] if "time" in places else ""
    letters = "xy" if Heading.of(clock).meaning == "x" else ""
    free = [k for k in free if _nameless(Heading.of(table.names[k]), *letters)]
    free = [k for k in free if changes(table.values[:, k])]
    return free if len(free) == 1 or any(decays(table.values[:, k]) for k in free) else []


def _swinging(table: Table, columns: list[int], *, widest: bool = False) -> int:
    """Return the first column that decays, which a drive does not; of axes one that swings widely."""
    columns = [k for k in columns if decays(table.values[:, k])] or columns
    if not widest or len(columns) == 1:
        return columns[0]
    factors = [ANGLES.get(spelling(Heading.of(table.names[k]).unit or ""), 1.0) for k in columns]
    spreads = np.nanstd(table.values[:, columns], axis=0) * factors
    return columns[int(np.argmax(2 * spreads >= spreads.max()))]


def decays(values: Floats) -> bool:
    """Return whether the spread of a column falls by a tenth from its first to its last quarter."""
    first, *_, last = np.array_split(values[np.isfinite(values)], 4)
    return bool(last.size) and float(np.std(last)) < DECAYED * float(np.std(first))


def _rivalry(table: Table, place: int, rivals: list[int], where: str) -> list[Finding]:
    """Return the finding that other columns may be the angle, too."""
    others = [k for k in rivals if k != place]
    if not others:
        return []
    heads = listed([repr(head_of(table, k)) for k in others], MOST_UNUSED)
    more = by_hand(where, angle=others[0] + 1)
    return [finding_of("angle-chosen", head=head_of(table, place), others=heads, more=more)]


def rises(values: Floats) -> bool:
    """Return whether a column rises nearly always, and not by 1 each time as a counter does."""
    steps = np.diff(values)
    steps = steps[np.isfinite(steps)]
    return bool(np.sum(steps > 0) > RISING * steps.size and np.any(steps != 1))


def _by_position(
    table: Table, places: dict[str, int], where: str, *, timed: bool
) -> list[Finding]:
    """Assign time and angle, or time and places on a circle, in a table without headings."""
    free = [k for k in range(table.values.shape[1]) if k not in places.values()]
    guesses: list[str] = []
    rivals: list[int] = []
    if not timed:  # the rate is known: ignore columns that number the readings
        free = [k for k in free if np.any(np.diff(table.values[:, k]) != 1)]
    if "time" not in places and free:
        steps = np.diff(table.values[:, free], axis=0)
        up = np.sum(steps > 0, axis=0) > RISING * np.sum(np.isfinite(steps), axis=0)
        if up.any():
            clocks = [k for k in free if rises(table.values[:, k])] or [free[int(np.argmax(up))]]
            k = places["time"] = clocks[0]
            free.remove(k)
            guesses.append(f"column {k + 1} is the time in s")
    free = [k for k in free if changes(table.values[:, k])] or free
    if free and not any(channel in places for channel in ANGLE_CHANNELS):
        if len(free) > 1 and on_circle(*table.values[:, free[:2]].T):
            places |= {"pixel_x": free[0], "pixel_y": free[1]}
            guesses.append(f"columns {free[0] + 1} and {free[1] + 1} are places x and y on a circle")
        else:
            places["angle"], rivals = _swinging(table, free), free
            guesses.append(f"column {places['angle'] + 1} is the angle")
    finding = finding_of("columns-guessed.places", names=", ".join(guesses))
    findings = [finding] if guesses else []
    return findings + (_rivalry(table, places["angle"], rivals, where) if rivals else [])


def on_circle(x: Floats, y: Floats) -> bool:
    """Return whether places lie on an arc: ten times nearer to a circle than to a line."""
    good = np.isfinite(x) & np.isfinite(y)
    u, v = x[good] - np.mean(x[good]), y[good] - np.mean(y[good])
    line = float(np.linalg.svd(np.column_stack([u, v]), compute_uv=False)[-1])
    columns = np.column_stack([u, v, np.ones(u.size)])
    a, b, c = np.linalg.lstsq(columns, u**2 + v**2, rcond=None)[0].tolist()
    away = np.hypot(u - a / 2, v - b / 2) - math.sqrt(c + a * a / 4 + b * b / 4)
    turns = np.unwrap(np.arctan2(v - b / 2, u - a / 2))  # of a phase plane
    return float(np.linalg.norm(away)) < ON_ARC * line and float(np.ptp(turns)) < math.tau


def position_of(table: Table, places: Mapping[str, int]) -> int | None:
    """Return the column named position, unless it contradicts a velocity; else None."""
    from scipy.signal import detrend

    heads = {k: Heading.of(head) for k, head in enumerate(table.names) if k not in places.values()}
    fitting = [k for k, head in heads.items() if head.meaning == "position"]
    fitting = [k for k in fitting if heads[k].unit is None or heads[k].rank("angle") is not None]
    if len(fitting) != 1 or "velocity" not in places:
        return fitting[0] if len(fitting) == 1 else None
    both = table.values[:, [fitting[0], places["velocity"]]]
    both = both[np.isfinite(both).all(axis=1)]
    if both.shape[0] < 5:
        return None
    one, other = detrend(both[:, 0]), detrend(np.cumsum(both[:, 1]))
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return fitting[0] if size > 0 and float(one @ other) > POSITION_AGREES * size else None


def side_by_side(table: Table) -> list[Table]:
    """Return the tables of runs beside each other, whose columns begin with times each and agree."""
    heads = [Heading.of(name) for name in table.names]
    begins = [k for k, head in enumerate(heads) if head.meaning == "time"]
    blocks = [range(a, b) for a, b in itertools.pairwise([*begins, len(heads)])]
    kinds = {tuple((heads[k].meaning, heads[k].unit) for k in block) for block in blocks}
    if len(blocks) < 2 or begins[0] or len(kinds) > 1 or len(blocks[0]) < 2:
        return [table]
    if all(_copied(table.values[:, blocks[0][1]], table.values[:, b[1]]) for b in blocks[1:]):
        return [table]
    good = [np.isfinite(table.values[:, block[0]]) for block in blocks]
    return [
        dataclasses.replace(
            table,
            names=tuple(table.names[k] for k in block),
            values=table.values[rows][:, list(block)],
            rows=table.rows[rows],
            order=table.order[rows],
        )
        for block, rows in zip(blocks, good, strict=True)
    ]


def _copied(one: Floats, other: Floats) -> bool:
    """Return whether two columns have the same readings, up to a factor and a zero."""
    good = np.isfinite(one) & np.isfinite(other)
    size = np.std(one[good]) * np.std(other[good])
    covariance = np.mean((one[good] - np.mean(one[good])) * (other[good] - np.mean(other[good])))
    return bool(abs(covariance) >= COPIED * size)


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
    heading, words = Heading.of(head), plain(head)
    unit = spelling(heading.unit or "")
    if (heading.meaning in {"drive", "motor"} or unit in MOTOR_UNITS) and plan.kind == "free":
        return [finding_of("motor-column", head=head)]
    bare = "angle" not in channels and "peaks" not in channels
    if bare and (heading.meaning in {"angle", "position"} or unit in ANGLES):
        return [finding_of("angle-column", head=head)]
    if "pivot" in heading.meanings and plan.pivot is None:
        kind = next((u for pattern, u in PIVOT_KINDS if re.search(pattern, words)), "m")
        unit = unit if unit in PIVOT_UNITS else kind
        return [finding_of("pivot-column", head=head, unit=unit)]
    return []
