"""Intervals of the trajectory method: their coverage; errors against the Cramer-Rao bound.

Synthetic free decays over w0 5 to 7 rad/s, damping ratio .002 to .01, Coulomb friction .02 to .3
rad/s^2 and noise .05 to .5 degrees, 30 s at 100 Hz, released at rest between 2.9 and 3.05 rad.
Decays and the Cramer-Rao bound, the least variance of an unbiased estimate, are computed here,
independently of the fit: half swings from turn to turn, derivatives by finite differences.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import chain

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from benchmarks.peers.report import machine, note, say, table
from pendmap.identification.methods.trajectory import fit_together, identification_of, physical
from pendmap.records import Run

NAMES = ("w0", "c_over_m", "Tr", "offset")
HEADERS = ("parameter", "cover %", "95 % of that", "wanted", "rms / bound", "wanted", "median z^2")
SAMPLE, STEP, CHANGE = 0.01, 0.0025, 1e-5
TIMES = np.arange(3000) * SAMPLE
BATCH = 50
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """A decay: its truth and its noise."""

    truth: Array  # w0, c_over_m, Tr, offset, theta0, v0
    sigma: float
    seed: int


def drawn(seed: int, index: int) -> Case:
    """Draw a decay."""
    rng = np.random.default_rng([seed, index])
    w0, zeta = rng.uniform(5, 7), rng.uniform(0.002, 0.01)
    friction, degrees = rng.uniform(0.02, 0.3), rng.uniform(0.05, 0.5)
    offset, theta = math.radians(rng.uniform(-0.1, 0.1)), rng.uniform(2.9, 3.05)
    truth = np.array([w0, 2 * zeta * w0, friction, offset, theta, 0.0])
    return Case(truth, math.radians(degrees), int(rng.integers(2**31)))


def decays(truths: Array) -> Array:
    """Return the readings without noise, a row for each row of parameters.

    The method is classic Runge-Kutta in steps of 2.5 ms, each row at its own time: a step ends at
    the turn wherever the velocity passes zero, and the state is constant once friction holds it.
    Errors are about 1e-9.
    """
    w0, c_over_m, friction, offset, theta, velocity = (column.copy() for column in truths.T)
    now = np.zeros(len(truths))
    angles = np.full((len(truths), len(TIMES)), np.nan)
    sense = np.where(velocity != 0, np.sign(velocity), -np.sign(np.sin(theta)))
    moving = np.ones(len(truths), bool)
    due = np.zeros(len(truths), int)

    def slope(angle: Array, speed: Array) -> Array:
        pulled: Array = -c_over_m * speed - w0**2 * np.sin(angle) - sense * friction
        return pulled

    while np.any(moving):
        a = [velocity, slope(theta, velocity)]
        b = [velocity + STEP / 2 * a[1], slope(theta + STEP / 2 * a[0], velocity + STEP / 2 * a[1])]
        c = [velocity + STEP / 2 * b[1], slope(theta + STEP / 2 * b[0], velocity + STEP / 2 * b[1])]
        d = [velocity + STEP * c[1], slope(theta + STEP * c[0], velocity + STEP * c[1])]
        end = [
            before + STEP / 6 * (p + 2 * q + 2 * r + s)
            for before, p, q, r, s in zip((theta, velocity), a, b, c, d, strict=True)
        ]
        turned = moving & (end[1] * sense < 0)
        last = slope(end[0], end[1])
        part = np.ones(len(truths))
        for k in np.flatnonzero(turned):
            part[k] = first_zero(velocity[k], end[1][k], STEP * a[1][k], STEP * last[k])
        there = (due * SAMPLE - now) / STEP
        within = moving & (there <= part) & (due < len(TIMES))
        reached = hermite(there, theta, end[0], STEP * velocity, STEP * end[1])
        angles[within, due[within]] = reached[within]
        due += within
        at_turn = hermite(part, theta, end[0], STEP * velocity, STEP * end[1])
        now = now + part * STEP
        theta = np.where(turned, at_turn, end[0])
        velocity = np.where(turned, 0.0, end[1])
        pull = -(w0**2) * np.sin(theta)
        stuck = turned & (np.abs(pull) <= friction)
        for k in np.flatnonzero(stuck):
            angles[k, due[k] :] = theta[k]
        sense = np.where(turned, np.sign(pull), sense)
        moving &= ~stuck & (due < len(TIMES))
    return angles + offset[:, None]


def hermite(x: Array, a: Array, b: Array, slope_a: Array, slope_b: Array) -> Array:
    """Return the cubic Hermite interpolant between two points; slopes are those of a step."""
    return (
        a * (1 + 2 * x) * (1 - x) ** 2
        + slope_a * x * (1 - x) ** 2
        + b * x**2 * (3 - 2 * x)
        + slope_b * x**2 * (x - 1)
    )


def first_zero(a: float, b: float, slope_a: float, slope_b: float) -> float:
    """Return the first zero of the cubic of the velocity."""
    # A start at a turn is itself a zero.
    least = 1e-9 if a == 0 else 0.0
    return float(brentq(hermite, least, 1.0, args=(a, b, slope_a, slope_b), xtol=1e-13))


def prepared(request: tuple[int, int, int]) -> list[tuple[Case, Array, Array]]:
    """Return decays ``first`` to ``last`` of a seed, their readings and their bounds."""
    seed, first, last = request
    cases = [drawn(seed, index) for index in range(first, last)]
    # From rest the motion has one direction only: there both differences are taken to that side.
    steps = [np.diag([0.0] * 6), np.diag([1, 1, 1, 1, 1, -1]), np.diag([-1, -1, -1, -1, -1, -2])]
    variants = [case.truth + CHANGE * row for case in cases for rows in steps for row in rows]
    curves = decays(np.array(variants)).reshape(len(cases), 3, 6, len(TIMES))
    out = []
    for case, (middle, up, down) in zip(cases, curves, strict=True):
        jacobian = (up - down) / (2 * CHANGE)
        jacobian[5] = (3 * middle[5] - 4 * up[5] + down[5]) / (2 * CHANGE)
        information = jacobian @ jacobian.T / case.sigma**2
        noise = np.random.default_rng(case.seed).normal(0.0, case.sigma, TIMES.shape)
        out.append((case, middle[0] + noise, np.sqrt(np.diag(np.linalg.inv(information)))))
    return out


def binomial(share: float, count: int) -> str:
    """Return the 95 % interval of a share (Wilson)."""
    z = 1.96
    centre = (share + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z / (1 + z**2 / count) * math.sqrt(share * (1 - share) / count + (z / (2 * count)) ** 2)
    return f"{100 * (centre - half):.1f} to {100 * (centre + half):.1f}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000, help="decays")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    say(f"Intervals of the trajectory method, {given.count} decays, seed {given.seed}")
    say(machine(("pendmap", "numpy", "scipy")))
    firsts = range(0, given.count, BATCH)
    requests = [(given.seed, k, min(k + BATCH, given.count)) for k in firsts]
    errors, inside, taken, odd = [], [], [], []
    with ProcessPoolExecutor() as pool:
        batches = chain.from_iterable(pool.map(prepared, requests))
        for k, (case, readings, limit) in enumerate(batches):
            start = time.perf_counter()
            run = Run("", "", "free", TIMES, readings, np.ones(TIMES.size, bool))
            found = identification_of(physical(fit_together([run])))
            taken.append(time.perf_counter() - start)
            values = np.array([found[name] for name in NAMES])
            ends = [found.estimates[name].ci95 or (math.nan, math.nan) for name in NAMES]
            truth = case.truth[: len(NAMES)]
            errors.append((values - truth) / limit[: len(NAMES)])
            inside.append([a <= t <= b for (a, b), t in zip(ends, truth, strict=True)])
            if found.warnings or np.abs(errors[-1]).max() > 5:  # noqa: PLR2004 (bounds)
                odd.append(f"{k}: {errors[-1].round(1)} {'; '.join(found.warnings)}")
            if k % 100 == 99:  # noqa: PLR2004
                note(f"{k + 1} decays")
    scaled, covered = np.array(errors), np.array(inside)
    rows = []
    for k, name in enumerate(NAMES):
        share = float(np.mean(covered[:, k]))
        rms = float(np.sqrt(np.mean(scaled[:, k] ** 2)))
        median = float(np.median(scaled[:, k] ** 2)) / 0.4549
        rows.append(
            (
                name,
                f"{100 * share:.1f}",
                binomial(share, given.count),
                "93 to 97",
                f"{rms:.3f}",
                "< 1.2",
                f"{median:.3f}",
            )
        )
    say(table(HEADERS, rows))
    say(
        f"seconds for one decay with intervals: median {statistics.median(taken):.3f}, most "
        f"{max(taken):.3f} (wanted: below 0.3)"
    )
    for line in odd:
        note(line)


if __name__ == "__main__":
    main()
