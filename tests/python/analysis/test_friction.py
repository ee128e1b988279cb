"""Stick and slip in one trajectory against scipy, event by event."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import pendmap
from pendmap import Pendulum

if TYPE_CHECKING:
    from pathlib import Path

UNTIL = 25.0
STEP = 0.05
"""Longest step of the oracle: it would miss two zeros of the velocity that are closer."""


class Happening(NamedTuple):
    """A turning point, a stick or a release."""

    time: float
    kind: str
    theta: float


def load(x: Pendulum, time: float, theta: float) -> float:
    return x.torque - (1 + x.p * math.cos(x.omega * time + x.phase)) * math.sin(theta)


def released(x: Pendulum, time: float, theta: float) -> tuple[float, float] | None:
    """Return when and in which sense a stuck pendulum moves: the first zero on a fine grid."""
    grid = np.arange(time, min(UNTIL, time + x.period) + 1e-3, 1e-3)
    loads = np.array([load(x, t, theta) for t in grid])
    moving = np.flatnonzero(np.abs(loads) > x.theta_r)
    if moving.size == 0:
        return None
    k = int(moving[0])
    sense = math.copysign(1, loads[k])
    root = brentq(lambda t: sense * load(x, t, theta) - x.theta_r, grid[k - 1], grid[k], xtol=1e-14)
    return float(root), sense


def scipy_run(x: Pendulum, theta: float, velocity: float) -> tuple[list[Happening], list[float]]:
    """Integrate between events, with the sign of the velocity held fixed in each piece."""
    happened: list[Happening] = []
    time, state, sense = 0.0, [theta, velocity], math.copysign(1, velocity)
    while time < UNTIL:

        def slope(t: float, y: list[float], sense: float = sense) -> list[float]:
            return [y[1], load(x, t, y[0]) - x.gamma * y[1] - x.theta_r * sense]

        def stop(_: float, y: list[float]) -> float:
            return y[1]

        stop.terminal, stop.direction = True, -sense  # type: ignore[attr-defined]
        run = solve_ivp(
            slope,
            (time, UNTIL),
            state,
            "DOP853",
            events=stop,
            rtol=3e-14,
            atol=1e-14,
            max_step=STEP,
        )
        time, state = float(run.t[-1]), [float(run.y[0, -1]), float(run.y[1, -1])]
        if run.status == 0:
            break
        state[1] = 0.0
        pull = load(x, time, state[0])
        if abs(pull) > x.theta_r:
            sense = math.copysign(1, pull)
            happened.append(Happening(time, "turn", state[0]))
            continue
        happened.append(Happening(time, "stick", state[0]))
        after = released(x, time, state[0])
        if after is None:
            return happened, state
        time, sense = after
        happened.append(Happening(time, "release", state[0]))
    return happened, state


def models() -> list[tuple[Pendulum, float, float]]:
    rng = np.random.default_rng(7)
    return [
        (
            Pendulum(
                gamma=rng.uniform(0, 0.3),
                p=rng.uniform(0.2, 2),
                omega=rng.uniform(0.5, 2.5),
                phase=rng.uniform(-3, 3),
                torque=rng.uniform(-0.1, 0.1),
                theta_r=rng.uniform(0.02, 0.3),
            ),
            rng.uniform(-3, 3),
            rng.uniform(-2, 2),
        )
        for _ in range(25)
    ]


@pytest.mark.parametrize(("pendulum", "theta", "velocity"), models())
def test_random_frictions_against_scipy(pendulum: Pendulum, theta: float, velocity: float) -> None:
    expected, end = scipy_run(pendulum, theta, velocity)
    run = pendmap.simulate(pendulum, theta, velocity, UNTIL, tol=1e-12)
    kinds = [str(kind) for kind in run.event_kind.values]
    found = list(zip(run.event_time.values, kinds, run.event_theta.values, strict=True))
    if "stuck for ever" in kinds:
        assert found.pop()[:2] == (found[-1][0], "stuck for ever")
        assert run["stuck"].item() == 1
    assert [kind for _, kind, _ in found] == [event.kind for event in expected]
    # Near a saddle the motion amplifies the error of either integrator.
    for (time, _, angle), event in zip(found, expected, strict=True):
        assert time == pytest.approx(event.time, abs=1e-7)
        assert angle == pytest.approx(event.theta, abs=1e-8)
    assert float(run.theta[-1]) == pytest.approx(end[0], abs=1e-8)
    assert float(run.velocity[-1]) == pytest.approx(end[1], abs=1e-8)


def test_events_are_stored(tmp_path: Path) -> None:
    stuck = pendmap.simulate(Pendulum(p=0, theta_r=0.1), 1, 0, 50)
    free = pendmap.simulate(Pendulum(p=0), 0, 30, 0.1)
    assert free.sizes["event"] == 0
    for name, run in (("stuck", stuck), ("free", free)):
        again = pendmap.load(pendmap.save(run, tmp_path / f"{name}.nc"))
        assert list(again.event_kind.values) == list(run.event_kind.values)
        assert again.event_time.values == pytest.approx(run.event_time.values)
    assert "permanently" in stuck.attrs["summary"]
    assert stuck["stuck"].item() == 1
    assert free["stuck"].item() == 0


def test_friction_without_a_turning_point_is_a_constant_torque() -> None:
    """Without a turning point friction is a constant torque against the motion."""
    rubbing = pendmap.simulate(Pendulum(theta_r=0.05), 0, 7, 5, tol=1e-12)
    pushed = pendmap.simulate(Pendulum(torque=-0.05), 0, 7, 5, tol=1e-12)
    assert (rubbing.velocity.values > 0).all()
    assert rubbing.theta.values == pytest.approx(pushed.theta.values, abs=1e-12)


def test_a_pendulum_held_for_ever_has_no_exponent() -> None:
    run = pendmap.simulate(
        pendmap.Pendulum(p=1.5, omega=0.87, theta_r=0.2), 1.0, 0.0, 100.0, lyapunov=True
    )
    assert run["stuck"].item()
    assert "exponent" not in run


def test_a_motion_that_an_effect_drives_to_infinity_is_refused_in_one_line() -> None:
    fed = pendmap.Pendulum(effects=(pendmap.Effect("quadratic_drag", {"q": -1.0}),))
    with pytest.raises(pendmap.InputError, match="leaves the range of numbers"):
        pendmap.simulate(fed, 1.0, 2.0, 30.0)
    with pytest.raises(pendmap.InputError, match="leaves the range of numbers"):
        pendmap.basins(fed, pendmap.Grid.square(20))
