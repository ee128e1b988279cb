"""Events of ``pendmap continue`` under dry friction, bracketed by runs of scipy.

With ``--planes``, points of its curves of these events over two parameters, drawn at random. At
such a point the branch is followed along the first parameter alone, and its event must be there.

Pendulums and parameters that vary are drawn at random. Beside every event, at the parameter plus
and minus 1e-6, the orbit of the branch is sought by Newton's method on a map of scipy (DOP853).
Events that are alone within twice that distance on their branch are taken. One is bracketed if
both runs say what they must: beyond a fold no orbit, before it two; at a doubling or symmetry
breaking multipliers on both sides of the critical one; at an onset of sticking or a grazing another
sequence of slips and sticks; beyond the boundary of rest an angle that friction holds.
"""

from __future__ import annotations

import argparse
import itertools
import math
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp  # type: ignore[import-untyped]
from scipy.optimize import brentq, minimize_scalar  # type: ignore[import-untyped]

import pendmap
from benchmarks.peers.report import machine, note, say, table
from pendmap.analysis.result import records

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr

Floats = NDArray[np.float64]
RANGES = {
    "p": (0.1, 1.8),
    "omega": (1.1, 2.8),
    "gamma": (0.05, 0.3),
    "torque": (0.0, 0.3),
    "theta_r": (0.02, 0.4),
}
TYPES = ((2, 0), (1, 0), (1, 1), (2, 1), (4, 0))
PLANES = (("p", "omega"), ("p", "theta_r"), ("p", "torque"), ("omega", "gamma"))
PART = 0.25  # Of the range of a parameter that a plane has
AROUND = 1e-4
ON = 1e-9
BESIDE = 1e-6
EVENT = ("kind", "value", "theta", "velocity", "n", "w", "branch", "orbit")
CRITICAL = {"period_doubling": -1, "symmetry_breaking": 1}
SHORT = 1e-13
TINY = 1e-300
SAMPLES = 60
SETTLED = 1e-10
FAR = 0.1
STILL = 1e-9
NEAR = 40


def first_turn(solution: Any, sense: float, start: float, end: float) -> tuple[float, bool]:  # noqa: ANN401
    """Return when a velocity of this sense first passes 0, also for a moment, or the end."""

    def speed(t: float) -> float:
        return float(sense * solution(t)[1])

    times = np.linspace(start, end, 2 + int(SAMPLES * (end - start)))
    values = sense * solution(times)[1]
    for k in range(1, times.size):
        low, high = times[k - 1], times[k]
        if values[k] > 0 and k + 1 < times.size and values[k] < min(values[k - 1], values[k + 1]):
            # A minimum: it may be below 0 between the samples.
            ends = (low, times[k + 1])
            least = minimize_scalar(speed, bounds=ends, method="bounded", options={"xatol": 1e-9})
            high = least.x if least.fun < 0 else high
        if speed(high) < 0 and k > 1:
            return float(brentq(speed, low, high, xtol=1e-15)), True
        if speed(high) < 0:
            # From rest the velocity has its sense at first.
            near = start + 1e-6 * (high - start)
            return float(brentq(speed, near, high, xtol=1e-15)), True
    return end, False


