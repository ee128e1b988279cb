"""Columns that are taken for channels, by the words and units of headings or by their values."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.tables.findings import finding_of
from pendmap.tables.units import CHANNELS, Heading, spelling

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pendmap.records.description import Column
    from pendmap.signal import Floats
    from pendmap.tables.findings import Finding
    from pendmap.tables.text import Table

# Channels from which an angle can be computed
ANGLE_CHANNELS: Final = ("angle", "velocity", "pixel_x", "pixel_y", "acceleration", "peaks")
POSITION_AGREES: Final = 0.9  # Least correlation of a position with the integrated velocity
RISING: Final = 0.9  # Least share of rising steps of a clock
DECAYED: Final = 0.9  # Greatest spread of a decayed last quarter, over that of the first
ON_ARC: Final = 0.7  # Greatest distance from a circle, over that from a line, of places on an arc
COPIED: Final = 0.9999  # Least correlation of the readings of a copy in another unit
BY_UNIT: Final = 4  # Rank of a heading that fits by its unit alone
UNNAMED: Final = 9  # Rank of a heading that says nothing


def use_pixels(table: Table, places: dict[str, int], asked: Mapping[str, Column]) -> list[Finding]:
    """Assign the pixel coordinates of a table whose angle column is constant."""
    guessed = _by_name(table, {k: v for k, v in places.items() if k != "angle"}, timed=False)
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
    """Assign missing channels by the words and units of headings, or by position without names."""
    if not any(table.names):
        return _by_position(table, places, timed=timed)
    guessed = _by_name(table, places, timed=timed)
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
        others = _others(table, places | guessed, timed=timed)
        guessed |= {"angle": _decaying(table, others)[0]} if others else {}
    places.update(guessed)
    names = ", ".join(f"{channel} is {table.names[k]!r}" for channel, k in guessed.items())
    return [finding_of("columns-guessed", names=names)] if guessed else []


def _by_name(table: Table, places: dict[str, int], *, timed: bool) -> dict[str, int]:
    """Return columns whose headings fit channels without one."""
    guessed: dict[str, int] = {}
    for channel in CHANNELS:
        taken = {*places.values(), *guessed.values()}
        heads = {k: Heading.of(name) for k, name in enumerate(table.names) if k not in taken}
        best = [] if channel in places else _fitting(table, channel, heads, timed=timed)
        if len(best) > 1 and channel in {"angle", "velocity", "acceleration"}:  # of axes the widest
            best = _decaying(table, best)
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


def _nameless(head: Heading, *letters: str) -> bool:
    """Return whether a heading says nothing, as "value 1" or some letters."""
    return head.unit is None and head.meaning in {"", "plain", "smooth", *letters}


def _others(table: Table, places: Mapping[str, int], *, timed: bool) -> list[int]:
    """Return the columns of which one may be the angle where no heading says so."""
    free = [k for k in range(table.values.shape[1]) if k not in places.values()]
    if not timed and len(free) == 1:
        return free
    # Beside a column "X" of times "Y" is no place.
    clock = Heading.of(table.names[places["time"]]).meaning if "time" in places else ""
    letters = "xy" if clock == "x" else ""
    free = [k for k in free if _nameless(Heading.of(table.names[k]), *letters)]
    free = [k for k in free if changes(table.values[:, k])]
    return free if len(free) == 1 or any(decays(table.values[:, k]) for k in free) else []


def decays(values: Floats) -> bool:
    """Return whether the spread of a column falls by a tenth from its first to its last quarter."""
    first, *_, last = np.array_split(values[np.isfinite(values)], 4)
    return bool(last.size) and float(np.std(last)) < DECAYED * float(np.std(first))


def _decaying(table: Table, columns: list[int]) -> list[int]:
    """Return the columns that decay, which a drive does not; all if none does."""
    return [k for k in columns if decays(table.values[:, k])] or columns


def rises(values: Floats, *, counters: bool = False) -> bool:
    """Return whether a column rises nearly always, and not by 1 each time as a counter does."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(np.sum(steps > 0) > RISING * steps.size and (counters or np.any(steps != 1)))


def _by_position(table: Table, places: dict[str, int], *, timed: bool) -> list[Finding]:
    """Assign time and angle, or time and places on a circle, in a table without headings."""
    free = [k for k in range(table.values.shape[1]) if k not in places.values()]
    guesses = []
    if not timed:  # the rate is known: ignore columns that number the readings
        free = [k for k in free if np.any(np.diff(table.values[:, k]) != 1)]
    rising = [k for k in free if rises(table.values[:, k], counters=True)]
    if "time" not in places and rising:
        k = places["time"] = next((k for k in rising if rises(table.values[:, k])), rising[0])
        free.remove(k)
        guesses.append(f"column {k + 1} is the time in s")
    free = [k for k in free if changes(table.values[:, k])] or free
    if free and not any(channel in places for channel in ANGLE_CHANNELS):
        if len(free) > 1 and on_circle(*table.values[:, free[:2]].T):
            places |= {"pixel_x": free[0], "pixel_y": free[1]}
            guesses.append(f"columns {free[0] + 1} and {free[1] + 1} are x and y on a circle")
        else:
            places["angle"] = _decaying(table, free)[0]
            guesses.append(f"column {places['angle'] + 1} is the angle")
    return [finding_of("columns-guessed.places", names=", ".join(guesses))] if guesses else []


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
    one, other = detrend(both[:, 0]), detrend(np.cumsum(both[:, 1]))
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return fitting[0] if size > 0 and float(one @ other) > POSITION_AGREES * size else None


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
    # The same readings in another unit are no further run.
    if all(abs(np.corrcoef(a[rows], b[rows])[0, 1]) > COPIED for a, b, rows in together):
        return [table]
    taken = ("rows", "order")
    return [
        dataclasses.replace(
            table,
            names=tuple(table.names[k] for k in block),
            values=table.values[rows][:, block],
            texts={},
            **{name: getattr(table, name)[rows] for name in taken},
        )
        for block, rows in zip(blocks, good, strict=True)
    ]


def head_of(table: Table, place: int) -> str:
    """Return the heading of a column."""
    return table.names[place] or f"column {place + 1}"


def changes(values: Floats) -> bool:
    """Return whether a column has at least two different values."""
    seen = values[np.isfinite(values)]
    return bool(seen.size) and float(np.ptp(seen)) > 0
