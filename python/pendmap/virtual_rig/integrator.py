"""The virtual rig's integrator: many runs in parallel, with exact dry friction.

Each iteration makes one step for every run, each with its own length. The signs of the velocity
and of the load on the bearing are held through a step, so that the equation is smooth there; a
step ends at a change of sign. A pendulum at rest sticks exactly while the sum of all other torques
is at most the dry friction. The first event of each step is a zero of the velocity, of a slip
margin or of the load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from pendmap.virtual_rig import path as gauss
from pendmap.virtual_rig.lanes import Lanes, solve
from pendmap.virtual_rig.path import Floats, value

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pendmap.virtual_rig.equation import Equation
    from pendmap.virtual_rig.lanes import Indices, Step
    from pendmap.virtual_rig.path import Path

_TINY: Final = 1e-4
"""First evaluation of a velocity that starts at zero, as a share of a sixteenth of a step."""
_ROUNDING: Final = 1e-12  # Velocity below which rounding dominates, rad/s

PLACES: Final[Floats] = np.arange(17) / 16
"""Places within a step where signs are evaluated, shape (17,)."""
_BASIS: Final = gauss.basis(PLACES, gauss.NODES + 2)


def integrate(equation: Equation, end: Floats, theta: Floats, velocity: Floats) -> list[Path]:
    """Integrate all runs from their initial states to their ends, s; return a path for each."""
    lanes = Lanes(equation, end, theta, velocity)
    live = np.flatnonzero(end > 0)
    while live.size:
        step = solve(lanes, live)
        lanes.wish[live] = step.wish
        if step.good.any():
            _commit(lanes, step)
        live = live[lanes.time[live] < end[live]]
    return lanes.paths


def _commit(lanes: Lanes, step: Step) -> None:
    """Apply the accepted steps, each up to its first event."""
    rows = np.flatnonzero(step.good)
    lane, length = step.lane[rows], step.length[rows]
    switches = first_switches(lanes, step, rows)
    for k, i in zip(rows.tolist(), lane.tolist(), strict=True):
        if step.length[k] > 0:
            begin, long = float(lanes.time[i]), float(step.length[k])
            lanes.paths[i].steps.append((begin, long, step.theta[k], step.velocity[k]))
    places = np.array([switches[k].place if k in switches else 1.0 for k in rows.tolist()])
    polynomials = gauss.basis(places, gauss.NODES + 2)
    ends = lanes.time[lane] + length >= lanes.stop[lane]
    lanes.theta[lane] = np.einsum("nk,nk->n", polynomials, step.theta[rows])
    lanes.velocity[lane] = np.einsum("nk,nk->n", polynomials[:, :-1], step.velocity[rows])
    lanes.own[lane] = np.einsum("nk,nkm->nm", polynomials[:, :-1], step.own[rows])
    lanes.time[lane] += places * length
    for k, i, end in zip(rows.tolist(), lane.tolist(), ends, strict=True):
        if k in switches:
            lanes.happen(i, switches[k].what)
        elif end:
            lanes.time[i] = lanes.stop[i]
            lanes.kick(i)


def may_turn(velocity: Floats, acceleration: Floats, length: Floats) -> NDArray[np.bool_]:
    """Return which lanes may come to rest within the step, shape (L,).

    Velocity and acceleration are those at the 17 places, times the lane's direction, shape (L, 17).
    """
    crosses = (velocity[:, 1:] <= 0).any(axis=1)
    reach = length / (PLACES.size - 1) * np.abs(acceleration).max(axis=1)
    low = velocity.min(axis=1, where=velocity > 0, initial=np.inf) < reach
    dips = ((acceleration[:, :-1] < 0) & (acceleration[:, 1:] > 0)).any(axis=1)
    return np.asarray(crosses | (low & dips))


def turn_of(
    velocity: list[float], acceleration: list[float], direction: float, seen: Floats
) -> float | None:
    """Return the first place after s = 0 at which a velocity becomes zero, or None.

    ``velocity`` and ``acceleration`` are Legendre coefficients over the step, ``seen`` is
    ``direction * velocity`` at the 17 places.
    """

    def forward(s: float) -> float:
        return direction * value(velocity, s)

    def slope(s: float) -> float:
        return direction * value(acceleration, s)

    for k in range(1, PLACES.size):
        low, high = float(PLACES[k - 1]), float(PLACES[k])
        if k == 1 and seen[0] <= 0:
            low = _TINY * high
            if forward(low) <= 0:
                # The slip took no time, or rounding hides it: time must advance.
                return low if abs(seen[1]) > _ROUNDING else high
        if seen[k] <= 0:
            return root(forward, low, high)
        if slope(low) < 0 < slope(high):
            # A minimum between two places: it lies at the zero of the acceleration.
            least = root(slope, low, high)
            if forward(least) <= 0:
                return root(forward, low, least)
    return None


def root(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the zero of a function in an interval, or the end of smaller value if signs agree."""
    at_low, at_high = function(low), function(high)
    if at_low * at_high >= 0:
        return low if abs(at_low) < abs(at_high) else high
    return float(brentq(function, low, high, xtol=1e-15, rtol=1e-15, maxiter=200))