class Motion:
    """The pendulum with values of p, omega, gamma, torque and theta_r."""

    def __init__(self, values: Floats) -> None:
        """Keep the values."""
        self.p, self.omega, self.gamma, self.torque, self.friction = values

    def load(self, tau: float, theta: float) -> float:
        """Return the acceleration without the friction at rest."""
        return self.torque - (1 + self.p * math.cos(self.omega * tau)) * math.sin(theta)

    def release(self, tau: float, theta: float, until: float) -> float:
        """Return the time from which friction no longer holds the pendulum, at most `until`."""
        times = np.linspace(tau, until, 400)

        def over(t: float) -> float:
            return abs(self.load(t, theta)) - self.friction

        for a, b in itertools.pairwise(times):
            if over(a) <= 0 < over(b):
                return float(brentq(over, a, b, xtol=1e-14))
        return until

    def flow(self, x: Floats) -> tuple[Floats, str]:
        """Return the state a period later, and the phases in turn."""
        tau, end, phases = 0.0, 2 * math.pi / self.omega, ""
        theta, velocity = x
        while end - tau > SHORT:
            if velocity == 0 and abs(self.load(tau, theta)) <= self.friction:
                phases += "0"
                tau = self.release(tau, theta, end)
                if tau >= end:
                    break
            sense = math.copysign(1, velocity if velocity != 0 else self.load(tau, theta))
            phases += "+" if sense > 0 else "-"

            def rates(t: float, y: Floats, sense: float = sense) -> list[float]:
                return [y[1], self.load(t, y[0]) - self.gamma * y[1] - sense * self.friction]

            start = [theta, velocity if velocity != 0 else sense * TINY]
            at: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-14, "dense_output": True}
            run = solve_ivp(rates, (tau, end), start, "DOP853", **at)
            tau, turns = first_turn(run.sol, sense, tau, end)
            theta, velocity = run.sol(tau)
            if turns:
                velocity = 0.0
        return np.array([theta, velocity]), phases

    def slope(self, x: Floats) -> Floats:
        """Return the derivative of a period by differences; from rest none by the velocity."""
        step = 1e-6
        sides = step * np.eye(2)[: 1 if x[1] == 0 else 2]
        columns = [(self.flow(x + e)[0] - self.flow(x - e)[0]) / (2 * step) for e in sides]
        return np.array([*columns, *np.zeros((2 - len(columns), 2))]).T

    def orbit(self, points: Floats) -> Floats | None:
        """Return the points of an orbit near some, one a period, by Newton's method."""
        points, n = points.copy(), len(points)
        for _ in range(12):
            ends = np.array([self.flow(x)[0] for x in points])
            gap = ends - np.roll(points, -1, axis=0)
            gap[:, 0] = np.remainder(gap[:, 0] + math.pi, 2 * math.pi) - math.pi
            if np.abs(gap).max() < SETTLED:
                return points
            by = np.zeros((n, 2, n, 2))
            for k, x in enumerate(points):
                by[k, :, k] += self.slope(x)
                by[k, :, (k + 1) % n] -= np.eye(2)
            step = np.linalg.solve(by.reshape(2 * n, 2 * n), gap.ravel()).reshape(n, 2)
            if np.abs(step).max() > FAR:
                return None
            points = points - step
            points[np.abs(points[:, 1]) < STILL, 1] = 0.0
        return None

    def test(self, points: Floats, m: int) -> float:
        """Return ``det(DP^n - m)`` of an orbit."""
        whole = np.linalg.multi_dot([np.eye(2), *(self.slope(x) for x in points[::-1])])
        return float(np.linalg.det(whole - m * np.eye(2)))

    def phases(self, points: Floats) -> tuple[int, int]:
        """Return the numbers of slips and of sticks around an orbit."""
        text = "".join(self.flow(x)[1] for x in points)
        joined = text[:1] + "".join(b for a, b in itertools.pairwise(text) if a != b)
        joined = joined[:-1] if len(joined) > 1 and joined[0] == joined[-1] else joined
        return len(joined) - joined.count("0"), joined.count("0")

    def excess(self, theta: float) -> float:
        """Return the load over the friction at its greatest, where it is equal in both senses."""

        def loads(x: float) -> list[float]:
            return [self.torque - part * math.sin(x) for part in (1 - self.p, 1 + self.p)]

        angle = brentq(
            lambda x: max(loads(x)) + min(loads(x)), theta - FAR, theta + FAR, xtol=1e-14
        )
        return max(loads(angle)) - self.friction


