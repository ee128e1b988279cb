"""Columns that are taken for channels, by the words and units of headings or by their values."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.tables.findings import finding_of
from pendmap.tables.units import CHANNELS, LENGTHS, Heading, spelling

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pendmap.signal import Floats
    from pendmap.tables.findings import Finding
    from pendmap.tables.text import Table

# Channels from which an angle can be computed
ANGLE_CHANNELS: Final = ("angle", "velocity", "pixel_x", "pixel_y", "peaks")
POSITION_AGREES: Final = 0.9  # Least correlation of a position with the integrated velocity
RISING: Final = 0.9  # Least share of rising steps of a clock
DECAYED: Final = 0.9  # Greatest spread of a decayed last quarter, over that of the first
LEAST_CROSSINGS: Final = 3  # Fewest crossings of the middle of what swings
MOST_CROSSED: Final = 1 / 3  # Share of the steps of noise, half of which cross, that do in a swing
LEAST_FILLED: Final = 0.1  # Least share of the rows in which a column of readings has a number
ON_ARC: Final = 0.7  # Greatest distance from a circle, over that from a line, of places on an arc
COPIED: Final = 0.9999  # Least correlation of the readings of a copy in another unit
BY_UNIT: Final = 4  # Rank of a heading that fits by its unit alone
_AXES: Final = {"x", "y", "z"}
UNNAMED: Final = 9  # Rank of a heading that says nothing


def guess(table: Table, places: dict[str, int], *, timed: bool) -> list[Finding]:
    """Assign missing channels by the words and units of headings, or without names by values."""
    by = _by_name if any(table.names) else likely
    guessed = by(table, places, timed=timed)
    axes = axes_of(table)
    guessed = {c: k for c, k in guessed.items() if k not in axes}
    if axes and table.names[axes[0]].strip().lower() not in _AXES:  # of a place, not of a sensor
        plane = zip(("pixel_x", "pixel_y"), axes[:2], strict=True)
        guessed |= {channel: k for channel, k in plane if channel not in places}
    if "time" in places and any(channel in places for channel in ANGLE_CHANNELS):
        guessed = {c: k for c, k in guessed.items() if c in {"velocity", "trigger"}}
    # An angle given with pixel coordinates was computed from them.
    both = guessed | places
    pair = "pixel_x" in both and "pixel_y" in both
    moves = "angle" in both and changes(table.values[:, both["angle"]])
    if "pixel_x" in places or (pair and not moves):
        guessed.pop("angle", None)
    elif "angle" in both or not pair:
        guessed = {c: k for c, k in guessed.items() if not c.startswith("pixel")}
    if not {"angle", "pixel_x", "peaks"} & {*places, *guessed}:
        position = position_of(table, places | guessed)
        guessed |= {} if position is None else {"angle": position}
    if not any(channel in places or channel in guessed for channel in ANGLE_CHANNELS):
        guessed |= _nameless_angle(table, places | guessed)
    places.update(guessed)
    names = ", ".join(f"{channel} is {head_of(table, k)!r}" for channel, k in guessed.items())
    return [finding_of("columns-guessed", names=names)] if guessed else []


def _by_name(table: Table, places: dict[str, int], *, timed: bool) -> dict[str, int]:
    """Return columns whose headings fit channels without one."""
    guessed: dict[str, int] = {}
    for channel in CHANNELS:
        taken = {*places.values(), *guessed.values()}
        heads = {k: Heading.of(name) for k, name in enumerate(table.names) if k not in taken}
        best = [] if channel in places else _fitting(table, channel, heads, timed=timed)
        if len(best) > 1 and channel in {"angle", "velocity", "acceleration"}:  # of axes the widest
            best = [k for k in best if decays(table.values[:, k])] or best  # a drive does not
            factors = [CHANNELS[channel].units.get(spelling(heads[k].unit or ""), 1) for k in best]
            columns = table.values[:, best] * factors
            spread = np.std(np.where(np.isfinite(columns), columns, 0.0), axis=0)
            best = [best[int(np.argmax(spread))]]
        guessed |= {channel: best[0]} if best else {}
    return guessed


def _fitting(table: Table, channel: str, heads: Mapping[int, Heading], *, timed: bool) -> list[int]:
    """Return the columns whose headings fit a channel best; without one of times what rises."""
    ranks = {k: rank for k, head in heads.items() if (rank := head.rank(channel)) is not None}
    by_word = any(rank < BY_UNIT for rank in ranks.values())
    if channel == "time" and not by_word:
        unnamed = [k for k, head in heads.items() if timed and _nameless(head, "x")]
        ranks = dict.fromkeys(unnamed, UNNAMED) | ranks
        ranks = {k: rank for k, rank in ranks.items() if rises(table.values[:, k])}
    # Volts or the angle of a motor beside a gyroscope are not the angle.
    if channel == "angle" and BY_UNIT not in ranks.values() and not by_word:
        ranks = {} if any(head.rank("velocity") in {0, 1} for head in heads.values()) else ranks
    moving = [k for k in ranks if changes(table.values[:, k])] or [*ranks]
    return [k for k in moving if ranks[k] == min(ranks[m] for m in moving)]


def _nameless(head: Heading, letters: str) -> bool:
    """Return whether a heading says nothing, as "value 1" or some letters."""
    return head.unit is None and head.meaning in {"", "plain", "smooth", *letters}


def axes_of(table: Table) -> list[int]:
    """Return the columns x, y, z of a sensor or a place: the widest, then that on its arc."""
    columns, names = table.values.T, [name.strip().lower() for name in table.names]
    for k in range(len(names) - 2):
        heads = [Heading.of(name) for name in names[k : k + 3]]
        place = heads[0].unit in LENGTHS or {"pendulum", "position"} & {*heads[0].meanings}
        if {head.name[-1:] for head in heads} == _AXES and (place or names[k] in _AXES):
            first, *rest = sorted((k, k + 1, k + 2), key=lambda k: -np.nanstd(columns[k]))
            return [first, *sorted(rest, key=lambda k: not on_circle(columns[first], columns[k]))]
    return []


def _nameless_angle(table: Table, places: Mapping[str, int]) -> dict[str, int]:
    """Return the column that may be the angle where no heading says so: one alone, or a decay."""
    # Beside a column "X" of times "Y" is no place.
    clock = Heading.of(table.names[places["time"]]).meaning if "time" in places else ""
    taken = {*places.values(), *axes_of(table)}
    free = [k for k in range(len(table.names)) if k not in taken]
    free = [k for k in free if _nameless(Heading.of(table.names[k]), "xy" if clock == "x" else "")]
    best = _swinging(table, free)
    alone = len(best) == 1 or (best and decays(table.values[:, best[0]]))
    return {"angle": best[0]} if alone else {}


def decays(values: Floats) -> bool:
    """Return whether the spread of a column falls by a tenth from its first to its last quarter."""
    first, *_, last = np.array_split(values[np.isfinite(values)], 4)
    return bool(last.size) and float(np.std(last)) < DECAYED * float(np.std(first))


def rises(values: Floats) -> bool:
    """Return whether a column rises nearly always, and not by 1 each time as a counter does."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(np.sum(steps > 0) > RISING * steps.size and np.any(steps != 1))


