"""The pivot's recorded motion: sign, scale, and quantised positions."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
from pendmap.records.summary import as_text
from recorded import COUNT, experiment, found, text

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from conftest import Run as Command

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


def described(tmp_path: Path, columns: Sequence[Floats], pivot: str) -> pendmap.Run:
    readings = COUNT * np.round(THETA / COUNT)
    names = ",".join(["t_s", "theta_rad", *("cart", "lift")[: len(columns)]])
    content = text((TIME, readings, *columns), names, "%.9g")
    (run,) = experiment(tmp_path, f"{RUN}pivot = {{ {pivot} }}\n", run=content).runs
    return run


@pytest.mark.parametrize("step", [1e-4, 1e-3, 2e-3])
def test_quantised_positions_give_the_pivot_s_acceleration(tmp_path: Path, step: float) -> None:
    run = described(
        tmp_path, [step * np.round(place(TIME) / step)], 'horizontal = "cart", unit = "m"'
    )
    assert run.pivot is not None
    assert run.pivot_unit == "m/s2"
    assert found(run)["pivot-smoothed"].mended
    assert "m/s2" in as_text(pendmap.read_experiment(tmp_path))
    push = run.pivot["horizontal"]
    again = swung(lambda t: float(np.interp(t, run.time, push)))
    size = float(np.sqrt(np.mean(THETA**2)))
    assert float(np.sqrt(np.mean((again - THETA) ** 2))) < 0.03 * size
    assert np.abs(push).max() < 2 * np.abs(pushed(TIME)).max()


def test_quantised_velocities_give_the_pivot_s_acceleration(tmp_path: Path) -> None:
    speed = np.gradient(place(TIME), TIME)
    run = described(tmp_path, [0.01 * np.round(speed / 0.01)], 'horizontal = "cart", unit = "m/s"')
    assert run.pivot is not None
    assert run.pivot_unit == "m/s2"
    assert np.abs(run.pivot["horizontal"] - pushed(TIME)).mean() < 0.1 * np.abs(pushed(TIME)).mean()


def test_positions_without_steps_are_unchanged(tmp_path: Path) -> None:
    run = described(tmp_path, [place(TIME)], 'horizontal = "cart", unit = "m"')
    assert run.pivot is not None
    assert run.pivot_unit == "m"
    np.testing.assert_allclose(run.pivot["horizontal"], place(TIME), atol=1e-8)


def test_a_sign_and_a_scale_turn_raw_columns_into_the_pivot(tmp_path: Path) -> None:
    raw = -pushed(TIME) / 0.0098
    run = described(tmp_path, [raw], 'horizontal = "cart", sign = -1, scale = 0.0098')
    assert run.pivot is not None
    np.testing.assert_allclose(run.pivot["horizontal"], pushed(TIME), atol=1e-6)


@pytest.mark.parametrize(
    ("key", "says"),
    [
        ("sign = 2", "sign must be 1 or -1, got 2"),
        ("scale = 0", "scale must be .*, got 0"),
    ],
)
def test_another_sign_or_scale_is_refused(tmp_path: Path, key: str, says: str) -> None:
    with pytest.raises(pendmap.InputError, match=says):
        described(tmp_path, [place(TIME)], f'horizontal = "cart", {key}')


def test_a_run_with_quantised_positions_is_compared(
    pendmap_command: Command, tmp_path: Path
) -> None:
    time = np.arange(12_000) / 1000
    noise = 5e-4 * np.random.default_rng(1).standard_normal(time.size)
    cart = 1e-3 * np.round(place(time) / 1e-3)
    content = text((time, np.interp(time, TIME, THETA) + noise, cart), "t_s,theta_rad,cart", "%.9g")
    experiment(tmp_path, f'{RUN}pivot = {{ horizontal = "cart", unit = "m" }}\n', run=content)
    (tmp_path / "model.toml").write_text("[pendulum]\nw0 = 5.0\nc_over_m = 0.05\n")
    run = pendmap_command("compare", "model.toml", ".", "--members", 20, "--json")
    assert run.returncode == 0, run.stderr
    (one,) = json.loads(run.stdout)["runs"]
    assert one["rms"] < 1.3 * 5e-4
