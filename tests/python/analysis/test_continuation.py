"""Branches of orbits: values by scipy, in both units, along any parameter, under friction."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

import pendmap
from by_scipy import poincare
from pendmap import Effect, Formula, InputError, Pendulum, Rig

BASE = Pendulum(gamma=0.1, omega=2.0)


def test_a_fold_and_a_doubling_are_where_scipy_has_them() -> None:
    result = pendmap.continuation(BASE, {"p": (0.3, 1.6)}, 1, 1, longest=1)
    kinds = dict(zip(result.event_kind.values.tolist(), result.event_value.values, strict=True))
    assert kinds["fold"] == pytest.approx(0.416787572822, abs=1e-10)
    assert kinds["period_doubling"] == pytest.approx(1.346858522521, abs=1e-10)
    (entry,) = np.flatnonzero(result.event_kind.values == "period_doubling")
    start = [float(result[f"event_{part}"][entry]) for part in ("theta", "velocity")]

    def above(p: float) -> float:
        """Return 1 + tr + det of the orbit's derivative."""
        pendulum = Pendulum(gamma=0.1, p=p, omega=2.0)
        turn = (2 * math.pi, 0.0)
        point = fsolve(lambda x: np.subtract(poincare(pendulum, x)[0], x) - turn, start, xtol=1e-10)
        _, derivative = poincare(pendulum, point)
        return float(1 + np.trace(derivative) + np.linalg.det(derivative))

    assert brentq(above, 1.34, 1.35, xtol=1e-12) == pytest.approx(
        kinds["period_doubling"], abs=1e-9
    )
    assert result.attrs["summary"].startswith("p = 0.3 to 1.6: 1 branch of orbits")


def test_branches_end_with_a_reason_and_twins_are_told() -> None:
    result = pendmap.continuation(BASE, {"p": (0.1, 1.4)}, 2, 0, longest=2)
    # The symmetric one, rest that it is born of, the twins.
    assert result.branch_symmetric.values.tolist() == [1, 1, 0, 0]
    assert result.branch_twin.values.tolist() == [-1, -1, 3, 2]
    ends = {*result.branch_begin.values.tolist(), *result.branch_end.values.tolist()}
    assert ends == {"meets rest", "end of the range", "meets its parent orbit"}
    fields = pendmap.analysis.continuation.SCHEMA.json(result)
    assert {event["kind"] for event in fields["events"]} == {"symmetry_breaking", "period_doubling"}
    assert [branch["kind"] for branch in fields["branches"]][:2] == ["oscillation", "rest"]
    assert all(len(branch["ends"]) == 2 for branch in fields["branches"])


def test_a_model_in_si_has_the_same_branches() -> None:
    w0 = 6.2
    rig = Rig(w0=w0, c_over_m=0.1 * w0, p=0.6, Omega=2 * w0)
    low, high = 1.2 * w0 / (2 * math.pi), 3.2 * w0 / (2 * math.pi)
    in_si = pendmap.continuation(rig, {"frequency_hz": (low, high)}, 1, 1, longest=1)
    bare = pendmap.continuation(
        Pendulum(gamma=0.1, p=0.6, omega=2.0), {"omega": (1.2, 3.2)}, 1, 1, longest=1
    )
    assert in_si.event_kind.values.tolist() == bare.event_kind.values.tolist()
    scaled = in_si.event_value.values * 2 * math.pi / w0
    assert scaled == pytest.approx(bare.event_value.values, abs=1e-9)


def test_friction_and_effects_vary_too() -> None:
    model = Pendulum(gamma=0.1, p=1.2, omega=2.0)
    rough = pendmap.continuation(model, {"theta_r": (0.02, 0.5)}, 1, 1, longest=1)
    assert rough.event_kind.values.tolist() == ["fold"]
    assert set(rough.orbit_phases.values.tolist()) == {"+"}
    drag = pendmap.continuation(model, {"quadratic_drag.q": (0.0, 0.3)}, 1, 1, longest=1)
    assert "fold" in drag.event_kind.values
    at = float(drag.event_value[drag.event_kind.values == "fold"][0])
    effects = [(Effect("quadratic_drag", {"q": at + by}),) for by in (-1e-4, 1e-4)]
    counts = [
        pendmap.orbit(Pendulum(gamma=0.1, p=1.2, omega=2.0, effects=one), 1, 1).sizes["orbit"]
        for one in effects
    ]
    assert counts[0] == counts[1] + 2


