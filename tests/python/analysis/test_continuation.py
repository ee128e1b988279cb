"""Branches of orbits: values by scipy, in both units, along any parameter, under friction."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

import pendmap
from by_scipy import poincare
from pendmap import Effect, InputError, Pendulum, Rig

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
    assert result.branch_symmetric.values.tolist() == [1, 0, 0]
    assert result.branch_twin.values.tolist() == [-1, 2, 1]
    ends = {*result.branch_begin.values.tolist(), *result.branch_end.values.tolist()}
    assert ends == {"meets rest", "end of the range", "meets its parent orbit"}
    fields = pendmap.analysis.continuation.SCHEMA.json(result)
    assert {event["kind"] for event in fields["events"]} == {"symmetry_breaking", "period_doubling"}
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
