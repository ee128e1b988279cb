"""Encoders that write a line at each edge, not at equal times.

Such a log has no readings between two edges, so none is missing where it is sparse: at a turning
point. At an edge the angle is known but for the encoder's own lines; what errs is the stamp. A
counter shows the count that begins there, which is half a count beyond the edge on either way:

    theta_k = (n_k - sign(n_k - n_(k-1)) / 2) * step
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted
from pendmap.records.resolution import step_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]

ALL: Final = 0.95
"""Share of the lines that are one count from the line before: of equal times only a few are."""

FEWEST: Final = 50


def logs_edges(theta: Floats) -> bool:
    """Whether nearly every reading is one count from the one before it."""
    good = theta[np.isfinite(theta)]
    step = step_of(good) if good.size >= FEWEST else 0.0
    if not step:
        return False
    return bool(np.mean(np.abs(np.abs(np.diff(good)) / step - 1) < 0.25) > ALL)


def spread(time: Floats) -> Floats:
    """Return times of which those that share a stamp fill its tick evenly, s, shape (N,)."""
    stamps, first, number = np.unique(time, return_index=True, return_counts=True)
    tick = float(np.min(np.diff(stamps))) if stamps.size > 1 else 0.0
    place = np.arange(time.size) - np.repeat(first, number)
    share = (place + 0.5) / np.repeat(number, number) - 0.5
    return np.asarray(time + share * tick)


def check(work: Work) -> None:
    """Put the readings of a log of edges on the edges."""
    if work.plan.pivot is not None or not logs_edges(work.theta):
        return
    step = step_of(work.theta)
    way = np.sign(np.round(np.diff(work.theta) / step))
    work.edges, work.seen = True, step
    # Where the edge itself is written a turn shows it twice.
    if np.count_nonzero(way == 0) <= np.count_nonzero(way[1:] * way[:-1] < 0):
        work.theta[1:] -= 0.5 * step * way
        work.theta[0] -= 0.5 * step * way[0]
        work.trusted[0] = False  # it may be what stood there as the log began


def say(work: Work) -> None:
    """Say that the readings are edges, once their unit is certain."""
    if work.edges:
        text = (
            f"an encoder of {2 * math.pi / work.seen:.5g} counts a turn writes a line at each edge:"
            f" the angles are those of {counted(work.theta.size, 'edge')}, their errors those of"
            " the stamps; none is missing between two of them"
        )
        work.say("edges-logged", text, mended=True)
