"""Clean synthetic records, and functions that write them to files."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.integrate import solve_ivp

import pendmap

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

W0, C, TR = 6.2, 0.05, 0.06
COUNT = 2 * math.pi / 4096


@functools.cache
def motion(
    start: float = 1.2,
    velocity: float = 0.0,
    duration: float = 20.0,
    rate: float = 100.0,
    drive: tuple[float, float, float] = (0.0, 1.0, 0.0),
) -> tuple[Floats, Floats, Floats]:
    """Return time, angle and velocity of a pendulum with viscous and (nearly) Coulomb friction."""
    p, omega, phi = drive
    time = np.arange(round(duration * rate) + 1) / rate

    def slope(t: float, y: Sequence[float]) -> tuple[float, float]:
        gravity = W0**2 * (1 + p * math.cos(omega * t + phi)) * math.sin(y[0])
        return y[1], -C * y[1] - gravity - TR * math.tanh(y[1] / 0.01)

    found = solve_ivp(
        slope, (0.0, duration), (start, velocity), t_eval=time, rtol=1e-8, atol=1e-9, max_step=0.05
    )
    theta, speed = found.y
    for part in (time, theta, speed):
        part.flags.writeable = False
    return time, theta, speed


def noisy(theta: Floats, noise: float = 0.001, count: float = COUNT, seed: int = 1) -> Floats:
    """Return readings with noise, rounded to counts."""
    read = theta + noise * np.random.default_rng(seed).standard_normal(theta.size)
    return count * np.round(read / count) if count else read


def text(columns: Sequence[Floats], names: str = "t_s,theta_rad", form: str = "%.6f") -> str:
    """Return the text of a CSV file."""
    rows = [",".join(form % value for value in row) for row in np.column_stack(columns)]
    return "\n".join([*([names] if names else []), *rows]) + "\n"


def clean(**given: Any) -> tuple[Floats, Floats]:  # noqa: ANN401 (those of motion)
    """Return a record without flaws: time and readings, both writeable."""
    time, theta, _ = motion(**given)
    return time.copy(), noisy(theta)


def read(folder: Path, content: str | bytes, name: str = "record.csv") -> pendmap.Run:
    """Write a file, read it, and return its run."""
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    (run,) = pendmap.read_experiment(path).runs
    return run


def found(run: pendmap.Run) -> dict[str, pendmap.Finding]:
    """Return the findings of a run by key."""
    return {finding.what: finding for finding in run.findings}


def experiment(folder: Path, description: str, **files: str) -> pendmap.Experiment:
    """Write an experiment and read it."""
    (folder / "experiment.toml").write_text(description, encoding="utf-8")
    for name, content in files.items():
        (folder / f"{name}.csv").write_text(content, encoding="utf-8")
    return pendmap.read_experiment(folder)


def words(given: dict[str, Any]) -> list[str]:
    """Return keywords of reading as options of the command line."""
    names = {"rate_hz": "rate", "from_s": "from", "to_s": "to"}
    pairs = [(names.get(k, k.replace("_", "-")), str(v)) for k, v in given.items()]
    return [word for name, value in pairs for word in (f"--{name}", value)]
