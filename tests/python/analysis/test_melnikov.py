"""Melnikov's criterion against reference values, the formula, and manifolds by scipy."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
from pendmap import Effect, Pendulum
from pendmap.files import facts

if TYPE_CHECKING:
    from numpy.typing import NDArray


def own(model: Pendulum, name: str = "own_p_melnikov") -> float:
    """Return the threshold at the model's own frequency."""
    return float(pendmap.melnikov(model, [1.0])[name])


def formula(gamma: float, omega: float, theta_r: float = 0.0, torque: float = 0.0) -> float:
    brake = 4 * gamma + math.pi * theta_r - math.pi * torque
    return brake * math.sinh(math.pi * omega / 2) / (math.pi * omega**2)


def test_the_reference_values_to_1e_9_and_the_true_tangency_near(truths: dict[str, Any]) -> None:
    for omega, p in truths["melnikov"]["p_M_gamma0p1"].items():
        assert abs(own(Pendulum(gamma=0.1, omega=float(omega))) - float(p)) < 1e-9
    # Computed from the manifolds: they differ at second order in gamma.
    for row, omega in zip(truths["melnikov"]["tangency"].values(), (0.87, 2.0), strict=True):
        assert abs(own(Pendulum(gamma=0.1, omega=omega)) / row["p_c"] - 1) < 0.01


@pytest.mark.parametrize("omega", [0.4, 1.0, 2.7])
def test_friction_and_torque_as_the_formula_says(omega: float) -> None:
    model = Pendulum(gamma=0.07, omega=omega, theta_r=0.03, torque=0.02, phase=0.7)
    found = pendmap.melnikov(model, [omega])
    for branch, torque in (("forward", 0.02), ("backward", -0.02)):
        expected = formula(0.07, omega, 0.03, torque)
        assert abs(found[f"p_{branch}"].item() - expected) < 1e-9
        assert abs(float(found["p_melnikov"].sel(branch=branch)[0]) - expected) < 1e-9
    assert found["own_p_melnikov"].item() == found["p_forward"].item()


def test_drag_loses_its_work_along_the_separatrix() -> None:
    # The integral of |th'|^3 along the separatrix is 8 * pi/2.
    drag = (Effect("quadratic_drag", {"q": 0.02}),)
    lost = 8 * 0.1 + 0.02 * 4 * math.pi
    expected = lost * math.sinh(math.pi / 2) / (2 * math.pi)
    assert abs(own(Pendulum(gamma=0.1, omega=1.0, effects=drag)) - expected) < 1e-9


def loop_by_scipy(gamma: float, omega: float, theta_r: float, torque: float) -> float:
    """Return the loop's threshold, from the unstable manifold of upright rest."""
    c = math.sqrt(1 - torque**2)

    def slope(t: float, y: NDArray[np.float64]) -> list[float]:
        # The distance u from upright rest, its rate, and the integrals up to the present time.
        u, rate = y[:2]
        power = -(torque * math.cos(u) + c * math.sin(u)) * rate
        push = c * math.sin(u) - 2 * torque * math.sin(u / 2) ** 2
        drive = [power * math.cos(omega * t), power * math.sin(omega * t)]
        return [rate, push, rate**2, abs(rate), *drive]

    def turned(_: float, y: NDArray[np.float64]) -> float:
        return float(y[1])

    turned.terminal = True
    turned.direction = -1
    start = [1e-13, 1e-13 * math.sqrt(c), 0, 0, 0, 0]
    run = solve_ivp(slope, (0, 400), start, "DOP853", None, events=turned, rtol=1e-13, atol=1e-22)
    end, (_, _, action, way, even, odd) = run.t[-1], run.y[:, -1]
    # The work is greatest for the phase at which the drive is odd about the turning point.
    work = math.cos(omega * end) * odd - math.sin(omega * end) * even
    return (gamma * 2 * action + theta_r * 2 * way) / abs(2 * work)