def in_order(values: Floats) -> bool:
    """Return whether numbers never fall, and rise."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(np.any(steps > 0) and np.all(steps >= 0))


def likely(table: Table, places: Mapping[str, int], *, timed: bool) -> dict[str, int]:
    """Return by their values the columns of missing times, what is in order, and angles.

    What counts the readings is no time. The angle swings smoothly from side to side; of several the
    first that decays is taken.
    """
    columns, taken = table.values.T, dict[str, int]()
    free = [k for k in range(len(table.names)) if k not in places.values()]
    free = [k for k in free if np.isfinite(columns[k]).mean() > LEAST_FILLED]
    ordered = [k for k in free if in_order(columns[k]) or rises(columns[k])]
    clocks = [k for k in ordered if np.any(np.diff(columns[k]) != 1)]
    if timed and "time" not in places and clocks:
        taken["time"] = next((k for k in clocks if rises(columns[k])), clocks[0])
    moving = [k for k in free if k not in ordered and changes(columns[k])]
    swinging = _swinging(table, moving)
    if swinging and not any(channel in places for channel in ANGLE_CHANNELS):
        x = min(swinging)
        y = next((k for k in moving if k != x and on_circle(columns[x], columns[k])), None)
        taken |= {"angle": swinging[0]} if y is None else {"pixel_x": x, "pixel_y": y}
    return taken


def _swinging(table: Table, columns: Sequence[int]) -> list[int]:
    """Return the columns that swing, or one that changes alone; those that decay first."""
    moving = [k for k in columns if changes(table.values[:, k])]
    if len(moving) > 1:
        moving = [k for k in moving if swings(table.values[:, k])]
    return sorted(moving, key=lambda k: not decays(table.values[:, k]))


def swings(values: Floats) -> bool:
    """Return whether a column goes from side to side of its middle, less often than noise does."""
    away = values[np.isfinite(values)] - np.nanmedian(values)
    wide = away[np.abs(away) > np.quantile(np.abs(away), 0.98) / 4]
    crossings = np.count_nonzero(np.diff(wide > 0))
    return bool(LEAST_CROSSINGS <= crossings < MOST_CROSSED * wide.size)


def on_circle(x: Floats, y: Floats) -> bool:
    """Return whether places swing on an arc, nearer to a circle than to a line."""
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
    both[:, 1] = np.cumsum(both[:, 1])
    one, other = detrend(both, axis=0).T
    alike = one @ other > POSITION_AGREES * np.linalg.norm(one) * np.linalg.norm(other)
    return fitting[0] if alike else None


def side_by_side(table: Table) -> list[Table]:
    """Return the tables of runs beside each other, whose columns agree and begin with times."""
    heads = [Heading.of(name) for name in table.names]
    begins = [k for k, head in enumerate(heads) if head.meaning == "time"]
    blocks = [list(range(a, b)) for a, b in itertools.pairwise([*begins, len(heads)])]
    kinds = {tuple((heads[k].meaning, heads[k].unit) for k in block) for block in blocks}
    if len(blocks) < 2 or begins[0] or len(kinds) > 1 or len(blocks[0]) < 2:
        return [table]
    good = [np.isfinite(table.values[:, block[:2]]).all(axis=1) for block in blocks]
    angles = [(table.values[:, block[1]], rows) for block, rows in zip(blocks, good, strict=True)]
    together = [(angles[0][0], angle, good[0] & rows) for angle, rows in angles[1:]]
    # A block that repeats the first one in another unit is a copy, not a run.
    if all(abs(np.corrcoef(a[rows], b[rows])[0, 1]) > COPIED for a, b, rows in together):
        return [table]
    taken, names = ("rows", "order"), table.names
    return [
        dataclasses.replace(
            table,
            names=tuple(
                names[k] if names.count(names[k]) == 1 else f"{names[k]} #{number}" for k in block
            ),
            values=table.values[rows][:, block],
            texts={},
            **{name: getattr(table, name)[rows] for name in taken},
        )
        for number, (block, rows) in enumerate(zip(blocks, good, strict=True), 1)
    ]


def head_of(table: Table, place: int) -> str:
    """Return the heading of a column; its number, if it has none or shares it."""
    name = table.names[place]
    return name if name and table.names.count(name) == 1 else f"column {place + 1}"


def changes(values: Floats) -> bool:
    """Return whether a column has different values, which do not just number the readings."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(np.any(steps != 0) and np.any(steps != 1))
