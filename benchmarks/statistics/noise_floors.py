"""Noise floors of records, seen without a model, over the errors that such readings have.

Free decays into rest, rotations kept up by a torque, and rest, 60 s each, read by sensors of 128 to
8192 counts at 30 to 1000 Hz with Gaussian noise (degrees) before the rounding. Motions are scipy's
(DOP853, rtol 1e-10). "over" is the median over the seeds of what `noise_of` says over what such a
reading errs by, sqrt(noise^2 + count^2 / 12); "farthest" is that of the record farthest off.
At rest a sensor whose noise does not reach the next count shows one alone: its noise is not seen.
"""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from benchmarks.peers.report import machine, note, say, table
from pendmap.records.noise import noise_of

if TYPE_CHECKING:
    from collections.abc import Callable

COUNTS = (128, 256, 512, 1024, 2048, 4096, 8192)
RATES = (30.0, 100.0, 300.0, 1000.0)
NOISE = (0.0, 0.05, 0.1, 0.3)
SECONDS, W0, FRICTION = 60.0, 6.3, 0.4
WANTED = 0.05
HEADERS = ("motion", "Hz", "counts", "noise", "over", "farthest", "stated +-", "said")
Array = NDArray[np.float64]


def free_decay() -> Callable[[Array], Array]:
    """Return a free decay from 2 rad, half swing by half swing, until friction holds it."""
    ends, parts, begin, angle = [0.0], [], 0.0, 2.0
    while begin < SECONDS and W0**2 * abs(math.sin(angle)) > FRICTION:
        way = -math.copysign(1.0, math.sin(angle))

        def rate(_: float, y: Array, way: float = way) -> list[float]:
            return [y[1], -0.1 * y[1] - W0**2 * math.sin(y[0]) - way * FRICTION]

        def turn(t: float, y: Array, way: float = way, begin: float = begin) -> float:
            return float(y[1] * way) if t > begin + 1e-3 else 1.0

        turn.terminal = True  # type: ignore[attr-defined]
        made = solve_ivp(
            rate, (begin, begin + 5), [angle, 0.0], method="DOP853", rtol=1e-10, atol=1e-12,
            events=turn, dense_output=True,
        )  # fmt: skip
        parts.append(made.sol)
        begin, angle = float(made.t[-1]), float(made.y[0, -1])
        ends.append(begin)
    rest = angle

    def at(time: Array) -> Array:
        theta = np.full(time.shape, rest)
        for a, b, part in zip(ends[:-1], ends[1:], parts, strict=True):
            own = (time >= a) & (time < b)
            if own.any():
                theta[own] = part(time[own])[0]
        return theta

    return at


def rotation() -> Callable[[Array], Array]:
    """Return a rotation sustained by a steady torque, about 15 rad/s."""

    def rate(_: float, y: Array) -> list[float]:
        return [y[1], 1.5 - 0.1 * y[1] - W0**2 * math.sin(y[0])]

    made = solve_ivp(
        rate, (0, SECONDS), [0.0, 19.0], method="DOP853", rtol=1e-10, atol=1e-12,
        dense_output=True,
    )  # fmt: skip
    return lambda time: np.asarray(made.sol(time)[0])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=8, help="records of each kind (8)")
    parser.add_argument("--rates", type=float, nargs="+", default=RATES, help="Hz")
    parser.add_argument("--all", action="store_true", help="all rows, not those beyond 5 % alone")
    given = parser.parse_args()
    motions = {
        "free decay": free_decay(),
        "rotation": rotation(),
        "rest": lambda time: np.full(time.shape, 0.3),
    }
    rows, within = [], dict.fromkeys(motions, 0)
    for rate in given.rates:
        time = np.arange(round(SECONDS * rate)) / rate
        for name, motion in motions.items():
            theta = motion(time)
            for counts in COUNTS:
                for noise in NOISE:
                    row, off = measured(time, theta, counts, noise, given.seeds)
                    within[name] += off <= WANTED
                    if off > WANTED or given.all:
                        rows.append([name, f"{rate:g}", str(counts), f"{noise:g}", *row])
        note(f"{rate:g} Hz done")
    total = len(given.rates) * len(COUNTS) * len(NOISE)
    say(machine(("numpy", "scipy")))
    say(table(HEADERS, rows))
    for name, number in within.items():
        say(f"{name}: {number} of {total} within {100 * WANTED:.0f} %")


def measured(
    time: Array, theta: Array, counts: int, noise: float, seeds: int
) -> tuple[list[str], float]:
    """Return the columns of a row, and the deviation of the median; noise in degrees."""
    count = math.tau / counts
    ratios, errors, said = [], [], ""
    for seed in range(seeds):
        rng = np.random.default_rng([seed, counts])
        place = count * rng.random()
        moved = theta + math.radians(noise) * rng.standard_normal(time.size)
        read = count * np.round((moved + place) / count) - place
        floor = noise_of(time, read, count=count)
        ratios.append(floor.sigma / math.hypot(math.radians(noise), count / math.sqrt(12)))
        errors.append(floor.stderr / floor.sigma)
        said = "count" if floor.limited_by_count else "bound" if floor.bound else ""
    over = float(np.median(ratios))
    farthest = max(ratios, key=lambda r: abs(math.log(r)))
    row = [f"{over:.3f}", f"{farthest:.3f}", f"{float(np.median(errors)):.3f}", said]
    return row, abs(over - 1)


if __name__ == "__main__":
    main()
