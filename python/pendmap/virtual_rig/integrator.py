"""The virtual rig's integrator: many runs side by side, dry friction exactly.

Each round makes one step for every run, each with a length of its own, by Gauss collocation solved
by Picard's iteration. Signs (of the velocity, of the load on the bearing) are held through a step,
so that the equation is smooth there; where one changes, the step ends.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.virtual_rig import collocation as gauss
from pendmap.virtual_rig.events import may_turn, stop_of, turn_of
from pendmap.virtual_rig.path import Event, Path

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pendmap.virtual_rig.effect import Motion
    from pendmap.virtual_rig.equation import Equation

    Floats = NDArray[np.float64]

__all__ = ["Starts", "integrate"]

TOLERANCE: Final = 1e-11
"""Largest last coefficient of the velocity in a step, rad/s."""

_FIXED: Final = 3e-13
"""Change of the velocity at which Picard's iteration ends, rad/s."""
_ITERATIONS: Final = 25
_SHORTEST: Final = 1e-9
_BASIS: Final = np.vstack([gauss.basis(np.zeros(1), gauss.NODES + 2), gauss.SCAN_BASIS])
_PLACES: Final = np.concatenate([[0.0], gauss.SCAN])


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

    run: NDArray[np.intp]
    begin: Floats
    end: Floats
    theta: Floats
    velocity: Floats


@dataclasses.dataclass
class _Step:
    """One step of the live lanes: lengths, polynomials, what came of it."""

    lane: NDArray[np.intp]
    length: Floats
    acceleration: Floats
    velocity: Floats
    theta: Floats
    own: Floats
    good: NDArray[np.bool_]
    wish: Floats


def integrate(equation: Equation, starts: Starts) -> list[Path]:
    """Integrate runs, or parts of them, from their starts to their ends.

    Parameters
    ----------
    equation : Equation
        The rig with its effects.
    starts : Starts
        N starts. Variables of the effects' own begin at 0.

    Returns
    -------
    list of Path
        One for each start.
    """
    lanes = _Lanes(equation, starts)
    live = np.flatnonzero(starts.end > starts.begin)
    while live.size:
        step = lanes.step(live)
        lanes.wish[live] = step.wish
        if step.good.any():
            lanes.commit(step)
        live = live[lanes.time[live] < starts.end[live]]
    return lanes.paths


