"""The first event within each step of many lanes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from pendmap.virtual_rig import collocation as gauss
from pendmap.virtual_rig.events import PLACES, may_turn, stop_of, turn_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.virtual_rig.lanes import Lanes
    from pendmap.virtual_rig.step import Step

    Floats = NDArray[np.float64]
    Indices = NDArray[np.intp]

__all__ = ["Switch", "first_switches"]

_BASIS: Final = gauss.basis(PLACES, gauss.NODES + 2)


class Switch(NamedTuple):
    """Where in a step, as a share of it, and what happens: a word of :meth:`Lanes.happen`."""

    place: float
    what: str


def first_switches(lanes: Lanes, step: Step, rows: Indices) -> dict[int, Switch]:
    """Return the first event of each of the ``rows`` of a step that has one."""
    found: dict[int, Switch] = {}
    slides = lanes.direction[step.lane[rows]] != 0
    if slides.any():
        _turns(lanes, step, rows[slides], found)
    for k in rows[~slides].tolist():
        _releases(lanes, step, k, found)
    if lanes.equation.watches_load:
        _unloads(lanes, step, rows, found)
    return found


def _keep(found: dict[int, Switch], k: int, place: float | None, what: str) -> None:
    if place is not None and (k not in found or place < found[k].place):
        found[k] = Switch(place, what)


def _turns(lanes: Lanes, step: Step, rows: Indices, found: dict[int, Switch]) -> None:
    """Velocity zeros of lanes that slide."""
    direction = lanes.direction[step.lane[rows]]
    sign = direction[:, np.newaxis]
    velocity = sign * (step.velocity[rows] @ _BASIS[:, :-1].T)
    # Exactly, so that rounding does not take a start from rest for one above or below it.
    velocity[:, 0] = np.abs(lanes.velocity[step.lane[rows]])
    acceleration = sign * (step.acceleration[rows] @ _BASIS[:, :-2].T)
    for n in np.flatnonzero(may_turn(velocity, acceleration, step.length[rows])).tolist():
        k = int(rows[n])
        polynomials = step.velocity[k].tolist(), step.acceleration[k].tolist()
        _keep(found, k, turn_of(*polynomials, float(direction[n]), velocity[n]), "rest")


def _releases(lanes: Lanes, step: Step, k: int, found: dict[int, Switch]) -> None:
    """Where a lane that sticks slips, and which way."""
    lane = int(step.lane[k])

    def margins(places: Floats) -> tuple[Floats, Floats]:
        own = gauss.basis(places, gauss.NODES + 1) @ step.own[k]
        return lanes.margins(lane, places * step.length[k], own)

    up, down = margins(PLACES)
    _keep(found, k, stop_of(lambda s: float(margins(np.array([s]))[0][0]), up), "up")
    _keep(found, k, stop_of(lambda s: float(margins(np.array([s]))[1][0]), down), "down")


def _unloads(lanes: Lanes, step: Step, rows: Indices, found: dict[int, Switch]) -> None:
    """Where the load on the bearing changes sign."""

    def load(rows: Indices, places: Floats) -> Floats:
        lane = step.lane[rows]
        basis = gauss.basis(places, gauss.NODES + 2)
        time = lanes.time[lane, np.newaxis] + places * step.length[rows, np.newaxis]
        theta, velocity = step.theta[rows] @ basis.T, step.velocity[rows] @ basis[:, :-1].T
        return lanes.side[lane, np.newaxis] * lanes.motion(lane, time, theta, velocity).load

    seen = load(rows, PLACES)
    # Between two places it does not fall by more than it changes from one to the next somewhere.
    near = seen.min(axis=1) < np.abs(np.diff(seen, axis=1)).max(axis=1)
    for n in np.flatnonzero(near).tolist():
        row = rows[n : n + 1]

        def here(s: float, row: Indices = row) -> float:
            return float(load(row, np.array([s]))[0, 0])

        _keep(found, int(row[0]), stop_of(here, seen[n]), "unload")
