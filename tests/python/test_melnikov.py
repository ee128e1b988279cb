"""Melnikov's criterion against reference values, the formula, and scipy's quadrature."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

import pendmap
from drawn import made, named
from pendmap import Effect, Pendulum, Rig
from recordings import recorded

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run


def formula(gamma: float, omega: float, theta_r: float = 0.0, torque: float = 0.0) -> float:
    brake = 4 * gamma + math.pi * theta_r - math.pi * torque
    return brake * math.sinh(math.pi * omega / 2) / (math.pi * omega**2)


def test_the_reference_values_to_1e_9(truths: dict[str, Any]) -> None:
    for omega, p in truths["melnikov"]["p_M_gamma0p1"].items():
        found = pendmap.melnikov(Pendulum(gamma=0.1, omega=float(omega)), [1.0])
        assert abs(found.attrs["p_melnikov"] - float(p)) < 1e-9


def test_the_true_tangency_is_near(truths: dict[str, Any]) -> None:
    # Computed with manifolds: they differ at the second order in gamma.
    for row, omega in zip(truths["melnikov"]["tangency"].values(), (0.87, 2.0), strict=True):
        found = pendmap.melnikov(Pendulum(gamma=0.1, omega=omega), [1.0]).attrs["p_melnikov"]
        assert abs(found / row["p_c"] - 1) < 0.01


@pytest.mark.parametrize("omega", [0.4, 1.0, 2.7])
def test_friction_and_torque_as_the_formula_says(omega: float) -> None:
    model = Pendulum(gamma=0.07, omega=omega, theta_r=0.03, torque=0.02, phase=0.7)
    found = pendmap.melnikov(model, [omega])
    for branch, torque in (("forward", 0.02), ("backward", -0.02)):
        expected = formula(0.07, omega, 0.03, torque)
        assert abs(found.attrs[f"p_{branch}"] - expected) < 1e-9
        assert abs(float(found["p_melnikov"].sel(branch=branch)[0]) - expected) < 1e-9
    assert found.attrs["p_melnikov"] == found.attrs["p_forward"]


def test_the_formula_by_quadrature_of_the_integral() -> None:
    gamma, theta_r, omega = 0.1, 0.05, 1.3

    def speed(t: float) -> float:
        return 2 / math.cosh(t)

    def sine(t: float) -> float:
        return math.sin(2 * math.atan(math.sinh(t)))

    lost = quad(
        lambda t: -(gamma * speed(t) + theta_r) * speed(t), -40, 40, epsabs=1e-13, limit=400
    )[0]

    def work(start: float) -> float:
        return quad(
            lambda t: -math.cos(omega * (t + start)) * sine(t) * speed(t),
            -40,
            40,
            epsabs=1e-13,
            limit=400,
        )[0]

    best = minimize_scalar(
        lambda s: -work(s),
        bounds=(0.0, math.tau / omega),
        method="bounded",
        options={"xatol": 1e-10},
    )
    by_quadrature = -lost / -best.fun
    assert abs(by_quadrature / formula(gamma, omega, theta_r) - 1) < 1e-9
    own = pendmap.melnikov(Pendulum(gamma=gamma, omega=omega, theta_r=theta_r), [omega])
    assert abs(own.attrs["p_melnikov"] - by_quadrature) < 1e-9


def test_drag_takes_what_its_work_along_the_separatrix_is() -> None:
    # The integral of |th'|^3 over sech: 8 * pi/2.
    plain, drag = 0.1, 0.02
    model = Pendulum(gamma=plain, omega=1.0, effects=(Effect("quadratic_drag", {"q": drag}),))
    found = pendmap.melnikov(model, [1.0]).attrs["p_melnikov"]
    lost = 8 * plain + drag * 4 * math.pi
    expected = lost * math.sinh(math.pi / 2) / (2 * math.pi)
    assert abs(found - expected) < 1e-9


def test_a_torque_that_keeps_up_the_rotation_has_no_threshold() -> None:
    found = pendmap.melnikov(Pendulum(gamma=0.01, omega=1.0, torque=0.3), [1.0])
    assert math.isnan(found.attrs["p_forward"])
    assert "keeps up the rotation forward" in found.attrs["summary"]
    assert found.attrs["p_melnikov"] == found.attrs["p_backward"]


def test_in_si_it_is_the_same() -> None:
    rig = Rig(w0=5.0, c_over_m=0.5, p=1.0, Omega=10.0)
    assert pendmap.melnikov(rig, [1.0]).attrs["p_melnikov"] == pytest.approx(formula(0.1, 2.0))


def test_what_is_refused() -> None:
    with pytest.raises(pendmap.InputError, match="ascending"):
        pendmap.melnikov(Pendulum(), [2.0, 1.0])


def test_figure_recording_and_file(tmp_path: Path) -> None:
    found = pendmap.melnikov(
        Pendulum(gamma=0.1, theta_r=0.02, torque=0.01), np.linspace(0.3, 4, 30)
    )
    assert any("backward" in text for text in named(made(found)))
    assert "/melnikov/data/forward" in recorded(found, tmp_path).static
    assert pendmap.load(pendmap.save(found, tmp_path / "m.nc")).equals(found)


def test_the_command(pendmap_command: Run, tmp_path: Path) -> None:
    run = pendmap_command("melnikov", "--omega", 1, "--json")
    said = json.loads(run.stdout)
    assert abs(said["p_melnikov"] - 0.293010476667326976) < 1e-9
    assert said["p_tangency"] is None
    assert not list(tmp_path.iterdir())
    run = pendmap_command("melnikov", "--omega", 1)
    assert run.returncode == 0, run.stderr
    names = {p.name for p in tmp_path.iterdir()}
    assert names == {"melnikov.nc", "melnikov.png", "melnikov.rrd"}


def test_without_damping_any_drive_tangles_and_there_are_no_basins() -> None:
    found = pendmap.melnikov(Pendulum(gamma=0.0, p=1.0))
    assert found.attrs["p_melnikov"] == 0
    assert "from p = 0 on" in found.attrs["summary"]
    assert "there are no basins" in found.attrs["summary"]
