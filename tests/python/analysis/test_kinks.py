"""Rest on a kink of the torque: one growth in all analyses, against scipy in each sector."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
from pendmap import Effect, Formula, Grid, Pendulum

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from numpy.typing import NDArray

FORMULA = Formula("uneven", "-b*abs(v)", {"b": 1})


def growth(
    stiffness: Callable[[float], float],
    damping: tuple[float, float],
    period: float,
    periods: int,
    start: float,
) -> float:
    """Return the mean growth rate of a small motion that is damped by its sense, by scipy."""
    state, logs = np.array([start, 0.3]), []

    def turn(_: float, y: NDArray[np.float64], *__: float) -> float:
        return float(y[1])

    turn.terminal = True  # type: ignore[attr-defined]
    for _ in range(periods):
        t = 0.0
        while t < period:
            forth = state[1] > 0 or (state[1] == 0 and stiffness(t) * state[0] < 0)
            turn.direction = -1.0 if forth else 1.0  # type: ignore[attr-defined]
            run = solve_ivp(
                lambda t, y, c: [y[1], -stiffness(t) * y[0] - c * y[1]],
                (t, period),
                state,
                method="DOP853",
                rtol=1e-10,
                atol=1e-14,
                args=(damping[0 if forth else 1],),
                events=turn,
            )
            t, state = float(run.t[-1]), run.y[:, -1]
            if run.status == 1:
                state = np.array([state[0], 0.0])
        logs.append(np.log(np.hypot(*state)))
        state /= np.hypot(*state)
    # Near a resonance directions return after one period or two, and others join them.
    return float(np.mean(logs[-2:]) / period)


def expected(model: Pendulum, b: float, theta: float, periods: int = 24) -> float:
    """Return the greater growth of a motion that begins forward and of one that begins backward."""
    sign, period = np.cos(theta), 2 * np.pi / model.omega

    def stiffness(t: float) -> float:
        return float(sign * (1 + model.p * np.cos(model.omega * t)))

    damping = model.gamma + b, model.gamma - b
    return max(growth(stiffness, damping, period, periods, start) for start in (1.0, -1.0))


def of_rest(found: xr.Dataset) -> float:
    """Return the exponent of hanging rest among attractors, nan where it is none of them."""
    names = found["attractor"].values.tolist()
    return float(found["exponent"].values[names.index("rest")]) if "rest" in names else np.nan


@pytest.mark.parametrize("given", ["effect", "formula"])
@pytest.mark.parametrize("seed", range(2))
def test_all_analyses_give_rest_one_growth(seed: int, given: str) -> None:
    draw = np.random.default_rng(seed)
    gamma, omega, p = draw.uniform(0.2, 0.4), draw.uniform(1.9, 2.1), draw.uniform(0.6, 1.0)
    b = float(gamma * draw.uniform(-1, 1))
    effect = FORMULA(b=b) if given == "formula" else Effect("asymmetric_viscous", {"b": b})
    model = Pendulum(gamma, p, omega, effects=(effect,))
    exact = expected(model, b, 0.0)
    orbits = pendmap.orbit(model, 1, 0, Grid.square(24))
    k = int(np.abs(orbits["theta_point"].values).argmin())
    size = np.hypot(*orbits["multipliers"].values[k, 0])
    assert np.log(size) * omega / (2 * np.pi) == pytest.approx(exact, abs=1e-6)
    assert bool(orbits["stable"].values[k]) == (exact < 0)
    basins = pendmap.basins(model, Grid.square(8))
    assert np.isnan(of_rest(basins)) == (exact > 0)
    if exact < 0:
        assert of_rest(basins) == pytest.approx(exact, abs=1e-6)
        found = pendmap.lyapunov(model, 0.01, 0.0)
        assert float(found["exponent"].values[0]) == pytest.approx(exact, abs=1e-6)


@pytest.mark.parametrize(
    ("gamma", "omega", "b", "theta", "p_max"),
    [(0.2, 1.8, 0.15, 0.0, 0.7), (0.1, 2.3, -0.1, 0.0, 0.9), (0.6, 10.0, 0.02, np.pi, 16.0)],
)
def test_critical_amplitudes_are_where_the_growth_vanishes(
    gamma: float, omega: float, b: float, theta: float, p_max: float
) -> None:
    effects = (Effect("asymmetric_viscous", {"b": b}),)
    found = pendmap.tongues(Pendulum(gamma, 0.5, omega, effects=effects), [omega], p_max)
    mine = found.critical_inverted.values == (theta > 0)
    (p,) = found.critical_p.values[mine]
    above = bool(found.critical_stable_above.values[mine][0])
    sides = [
        expected(Pendulum(gamma, p * by, omega), b, theta, 60) < 0 for by in (1 - 1e-4, 1 + 1e-4)
    ]
    assert sides == [not above, above]
    if theta == 0:
        model = Pendulum(gamma, 0.5, omega, effects=effects)
        along = pendmap.continuation(model, {"p": (0.5 * p, 1.2 * p)}, n=1, w=0, longest=1)
        at_rest = np.abs(along.event_theta.values) + np.abs(along.event_velocity.values) < 1e-9
        assert along.event_value.values[at_rest] == pytest.approx([p], abs=1e-9)
        assert along.event_kind.values[at_rest] == ["period_doubling"]


@pytest.mark.parametrize(
    ("half", "term"),
    [
        # (v + abs(v))/2: half of it is viscous damping.
        (True, "-b*max(v, 0)"),
        (True, "-b*max(0, v)"),
        (True, "b*min(-v, 0)"),
        (True, "-b*0.5*(v + abs(2*v - v))"),
        (True, "-b*(max(v, 3*v) - v)/2"),
        (True, "-b*max(v*abs(1 + theta*0), 0)"),
        (False, "-b*sqrt(v^2)"),
        (False, "-b*((v - 3*v)*(v/4 + v/4)*-1)^0.5"),
        (False, "-b*max(v, -v)"),
        (False, "-b*max(abs(v), 0)"),
        (False, "b*v*-1*sign(3*v - v)"),
    ],
)
def test_a_kink_may_be_written_in_other_ways(half: bool, term: str) -> None:  # noqa: FBT001 (a row of the table)
    written = Formula("written", term, {"b": 1})(b=0.2 if half else 0.1)
    found = pendmap.basins(Pendulum(0.05 if half else 0.15, 0.35, 2.1, effects=(written,)), 8)
    truth = pendmap.basins(Pendulum(0.15, 0.35, 2.1, effects=(FORMULA(b=0.1),)), 8)
    assert np.array_equal(found["label"], truth["label"])
    assert found.attrs["steps_per_period"] == truth.attrs["steps_per_period"]
    assert of_rest(found) == pytest.approx(of_rest(truth), abs=1e-9)


def test_the_kink_of_a_rest_is_one_of_the_speed() -> None:
    whole = Formula("whole", "-b*w0*abs(tanh(v/w0 + (v/w0)^3))", {"b": 1})
    model = Pendulum(0.15, 0.35, 2.1, effects=(whole(b=0.1),))
    plain = Pendulum(0.15, 0.35, 2.1, effects=(FORMULA(b=0.1),))
    one, other = (pendmap.basins(m, 8) for m in (model, plain))
    assert of_rest(one) == pytest.approx(of_rest(other), abs=1e-9)
    for term in ("-b*w0*abs(sin(v/w0))", "-b*w0*max(exp(v/w0) - 1, 0)"):
        with pytest.raises(pendmap.InputError, match="must have v as a factor"):
            Formula("other", term, {"b": 1})
