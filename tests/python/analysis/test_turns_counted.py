"""Maps of models not periodic in the angle, against scipy and the roots of the torque."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import pendmap
from pendmap import InputError
from pendmap.charts import legend

WINDOW = pendmap.Grid((-25.0, 25.0, 50), (-4.0, 4.0, 20))


def spring(k: float) -> pendmap.Effect:
    """Return an effect with the elastic torque ``-k theta``."""
    return pendmap.Effect("elastic_restoring", {"k": k})


def wells(k: float) -> list[float]:
    """Return the stable rests without drive: rising zeros of ``sin(theta) + k theta``."""
    looked = np.linspace(-1.2 / k, 1.2 / k, 20_001)
    pull = np.sin(looked) + k * looked
    rising = np.flatnonzero((pull[:-1] < 0) & (pull[1:] >= 0))
    found = [brentq(lambda x: math.sin(x) + k * x, looked[i], looked[i + 1]) for i in rising]
    return [0.0 if abs(x) < 1e-12 else x for x in found]


def ends(model: pendmap.Pendulum, theta: float, velocity: float, periods: int) -> float:
    """Return the angle after a number of periods, by scipy."""
    k = model.effects[0].parameters["k"]

    def slope(tau: float, state: np.ndarray) -> list[float]:
        drive = 1 + model.p * math.cos(model.omega * tau)
        return [state[1], -model.gamma * state[1] - drive * math.sin(state[0]) - k * state[0]]

    span = (0.0, periods * math.tau / model.omega)
    run = solve_ivp(slope, span, [theta, velocity], method="DOP853", rtol=1e-11, atol=1e-11)
    return float(run.y[0, -1])


@pytest.mark.parametrize("k", [0.03, 0.05, 0.11])
def test_rests_are_the_wells_of_the_potential(k: float) -> None:
    found = pendmap.basins(pendmap.Pendulum(gamma=0.3, p=0.0, effects=(spring(k),)), WINDOW)
    expected = [x for x in wells(k) if abs(x) < 25.0]
    np.testing.assert_allclose(np.sort(found["point_theta"].values), expected, atol=1e-9)
    for name, theta in zip(found["attractor"].values, found["point_theta"].values, strict=True):
        turn = round(theta / math.tau)
        assert str(name) == ("rest" if turn == 0 else f"rest turn {turn:+d}")


def test_starts_end_where_scipy_takes_them() -> None:
    draw = np.random.default_rng(11)
    checked = 0
    for _ in range(4):
        k, p = draw.uniform(0.03, 0.15), draw.uniform(0.3, 0.8)
        model = pendmap.Pendulum(gamma=0.3, p=p, omega=2.0, effects=(spring(k),))
        found = pendmap.basins(model, WINDOW)
        owner = found["point_attractor"].values
        turns = {
            int(i): round(float(found["point_theta"].values[owner == i].mean()) / math.tau)
            for i in found["id"].values
        }
        for row, column in draw.integers(0, (20, 50), size=(10, 2)):
            label = int(found["label"].values[row, column])
            start = float(found.theta[column]), float(found.velocity[row])
            end = ends(model, *start, periods=60)
            assert round(end / math.tau) == turns[label], (k, p, start)
            checked += 1
    assert checked == 40


def test_a_formula_is_mapped_as_the_effect_of_the_library() -> None:
    formula = pendmap.Formula("own_spring", "-k*theta", {"k": {"power": 2}})
    own = formula(k=0.05)
    one, other = (
        pendmap.basins(pendmap.Pendulum(gamma=0.2, p=0.8, effects=(effect,)), WINDOW)
        for effect in (spring(0.05), own)
    )
    assert len(one["attractor"]) > 3
    colours = legend.colours_of(one)  # attractors around different turns differ in colour
    assert len(set(colours)) == len(colours)
    np.testing.assert_array_equal(one["label"], other["label"])


def test_friction_holds_the_pendulum_in_the_wells_of_several_turns() -> None:
    k, held = 0.05, 0.1
    model = pendmap.Pendulum(gamma=0.2, p=0.0, theta_r=held, effects=(spring(k),))
    found = pendmap.basins(model, WINDOW)
    rests = [str(n) for n in found["attractor"].values if str(n).startswith("rest")]
    assert len(rests) == sum(abs(x) < 25.0 for x in wells(k))
    # A start at rest near a well remains there.
    still = pendmap.basins_of(model, [6.0, -6.0, 0.0], [0.0, 0.0, 0.0])
    names = [str(still["attractor"].values[i - 1]) for i in still["label"].values]
    assert names == ["rest turn +1", "rest turn -1", "rest"]


def test_an_analysis_that_needs_a_periodic_angle_is_refused() -> None:
    with pytest.raises(InputError, match="counts turns"):
        pendmap.melnikov(pendmap.Pendulum(effects=(spring(0.05),)))
