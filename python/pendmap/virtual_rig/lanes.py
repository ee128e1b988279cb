"""State of the lanes (runs under parallel integration), their steps and their events."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from pendmap.virtual_rig import path as gauss
from pendmap.virtual_rig.path import Event, Floats, Path

if TYPE_CHECKING:
    from pendmap.virtual_rig.effects.base import Motion
    from pendmap.virtual_rig.equation import Equation

Indices = NDArray[np.intp]

_FIRST: Final = 0.25  # Length of the first step over the longest allowed

TOLERANCE: Final = 1e-11
"""Largest of the last coefficients of an accepted velocity polynomial, rad/s."""
_FIXED: Final = 3e-13  # Change of the velocity at which the fixed-point iteration ends, rad/s
_ITERATIONS: Final = 25
"""Most fixed-point iterations of a step; without convergence a shorter step is tried."""
_SHORTEST: Final = 1e-9
"""Length of a step that is accepted whatever its error, s; corners of the equation end there."""
_SMALLEST: Final = 1e-300  # Lower bound of a step's error in the step-size formula, rad/s


class Lanes:
    """State of N lanes, one for each run, each at its own time, in arrays of shape (N,).

    ``time``, ``theta``, ``velocity`` are in s, rad, rad/s; ``own``, shape (N, M), are the effects'
    state variables; ``direction`` and ``side`` the signs of velocity (0: sticking) and load. The
    next step has the length ``wish``, s, at most ``longest``, one radian of the swing or of the
    drive, and ends at ``stop`` at the latest: a kick or the end.
    """

    def __init__(self, equation: Equation, end: Floats, theta: Floats, velocity: Floats) -> None:
        count = end.size
        self.equation = equation
        self.time, self.theta, self.velocity = np.zeros(count), theta.copy(), velocity.copy()
        self.direction, self.side = np.sign(self.velocity), np.ones(count)
        fastest = max(equation.parameters.w0, float(np.abs(equation.drive.frequency).max()))
        self.longest = 1.0 / fastest
        self.wish = np.full(count, _FIRST * self.longest)
        self.paths = [Path(lab) for lab in equation.lab.tolist()]
        # The last entry is the end of the run: it bounds the steps and is never applied.
        self._kicks = [
            [*equation.kicks(run, last), (last, 0.0)] for run, last in enumerate(end.tolist())
        ]
        self.stop = np.array([kicks[0][0] for kicks in self._kicks])
        every = np.arange(count)
        state = self.time, self.theta, self.velocity
        motion = self.motion(every, *(part[:, np.newaxis] for part in state))
        self.own = equation.begin(motion)[:, 0]
        self.side = np.where(motion.load[:, 0] < 0, -1.0, 1.0)
        for lane in np.flatnonzero(self.velocity == 0).tolist():
            self.direction[lane] = self._slips(lane)

    def motion(self, lane: Indices, time: Floats, theta: Floats, velocity: Floats) -> Motion:
        """Return the motion of L lanes at K times each; other arguments have the shape (L, K)."""
        run = lane[:, np.newaxis]
        signs = self.direction[run], self.side[run]
        return self.equation.motion(run, time, theta, velocity, *signs)

    def margins(self, lane: int, after: Floats, states: Floats) -> tuple[Floats, Floats]:
        """Return the slip margins, rad/s^2, of a lane at rest, at S times ``after`` its own, s.

        It slips to positive angles where the first is negative, to negative angles where the second
        is; ``states``, shape (S, M), holds the effects' state variables.
        """
        still = np.zeros((1, after.size))
        time, theta = self.time[lane] + after[np.newaxis], self.theta[lane] + still
        motion = self.motion(np.array([lane]), time, theta, still)
        load = self.equation.smooth(motion, states[np.newaxis])
        motion.direction = np.ones((1, 1))
        up = self.equation.friction(motion) - load
        motion.direction = -motion.direction
        return up[0], (load + self.equation.friction(motion))[0]

    def happen(self, lane: int, what: str) -> None:
        """Apply an event to a lane: ``rest``, ``up`` or ``down`` (released so), or ``unload``."""
        if what == "unload":
            self.side[lane] = -self.side[lane]
            return
        if what == "rest":
            self.velocity[lane] = 0.0
            self.direction[lane] = self._slips(lane)
            noted = "turn" if self.direction[lane] else "stick"
        else:
            self.direction[lane] = 1.0 if what == "up" else -1.0
            noted = "release"
        event = Event(float(self.time[lane]), noted, float(self.theta[lane]))
        self.paths[lane].events.append(event)

    def _slips(self, lane: int) -> float:
        """Return the direction in which a pendulum at rest slips, 0 if it sticks."""
        up, down = self.margins(lane, np.zeros(1), self.own[lane : lane + 1])
        if up[0] < 0:
            return 1.0
        return -1.0 if down[0] < 0 else 0.0

    def kick(self, lane: int) -> None:
        """Apply the kick at ``stop``, if there is one."""
        if len(self._kicks[lane]) == 1:
            return
        _, jump = self._kicks[lane].pop(0)
        self.stop[lane] = self._kicks[lane][0][0]
        self.velocity[lane] += jump
        self.direction[lane] = np.sign(self.velocity[lane])
        if self.velocity[lane] == 0:
            self.direction[lane] = self._slips(lane)


@dataclasses.dataclass(frozen=True)
class Step:
    """One step of L lanes; polynomials are Legendre coefficients over the step."""

    lane: Indices  # shape (L,)
    length: Floats  # s, shape (L,)
    acceleration: Floats  # shape (L, NODES)
    velocity: Floats  # shape (L, NODES + 1)
    theta: Floats  # shape (L, NODES + 2)
    own: Floats  # the effects' state variables, shape (L, NODES + 1, M)
    good: NDArray[np.bool_]  # whether the step is accurate enough, shape (L,)
    wish: Floats  # length of the next step, s, shape (L,)


def solve(lanes: Lanes, lane: Indices) -> Step:
    """Solve one step of some lanes; the last two coefficients estimate a polynomial's error."""
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
    states = h[:, :, np.newaxis] * (gauss.INTEGRAL @ changes)
    states[:, 0, :] += lanes.own[lane]
    tail = length * np.abs(acceleration[:, -2:]).max(axis=1)
    if rates.size:
        tail = np.maximum(tail, length * np.abs(changes[:, -2:, :]).max(axis=(1, 2)))
    good = (fixed & (tail <= TOLERANCE)) | (length <= _SHORTEST)
    factor = 0.9 * (TOLERANCE / np.maximum(tail, _SMALLEST)) ** (1 / gauss.NODES)
    factor = np.where(fixed, np.clip(factor, 0.2, 2.0), 0.4)
    wish = np.clip(length * factor, _SHORTEST, lanes.longest)
    # A step shortened by ``stop`` is no evidence against the proposed length.
    early = good & (length < wished)
    wish = np.where(early, np.maximum(wish, wished), wish)
    return Step(lane, length, acceleration, velocity, theta, states, good, wish)


def _iterate(
    lanes: Lanes, lane: Indices, length: Floats
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Return accelerations and state rates at the Gauss points, and which lanes converged."""
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
        states = own0 + h[:, :, np.newaxis] * (gauss.FIRST @ rates) if rates.size else rates
        motion = lanes.motion(lane, time, theta, velocity)
        new, new_rates = lanes.equation.rates(motion, states)
        change = length * np.abs(new - acceleration).max(axis=1)
        if rates.size:
            change = np.maximum(change, length * np.abs(new_rates - rates).max(axis=(1, 2)))
        acceleration, rates = new, new_rates
        fixed = change <= _FIXED * (1 + np.abs(velocity0[:, 0]))
        if fixed.all():
            break
    return acceleration, rates, fixed
