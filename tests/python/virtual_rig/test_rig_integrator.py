"""The virtual rig's integrator against reference values, scipy and conserved energies."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pendmap.virtual_rig import EFFECTS
from pendmap.virtual_rig.effects.base import Drive, Reading
from pendmap.virtual_rig.equation import Equation, Parameters
from pendmap.virtual_rig.integrator import integrate

if TYPE_CHECKING:
    from pendmap.virtual_rig.effects.base import Effect
    from pendmap.virtual_rig.path import Path

LOW = {"rtol": 1e-12, "atol": 1e-13, "method": "DOP853"}
NUMBERS = ("gamma", "p", "omega", "theta0", "v0")
STILL = (0.0, 1.0, 0.0)


def run(
    parameters: Parameters,
    drive: tuple[float, float, float],
    start: tuple[float, float],
    end: float,
    *effects: Effect,
) -> Path:
    """Integrate one run from lab time 0."""
    equation = Equation(
        parameters, Drive.harmonic(*np.array([drive], float).T), np.zeros(1), effects
    )
    (path,) = integrate(equation, np.array([float(end)]), *np.array([start], float).T)
    return path


def last(path: Path, time: float) -> float:
    return float(path.angle(np.array([time]))[0])


def test_free_decay_of_the_truths(truths: dict[str, Any]) -> None:
    case = truths["free_decay"]["nonlinear"][0]
    times, peaks = ([float(x) for x in case[key]] for key in ("times", "thetas"))
    parameters = Parameters(float(case["w0"]), float(case["c_over_m"]), float(case["Tr"]))
    path = run(parameters, STILL, (float(case["theta0"]), 0), times[-1] + 5)
    assert [event.what for event in path.events] == ["turn"] * (len(peaks) - 2) + ["stick"]
    assert [event.time for event in path.events] == pytest.approx(times[1:], abs=1e-10)
    assert [event.theta for event in path.events] == pytest.approx(peaks[1:], abs=1e-11)
    assert last(path, times[-1] + 4) == pytest.approx(peaks[-1], abs=1e-11)


@pytest.mark.parametrize("case", range(6))
def test_stick_and_slip_of_the_truths(truths: dict[str, Any], case: int) -> None:
    true = truths["stick_slip"][case]
    parameters = Parameters(1, true["gamma"], true["theta_r"])
    end = true["periods"] * math.tau / true["omega"]
    path = run(parameters, (true["p"], true["omega"], 0), (true["theta0"], true["v0"]), end)
    events = [event for event in true["events"] if event["what"] != "stuck for ever"]
    assert [event.what for event in path.events] == [event["what"] for event in events]
    for mine, other in zip(path.events, events, strict=True):
        assert mine.time == pytest.approx(other["tau"], abs=1e-9)
        assert mine.theta == pytest.approx(other["theta"], abs=1e-10)
    assert last(path, end) == pytest.approx(true["theta"], abs=1e-11)
    assert path.velocity(np.array([end])) == pytest.approx(true["v"], abs=1e-11)


def test_trajectories_of_the_truths(truths: dict[str, Any]) -> None:
    for true in truths["trajectories"]:
        gamma, p, omega, theta, v = (float(true[k]) for k in NUMBERS)
        end = float(true["times"][0])
        path = run(Parameters(1, gamma, 0), (p, omega, 0.0), (theta, v), end)
        assert last(path, end) == pytest.approx(float(true["theta"][0]), abs=1e-10)


@pytest.mark.parametrize("phase", [0.0, 0.3, -math.pi / 2, math.pi])
@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_starts_at_the_edge_of_a_stick_come_to_their_end(friction: float, phase: float) -> None:
    for strength in (0.0, 0.5):
        limit = math.asin(friction / (36 * (1 + strength * math.cos(phase))))
        for theta in (limit, -limit, math.pi - limit, 0.0):
            path = run(Parameters(6, 0.1, friction), (strength, 12, phase), (theta, 0), 3)
            assert len(path.steps) < 1000
            assert math.isfinite(last(path, 3.0))


@pytest.mark.parametrize(("e", "start", "end"), [(0.0, 3.0, 60), (0.3, 2.0, 20)])
def test_energy_is_kept_also_by_an_inertia_that_varies(e: float, start: float, end: float) -> None:
    # The Lagrangian with this inertia conserves (1 + e cos(n th + psi)) v^2 / 2 - w0^2 cos th.
    effect = EFFECTS["inertia_ripple"](e=e, n=2, psi=0.7)
    path = run(Parameters(6.2, 0, 0), STILL, (start, 0), end, effect)
    time = np.linspace(0, end, 500)
    theta, velocity = path.angle(time), path.velocity(time)
    inertia = 1 + e * np.cos(2 * theta + 0.7)
    energy = inertia * velocity**2 / 2 - 6.2**2 * np.cos(theta)
    assert np.ptp(energy) < (1e-9 if e else 1e-10)


def test_a_compliant_pivot_against_its_lagrangian() -> None:
    # Cart and pendulum, from the Lagrangian: M x'' + m l (th'' cos - th'^2 sin) = -k x - d x'.
    w0, mu, wx, z, c = 6.2, 0.05, 30.0, 0.02, 0.1

    def rate(_: float, y: np.ndarray) -> list[float]:
        th, v, x, u = y
        matrix = np.array([[1.0, math.cos(th)], [mu * math.cos(th), 1.0]])
        side = mu * v**2 * math.sin(th) - 2 * z * wx * u - wx**2 * x
        a, b = np.linalg.solve(matrix, [-c * v - w0**2 * math.sin(th), side])
        return [v, a, u, b]

    aside = mu * math.sin(0.5) * (w0**2 * math.cos(0.5) + 11.0**2) / wx**2
    other = solve_ivp(rate, (0, 4), [0.5, 11.0, aside, 0], **LOW)
    effect = EFFECTS["pivot_compliance"](mu=mu, wx=wx, z=z)
    path = run(Parameters(w0, c, 0), STILL, (0.5, 11.0), 4, effect)
    assert last(path, 4.0) == pytest.approx(other.y[0, -1], abs=1e-9)


def test_corners_and_cusps_against_scipy_in_pieces() -> None:
    # With all signs written out scipy has to shorten its steps across them.
    w0, friction = 6.2, 0.3
    load = EFFECTS["load_dependent_friction"](k=0.1)
    sharp = EFFECTS["stribeck_friction:sharp"](a=0.1, vs=0.5)
    magnet = EFFECTS["magnet"](amplitude=0.5, width=0.1)

    def rate(t: float, y: np.ndarray) -> list[float]:
        th, v = y
        up = 1 + 0.9 * math.cos(9 * t)
        x = (th - math.tau * round(th / math.tau)) / 0.1
        dry = friction + 0.1 * (abs(up * math.cos(th) + (v / w0) ** 2) - 1)
        dry += 0.1 * math.exp(-abs(v / 0.5))
        pull = 0.5 * x * math.exp(-(x**2) / 2)
        return [v, -(w0**2) * up * math.sin(th) - math.copysign(dry, v) - pull]

    other = solve_ivp(rate, (0, 2), [2.5, 1.0], **(LOW | {"max_step": 1e-3}))
    path = run(Parameters(w0, 0, friction), (0.9, 9, 0), (2.5, 1.0), 2, load, sharp, magnet)
    assert last(path, 2.0) == pytest.approx(other.y[0, -1], abs=1e-7)


def test_impulses_are_jumps_of_the_velocity() -> None:
    train = EFFECTS["impulses:train"](J=0.05, every=2.0, pattern=7)
    assert len(train.kicks(0, 10)) >= 3
    for effect in (train, EFFECTS["impulses"](J=0.05, t0=4.3)):
        path = run(Parameters(6.2, 0.1, 0.1), STILL, (1.0, 0), 10, effect)
        for time, jump in effect.kicks(0, 10):
            before, after = path.velocity(np.array([time - 1e-9, time + 1e-9]))
            assert after - before == pytest.approx(jump, abs=1e-6)


def test_a_lag_against_its_differential_equation() -> None:
    path = run(Parameters(6.2, 0.1, 0.1), STILL, (2.5, 0), 3)
    lag = EFFECTS["sensor_lag"](tau=0.02)

    def rate(t: float, y: np.ndarray) -> list[float]:
        return [(last(path, t) - float(y[0])) / 0.02]

    time = np.sort(np.random.default_rng(1).uniform(0, 3, 40))
    start = lag.distort(Reading(np.array([0.0, 1.0]), np.zeros(2), path))[0]
    other = solve_ivp(rate, (0, 3), [start], t_eval=time, rtol=1e-9, atol=1e-10, max_step=0.05)
    span = np.concatenate([[0.0], time, [3.0]])
    read = lag.distort(Reading(span, np.zeros(span.size), path))[1:-1]
    assert read == pytest.approx(other.y[0], abs=2e-8)
