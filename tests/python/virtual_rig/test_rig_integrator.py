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
from pendmap.virtual_rig.integrator import Starts, integrate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.virtual_rig.effects.base import Effect
    from pendmap.virtual_rig.path import Path

LOW = {"rtol": 1e-12, "atol": 1e-13, "method": "DOP853"}


def run(  # noqa: PLR0913, PLR0917 (the parameters of a run)
    parameters: Parameters,
    drive: tuple[float, float, float],
    theta: float,
    velocity: float,
    end: float,
    effects: Sequence[Effect] = (),
) -> Path:
    """Integrate one run from lab time 0."""
    arrays = (np.array([x]) for x in drive)
    equation = Equation(parameters, Drive.harmonic(*arrays), np.zeros(1), effects)
    begin = np.zeros(1)
    starts = Starts(
        np.array([0]), begin, begin + end, np.array([float(theta)]), np.array([float(velocity)])
    )
    (path,) = integrate(equation, starts)
    return path


def scipy_with_events(
    parameters: Parameters,
    drive: tuple[float, float, float],
    theta: float,
    velocity: float,
    end: float,
) -> tuple[float, float, int]:
    """Integrate with DOP853, turn by turn, sticks by events; return the end and number of sticks.

    An event that appears and disappears within one step is missed, so steps are kept short.
    """
    p, frequency, phase = drive
    w0, c, limit = parameters.w0, parameters.c_over_m, parameters.friction

    def load(t: float, th: float) -> float:
        return -(w0**2) * (1 + p * math.cos(frequency * t + phase)) * math.sin(th)

    def stopped(_: float, y: np.ndarray) -> float:
        return float(y[1])

    stopped.terminal = True  # type: ignore[attr-defined]
    t, y, sticks = 0.0, [theta, velocity], 0
    while t < end:
        sign = float(np.sign(y[1]))
        if sign == 0:
            here = load(t, y[0])
            sign = float(np.sign(here)) if abs(here) > limit else 0.0
        if sign == 0:
            sticks += 1

            def slips(s: float, _: np.ndarray, th: float = y[0]) -> float:
                return limit - abs(load(s, th))

            slips.terminal = True  # type: ignore[attr-defined]
            held = solve_ivp(lambda *_: [1.0], (t, end), [0.0], events=slips, max_step=2e-3, **LOW)
            t = float(held.t[-1])
            sign = float(np.sign(load(t, y[0])))
            if t >= end:
                break

        def rate(s: float, y: np.ndarray, sign: float = sign) -> list[float]:
            return [y[1], load(s, y[0]) - c * y[1] - sign * limit]

        stopped.direction = -sign  # type: ignore[attr-defined]
        piece = solve_ivp(rate, (t, end), y, events=stopped, max_step=5e-3, **LOW)
        t, y = float(piece.t[-1]), [float(piece.y[0, -1]), float(piece.y[1, -1])]
        if piece.status == 1:
            y[1] = 0.0
    return y[0], y[1], sticks


def test_free_decay_of_the_truths(truths: dict[str, Any]) -> None:
    case = truths["free_decay"]["nonlinear"][0]
    times, peaks = ([float(x) for x in case[key]] for key in ("times", "thetas"))
    parameters = Parameters(float(case["w0"]), float(case["c_over_m"]), float(case["Tr"]))
    path = run(parameters, (0, 1, 0), float(case["theta0"]), 0, times[-1] + 5)
    assert [event.what for event in path.events] == ["turn"] * (len(peaks) - 2) + ["stick"]
    assert [event.time for event in path.events] == pytest.approx(times[1:], abs=1e-10)
    assert [event.theta for event in path.events] == pytest.approx(peaks[1:], abs=1e-11)
    still = path.angle(np.array([times[-1] + 4]))
    assert still == pytest.approx(peaks[-1], abs=1e-11)


@pytest.mark.parametrize("case", range(6))
def test_stick_and_slip_of_the_truths(truths: dict[str, Any], case: int) -> None:
    true = truths["stick_slip"][case]
    parameters = Parameters(1, true["gamma"], true["theta_r"])
    end = true["periods"] * math.tau / true["omega"]
    path = run(parameters, (true["p"], true["omega"], 0), true["theta0"], true["v0"], end)
    events = [event for event in true["events"] if event["what"] != "stuck for ever"]
    assert [event.what for event in path.events] == [event["what"] for event in events]
    for mine, other in zip(path.events, events, strict=True):
        assert mine.time == pytest.approx(other["tau"], abs=1e-9)
        assert mine.theta == pytest.approx(other["theta"], abs=1e-10)
    last = np.array([end])
    assert path.angle(last) == pytest.approx(true["theta"], abs=1e-11)
    assert path.velocity(last) == pytest.approx(true["v"], abs=1e-11)


def test_trajectories_of_the_truths(truths: dict[str, Any]) -> None:
    for true in truths["trajectories"]:
        gamma, p, omega = (float(true[key]) for key in ("gamma", "p", "omega"))
        end = float(true["times"][0])
        drive = (p, omega, 0.0)
        path = run(Parameters(1, gamma, 0), drive, float(true["theta0"]), float(true["v0"]), end)
        assert path.angle(np.array([end])) == pytest.approx(float(true["theta"][0]), abs=1e-10)


