"""The equation of motion as functions: against scipy's integrators, formulas and differences."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
from pendmap import Effect, Formula, InputError, Pendulum, Rig

if TYPE_CHECKING:
    from numpy.typing import NDArray

OWN = Formula("own_pull", "-k*sin(2*theta)*cos(phase)*v", {"k": 1})
MODELS = (
    Pendulum(gamma=0.1, p=1.0, omega=2.0, phase=0.3, torque=0.05),
    Pendulum(gamma=0.1, p=0.6, omega=2.0, effects=(Effect("cubic_damping", {"k3": 0.03}),)),
    Pendulum(
        *(0.1, 0.6, 1.7),
        lab_time=20.0,
        effects=(
            Effect("viscous_drift", {"r": 0.002}),
            Effect("inertia_ripple", {"e": 0.1, "n": 2, "psi": 0.4}),
            Effect("added_mass", {"e": 0.1}),
            Effect("lateral_drive", {"e": 0.2, "phase": 0.5}),
            Effect("drive_second_harmonic", {"e": 0.2, "phase": 0.7}),
            Effect("encoder_gain", {"e": 0.05}),
            OWN(k=0.1),
        ),
    ),
    Rig(
        *(6.2, 0.3, 0.0, 0.5, 0.8, 12.0, 0.4),
        lab_time_s=5.0,
        effects=(Effect("cubic_damping", {"k3": 0.01}), Effect("viscous_drift", {"r": 0.01})),
    ),
)


def dop853(model: Pendulum | Rig, times: NDArray[np.float64], start: tuple[float, float]) -> Any:  # noqa: ANN401
    """Return the states of scipy's integrator at these times, shape (2, N)."""
    span, fine = (0.0, float(times[-1])), {"rtol": 1e-12, "atol": 1e-12}
    return solve_ivp(model.rhs, span, start, method="DOP853", t_eval=times, **fine).y


@pytest.mark.parametrize("model", MODELS)
def test_simulate_solves_the_equation_that_the_model_gives(model: Pendulum | Rig) -> None:
    times = np.linspace(0.0, 15.0 / model.units.w0, 40)
    start = 1.0, 0.5 * model.units.w0
    run = pendmap.simulate(model, *start, t_eval=times, tol=1e-12)
    expected = dop853(model, times, start)
    # Dense output of scipy's is of order 7: its error exceeds that of a step.
    assert run.theta.values == pytest.approx(expected[0], abs=2e-10)
    assert run.velocity.values == pytest.approx(expected[1], abs=2e-10 * model.units.w0)


def test_the_acceleration_is_the_papers_equation_and_its_effects() -> None:
    draw = np.random.default_rng(1)
    t, theta, v = draw.uniform(-3, 3, (3, 50))
    effects = Effect("cubic_damping", {"k3": 0.03}), Effect("viscous_drift", {"r": 0.01})
    pendulum = Pendulum(0.2, 0.7, 1.9, 0.3, 0.05, 0.1, lab_time=4.0, effects=effects)
    lifted = 1 + 0.7 * np.cos(1.9 * t + 0.3)
    damping = 0.2 * v + 0.03 * v**3 + 0.01 * (4.0 + t) * v + 0.1 * np.sign(v)
    expected = 0.05 - lifted * np.sin(theta) - damping
    assert pendulum.acceleration(t, theta, v) == pytest.approx(expected, abs=1e-14)
    rig = Rig.from_pendulum(pendulum, 6.2)
    in_si = rig.acceleration(t / 6.2, theta, v * 6.2)
    assert in_si == pytest.approx(6.2**2 * expected, rel=1e-12, abs=1e-12)
    grid = pendulum.acceleration(0.0, theta[:, None], v[None, :])
    assert grid.shape == (50, 50)
    assert grid[3, 7] == pendulum.acceleration(0.0, theta[3], v[7])


@pytest.mark.parametrize("model", MODELS)
def test_the_jacobian_is_that_of_differences(model: Pendulum | Rig) -> None:
    t, theta, v, h = 0.7, 1.1, 0.4 * model.units.w0, 1e-5
    columns = [
        (model.rhs(t, [theta + a, v + b]) - model.rhs(t, [theta - a, v - b])) / (2 * h)
        for a, b in ((h, 0.0), (0.0, h))
    ]
    expected = pytest.approx(np.array(columns).T, rel=1e-7, abs=1e-7)
    assert model.jacobian(t, theta, v) == expected


RUBBING = (
    Effect("asymmetric_coulomb", {"d": 0.05}),
    Effect("stribeck_friction", {"a": 0.1, "vs": 0.3}),
    Effect("load_dependent_friction", {"k": 0.1}),
    Effect("coulomb_drift", {"r": 0.002}),
    Effect("rough_spot", {"f": 0.2, "th0": 0.3, "w": 0.2}),
    Formula("own_rub", "-k*sign(v)*(2 + cos(theta)) - c*v", {"k": 2, "c": 1})(k=0.05, c=0.1),
)


@pytest.mark.parametrize("effect", RUBBING, ids=lambda effect: effect.name)
def test_at_rest_friction_holds_or_opposes_the_motion_that_begins(effect: Effect) -> None:
    draw = np.random.default_rng(7)
    t, theta = draw.uniform(0, 6, 200), draw.uniform(-np.pi, np.pi, 200)
    model = Pendulum(0.1, 0.7, 1.9, 0.4, 0.02, 0.15, lab_time=5.0, effects=(effect,))
    still, jacobian = model.acceleration(t, theta, 0.0), model.jacobian(t, theta, -0.0)
    # A motion forward is slowed below 0 and one backward above it where neither begins.
    forth, back = (model.acceleration(t, theta, v) for v in (1e-300, -1e-300))
    expected = np.where(forth > 0, forth, np.where(back < 0, back, 0.0))
    held = expected == 0
    assert 5 < held.sum() < 195
    assert still == pytest.approx(expected, abs=1e-12)
    assert (jacobian[held] == [[0, 1], [0, 0]]).all()
    moving = model.jacobian(t, theta, 1e-300 * np.sign(expected))[~held]
    assert jacobian[~held] == pytest.approx(moving, abs=1e-12)
    rates = model.rhs(t[0], [theta, 0 * theta])
    assert (rates == [0 * theta, model.acceleration(t[0], theta, 0.0)]).all()


YIELDING = Pendulum(effects=(Effect("dahl_friction", {"f": 0.1, "zc": 0.1}),))


@pytest.mark.parametrize(
    ("function", "given", "complaint"),
    [
        (YIELDING.acceleration, (0, 0, 0), "effects must act by time, angle and velocity alone"),
        (Pendulum().acceleration, (0, np.nan, 0), "theta must be finite numbers, got nan"),
        (Pendulum().jacobian, ([0, 1], [0, 1, 2], 0), "t, theta and v must have shapes that"),
        (Pendulum().rhs, (0, [1, 2, 3]), r"y must have the shape \(2,\) or \(2, k\), got \(3,\)"),
    ],
)
def test_what_no_function_of_time_and_state_gives_is_refused(
    function: Any,  # noqa: ANN401 (a method of a model)
    given: tuple[Any, ...],
    complaint: str,
) -> None:
    with pytest.raises(InputError, match=complaint):
        function(*given)
