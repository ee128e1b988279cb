"""Events of ``pendmap continue`` against heyoka.

Pendulums, drives and parameters that vary are drawn at random. Every fold, doubling and symmetry
breaking that `continue` locates is the start of Newton's method on ``P^n(x) = x`` and
``det(DP^n - m) = 0`` with the second derivatives of heyoka's variational equations.
"""

from __future__ import annotations

import argparse
import math
from collections import defaultdict

import heyoka as hy  # type: ignore[import-untyped]
import numpy as np
from numpy.typing import NDArray

import pendmap
from benchmarks.peers.report import machine, note, say, table
from pendmap.analysis.result import records

Floats = NDArray[np.float64]
RANGES = {"p": (0.1, 1.8), "omega": (1.1, 2.8), "gamma": (0.05, 0.5), "torque": (0.0, 0.4)}
MULTIPLIERS = {"fold": 1, "period_doubling": -1, "symmetry_breaking": -1}
"""Critical multiplier of the map that closes; of symmetric orbits the half map with a mirror."""
TYPES = ((1, 0), (2, 0), (1, 1), (2, 1))
ITERATIONS = 10
MIRRORED = 1e-6
EVENT = ("kind", "value", "theta", "velocity", "n", "w")


class Heyoka:
    """The flow over whole periods with derivatives to second order."""

    def __init__(self) -> None:
        """Compile the variational equations; time is counted in periods of the drive."""
        x, v = hy.make_vars("x", "v")
        p, omega, gamma, torque = (hy.par[k] for k in range(4))
        period = 2 * math.pi / omega
        pull = (1.0 + p * hy.cos(2 * math.pi * hy.time)) * hy.sin(x)
        system = [(x, period * v), (v, period * (-gamma * v - pull + torque))]
        varied = hy.var_ode_sys(system, [x, v, p, omega, gamma, torque], order=2)
        start = {"pars": [0.0, 1.0, 0.0, 0.0], "time": 0.0, "compact_mode": True}
        self.integrator = hy.taylor_adaptive(varied, [0.0, 0.0], **start)
        self.first = self.integrator.state.copy()
        self.places = [tuple(self.integrator.get_mindex(k)) for k in range(2, self.first.size)]

    def flow(self, x: Floats, values: Floats, periods: int) -> tuple[Floats, Floats, Floats]:
        """Return the image, and its first and second derivatives by state and parameters."""
        self.integrator.time = 0.0
        self.integrator.state[:] = self.first
        self.integrator.state[:2] = x
        self.integrator.pars[:] = values
        self.integrator.propagate_until(float(periods))
        by, twice = np.zeros((2, 6)), np.zeros((2, 6, 6))
        for (part, *orders), value in zip(self.places, self.integrator.state[2:], strict=True):
            variables = [k for k, order in enumerate(orders) for _ in range(order)]
            if sum(orders) == 1:
                by[part, variables[0]] = value
            elif variables:
                one, other = variables
                twice[part, one, other] = twice[part, other, one] = value
        return self.integrator.state[:2].copy(), by, twice

    def refined(self, event: dict[str, float], values: Floats, varied: int, m: int) -> float:
        """Return the value of the parameter at an event, by Newton's method from there."""
        x, values = np.array([event["theta"], event["velocity"]]), values.copy()
        n, turns = int(event["n"]), int(event["w"])
        half = n % 2 == 0 and turns == 0
        if half:
            image, _, _ = self.flow(x, values, n // 2)
            half = (
                math.hypot(math.remainder(image[0] + x[0], 2 * math.pi), image[1] + x[1]) < MIRRORED
            )
        sign, periods = (-1.0, n // 2) if half else (1.0, n)
        columns = [0, 1, 2 + varied]
        for _ in range(ITERATIONS):
            image, by, twice = self.flow(x, values, periods)
            d, dd = sign * by[:, :2], sign * twice[:, :2]
            apart = sign * image - x
            apart[0] = math.remainder(apart[0], 2 * math.pi)
            test = 1 - m * np.trace(d) + np.linalg.det(d)
            matrix = np.zeros((3, 3))
            matrix[:2] = sign * by[:, columns] - np.eye(2, 3)
            matrix[2] = [
                -m * np.trace(dd[:, :, k])
                + dd[0, 0, k] * d[1, 1]
                + d[0, 0] * dd[1, 1, k]
                - dd[0, 1, k] * d[1, 0]
                - d[0, 1] * dd[1, 0, k]
                for k in columns
            ]
            step = np.linalg.solve(matrix, [*apart, test])
            x, values[varied] = x - step[:2], values[varied] - step[2]
        return float(values[varied])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20, help="pendulums drawn")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    say(machine(["pendmap", "heyoka"]))
    draw, flow = np.random.default_rng(asked.seed), Heyoka()
    names = list(RANGES)
    differences: dict[str, list[float]] = defaultdict(list)
    for k in range(asked.count):
        values = np.array([draw.uniform(*ends) for ends in RANGES.values()])
        values[3] *= k % 2
        varied, (n, w) = int(draw.integers(0, 3)), TYPES[k % len(TYPES)]
        model = pendmap.Pendulum(**dict(zip(names, values.tolist(), strict=True)))
        ranges = {names[varied]: RANGES[names[varied]]}
        result = pendmap.continuation(model, ranges, n=n, w=w)
        for event in records(result, **{key: f"event_{key}" for key in EVENT}):
            if event["kind"] in MULTIPLIERS:
                values[varied] = event["value"]
                exact = flow.refined(event, values, varied, MULTIPLIERS[event["kind"]])
                differences[event["kind"]].append(abs(exact - event["value"]))
        note(f"{k + 1} of {asked.count}")
    rows = [
        [kind, str(len(away)), f"{np.median(away):.1e}", f"{max(away):.1e}"]
        for kind, away in sorted(differences.items())
    ]
    say(table(["event", "number", "median difference from heyoka", "greatest"], rows))


if __name__ == "__main__":
    main()