@pytest.mark.parametrize("seed", range(4))
def test_random_models_against_scipy_with_events(seed: int) -> None:
    rng = np.random.default_rng(seed)
    heavy = seed % 2 == 0  # strong friction: it sticks again and again
    parameters = Parameters(
        rng.uniform(3, 8), rng.uniform(0, 0.5), rng.uniform(8, 14) if heavy else rng.uniform(0, 0.3)
    )
    drive = (rng.uniform(0.3, 1.2), rng.uniform(2, 14), rng.uniform(-3, 3))
    theta, velocity, end = rng.uniform(-3, 3), rng.uniform(-6, 6), 4.0
    expected = scipy_with_events(parameters, drive, theta, velocity, end)
    path = run(parameters, drive, theta, velocity, end)
    state = float(path.angle(np.array([end]))[0]), float(path.velocity(np.array([end]))[0])
    assert state == pytest.approx(expected[:2], abs=1e-9)
    assert sum(event.what == "stick" for event in path.events) == expected[2]
    assert not heavy or expected[2] >= 1


@pytest.mark.parametrize("phase", [0.0, 0.3, -math.pi / 2, math.pi])
@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_starts_at_the_edge_of_a_stick_come_to_their_end(friction: float, phase: float) -> None:
    for strength in (0.0, 0.5):
        limit = math.asin(friction / (36 * (1 + strength * math.cos(phase))))
        for theta in (limit, -limit, math.pi - limit, 0.0):
            path = run(Parameters(6, 0.1, friction), (strength, 12, phase), theta, 0, 3)
            assert len(path.steps) < 1000
            assert np.isfinite(path.angle(np.array([3.0]))).all()


def test_energy_without_friction_is_kept() -> None:
    path = run(Parameters(6.2, 0, 0), (0, 1, 0), 3.0, 0, 60)
    time = np.linspace(0, 60, 500)
    energy = path.velocity(time) ** 2 / 2 - 6.2**2 * np.cos(path.angle(time))
    assert np.ptp(energy) < 1e-10


def test_a_compliant_pivot_against_its_lagrangian() -> None:
    # Cart and pendulum, from the Lagrangian: M x'' + m l (th'' cos - th'^2 sin) = -k x - d x'.
    w0, mu, wx, z, c = 6.2, 0.05, 30.0, 0.02, 0.1

    def rate(_: float, y: np.ndarray) -> list[float]:
        th, v, x, u = y
        matrix = np.array([[1.0, math.cos(th)], [mu * math.cos(th), 1.0]])
        force = [
            -c * v - w0**2 * math.sin(th),
            mu * v**2 * math.sin(th) - 2 * z * wx * u - wx**2 * x,
        ]
        a, b = np.linalg.solve(matrix, force)
        return [v, a, u, b]

    aside = mu * math.sin(0.5) * (w0**2 * math.cos(0.5) + 11.0**2) / wx**2
    other = solve_ivp(rate, (0, 4), [0.5, 11.0, aside, 0], **LOW)
    effect = EFFECTS["pivot_compliance"](mu=mu, wx=wx, z=z)
    path = run(Parameters(w0, c, 0), (0, 1, 0), 0.5, 11.0, 4, [effect])
    assert path.angle(np.array([4.0])) == pytest.approx(other.y[0, -1], abs=1e-9)


def test_an_inertia_that_varies_keeps_its_energy() -> None:
    # The Lagrangian with this inertia conserves (1 + e cos(n th + psi)) v^2 / 2 - w0^2 cos th.
    effect = EFFECTS["inertia_ripple"](e=0.3, n=2, psi=0.7)
    path = run(Parameters(6.2, 0, 0), (0, 1, 0), 2.0, 0, 20, [effect])
    time = np.linspace(0, 20, 300)
    theta, velocity = path.angle(time), path.velocity(time)
    inertia = 1 + 0.3 * np.cos(2 * theta + 0.7)
    assert np.ptp(inertia * velocity**2 / 2 - 6.2**2 * np.cos(theta)) < 1e-9


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
    effects = [load, sharp, magnet]
    path = run(Parameters(w0, 0, friction), (0.9, 9, 0), 2.5, 1.0, 2, effects)
    assert path.angle(np.array([2.0])) == pytest.approx(other.y[0, -1], abs=1e-7)


def test_impulses_are_jumps_of_the_velocity() -> None:
    train = EFFECTS["impulses:train"](J=0.05, every=2.0, pattern=7)
    assert len(train.kicks(0, 10)) >= 3
    for effect in (train, EFFECTS["impulses"](J=0.05, t0=4.3)):
        path = run(Parameters(6.2, 0.1, 0.1), (0, 1, 0), 1.0, 0, 10, [effect])
        for time, jump in effect.kicks(0, 10):
            before, after = path.velocity(np.array([time - 1e-9, time + 1e-9]))
            assert after - before == pytest.approx(jump, abs=1e-6)


def test_a_lag_against_its_differential_equation() -> None:
    path = run(Parameters(6.2, 0.1, 0.1), (0, 1, 0), 2.5, 0, 3)
    lag = EFFECTS["sensor_lag"](tau=0.02)

    def rate(t: float, y: np.ndarray) -> list[float]:
        return [(float(path.angle(np.array([t]))[0]) - float(y[0])) / 0.02]

    time = np.sort(np.random.default_rng(1).uniform(0, 3, 40))
    start = lag.distort(Reading(np.array([0.0, 1.0]), np.zeros(2), path))[0]
    other = solve_ivp(rate, (0, 3), [start], t_eval=time, rtol=1e-9, atol=1e-10, max_step=0.05)
    span = np.concatenate([[0.0], time, [3.0]])
    read = lag.distort(Reading(span, np.zeros(span.size), path))[1:-1]
    assert read == pytest.approx(other.y[0], abs=2e-8)
