"""Columns that no channel is read from: their names, and what they may mean for the run."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.experiment import Finding
from pendmap.records.units import name_and_unit, plain, spelling

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import NDArray

    from pendmap.records.description import RunPlan
    from pendmap.records.text import Table

MOTOR: Final = re.compile(
    r"\b(torques?|drehmoment|couple|tau|currents?|strom|motors?|pwm|duty|effort|actuator|u)\b"
)
MOTOR_UNITS: Final = ("nm", "mnm", "a", "ma")

PIVOT: Final = re.compile(
    r"\b(pivot|cart|carriage|trolley|slider?|shaker|stage|base|platform|support|suspension|wagen)\b"
)
PIVOT_UNITS: Final = {"m": "m", "mm": "mm", "cm": "cm", "m/s": "m/s", "m/s2": "m/s2", "g": "g"}
PIVOT_KINDS: Final = ((r"\bacc", "m/s2"), (r"\b(vel|speed)", "m/s"), (r"\b(pos|place|x)", "m"))
"""What a name without a unit says that the pivot's column is."""

ANGLE: Final = re.compile(r"pos(ition)?|.*(angle|winkel|theta|encoder).*")

MOST: Final = 12
"""Names that a line lists."""


def head_of(table: Table, place: int) -> str:
    """Return what a column is called."""
    return table.names[place] or f"column {place + 1}"


def changes(values: NDArray[np.float64]) -> bool:
    """Whether a column has numbers, and not one alone."""
    seen = values[np.isfinite(values)]
    return bool(seen.size) and float(np.ptp(seen)) > 0


def ask(
    table: Table, used: Collection[int], channels: Collection[str], plan: RunPlan
) -> tuple[tuple[str, ...], list[Finding]]:
    """Return the names of columns that are not used, and what is to be asked about them.

    Parameters
    ----------
    table : Table
        All columns.
    used : collection of int
        Places of those that a channel or the pivot is read from.
    channels : collection of str
        The channels that there are.
    plan : RunPlan
        What is known of the run: a pivot that is named is asked for no more.
    """
    rest = [k for k in range(table.values.shape[1]) if k not in used]
    rest = [k for k in rest if table.names[k] or np.isfinite(table.values[:, k]).any()]
    names = tuple(head_of(table, k) for k in rest)
    if not rest:
        return (), []
    more = f", ... ({len(names)} in all)" if len(names) > MOST else ""
    findings = [Finding("columns-unused", f"not used: {', '.join(map(repr, names[:MOST]))}{more}")]
    for k in rest:
        if changes(table.values[:, k]):
            findings += _asked(head_of(table, k), channels, plan)
    seen = {found.what: found for found in reversed(findings)}  # the first of each kind is enough
    return names, list(reversed(seen.values()))


def _asked(head: str, channels: Collection[str], plan: RunPlan) -> list[Finding]:
    name, unit = name_and_unit(head)
    name, unit = plain(name), spelling(unit or "")
    said = plain(head)
    if (MOTOR.search(name) or unit in MOTOR_UNITS) and plan.kind == "free":
        text = f"{head!r} looks like a motor's: a driven record is no free decay"
        return [Finding("motor-column", text)]
    bare = "angle" not in channels and "peaks" not in channels
    if bare and (ANGLE.fullmatch(name) or unit in {"rad", "deg", "°"}):
        text = f"{head!r} may be the angle itself: angle = {{ name = {head!r} }} in [columns]"
        return [Finding("angle-column", f"{text} of experiment.toml takes it")]
    if PIVOT.search(said) and plan.pivot is None:
        kind = next((u for pattern, u in PIVOT_KINDS if re.search(pattern, said)), "m")
        unit = PIVOT_UNITS.get(unit, kind)
        text = (
            f'{head!r} may be the pivot\'s: pivot = {{ horizontal = "{head}", unit = "{unit}" }}'
            " (or vertical) in [[run]] of experiment.toml takes it"
        )
        return [Finding("pivot-column", text)]
    return []
