"""The pivot's recorded motion: sign, scale, and quantised positions."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from recorded import COUNT, experiment, found, text

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    import pendmap

    Floats = NDArray[np.float64]

W0, C, GRAVITY = 5.0, 0.05, 9.81
RATE = 200.0
TIME = np.arange(round(12 * RATE)) / RATE


def place(time: Floats) -> Floats:
    """Return the position of a cart that moves 60 mm to the left and back in 1.5 s, then stops."""
    return -0.03 * (1 - np.cos(math.tau * np.clip(time - 0.5, 0.0, 1.5) / 1.5)) + 0.2


def pushed(time: Floats) -> Floats:
    """Return the acceleration of the cart, m/s^2."""
    inside = (time > 0.5) & (time < 2.0)
    return np.where(
        inside, -0.03 * (math.tau / 1.5) ** 2 * np.cos(math.tau * (time - 0.5) / 1.5), 0
    )


def swung(acceleration: Callable[[float], float]) -> Floats:
    """Return the angle, by scipy, of a pendulum at rest on the accelerated cart."""

    def slope(t: float, y: Sequence[float]) -> tuple[float, float]:
        push = acceleration(t) / GRAVITY * math.cos(y[0])
        return y[1], -C * y[1] - W0**2 * (math.sin(y[0]) + push)

    found = solve_ivp(slope, (0.0, 12.0), (0.0, 0.0), t_eval=TIME, rtol=1e-8, max_step=0.01)
    return np.asarray(found.y[0])


THETA = swung(lambda t: float(pushed(np.array([t]))[0]))
RUN = '[rig]\nw0 = 5.0\n[[run]]\nfile = "run.csv"\nkind = "forced"\n'


def described(tmp_path: Path, column: Floats, pivot: str) -> pendmap.Run:
    readings = COUNT * np.round(THETA / COUNT)
    content = text((TIME, readings, column), "t_s,theta_rad,cart", "%.9g")
    (run,) = experiment(tmp_path, f"{RUN}pivot = {{ {pivot} }}\n", run=content).runs
    return run


STEPS = [(step * np.round(place(TIME) / step), "m") for step in (1e-4, 1e-3, 2e-3)]
SPEED = 0.01 * np.round(np.gradient(place(TIME), TIME) / 0.01)


@pytest.mark.parametrize(("column", "unit"), [*STEPS, (SPEED, "m/s")])
def test_quantised_columns_give_the_pivot_s_acceleration(
    tmp_path: Path, column: Floats, unit: str
) -> None:
    run = described(tmp_path, column, f'horizontal = "cart", unit = "{unit}"')
    assert run.pivot is not None
    assert run.pivot_unit == "m/s2"
    assert found(run)["pivot-smoothed"].mended
    push = run.pivot["horizontal"]
    again = swung(lambda t: float(np.interp(t, run.time, push)))
    size = float(np.sqrt(np.mean(THETA**2)))
    assert float(np.sqrt(np.mean((again - THETA) ** 2))) < 0.03 * size
    assert np.abs(push).max() < 2 * np.abs(pushed(TIME)).max()


@pytest.mark.parametrize(
    ("raw", "pivot", "unit", "read"),
    [
        (place(TIME), 'unit = "m"', "m", place(TIME)),  # without steps it is unchanged
        (-pushed(TIME) / 0.0098, "sign = -1, scale = 0.0098", "m/s2", pushed(TIME)),
    ],
)
def test_other_columns_are_the_pivot_by_unit_sign_and_scale(
    tmp_path: Path, raw: Floats, pivot: str, unit: str, read: Floats
) -> None:
    run = described(tmp_path, raw, f'horizontal = "cart", {pivot}')
    assert run.pivot is not None
    assert run.pivot_unit == unit
    np.testing.assert_allclose(run.pivot["horizontal"], read, atol=1e-6)
