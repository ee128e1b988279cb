"""The branch of the rotation 1:1 along p with its fold and its doubling, on one core.

pendmap searches the orbits itself; a pseudo-arclength continuation by scipy is given a start.
pynamicalsys has no continuation: its Newton's method at falling p ends at the fold, on one half.
"""

from __future__ import annotations

import math
import time
from functools import partial
from typing import TYPE_CHECKING

import numba
import numpy as np
from pynamicalsys import DiscreteDynamicalSystem
from pynamicalsys.continuous_time.fixed_step import rk4_step
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import pendmap
from benchmarks.peers.pynamical import _slope
from benchmarks.peers.report import machine, say, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats, Row = NDArray[np.float64], tuple[float, int, float, float]  # s, orbits, events

GAMMA, OMEGA, LOW, HIGH = 0.1, 2.0, 0.3, 1.6
PERIOD = 2 * math.pi / OMEGA
ARC, LEAST, STEPS = 0.05, 1e-10, 800  # Arclength; last step of p; of RK4, for an error of 1e-10
CLOSED, FAR = 1e-11, 0.2  # Largest residual; distance beyond which another orbit was met
HEADERS = ("method", "s", "times ours", "orbits", "fold at p", "doubling at p")


def by_pendmap(longest: int) -> Row:
    """Follow the branch, and those of its doublings up to ``longest`` periods."""
    begun = time.process_time()
    model, ranges = pendmap.Pendulum(gamma=GAMMA, omega=OMEGA), {"p": (LOW, HIGH)}
    result = pendmap.continuation(model, ranges, n=1, w=1, longest=longest, threads=1)
    took, first = time.process_time() - begun, result["event_n"].values == 1
    events = dict(
        zip(result["event_kind"].values[first], result["event_value"].values[first], strict=True)
    )
    return took, result.sizes["orbit"], float(events["fold"]), float(events["period_doubling"])


def gap(z: Floats) -> tuple[Floats, Floats]:
    """Return P(x) - x - (2 pi, 0) at (theta, velocity, p), and its derivative, by DOP853."""

    def rhs(tau: float, y: Floats) -> Floats:
        drive, sine = math.cos(OMEGA * tau), math.sin(y[0])
        slopes = -(1 + z[2] * drive) * math.cos(y[0]) * y[2:5] - GAMMA * y[5:]
        slopes[2] -= drive * sine
        return np.array([y[1], -GAMMA * y[1] - (1 + z[2] * drive) * sine, *y[5:], *slopes])

    run = solve_ivp(rhs, (0, PERIOD), [*z[:2], 1, 0, 0, 0, 1, 0], "DOP853", rtol=1e-12, atol=1e-13)
    end = run.y[:, -1]
    return end[:2] - z[:2] - [2 * math.pi, 0], end[2:].reshape(2, 3) - np.eye(2, 3)


def corrected(z: Floats, way: Floats, arc: float) -> tuple[Floats, Floats, Floats]:
    """Return the orbit at an arclength from another, the tangent, and the tests of both events."""
    guess, step = z + arc * way, np.ones(3)
    while np.linalg.norm(step) > CLOSED:
        apart, by = gap(guess)
        step = np.linalg.solve(np.vstack([by, way]), [*apart, way @ (guess - z) - arc])
        guess = guess - step
    tangent = np.cross(*by)
    tangent *= np.sign(tangent @ way) / np.linalg.norm(tangent)
    return guess, tangent, np.array([tangent[2], np.linalg.det(by[:, :2] + 2 * np.eye(2))])


def by_scipy(start: tuple[float, float]) -> Row:
    """Follow the branch from HIGH around the fold to HIGH again."""
    begun, steps, events = time.process_time(), 0, [math.nan, math.nan]
    z, way, tests = corrected(np.array([*start, HIGH]), np.array([0.0, 0.0, -1.0]), 0.0)
    while z[2] <= HIGH + CLOSED:
        after = corrected(z, way, ARC)
        for k in np.flatnonzero(after[2] * tests < 0):
            at = partial(corrected, z, way)
            arc = brentq(lambda s, k=k, at=at: at(s)[2][k], 0, ARC, xtol=1e-13)
            events[k] = at(arc)[0][2]
        (z, way, tests), steps = after, steps + 1
    return time.process_time() - begun, steps, events[0], events[1]


@numba.njit
def _map(x: Floats, parameters: Floats) -> Floats:
    step = 2 * math.pi / parameters[2] / STEPS
    for k in range(STEPS):
        x = rk4_step(k * step, x, parameters, _slope, step)
    return x


def by_pynamicalsys(start: tuple[float, float]) -> Row:
    """Follow the stable half of the branch from HIGH down by Newton's method at each p."""
    system = DiscreteDynamicalSystem(mapping=_map, system_dimension=2, number_of_parameters=3)
    look = {"periods": [2 * math.pi, math.inf], "convergence_threshold": CLOSED, "max_iter": 20}

    def orbit(p: float, x: Floats) -> Floats:
        return system.find_periodic_orbit(x, 1, parameters=[GAMMA, p, OMEGA], **look)

    def test(p: float, x: Floats) -> float:
        values, _ = system.eigenvalues_and_eigenvectors(orbit(p, x), 1, [GAMMA, p, OMEGA])
        return 1 + float(np.min(np.real(values)))

    x = orbit(HIGH, np.array(start))  # compiles
    begun, orbits, doubling, before = time.process_time(), 0, math.nan, test(HIGH, x)
    p, stride = HIGH, 0.01
    while stride > LEAST:
        try:
            there = orbit(p - stride, x)
        except RuntimeError:
            there = np.full(2, math.inf)
        if np.linalg.norm(there - x) > FAR:
            stride /= 2
            continue
        after = test(p - stride, there)
        if after * before < 0:
            doubling = brentq(test, p - stride, p, (x,), xtol=1e-13)
        p, x, before, orbits = p - stride, there, after, orbits + 1
    return time.process_time() - begun, orbits, p, doubling


def main() -> None:
    """Print the table."""
    say(machine(["pendmap", "scipy", "pynamicalsys"]))
    found = pendmap.orbit(pendmap.Pendulum(gamma=GAMMA, omega=OMEGA, p=HIGH), n=1, w=1)
    upper = np.argmax(found["velocity_point"].values)
    start = float(found["theta_point"][upper]), float(found["velocity_point"][upper])
    methods = {
        "pendmap": partial(by_pendmap, 1),
        "pendmap, doublings to n = 32": partial(by_pendmap, 32),
        "scipy, pseudo-arclength": partial(by_scipy, start),
        "pynamicalsys, stable half": partial(by_pynamicalsys, start),
    }
    rows = [[name, *min(method() for _ in range(3))] for name, method in methods.items()]
    ours, texts = rows[0], []
    for name, took, count, *events in rows:
        away = [f"{p - q:+.1e}" for p, q in zip(events, ours[3:], strict=True)]
        shown = away if texts else [f"{p:.12f}" for p in events]
        texts.append([name, f"{took:.3g}", f"{took / ours[1]:.3g}", str(count), *shown])
    say(table(HEADERS, texts))


if __name__ == "__main__":
    main()
