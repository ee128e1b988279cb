"""heyoka's adaptive Taylor integrator with terminal events: stick and slip."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import heyoka as hy  # type: ignore[import-untyped]
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from benchmarks.peers.common import Case

    Floats = NDArray[np.float64]

BEGIN = 1e-4


class HeyokaFriction:
    """One trajectory at a time; a terminal event at each zero of the velocity."""

    label = "heyoka"

    def __init__(self, case: Case, theta_r: float, tol: float) -> None:
        """Compile the integrator for one case; `tol` is heyoka's own."""
        self.case, self.theta_r, self.tol = case, theta_r, tol
        x, v = hy.make_vars("x", "v")
        force = 1.0 + case.p * hy.cos(case.omega * hy.time)
        rubbing = hy.par[0] * theta_r
        event = hy.t_event(v, callback=self._turned)
        self.integrator = hy.taylor_adaptive(
            [(x, v), (v, -case.gamma * v - force * hy.sin(x) - rubbing)],
            [0.0, 1.0],
            tol=tol,
            t_events=[event],
            pars=[1.0],
        )

    @property
    def setting(self) -> str:
        """The tolerance as text."""
        return f"terminal events, tol {self.tol:.0e}"

    def _load(self, time: float, angle: float) -> float:
        return -(1.0 + self.case.p * math.cos(self.case.omega * time)) * math.sin(angle)

    def _turned(self, integrator: Any, _: int) -> bool:  # noqa: ANN401 (heyoka has no types)
        load = self._load(integrator.time, integrator.state[0])
        integrator.state[1] = 0.0
        if abs(load) <= self.theta_r:
            return False
        integrator.pars[0] = math.copysign(1.0, load)
        return True

    def _release(self, time: float, angle: float) -> tuple[float, float]:
        """Return when the load begins to exceed the friction, and its sign."""
        case, sine = self.case, math.sin(angle)
        found = (math.inf, 1.0)
        for sense in (1.0, -1.0):
            cosine = (-sense * self.theta_r / sine - 1.0) / case.p if sine else 2.0
            if abs(cosine) < 1.0:
                phase = math.copysign(math.acos(cosine), sense * case.p * sine)
                ahead = (phase - case.omega * time) % (2.0 * math.pi)
                found = min(found, (time + ahead / case.omega, sense))
        return found

    def _one(self, angle: float, speed: float, end: float) -> tuple[float, float]:
        ta = self.integrator
        ta.reset_cooldowns()
        ta.time = 0.0
        ta.state[:] = angle, speed
        ta.pars[0] = math.copysign(1.0, speed)
        while ta.time < end:
            if ta.propagate_until(end)[0] == hy.taylor_outcome.time_limit:
                break
            until, sense = self._release(ta.time, ta.state[0])
            if until >= end:
                break
            # There velocity and acceleration are 0, which would trigger an event at once: start a
            # short step later by the Taylor series, whose next term is of the fourth power.
            jerk = self.case.p * self.case.omega * math.sin(self.case.omega * until)
            jerk *= math.sin(ta.state[0])
            ta.reset_cooldowns()
            ta.time = until + BEGIN
            ta.pars[0] = sense
            ta.state[0] += jerk * BEGIN**3 / 6.0
            ta.state[1] = jerk * BEGIN**2 / 2.0
        return float(ta.state[0]), float(ta.state[1])

    def advance(self, theta: Floats, velocity: Floats, periods: int) -> tuple[Floats, Floats]:
        """Return unwrapped angle and velocity, shape (N,), after whole forcing periods."""
        end = periods * self.case.period
        pairs = zip(theta.tolist(), velocity.tolist(), strict=True)
        ends = np.array([self._one(a, b, end) for a, b in pairs])
        return ends[:, 0], ends[:, 1]