def around(data: xr.Dataset, event: dict[str, Any]) -> tuple[Floats, Floats, int]:
    """Return the points of the orbits of an event's branch, their values, and its place."""
    mine = np.flatnonzero(data["orbit_branch"].values == event["branch"])
    points = np.stack([data["point_theta"].values, data["point_velocity"].values], axis=-1)
    first, n = np.searchsorted(data["point_orbit"].values, mine), int(event["n"])
    x = np.array([points[k : k + n] for k in first])
    x[:, :, 0] = np.unwrap(x[:, :, 0], axis=0)
    at = data["orbit_value"].values[mine]
    place = int(np.flatnonzero(mine == event["orbit"])[0])
    return x, at, place


def beside(x: Floats, at: Floats, place: int, value: float) -> list[Floats]:
    """Return the points of orbits with a value of the parameter, the nearest to a place first."""
    pairs = [k for k in range(at.size - 1) if min(at[k : k + 2]) <= value < max(at[k : k + 2])]
    parts = [(value - at[k]) / (at[k + 1] - at[k]) for k in pairs]
    orbits = [x[k] + part * (x[k + 1] - x[k]) for k, part in zip(pairs, parts, strict=True)]
    return sorted(orbits, key=lambda one: float(np.abs(one - x[place]).max()))


def bracketed(data: xr.Dataset, event: dict[str, Any], values: Floats, varied: int) -> bool:
    """Return whether runs on both sides of an event say what they must."""
    kind = event["kind"]
    x, at, place = around(data, event)
    sides = []
    for by in (-BESIDE, BESIDE):
        moved = values.copy()
        moved[varied] = event["value"] + by
        motion = Motion(moved)
        near = beside(x, at, place, moved[varied])[:2]
        orbits = [motion.orbit(one) for one in near]
        sides.append((motion, [one for one in orbits if one is not None]))
    if kind == "rest_boundary":
        excess = [motion.excess(event["theta"]) for motion, _ in sides]
        return excess[0] * excess[1] < 0
    if kind == "fold":
        (empty, none), (motion, both) = sorted(sides, key=lambda side: len(side[1]))
        if none or len(both) != 2:  # noqa: PLR2004 (a fold joins two)
            return False
        test = [motion.test(x, 1) for x in both]
        return test[0] * test[1] < 0 and empty.orbit(0.5 * (both[0] + both[1])) is None
    if all(orbits for _, orbits in sides):
        one, other = ((motion, orbits[0]) for motion, orbits in sides)
    else:
        # Where the branch turns back both of its sides are on one of the parameter.
        (_, none), (motion, both) = sorted(sides, key=lambda side: len(side[1]))
        if none or len(both) != 2:  # noqa: PLR2004
            return False
        one, other = ((motion, orbit) for orbit in both)
    if kind in {"period_doubling", "symmetry_breaking"}:
        return one[0].test(one[1], CRITICAL[kind]) * other[0].test(other[1], CRITICAL[kind]) < 0
    return one[0].phases(one[1]) != other[0].phases(other[1])


def is_alone(event: dict[str, Any], places: list[tuple[int, float]]) -> bool:
    """Return whether no other event and no end of the branch lies beside an event."""
    mine = [abs(value - event["value"]) for branch, value in places if branch == event["branch"]]
    return all(away == 0 or away > 2 * BESIDE for away in mine)


def along(
    values: Floats, varied: int, ends: tuple[float, float], sought: tuple[int, int, int]
) -> tuple[xr.Dataset, list[dict[str, Any]]]:
    """Return branches of orbits (n, w, longest) along a parameter, and events that are alone."""
    model = pendmap.Pendulum(**dict(zip(RANGES, values.tolist(), strict=True)))
    n, w, longest = sought
    result = pendmap.continuation(model, {list(RANGES)[varied]: ends}, n, w, longest=longest)
    events = records(result, **{key: f"event_{key}" for key in EVENT})
    places = [(one["branch"], one["value"]) for one in events]
    for end in ("branch_first", "branch_last"):
        places += list(enumerate(result[end].values.tolist()))
    return result, [one for one in events if is_alone(one, places)]