class _Lanes:
    def __init__(self, equation: Equation, starts: Starts) -> None:
        count = starts.run.size
        self.equation = equation
        self.run, self.end = starts.run, starts.end
        self.time = starts.begin.astype(float)
        self.theta = starts.theta.astype(float)
        self.velocity = starts.velocity.astype(float)
        self.own = np.zeros((count, equation.states))
        self.direction = np.sign(self.velocity)
        self.side = np.ones(count)
        fastest = max(equation.parameters.w0, float(np.abs(equation.drive.frequency).max()))
        self.longest = 1.0 / fastest
        self.wish = np.full(count, 0.25 * self.longest)
        self.paths = [Path() for _ in range(count)]
        self.kicks = [
            equation.kicks(int(run), float(begin), float(end))
            for run, begin, end in zip(starts.run, starts.begin, starts.end, strict=True)
        ]
        self.stop = np.array(
            [kicks[0][0] if kicks else end for kicks, end in zip(self.kicks, self.end, strict=True)]
        )
        for lane in range(count):
            state = (array[lane : lane + 1] for array in (self.time, self.theta, self.velocity))
            self.side[lane] = -1.0 if self._motion(lane, *state).load[0, 0] < 0 else 1.0
            if self.velocity[lane] == 0:
                self.direction[lane] = self._slips(lane)

    # One step of all live lanes

    def step(self, lane: NDArray[np.intp]) -> _Step:
        """Solve one step of the live lanes and choose the next one's length."""
        left = self.stop[lane] - self.time[lane]
        length = np.minimum(self.wish[lane], left)
        acceleration, rates, fixed = self._solve(lane, length)
        coefficients = acceleration @ gauss.COEFFICIENTS.T
        step = self._polynomials(lane, length, coefficients, rates)
        tail = length * np.abs(coefficients[:, -2:]).max(axis=1)
        if rates.size:
            own = np.moveaxis(rates, 1, 2) @ gauss.COEFFICIENTS.T
            tail = np.maximum(tail, length * np.abs(own[:, :, -2:]).max(axis=(1, 2)))
        step.good = (fixed & (tail <= TOLERANCE)) | (length <= _SHORTEST)
        factor = 0.9 * (TOLERANCE / np.maximum(tail, 1e-300)) ** (1 / gauss.NODES)
        factor = np.where(fixed, np.clip(factor, 0.2, 2.0), 0.4)
        wish = np.clip(length * factor, _SHORTEST, self.longest)
        # A step cut short by the end of a run or a kick says nothing about the next one.
        cut = step.good & (length < self.wish[lane])
        step.wish = np.where(cut, np.maximum(wish, self.wish[lane]), wish)
        return step

    def _solve(
        self, lane: NDArray[np.intp], length: Floats
    ) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Accelerations at the Gauss points, rates of own variables, and where they are fixed."""
        h = length[:, np.newaxis]
        theta0, velocity0 = self.theta[lane][:, np.newaxis], self.velocity[lane][:, np.newaxis]
        time = self.time[lane][:, np.newaxis] + h * gauss.POINTS
        run = self.run[lane][:, np.newaxis]
        direction, side = self.direction[lane][:, np.newaxis], self.side[lane][:, np.newaxis]
        own0 = self.own[lane][:, np.newaxis, :]
        acceleration = np.zeros((lane.size, gauss.NODES))
        rates = np.zeros((lane.size, gauss.NODES, self.equation.states))
        free = theta0 + h * gauss.POINTS * velocity0
        fixed = np.zeros(lane.size, bool)
        for _ in range(_ITERATIONS):
            velocity = velocity0 + h * (acceleration @ gauss.FIRST.T)
            theta = free + h**2 * (acceleration @ gauss.SECOND.T)
            own = own0 + h[:, :, np.newaxis] * (gauss.FIRST @ rates) if rates.size else rates
            motion = self.equation.motion(run, time, theta, velocity, direction, side)
            new, new_rates = self.equation.rates(motion, own)
            change = length * np.abs(new - acceleration).max(axis=1)
            if rates.size:
                drift = np.abs(new_rates - rates).max(axis=(1, 2))
                change = np.maximum(change, length * drift)
            acceleration, rates = new, new_rates
            fixed = change <= _FIXED * (1 + np.abs(velocity0[:, 0]))
            if fixed.all():
                break
        return acceleration, rates, fixed

    def _polynomials(
        self, lane: NDArray[np.intp], length: Floats, coefficients: Floats, rates: Floats
    ) -> _Step:
        h = length[:, np.newaxis]
        velocity = h * (coefficients @ gauss.INTEGRAL.T)
        velocity[:, 0] += self.velocity[lane]
        theta = h * (velocity @ gauss.SECOND_INTEGRAL.T)
        theta[:, 0] += self.theta[lane]
        own = h[:, :, np.newaxis] * (gauss.INTEGRAL @ gauss.COEFFICIENTS @ rates)
        own[:, 0, :] += self.own[lane]
        nothing = np.zeros(lane.size)
        return _Step(
            lane, length, coefficients, velocity, theta, own, nothing.astype(bool), nothing
        )

    # What a step leads to

    def commit(self, step: _Step) -> None:
        """Take over the steps that are good, each up to its first event."""
        rows = np.flatnonzero(step.good)
        events = self._events(step, rows)
        lane = step.lane[rows]
        ends = {k: place for k, (place, _) in events.items()}
        for k, i in zip(rows, lane, strict=True):
            self.paths[i].add(
                float(self.time[i]), float(step.length[k]), step.theta[k], step.velocity[k]
            )
        # P_k(1) = 1: the end's values are sums of coefficients.
        last = self.time[lane] + step.length[rows] >= self.stop[lane]
        begin = self.time[lane].copy()
        self.theta[lane] = step.theta[rows].sum(axis=1)
        self.velocity[lane] = np.where(
            self.direction[lane] == 0, 0.0, step.velocity[rows].sum(axis=1)
        )
        self.own[lane] = step.own[rows].sum(axis=1)
        self.time[lane] = np.where(last, self.stop[lane], begin + step.length[rows])
        for k, start, whole in zip(rows.tolist(), begin.tolist(), last, strict=True):
            if k in ends:
                self._cut(step, k, start, ends[k])
                events[k][1](int(step.lane[k]))
            elif whole:
                self._kick(int(step.lane[k]))

    def _cut(self, step: _Step, k: int, begin: float, place: float) -> None:
        """Put a lane where its step is at ``place``."""
        i = step.lane[k]
        polynomials = gauss.basis(np.array([place]), gauss.NODES + 2)[0]
        self.time[i] = begin + place * step.length[k]
        self.theta[i] = polynomials @ step.theta[k]
        self.velocity[i] = polynomials[:-1] @ step.velocity[k]
        self.own[i] = polynomials[:-1] @ step.own[k]

    def _events(
        self, step: _Step, rows: NDArray[np.intp]
    ) -> dict[int, tuple[float, Callable[[int], None]]]:
        """Return place and consequence of the first event in each step that has one."""
        found: dict[int, tuple[float, Callable[[int], None]]] = {}
        direction = self.direction[step.lane[rows]]
        slides = rows[direction != 0]
        if slides.size:
            sign = self.direction[step.lane[slides]][:, np.newaxis]
            velocity = sign * (step.velocity[slides] @ _BASIS[:, :-1].T)
            # Exactly, so that a start from rest is not taken for a start above or below it.
            velocity[:, 0] = np.abs(self.velocity[step.lane[slides]])
            acceleration = sign * (step.acceleration[slides] @ _BASIS[:, :-2].T)
            near = may_turn(velocity, acceleration, step.length[slides])
            for k, seen in zip(slides[near], velocity[near], strict=True):
                polynomials = step.velocity[k].tolist(), step.acceleration[k].tolist()
                place = turn_of(*polynomials, float(self.direction[step.lane[k]]), seen)
                if place is not None:
                    found[int(k)] = (place, self._rest)
        for k in rows[direction == 0]:
            self._releases(step, int(k), found)
        if self.equation.watches_load:
            for k in rows[self._may_unload(step, rows)]:
                self._unloads(step, int(k), found)
        return found

    def _releases(
        self, step: _Step, k: int, found: dict[int, tuple[float, Callable[[int], None]]]
    ) -> None:
        """Find where a lane that sticks slips, and which way."""
        seen = self._margins(step, k, _PLACES)
        for which, sign in ((0, 1.0), (1, -1.0)):

            def margin(s: float, which: int = which) -> float:
                return float(self._margins(step, k, np.array([s]))[which][0])

            place = stop_of(margin, seen[which])
            if place is not None and (k not in found or place < found[k][0]):

                def release(i: int, sign: float = sign) -> None:
                    self.direction[i] = sign
                    self._note(i, "release")

                found[k] = (place, release)

    def _margins(self, step: _Step, k: int, places: Floats) -> tuple[Floats, Floats]:
        """Both margins of the stick at places within a step, shape (S,) each."""
        own = (gauss.basis(places, gauss.NODES + 1) @ step.own[k])[np.newaxis]
        motion = self._held(int(step.lane[k]), places * step.length[k])
        up, down = self.equation.margins(motion, own)
        return up[0], down[0]

    def _may_unload(self, step: _Step, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Tell in which steps the load on the bearing may change sign."""
        lane = step.lane[rows]
        time = self.time[lane][:, np.newaxis] + _PLACES * step.length[rows][:, np.newaxis]
        sign = self.side[lane][:, np.newaxis]
        theta, velocity = step.theta[rows] @ _BASIS.T, step.velocity[rows] @ _BASIS[:, :-1].T
        run, direction = self.run[lane][:, np.newaxis], self.direction[lane][:, np.newaxis]
        load = sign * self.equation.motion(run, time, theta, velocity, direction, sign).load
        # Between two places it falls by less than it changes from one to the next somewhere.
        near = load.min(axis=1) < np.abs(np.diff(load, axis=1)).max(axis=1)
        return np.asarray(near)

    def _unloads(
        self, step: _Step, k: int, found: dict[int, tuple[float, Callable[[int], None]]]
    ) -> None:
        """Find where the load on the bearing changes sign."""
        lane = int(step.lane[k])

        def load(places: Floats) -> Floats:
            polynomials = gauss.basis(places, gauss.NODES + 2)
            time = self.time[lane] + places * step.length[k]
            motion = self._motion(
                lane, time, polynomials @ step.theta[k], polynomials[:, :-1] @ step.velocity[k]
            )
            return np.asarray(self.side[lane] * motion.load[0])

        place = stop_of(lambda s: float(load(np.array([s]))[0]), load(_PLACES))
        if place is not None and (k not in found or place < found[k][0]):

            def unload(i: int) -> None:
                self.side[i] = -self.side[i]

            found[k] = (place, unload)

    # Consequences

    def _rest(self, lane: int) -> None:
        """The velocity is zero: the pendulum turns, goes on, or sticks."""
        self.velocity[lane] = 0.0
        self.direction[lane] = self._slips(lane)
        self._note(lane, "turn" if self.direction[lane] else "stick")

    def _slips(self, lane: int) -> float:
        """Direction in which a pendulum at rest slips; 0 if it sticks."""
        up, down = self.equation.margins(self._held(lane, np.zeros(1)), self.own[lane][None, None])
        if up[0, 0] < 0:
            return 1.0
        return -1.0 if down[0, 0] < 0 else 0.0

    def _kick(self, lane: int) -> None:
        """Apply the kick that ended a step, if one did."""
        if not self.kicks[lane]:
            return
        _, jump = self.kicks[lane].pop(0)
        self.stop[lane] = self.kicks[lane][0][0] if self.kicks[lane] else self.end[lane]
        self.velocity[lane] += jump
        self.direction[lane] = np.sign(self.velocity[lane])
        if self.velocity[lane] == 0:
            self.direction[lane] = self._slips(lane)

    def _motion(self, lane: int, time: Floats, theta: Floats, velocity: Floats) -> Motion:
        """Motion of one lane at S times, each argument of shape (S,)."""
        return self.equation.motion(
            self.run[lane].reshape(1, 1),
            time[np.newaxis],
            theta[np.newaxis],
            velocity[np.newaxis],
            self.direction[lane].reshape(1, 1),
            self.side[lane].reshape(1, 1),
        )

    def _held(self, lane: int, after: Floats) -> Motion:
        """Motion of a lane held where it is, at times after its own, s."""
        still = np.zeros_like(after)
        return self._motion(lane, self.time[lane] + after, self.theta[lane] + still, still)

    def _note(self, lane: int, what: str) -> None:
        event = Event(float(self.time[lane]), what, float(self.theta[lane]))
        self.paths[lane].events.append(event)
