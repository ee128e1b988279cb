"""Small damping: motions have time to settle, and what is left is explained."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
from pendmap import Grid, Pendulum


@pytest.mark.parametrize("seed", range(3))
def test_nothing_stays_undecided_where_damping_is_small(seed: int) -> None:
    draw = np.random.default_rng(seed)
    gamma = float(np.exp(draw.uniform(math.log(0.002), math.log(0.02))))
    pendulum = Pendulum(gamma=gamma, p=draw.uniform(0.1, 0.5), omega=draw.uniform(1.5, 2.5))
    found = pendmap.basins(pendulum, Grid.square(8), check=False)
    assert found["undecided"].item() == 0.0
    bound = 400 / (gamma * pendulum.period)
    assert found.attrs["max_periods"] == math.ceil(max(bound, 4000))


def test_a_start_that_takes_long_ends_where_scipy_says() -> None:
    pendulum = Pendulum(gamma=0.01, p=0.6, omega=2.0)
    theta, velocity = 0.4, 0.9
    label = pendmap.basins_of(pendulum, [theta], [velocity], check=False)

    def slope(t: float, y: list[float]) -> list[float]:
        return [y[1], -0.01 * y[1] - (1 + 0.6 * math.cos(2 * t)) * math.sin(y[0])]

    # After the settling time the stroboscopic points are those of the attractor.
    end = (int(label["settle_periods"][0]) + 500) * math.pi
    run = solve_ivp(slope, (0, end), [theta, velocity], method="DOP853", rtol=1e-9, atol=1e-9)
    which = int(label["label"][0])
    own = label["point_attractor"].values == which
    points = np.stack([label["point_theta"].values[own], label["point_velocity"].values[own]])
    last = np.array([math.remainder(run.y[0, -1], math.tau), run.y[1, -1]])
    assert np.hypot(*(points - last[:, None])).min() < 1e-2


def test_a_bound_that_is_given_is_not_extended() -> None:
    pendulum = Pendulum(gamma=0.003, p=1.0, omega=2.0)
    found = pendmap.basins(pendulum, Grid.square(6), check=False, max_periods=100)
    assert found.attrs["max_periods"] == 100
    assert found["undecided"].item() > 0


def test_rotations_that_dry_friction_does_not_stop_are_explained() -> None:
    pendulum = Pendulum(gamma=0.0, theta_r=0.01, p=0.3, omega=2.0)
    found = pendmap.basins_of(pendulum, [0.0, 0.5], [2.0, 0.1], check=False, max_periods=500)
    assert list(found["label"].values > 0) == [False, True]
    assert "a rotation sustained by the drive approaches no attractor" in found.attrs["summary"]
