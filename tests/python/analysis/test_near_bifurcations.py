"""Near bifurcations and with small damping: slow attractors take their starts, and no others."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
from by_scipy import motion
from pendmap import Grid, Pendulum

GRID = Grid.square(14)


@pytest.mark.parametrize("seed", range(4))
def test_rest_near_its_saddle_node_keeps_its_starts(seed: int) -> None:
    draw = np.random.default_rng(seed)
    torque = (1 - 10 ** draw.uniform(-3.5, -1.5)) * (-1) ** seed
    p, gamma = (0.0, 0.01)[seed // 2], draw.uniform(0.4, 1.0)
    pendulum = Pendulum(gamma=gamma, p=p, omega=draw.uniform(1.5, 2.5), torque=torque)
    found = pendmap.basins(pendulum, GRID, check=False)
    theta, velocity = np.meshgrid(found["theta"].values, found["velocity"].values)
    angles = motion(pendulum, theta, velocity, [500, 700], tol=1e-7)[0]
    rotating = np.abs(angles[:, 1] - angles[:, 0]) > math.tau
    turns = found["id"].values[found["kind"].str.contains("rotation").values]
    assert 0 < rotating.sum() < rotating.size
    assert found["undecided"].item() == 0
    assert np.array_equal(np.isin(found["label"].values.ravel(), turns), rotating)


@pytest.mark.parametrize(("gamma", "torque"), [(1.1, 0.99995), (0.9, -0.96), (1.5, 1.0001)])
def test_a_rotation_that_nearly_stands_still_is_found(gamma: float, torque: float) -> None:
    found = pendmap.basins(Pendulum(gamma=gamma, p=0.0, torque=torque), GRID, check=False)
    assert "rotation" in found["kind"].values
    assert found["undecided"].item() == 0


def test_a_slow_attractor_is_waited_for() -> None:
    pendulum = Pendulum(gamma=0.1, p=1.25893, omega=2.0)
    found = pendmap.basins(pendulum, Grid.square(12), check=False)
    slowest = np.abs(found["exponent"].values).min()
    assert found["undecided"].item() == 0
    assert found.attrs["max_periods"] == math.ceil(200 / (slowest * pendulum.period))
    bounded = pendmap.basins(pendulum, Grid.square(12), check=False, max_periods=3000)
    assert bounded.attrs["max_periods"] == 3000
    assert bounded["undecided"].item() > 0.1


def test_a_bound_that_is_given_bounds_the_search() -> None:
    pendulum = Pendulum(gamma=1e-4, p=0.5, omega=2.0)
    found = pendmap.basins(pendulum, Grid.square(4), check=False, max_periods=1200)
    assert (found.attrs["max_periods"], found.attrs["chaos_bound"]) == (1200, 5 * 1200)
    assert found["undecided"].item() == 1.0
    usual = pendmap.basins(Pendulum(p=2.0), Grid.square(4), check=False, max_periods=10)
    assert usual.attrs["chaos_bound"] == 5000


def test_a_long_search_reports_its_progress() -> None:
    def progress(done: int, total: int) -> None:
        if 0 < done < total:
            raise StopIteration

    with pytest.raises(StopIteration):
        pendmap.basins(Pendulum(gamma=1e-4, p=0.3), Grid.square(4), progress=progress)


def held(pendulum: Pendulum, theta: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Return which starts friction stops in the end, by scipy and a friction of finite slope."""
    n = theta.size

    def slope(_: float, y: np.ndarray) -> np.ndarray:
        friction = pendulum.theta_r * np.tanh(y[n:] / 1e-5)
        return np.concatenate(
            [y[n:], pendulum.torque - pendulum.gamma * y[n:] - np.sin(y[:n]) - friction]
        )

    y = np.concatenate([theta, velocity])
    run = solve_ivp(slope, (0, 150), y, method="LSODA", rtol=1e-6, atol=1e-7, t_eval=[100, 150])
    return np.abs(run.y[:n, 1] - run.y[:n, 0]) < 0.5


@pytest.mark.parametrize(
    ("gamma", "torque", "theta_r"),
    [(1.0, 1.0, 0.05), (0.6, 1.015, 0.03), (0.8, -1.03, 0.05), (2.0, 0.96, 0.05)],
)
def test_friction_holds_all_angles_where_the_load_is_less(
    gamma: float, torque: float, theta_r: float
) -> None:
    pendulum = Pendulum(gamma=gamma, p=0.0, torque=torque, theta_r=theta_r)
    found = pendmap.basins(pendulum, Grid.square(8), check=False)
    theta, velocity = np.meshgrid(found["theta"].values, found["velocity"].values)
    rests = found["id"].values[found["kind"].str.contains("rest").values]
    assert found["undecided"].item() == 0
    truth = held(pendulum, theta.ravel(), velocity.ravel())
    assert np.array_equal(np.isin(found["label"].values.ravel(), rests), truth)


@pytest.mark.parametrize(
    ("gamma", "p", "omega", "theta_r"),
    [(0.3, 40, 20, 1e-3), (0.1, 40, 20, 5e-4), (0.2, 14.3, 10, 5e-4), (0.3, 60, 30, 1e-4)],
)
def test_small_stick_slip_orbits_beside_a_rest_capture_their_starts(
    gamma: float, p: float, omega: float, theta_r: float
) -> None:
    # They come within 1e-6 to 1e-4 of the set that friction holds upside down.
    model = Pendulum(gamma, p, omega, theta_r=theta_r)
    found = pendmap.basins(model, 16)
    assert (found["label"].values >= 0).all()
    names = [str(name) for name in found["attractor"].values if "oscillation" in str(name)]
    assert len(names) == 2
    shares = found["fraction"].sel(attractor=names).values
    assert shares[0] == shares[1] > 0


@pytest.mark.parametrize("seed", range(3))
def test_nothing_stays_undecided_where_damping_is_small(seed: int) -> None:
    draw = np.random.default_rng(seed)
    gamma = float(np.exp(draw.uniform(math.log(0.002), math.log(0.02))))
    pendulum = Pendulum(gamma=gamma, p=draw.uniform(0.1, 0.5), omega=draw.uniform(1.5, 2.5))
    found = pendmap.basins(pendulum, Grid.square(8), check=False)
    assert found["undecided"].item() == 0.0
    bound = 400 / (gamma * pendulum.period)
    assert found.attrs["max_periods"] == math.ceil(max(bound, 4000))


def test_a_rotation_that_dry_friction_does_not_stop_stays_undecided() -> None:
    pendulum = Pendulum(gamma=0.0, theta_r=0.01, p=0.3, omega=2.0)
    found = pendmap.basins_of(pendulum, [0.0, 0.5], [2.0, 0.1], check=False, max_periods=500)
    assert list(found["label"].values > 0) == [False, True]
