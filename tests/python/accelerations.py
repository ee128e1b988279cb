"""Readings of an accelerometer on the rod, computed from decays integrated with scipy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from decays import decay

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]

GRAVITY = 9.81
TRUTH = {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.08}

PLACE = 'direction = "tangential", distance_m = %g'
# Parameters of a sensor for `readings`, and its entries in [columns]
SENSORS: dict[str, tuple[dict[str, Any], str]] = {
    "near": ({"distance": 0.1}, PLACE % 0.1),
    "far": ({"distance": 0.5}, PLACE % 0.5),
    "removed": ({"distance": 0.1, "gravity": 0.0}, PLACE % 0.1 + ", gravity_removed = true"),
    "angular": ({"direction": "angular", "noise": 0.2}, 'unit = "rad/s2"'),
}


def column(sensor: str) -> str:
    """Return the entry of [columns] that describes the acceleration."""
    return f'{{ name = "acc", {SENSORS[sensor][1]} }}'


def handled(
    sensor: str, releases: Sequence[tuple[float, float]], hold: float = 1.5
) -> tuple[Floats, Floats, list[tuple[float, float]]]:
    """Return times, readings, and the interval of free swing of each of several releases.

    The pendulum is carried to each angle (rad) in 1.5 s along a quintic, held there, and swings for
    the given number of seconds; a hand stops it at once.
    """
    given = {"gravity": GRAVITY, "noise": 0.02, "distance": 1.0, **SENSORS[sensor][0]}
    noise, gravity = given.pop("noise"), given["gravity"]
    parts, free, count, last = [], [], 0, 0.0
    s = np.arange(150) / 150
    for angle, seconds in releases:
        way = last + (angle - last) * (10 * s**3 - 15 * s**4 + 6 * s**5)
        hand = np.append(way, np.full(round(100 * hold), angle))
        bend = np.gradient(np.gradient(hand, 0.01), 0.01)
        felt = bend if sensor == "angular" else given["distance"] * bend + gravity * np.sin(hand)
        _, theta, swing = readings(**given, noise=0.0, release=angle, seconds=seconds)
        parts += [felt, swing[:-1]]
        count += hand.size
        free.append((count / 100, (count + swing.size - 1) / 100))
        count, last = count + swing.size - 1, float(theta[-1])
    drawn = np.random.default_rng(0).standard_normal(count)
    return np.arange(count) / 100, np.concatenate(parts) + noise * drawn, free


def readings(  # noqa: PLR0913 (the pendulum and the sensor)
    direction: str = "tangential",
    *,
    distance: float = 0.1,
    gravity: float = GRAVITY,
    release: float = 1.0,
    c_over_m: float = TRUTH["c_over_m"],
    friction: float = TRUTH["Tr"],
    bias: float = 0.0,
    tilt: float = 0.0,
    noise: float = 0.02,
    seconds: float = 40.0,
    rate: float = 100.0,
    seed: int = 0,
) -> tuple[Floats, Floats, Floats]:
    """Return times, the angle without noise, and the specific force with it (m/s^2 or rad/s^2)."""
    made = decay(TRUTH["w0"], c_over_m, friction, release)
    time = np.arange(round(seconds * rate) + 1) / rate
    theta = made.angle(time)
    moving = time < made.spline.x[-1]
    velocity = np.where(moving, made.spline(np.minimum(time, made.spline.x[-1]), 1), 0.0)
    sense = np.sign(velocity)
    pull = -c_over_m * velocity - TRUTH["w0"] ** 2 * np.sin(theta) - friction * sense
    pull = np.where(moving, pull, 0.0)
    across = distance * pull + gravity * np.sin(theta)
    along = distance * velocity**2 + gravity * np.cos(theta)
    force = {
        "tangential": np.cos(tilt) * across + np.sin(tilt) * along,
        "radial": np.cos(tilt) * along - np.sin(tilt) * across,
        "angular": pull,
    }[direction]
    drawn = np.random.default_rng(seed).standard_normal(time.size)
    return time, theta, force + bias + noise * drawn


def experiment(
    folder: Path, column: str, *columns: Floats, names: str = "t_s,acc", more: str = ""
) -> Path:
    """Write a folder with one run; ``column`` describes the acceleration in [columns]."""
    folder.mkdir(exist_ok=True)
    table = np.stack(columns, axis=1)
    np.savetxt(folder / "run.csv", table, delimiter=",", header=names, comments="", fmt="%.10g")
    said = f"acceleration = {column}\n" if column else ""
    text = f'{more}[columns]\n{said}[[run]]\nfile = "run.csv"\n'
    (folder / "experiment.toml").write_text(text, encoding="utf-8")
    return folder