@pytest.mark.parametrize("seed", range(6))
def test_the_loop_agrees_with_scipy(seed: int) -> None:
    """A torque that keeps up a rotation tilts the potential; a weak one has both thresholds."""
    random = np.random.default_rng(seed)
    gamma, omega = float(random.uniform(0.001, 0.06)), float(random.uniform(0.5, 2.5))
    strong, theta_r = seed < 3, 0.01 * float(random.uniform())
    torque = float(random.uniform(0.1, 0.97)) if strong else 3 * gamma / math.pi
    torque *= (-1) ** seed
    model = Pendulum(gamma=gamma, omega=omega, theta_r=theta_r, torque=torque, phase=0.4)
    found = pendmap.melnikov(model, [omega])
    expected = loop_by_scipy(gamma, omega, theta_r, abs(torque))
    assert found["p_loop"].item() == pytest.approx(expected, rel=1e-9 if strong else 1e-8)
    assert (found["own_p_melnikov"].item() == found["p_loop"].item()) == strong
    assert ("loop" in found["branch"].values) == strong
    assert ("perturbation" in found.attrs["summary"]) != strong


def test_the_manifolds_touch_at_the_computed_threshold() -> None:
    # Both manifolds of upright rest, integrated with scipy, touch at p = 0.067533.
    touch = own(Pendulum(gamma=0.02, omega=2.0, torque=0.5))
    assert touch == pytest.approx(0.067533, rel=2e-3)
    # Forward manifolds of neighbouring saddles touch at 0.2142, by integration with scipy.
    found = pendmap.melnikov(Pendulum(gamma=0.1, omega=2.0, torque=0.2), [2.0])
    assert found["branch"].values.tolist() == ["loop", "forward", "backward"]
    assert abs(found["own_p_melnikov"].item() - 0.34596) < 1e-5
    assert abs(found["p_forward"].item() / 0.2142 - 1) < 0.03
    assert "sustains the rotation forward" in found.attrs["summary"]
    assert "heteroclinic" in found.attrs["summary"]


def test_torques_however_given_and_however_weak() -> None:
    bias = (Effect("bias_torque", {"torque": 0.2}),)
    assert own(Pendulum(effects=bias)) == pytest.approx(own(Pendulum(torque=0.2)), rel=1e-9)
    # As a torque weakens to 0 with damping, the threshold tends to that without torque.
    for torque in (1e-3, 1e-6, 1e-9):
        weak = own(Pendulum(gamma=0.1, omega=2.0, torque=torque))
        assert weak == pytest.approx(formula(0.1, 2.0), rel=10 * torque)


def test_losses_that_a_torque_compensates_remain_losses() -> None:
    made_up = Pendulum(gamma=0.1, omega=2.0, torque=0.4 / math.pi)
    a = facts(pendmap.melnikov(made_up, [2.0]))
    assert a["own_p_melnikov"] == pytest.approx(0.0, abs=1e-12)
    assert "fractal" in a["summary"]
    assert "Without damping" not in a["summary"]
    free = pendmap.melnikov(Pendulum(gamma=0.0, omega=2.0, torque=0.3), [2.0])
    assert "Without damping" in free.attrs["summary"]
    # Without damping any drive tangles.
    found = pendmap.melnikov(Pendulum(gamma=0.0, p=1.0))
    assert found["own_p_melnikov"].item() == 0
    assert "from p = 0 on" in found.attrs["summary"]
    assert "no attractors and no basins" in found.attrs["summary"]


def test_thresholds_that_rounding_hides_are_not_given() -> None:
    fast = pendmap.melnikov(Pendulum(gamma=0.1, omega=14.0), [14.0, 30.0])
    assert fast["own_p_melnikov"].item() == pytest.approx(formula(0.1, 14.0), rel=1e-6)
    assert np.isnan(fast["p_melnikov"].values[1]).all()
    a = facts(pendmap.melnikov(Pendulum(gamma=0.1, omega=30.0), [1.0]))
    assert math.isnan(a["own_p_melnikov"])
    assert "below rounding errors" in a["summary"]