def on_branches(draw: np.random.Generator, k: int) -> Iterator[tuple[str, bool, str]]:
    """Yield events on the branches of a pendulum: what happens, whether bracketed, where."""
    values = np.array([draw.uniform(*ends) for ends in RANGES.values()])
    values[3] *= k % 2
    varied, (n, w) = int(draw.integers(0, 5)), TYPES[k % len(TYPES)]
    ends = list(RANGES.values())[varied]
    result, alone = along(values, varied, ends, (n, w, 2 * n))
    draw.shuffle(alone)
    for event in alone[:3]:
        ok = bracketed(result, event, values, varied)
        yield event["kind"], ok, f"{values.tolist()} {varied} {event}"


def on_curves(draw: np.random.Generator, k: int) -> Iterator[tuple[str, bool, str]]:
    """Yield points of curves in a plane: what happens, whether bracketed, where."""
    values = np.array([draw.uniform(*ends) for ends in RANGES.values()])
    over, names = PLANES[k % len(PLANES)], list(RANGES)
    ranges = {}
    for name in over:
        (low, high), part = RANGES[name], draw.uniform(0, 1 - PART)
        ranges[name] = low + part * (high - low), low + (part + PART) * (high - low)
    values[3] *= k // len(PLANES) % 2
    model = pendmap.Pendulum(**dict(zip(names, values.tolist(), strict=True)))
    plane = pendmap.continuation(model, ranges, up_to=2)
    kinds = plane["curve_kind"].values[plane["place_curve"].values]
    fit = [np.isin(kinds, ("stick_onset", "grazing", "rest_boundary"))]
    for name, (low, high) in ranges.items():
        at = plane[f"place_{name}"].values
        fit.append((low + AROUND < at) & (at < high - AROUND))
        # Beside a kink another change is too near.
        fit.append(np.abs(np.diff(at, prepend=np.inf)) > AROUND)
    places = np.flatnonzero(np.all(fit, axis=0))
    for place in draw.permutation(places)[:3]:
        for name in over:
            values[names.index(name)] = plane[f"place_{name}"].values[place]
        curve, varied = int(plane["place_curve"].values[place]), names.index(over[0])
        n, w = (int(plane[f"curve_{key}"].values[curve]) for key in ("n", "w"))
        here, text = values[varied], f"{values.tolist()} {varied} {n}:{w}"
        if kinds[place] == "rest_boundary":
            theta = float(plane["place_theta"].values[place])
            excess = []
            for by in (-BESIDE, BESIDE):
                values[varied] = here + by
                excess.append(Motion(values).excess(theta))
            yield kinds[place], excess[0] * excess[1] < 0, text
            continue
        ends = (here - AROUND, here + AROUND)
        result, alone = along(values, varied, ends, (n, w, n))
        near = [one for one in alone if abs(one["value"] - here) < ON]
        same = [one for one in near if one["kind"] == kinds[place]]
        ok = bool(same) and bracketed(result, same[0], values, varied)
        yield kinds[place], ok, f"{text} {near}"


def main() -> None:
    """Print how many events are bracketed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=50, help="events")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--planes", action="store_true", help="points of curves over two")
    asked = parser.parse_args()
    say(machine(["pendmap", "scipy"]))
    draw = np.random.default_rng(asked.seed)
    right: Counter[str] = Counter()
    every: Counter[str] = Counter()
    for k in itertools.count():
        if every.total() >= asked.count:
            break
        for kind, ok, where in (on_curves if asked.planes else on_branches)(draw, k):
            every[kind] += 1
            right[kind] += ok
            if not ok:
                say(f"not bracketed: {list(RANGES)} {where}")
        note(f"{every.total()} of {asked.count}")
    say(table(["event", "number", "bracketed"], [[x, str(every[x]), str(right[x])] for x in every]))


if __name__ == "__main__":
    main()
