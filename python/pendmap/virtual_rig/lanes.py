"""The runs that are being integrated, side by side, and what becomes of them at an event."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.virtual_rig.path import Event, Path

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pendmap.virtual_rig.effects.base import Motion
    from pendmap.virtual_rig.equation import Equation

    Floats = NDArray[np.float64]
    Indices = NDArray[np.intp]

_FIRST: Final = 0.25
"""The first step, as a share of the longest."""


@dataclasses.dataclass(frozen=True)
class Starts:
    """Where N integrations begin and end.

    Parameters
    ----------
    run : array of int, shape (N,)
        Which of the equation's runs each belongs to.
    begin, end : array, shape (N,)
        Times since that run began, s.
    theta, velocity : array, shape (N,)
        State at ``begin``, rad and rad/s.
    """

    run: Indices
    begin: Floats
    end: Floats
    theta: Floats
    velocity: Floats


class Lanes:
    """State of N lanes, each at a time of its own.

    Attributes
    ----------
    time, theta, velocity : array, shape (N,)
        Where each lane is, s, rad, rad/s.
    own : array, shape (N, M)
        The effects' own variables.
    direction, side : array, shape (N,)
        Signs of the velocity and of the load on the bearing; direction 0 sticks.
    wish : array, shape (N,)
        Length of the next step, s.
    stop : array, shape (N,)
        Where that step has to end at the latest: at a kick or at the end, s.
    longest : float
        Longest step, s: a radian of the swing or of the drive.
    paths : list of Path
        What was integrated so far.
    """

    def __init__(self, equation: Equation, starts: Starts) -> None:
        count = starts.run.size
        self.equation = equation
        self.run, self.end = starts.run, starts.end
        self.time = starts.begin.astype(float)
        self.theta = starts.theta.astype(float)
        self.velocity = starts.velocity.astype(float)
        self.direction, self.side = np.sign(self.velocity), np.ones(count)
        fastest = max(equation.parameters.w0, float(np.abs(equation.drive.frequency).max()))
        self.longest = 1.0 / fastest
        self.wish = np.full(count, _FIRST * self.longest)
        self.paths = [Path() for _ in range(count)]
        self._kicks = [
            equation.kicks(int(run), float(begin), float(end))
            for run, begin, end in zip(starts.run, starts.begin, starts.end, strict=True)
        ]
        self.stop = np.array(
            [
                kicks[0][0] if kicks else end
                for kicks, end in zip(self._kicks, self.end, strict=True)
            ]
        )
        every = np.arange(count)
        state = self.time, self.theta, self.velocity
        motion = self.motion(every, *(part[:, np.newaxis] for part in state))
        self.own = equation.begin(motion)[:, 0]
        self.side = np.where(motion.load[:, 0] < 0, -1.0, 1.0)
        for lane in np.flatnonzero(self.velocity == 0).tolist():
            self.direction[lane] = self._slips(lane)

    def motion(self, lane: Indices, time: Floats, theta: Floats, velocity: Floats) -> Motion:
        """Motion of L lanes at K times each; the others of shape (L, K)."""
        return self.equation.motion(
            self.run[lane, np.newaxis],
            time,
            theta,
            velocity,
            self.direction[lane, np.newaxis],
            self.side[lane, np.newaxis],
        )

    def margins(self, lane: int, after: Floats, own: Floats) -> tuple[Floats, Floats]:
        """How far a lane that is held where it is stays from slipping, up and down, rad/s^2.

        Parameters
        ----------
        lane : int
            Which.
        after : array, shape (S,)
            Times after the lane's own, s.
        own : array, shape (S, M)
            The effects' own variables then.

        Returns
        -------
        array, array, shape (S,)
            Margins; the pendulum slips where one is negative.
        """
        still = np.zeros((1, after.size))
        time, theta = self.time[lane] + after[np.newaxis], self.theta[lane] + still
        motion = self.motion(np.array([lane]), time, theta, still)
        up, down = self.equation.margins(motion, own[np.newaxis])
        return up[0], down[0]

    def happen(self, lane: int, what: str) -> None:
        """Let an event happen to a lane: ``rest``, ``up``, ``down`` (released so) or ``unload``."""
        happens: dict[str, Callable[[int], None]] = {
            "rest": self._rest,
            "up": self._up,
            "down": self._down,
            "unload": self._unload,
        }
        happens[what](lane)

    def _rest(self, lane: int) -> None:
        self.velocity[lane] = 0.0
        self.direction[lane] = self._slips(lane)
        self._note(lane, "turn" if self.direction[lane] else "stick")

    def _up(self, lane: int) -> None:
        self.direction[lane] = 1.0
        self._note(lane, "release")

    def _down(self, lane: int) -> None:
        self.direction[lane] = -1.0
        self._note(lane, "release")

    def _unload(self, lane: int) -> None:
        self.side[lane] = -self.side[lane]

    def _slips(self, lane: int) -> float:
        """Direction in which a pendulum at rest slips; 0 if it sticks."""
        up, down = self.margins(lane, np.zeros(1), self.own[lane : lane + 1])
        if up[0] < 0:
            return 1.0
        return -1.0 if down[0] < 0 else 0.0

    def kick(self, lane: int) -> None:
        """Apply the kick at ``stop``, if there is one."""
        if not self._kicks[lane]:
            return
        _, jump = self._kicks[lane].pop(0)
        self.stop[lane] = self._kicks[lane][0][0] if self._kicks[lane] else self.end[lane]
        self.velocity[lane] += jump
        self.direction[lane] = np.sign(self.velocity[lane])
        if self.velocity[lane] == 0:
            self.direction[lane] = self._slips(lane)

    def _note(self, lane: int, what: str) -> None:
        event = Event(float(self.time[lane]), what, float(self.theta[lane]))
        self.paths[lane].events.append(event)
