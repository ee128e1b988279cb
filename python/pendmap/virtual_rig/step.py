"""One step of many lanes: Gauss collocation, solved by Picard's iteration."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.virtual_rig import path as gauss

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.virtual_rig.lanes import Indices, Lanes
    from pendmap.virtual_rig.path import Floats

TOLERANCE: Final = 1e-11
"""Largest last coefficients of a velocity's polynomial, rad/s."""

_FIXED: Final = 3e-13
"""Change of the velocity at which the iteration ends, rad/s."""
_ITERATIONS: Final = 25
_SHORTEST: Final = 1e-9
"""A step that is taken whatever its error, s; corners of the equation end there."""
_SMALLEST: Final = 1e-300


@dataclasses.dataclass(frozen=True)
class Step:
    """A step of L lanes; polynomials are Legendre coefficients over it."""

    lane: Indices  # shape (L,)
    length: Floats  # s, shape (L,)
    acceleration: Floats  # shape (L, NODES)
    velocity: Floats  # shape (L, NODES + 1)
    theta: Floats  # shape (L, NODES + 2)
    own: Floats  # the effects' own variables, shape (L, NODES + 1, M)
    good: NDArray[np.bool_]  # whether the step is accurate enough, shape (L,)
    wish: Floats  # length of the next step, s, shape (L,)


def solve(lanes: Lanes, lane: Indices) -> Step:
    """Solve one step of some lanes; the last two coefficients of a polynomial are its error."""
    wished = lanes.wish[lane]
    length = np.minimum(wished, lanes.stop[lane] - lanes.time[lane])
    h = length[:, np.newaxis]
    values, rates, fixed = _iterate(lanes, lane, length)
    acceleration = values @ gauss.COEFFICIENTS.T
    velocity = h * (acceleration @ gauss.INTEGRAL.T)
    velocity[:, 0] += lanes.velocity[lane]
    theta = h * (velocity @ gauss.SECOND_INTEGRAL.T)
    theta[:, 0] += lanes.theta[lane]
    changes = gauss.COEFFICIENTS @ rates
    own = h[:, :, np.newaxis] * (gauss.INTEGRAL @ changes)
    own[:, 0, :] += lanes.own[lane]
    tail = length * np.abs(acceleration[:, -2:]).max(axis=1)
    if rates.size:
        tail = np.maximum(tail, length * np.abs(changes[:, -2:, :]).max(axis=(1, 2)))
    good = (fixed & (tail <= TOLERANCE)) | (length <= _SHORTEST)
    factor = 0.9 * (TOLERANCE / np.maximum(tail, _SMALLEST)) ** (1 / gauss.NODES)
    factor = np.where(fixed, np.clip(factor, 0.2, 2.0), 0.4)
    wish = np.clip(length * factor, _SHORTEST, lanes.longest)
    # A step that had to end early says nothing against the length that was wished for.
    early = good & (length < wished)
    wish = np.where(early, np.maximum(wish, wished), wish)
    return Step(lane, length, acceleration, velocity, theta, own, good, wish)


def _iterate(
    lanes: Lanes, lane: Indices, length: Floats
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Return accelerations and rates of own variables at the Gauss points, and where they hold."""
    h = length[:, np.newaxis]
    time = lanes.time[lane, np.newaxis] + h * gauss.POINTS
    velocity0, own0 = lanes.velocity[lane, np.newaxis], lanes.own[lane, np.newaxis, :]
    free = lanes.theta[lane, np.newaxis] + h * gauss.POINTS * velocity0
    acceleration = np.zeros((lane.size, gauss.NODES))
    rates = np.zeros((lane.size, gauss.NODES, own0.shape[-1]))
    fixed = np.zeros(lane.size, bool)
    for _ in range(_ITERATIONS):
        velocity = velocity0 + h * (acceleration @ gauss.FIRST.T)
        theta = free + h**2 * (acceleration @ gauss.SECOND.T)
        own = own0 + h[:, :, np.newaxis] * (gauss.FIRST @ rates) if rates.size else rates
        motion = lanes.motion(lane, time, theta, velocity)
        new, new_rates = lanes.equation.rates(motion, own)
        change = length * np.abs(new - acceleration).max(axis=1)
        if rates.size:
            change = np.maximum(change, length * np.abs(new_rates - rates).max(axis=(1, 2)))
        acceleration, rates = new, new_rates
        fixed = change <= _FIXED * (1 + np.abs(velocity0[:, 0]))
        if fixed.all():
            break
    return acceleration, rates, fixed
