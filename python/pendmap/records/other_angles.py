"""Columns that tell the angle where the one that is named for it does not."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.units import CHANNELS, name_and_unit, plain

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from pendmap.records.text import Table

POSITION: Final = "pos(ition)?"

AGREE: Final = 0.9
"""Correlation of a position with the integral of the velocity, each less its line, from which they
are of one motion."""


def position_of(table: Table, places: Mapping[str, int]) -> int | None:
    """Return the column called a position that is the angle; none where nothing tells it.

    A velocity beside it must be its slope: a cart has a position, too.
    """
    split = [name_and_unit(head) for head in table.names]
    found = [
        k
        for k, (name, unit) in enumerate(split)
        if k not in places.values()
        and re.fullmatch(POSITION, plain(name))
        and (unit is None or CHANNELS["angle"].has(unit))
    ]
    if len(found) != 1:
        return None
    if "velocity" not in places:
        return found[0]
    both = table.values[:, [found[0], places["velocity"]]]
    both = both[np.isfinite(both).all(axis=1)]
    if both.shape[0] < 5:
        return None
    one, other = _bent(both[:, 0]), _bent(np.cumsum(both[:, 1]))
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return found[0] if size > 0 and float(one @ other) > AGREE * size else None


def _bent(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values less their line."""
    place = np.arange(values.size)
    return np.asarray(values - np.polyval(np.polyfit(place, values, 1), place))
