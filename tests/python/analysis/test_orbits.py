"""Periodic orbits and Lyapunov exponents against scipy and reference values."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from by_scipy import poincare
from pendmap import Pendulum, render
from pendmap.files import facts
from recordings import recorded

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr

TRANSIENT = Pendulum(gamma=0.1, p=1.8, omega=2.0)


@pytest.fixture(scope="module")
def chaos() -> xr.Dataset:
    return pendmap.lyapunov(Pendulum(gamma=0.1, p=2.0, omega=2.0))


@pytest.fixture(scope="module")
def settled() -> xr.Dataset:
    """Return a start that is chaotic for some time."""
    return pendmap.lyapunov(TRANSIENT, 0.6, 0.2)


def test_chaos_against_the_reference(chaos: xr.Dataset, truths: dict[str, Any]) -> None:
    entry = truths["lyapunov"]["w2.0_p2.0"]
    a = facts(chaos)
    assert a["end"] == "chaotic"
    assert 0 < a["largest_exponent_stderr"] < 0.002 * a["largest_exponent"]
    assert abs(a["largest_exponent"] - entry["lle_per_tau"]) < 3 * math.hypot(
        a["largest_exponent_stderr"], entry["se"]
    )
    assert a["per_period"] == pytest.approx(a["largest_exponent"] * math.pi)
    assert a["second_exponent"] + a["largest_exponent"] == pytest.approx(-0.1)
    assert abs(a["kaplan_yorke_dimension"] - entry["D_KY_map"]) < 2e-3
    assert float(chaos["exponent"][0]) == a["largest_exponent"]


def test_growth_along_the_start_is_the_tangents_of_scipy(settled: xr.Dataset) -> None:
    tangent = np.full(2, math.sqrt(0.5))
    for k, growth in enumerate(settled["growth"].values[1:9], 1):
        _, derivative = poincare(TRANSIENT, (0.6, 0.2), k)
        assert growth == pytest.approx(math.log(np.linalg.norm(derivative @ tangent)), abs=2e-3)


def test_transient_chaos_has_the_exponent_of_the_attractor_that_captures_it(
    settled: xr.Dataset,
) -> None:
    a = facts(settled)
    assert a["end"] == "captured"
    assert a["transient_periods"] > 30
    assert settled["growth"].values.max() > 15
    assert a["largest_exponent"] == pytest.approx(-0.05, abs=1e-9)
    assert (a["largest_exponent_stderr"], a["trajectories"]) == (0.0, 0)
    assert a["second_exponent"] == pytest.approx(-0.05, abs=1e-9)
    assert "reached after" in a["summary"]
    assert "rounding decides" in a["summary"]


def test_regular_motion_without_damping_has_the_growth_of_tau_and_no_error() -> None:
    # In a free pendulum the distance of neighbours grows in proportion to time.
    a = facts(pendmap.lyapunov(Pendulum(gamma=0.0, p=0.0), 2.0))
    assert a["largest_exponent"] == pytest.approx(a["regular"], rel=0.1)
    assert math.isnan(a["largest_exponent_stderr"])
    assert "not significantly different from 0" in a["summary"]
    chaotic = facts(pendmap.lyapunov(Pendulum(gamma=0.0, p=1.0), 2.0))
    assert chaotic["largest_exponent"] > 50 * chaotic["regular"]
    assert 0 < chaotic["largest_exponent_stderr"] < 0.01 * chaotic["largest_exponent"]


def test_friction_holds_a_pendulum_without_an_exponent_and_turns_shrink_area() -> None:
    found = pendmap.lyapunov(Pendulum(gamma=0.1, p=1.5, omega=0.87, theta_r=0.2))
    assert (found["end"].item(), str(found["attractor"].values[0])) == ("captured", "rest")
    assert math.isnan(found["largest_exponent"].item())
    assert "Friction holds it permanently" in found.attrs["summary"]
    found = pendmap.lyapunov(Pendulum(gamma=0.1, p=1.0, omega=0.87, theta_r=0.01))
    assert str(found["kind"].values[0]) == "oscillation"
    # Each turning point shrinks phase area in addition to viscous damping.
    assert -0.12 < found["exponent_sum"].item() < -0.101


# Periodic orbits; Rust tests have the reference values


@pytest.mark.parametrize(("n", "w", "count"), [(1, 1, 2), (2, 0, 3), (2, 2, 1)])
def test_each_orbit_closes_and_has_its_multipliers_by_scipy(n: int, w: int, count: int) -> None:
    model = Pendulum(gamma=0.1, p=1.4, omega=2.0, phase=0.4, torque=0.005)
    found = pendmap.orbit(model, n, w)
    assert found.sizes["orbit"] == count
    for k in range(found.sizes["orbit"]):
        row = found.isel(orbit=k)
        start = float(row["theta_point"]), float(row["velocity_point"])
        end, derivative = poincare(model, start, n, 1e-13)
        size = np.linalg.norm(derivative)
        gap = end - start - np.array([math.tau * w, 0.0])
        assert np.abs(gap).max() < 1e-9 * size
        own = np.sort_complex(row["multipliers"].values @ np.array([1, 1j]))
        theirs = np.sort_complex(np.linalg.eigvals(derivative).astype(complex))
        assert np.allclose(own, theirs, atol=1e-9 * size)
        assert bool(row["stable"]) == bool(np.abs(own).max() < 1)


def test_a_result_may_have_no_orbit(tmp_path: Path) -> None:
    found = pendmap.orbit(Pendulum(gamma=0.5, p=0.1, omega=2.0), 3, 1)
    assert found.sizes["orbit"] == 0
    assert found.attrs["summary"].startswith("No orbit of period 3 and 1 net turn forward, 0")
    back = pendmap.load(pendmap.save(found, tmp_path / "none.nc"))
    assert render.draw(back, tmp_path / "none.png").stat().st_size > 0
    assert "/summary" in recorded(back, tmp_path).columns


def test_without_drive_and_damping_hanging_rest_is_the_stable_one() -> None:
    found = pendmap.orbit(Pendulum(gamma=0.0, p=0.0))
    assert [str(name) for name in found["orbit"].values] == ["rest", "inverted rest"]
    assert found["stable"].values.tolist() == [1, 0]
