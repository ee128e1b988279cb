"""What an accelerometer on the rod reads of the decays of scipy, and its files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from decays import decay

if TYPE_CHECKING:
    from pathlib import Path

    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]

__all__ = ["GRAVITY", "TRUTH", "experiment", "readings"]

GRAVITY = 9.81
TRUTH = {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.08}


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
    """Write a folder with one run; ``column`` is what [columns] says of the acceleration."""
    folder.mkdir(exist_ok=True)
    table = np.stack(columns, axis=1)
    np.savetxt(folder / "run.csv", table, delimiter=",", header=names, comments="", fmt="%.10g")
    said = f"acceleration = {column}\n" if column else ""
    text = f'{more}[columns]\n{said}[[run]]\nfile = "run.csv"\n'
    (folder / "experiment.toml").write_text(text, encoding="utf-8")
    return folder