def test_a_start_must_be_near_an_orbit_of_the_model() -> None:
    model = Pendulum(gamma=0.1, p=0.6, omega=2.0)
    result = pendmap.continuation(model, {"p": (0.3, 1.0)}, 1, 1, start=(-0.96, 2.43), longest=1)
    assert result.sizes["branch"] == 1
    assert "section" not in result.sizes
    with pytest.raises(InputError, match="Newton's method finds none"):
        pendmap.continuation(model, {"p": (0.3, 1.0)}, 1, 1, start=(0.3, 9.0))
    with pytest.raises(InputError, match="p of the model must be in the range"):
        pendmap.continuation(model, {"p": (0.7, 1.0)}, 1, 1, start=(-0.96, 2.43))
    with pytest.raises(InputError, match="range of two values"):
        pendmap.continuation(model, {"p": (0.7, 0.7)}, 1, 1)
    with pytest.raises(InputError, match=r"one parameter, or two.*got {'p': \(0, 1\), 'omega'"):
        pendmap.continuation(model, {"p": (0, 1), "omega": (1, 2), "gamma": (0, 1)})
    with pytest.raises(InputError, match="longest must be a whole number from 1 to 64, got 0"):
        pendmap.continuation(model, {"p": (0.7, 1.0)}, longest=0)
    with pytest.raises(InputError, match=r"or EFFECT\.PARAMETER as pendmap effects"):
        pendmap.continuation(model, {"quadratic_drag.c": (0.0, 0.1)})


def test_all_types_up_to_a_period_give_regions_of_stable_orbits() -> None:
    result = pendmap.continuation(BASE, {"p": (0.3, 1.45)}, up_to=2)
    schema = pendmap.analysis.continuation.SCHEMA.json(result)
    assert [region["to"] for region in schema["regions"]][:-1] == pytest.approx(
        [
            0.378948709876,
            0.382951825776,
            0.416787572822,
            1.258943005924,
            1.331299842711,
            1.346858522520,
        ],
        abs=1e-9,
    )
    for value in (0.4, 1.0, 1.3, 1.34, 1.4):
        stable = pendmap.analysis.continuation.stable_orbits(result, value)
        basins = pendmap.basins(Pendulum(p=value, gamma=0.1, omega=2.0), pendmap.Grid.square(60))
        short = sorted(zip(*(basins[key].values.tolist() for key in ("n", "w")), strict=True))
        known = sorted((orbit["n"], orbit["w"]) for orbit in stable)
        assert known == [pair for pair in short if 1 <= pair[0] <= 2]
    with pytest.raises(InputError, match="must not be given with up_to"):
        pendmap.continuation(BASE, {"p": (0.3, 1.5)}, 1, up_to=2)


def test_an_invariant_curve_begins_on_the_side_that_is_named() -> None:
    def largest(b: float, c: float, start: float, until: float) -> float:
        """Return the largest angle of scipy's motion near the end."""
        result = solve_ivp(
            lambda t, x: [
                x[1],
                -(0.2 - b) * x[1] - c * x[1] ** 3 - (1 + 0.05 * math.cos(1.3 * t)) * math.sin(x[0]),
            ],
            (0, until),
            [start, 0.0],
            rtol=1e-9,
            atol=1e-10,
        )
        return float(np.abs(result.y[0, result.t > until - 20]).max())

    for c, side in ((0.5, 1), (-0.5, 0)):
        pump = Formula("pump", "b*v - c*v^3", {"b": 1, "c": -1})(b=0.18, c=c)
        model = Pendulum(gamma=0.2, p=0.05, omega=1.3, effects=(pump,))
        result = pendmap.continuation(model, {"pump.b": (0.15, 0.25)}, start=(0.0, 0.0))
        kinds = result.event_kind.values == "neimark_sacker"
        assert result.event_supercritical.values[kinds].tolist() == [side]
    # Supercritical: a small motion grows to a curve beyond. Subcritical: a large one grows before.
    assert 0.1 < largest(0.21, 0.5, 1e-3, 2000) < 0.25
    assert largest(0.19, -0.5, 0.05, 600) < 1e-2
    assert largest(0.19, -0.5, 0.2, 100) > 0.25