def stop_of(margin: Callable[[float], float], seen: Floats) -> float | None:
    """Return the first place at which a margin, ``seen`` at PLACES, becomes negative, or None."""
    for k in range(1, PLACES.size):
        low, high = PLACES[k - 1], PLACES[k]
        if seen[k] < 0:
            # A margin of 0 at the start of a stick is exhausted at once, but time must advance.
            return root(margin, low, high) if seen[k - 1] > 0 else low + _TINY * (high - low)
        if 1 < k < PLACES.size - 1 and _dips(seen[k - 1 : k + 2]):
            ends = (PLACES[k - 1], PLACES[k + 1])
            minimum = minimize_scalar(
                margin, bounds=ends, method="bounded", options={"xatol": 1e-9}
            )
            if minimum.fun < 0:
                return root(margin, low, float(minimum.x))
    return None


def _dips(three: Floats) -> bool:
    """Return whether the parabola through three neighbours may become negative between them."""
    before, here, after = (float(x) for x in three)
    bend = before - 2 * here + after
    if not (here <= before and here <= after and bend > 0):
        return False
    return here <= 2 * (after - before) ** 2 / (8 * bend) + bend / 4


class Switch(NamedTuple):
    """Place of an event within a step, from 0 to 1, and its kind as in :meth:`Lanes.happen`."""

    place: float
    what: str


def first_switches(lanes: Lanes, step: Step, rows: Indices) -> dict[int, Switch]:
    """Return the first event of each of the ``rows`` of a step that has one."""
    switches: dict[int, Switch] = {}
    slides = lanes.direction[step.lane[rows]] != 0
    if slides.any():
        _turns(lanes, step, rows[slides], switches)
    for k in rows[~slides].tolist():
        _releases(lanes, step, k, switches)
    if lanes.equation.watches_load:
        _unloads(lanes, step, rows, switches)
    return switches


def _keep(switches: dict[int, Switch], k: int, place: float | None, what: str) -> None:
    if place is not None and (k not in switches or place < switches[k].place):
        switches[k] = Switch(place, what)


def _turns(lanes: Lanes, step: Step, rows: Indices, switches: dict[int, Switch]) -> None:
    """Add the velocity zeros of sliding lanes."""
    direction = lanes.direction[step.lane[rows]]
    sign = direction[:, np.newaxis]
    velocity = sign * (step.velocity[rows] @ _BASIS[:, :-1].T)
    # Set exactly, so that rounding does not give a start from rest a sign.
    velocity[:, 0] = np.abs(lanes.velocity[step.lane[rows]])
    acceleration = sign * (step.acceleration[rows] @ _BASIS[:, :-2].T)
    for n in np.flatnonzero(may_turn(velocity, acceleration, step.length[rows])).tolist():
        k = int(rows[n])
        polynomials = step.velocity[k].tolist(), step.acceleration[k].tolist()
        _keep(switches, k, turn_of(*polynomials, float(direction[n]), velocity[n]), "rest")


def _releases(lanes: Lanes, step: Step, k: int, switches: dict[int, Switch]) -> None:
    """Add the place and direction at which a sticking lane slips."""
    lane = int(step.lane[k])

    def margins(places: Floats) -> tuple[Floats, Floats]:
        states = gauss.basis(places, gauss.NODES + 1) @ step.own[k]
        return lanes.margins(lane, places * step.length[k], states)

    up, down = margins(PLACES)
    _keep(switches, k, stop_of(lambda s: float(margins(np.array([s]))[0][0]), up), "up")
    _keep(switches, k, stop_of(lambda s: float(margins(np.array([s]))[1][0]), down), "down")


def _unloads(lanes: Lanes, step: Step, rows: Indices, switches: dict[int, Switch]) -> None:
    """Add the places at which the load on the bearing changes sign."""

    def load(rows: Indices, places: Floats) -> Floats:
        lane = step.lane[rows]
        basis = gauss.basis(places, gauss.NODES + 2)
        time = lanes.time[lane, np.newaxis] + places * step.length[rows, np.newaxis]
        theta, velocity = step.theta[rows] @ basis.T, step.velocity[rows] @ basis[:, :-1].T
        return lanes.side[lane, np.newaxis] * lanes.motion(lane, time, theta, velocity).load

    seen = load(rows, PLACES)
    # Its fall between two places is taken as at most the largest change between neighbours.
    near = seen.min(axis=1) < np.abs(np.diff(seen, axis=1)).max(axis=1)
    for n in np.flatnonzero(near).tolist():
        row = rows[n : n + 1]

        def here(s: float, row: Indices = row) -> float:
            return float(load(row, np.array([s]))[0, 0])

        _keep(switches, int(row[0]), stop_of(here, seen[n]), "unload")
