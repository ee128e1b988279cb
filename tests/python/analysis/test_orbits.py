"""Periodic orbits, stable and unstable, against reference values and scipy; figures and files."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
from drawn import made, named
from pendmap import Axis, Grid, Pendulum, render
from recordings import recorded

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr


DRIVEN = Pendulum(gamma=0.1, p=1.0, omega=2.0)


def once_by_scipy(pendulum: Pendulum, start: tuple[float, float], n: int) -> Any:  # noqa: ANN401
    """Return the state after n periods and its derivative, by the variational equations."""

    def slope(tau: float, y: Any) -> list[float]:  # noqa: ANN401
        pull = 1 + pendulum.p * math.cos(pendulum.omega * tau + pendulum.phase)
        bend = -pull * math.cos(y[0])
        a = pendulum.torque - pendulum.gamma * y[1] - pull * math.sin(y[0])
        further = [y[3], bend * y[2] - pendulum.gamma * y[3]]
        return [y[1], a, *further, y[5], bend * y[4] - pendulum.gamma * y[5]]

    run = solve_ivp(
        slope,
        (0.0, n * pendulum.period),
        (*start, 1.0, 0.0, 0.0, 1.0),
        method="DOP853",
        rtol=1e-13,
        atol=1e-14,
    )
    end = run.y[:, -1]
    return end[:2], np.array([[end[2], end[4]], [end[3], end[5]]])


def known(truths: dict[str, Any]) -> list[dict[str, Any]]:
    return [entry for entry in truths["attractors"] if entry["n"] <= 2]


def test_the_known_attractors_are_among_the_orbits(truths: dict[str, Any]) -> None:
    for entry in known(truths):
        model = Pendulum(gamma=entry["gamma"], p=entry["p"], omega=entry["omega"])
        found = pendmap.orbit(model, entry["n"], entry["winding"])
        at = np.array(min(entry["points"]))
        points = np.stack([found["theta_point"].values, found["velocity_point"].values], axis=1)
        gap = np.abs(points - at).max(axis=1)
        own = int(np.argmin(gap))
        assert gap[own] < 1e-9
        assert int(found["stable"][own]) == 1
        multipliers = found["multipliers"].values[own] @ np.array([1, 1j])
        expected = np.array(entry["mult"]) @ np.array([1, 1j])
        assert np.allclose(np.sort_complex(multipliers), np.sort_complex(expected), atol=1e-9)


@pytest.mark.parametrize(("n", "w", "count"), [(1, 1, 2), (2, 0, 3), (2, 2, 1)])
def test_each_orbit_closes_and_has_its_multipliers_by_scipy(n: int, w: int, count: int) -> None:
    model = Pendulum(gamma=0.1, p=1.4, omega=2.0, phase=0.4, torque=0.005)
    found = pendmap.orbit(model, n, w)
    assert found.sizes["orbit"] == count
    for k in range(found.sizes["orbit"]):
        row = found.isel(orbit=k)
        start = float(row["theta_point"]), float(row["velocity_point"])
        end, derivative = once_by_scipy(model, start, n)
        size = np.linalg.norm(derivative)
        gap = end - start - np.array([math.tau * w, 0.0])
        assert np.abs(gap).max() < 1e-9 * size
        own = np.sort_complex(row["multipliers"].values @ np.array([1, 1j]))
        theirs = np.sort_complex(np.linalg.eigvals(derivative).astype(complex))
        assert np.allclose(own, theirs, atol=1e-9 * size)
        assert bool(row["stable"]) == bool(np.abs(own).max() < 1)


def test_the_path_is_the_motion() -> None:
    found = pendmap.orbit(DRIVEN, 2, 0)
    for number in found["id"].values:
        mine = found["path_orbit"].values == number
        points = np.stack([found["point_theta"].values, found["point_velocity"].values], axis=1)
        points = points[found["point_orbit"].values == number]
        for piece in (0, 1):
            own = mine & (found["path_piece"].values == piece)
            path = np.stack([found["path_theta"].values[own], found["path_velocity"].values[own]])
            assert np.abs(path[:, 0] - points[piece]).max() < 1e-12
            gap = path[:, -1] - points[(piece + 1) % 2]
            gap[0] -= math.tau * round(gap[0] / math.tau)
            assert np.abs(gap).max() < 1e-7


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"n": 0}, "n must be a whole number from 1 to 64, got 0"),
        ({"n": 65}, "1 to 64"),
        ({"n": 1.5}, "n must be .*, got 1.5"),
        ({"w": math.nan}, "w must be .*, got nan"),
        ({"grid": 3}, "Grid"),
    ],
)
def test_invalid_arguments_are_refused(given: dict[str, Any], match: str) -> None:
    with pytest.raises(pendmap.InputError, match=match):
        pendmap.orbit(DRIVEN, **given)


def test_a_result_may_have_no_orbit(tmp_path: Path) -> None:
    found = pendmap.orbit(Pendulum(gamma=0.5, p=0.1, omega=2.0), 3, 1)
    assert found.sizes["orbit"] == 0
    assert found.attrs["summary"].startswith("No orbit of period 3 and 1 net turn forward, 0")
    back = pendmap.load(pendmap.save(found, tmp_path / "none.nc"))
    assert render.draw(back, tmp_path / "none.png").stat().st_size > 0
    assert "/summary" in recorded(back, tmp_path).columns


@pytest.fixture(scope="module")
def oscillations() -> xr.Dataset:
    return pendmap.orbit(Pendulum(gamma=0.1, p=1.3, omega=2.0), 2, 0)


def test_the_figure_names_orbits_and_their_stability(oscillations: xr.Dataset) -> None:
    figure = made(oscillations)
    said = named(figure)
    assert len(said) == oscillations.sizes["orbit"]
    assert sum(", stable" in text for text in said) == int(oscillations["stable"].sum())
    broken = [line for line in figure.axes[0].get_lines() if line.get_linestyle() == "--"]
    unstable = oscillations.sizes["orbit"] - int(oscillations["stable"].sum())
    assert len(broken) == unstable


def test_orbits_are_sought_within_the_given_box() -> None:
    wide = pendmap.orbit(DRIVEN, 1, 0)
    at = float(wide["theta_point"][0])
    box = Grid(Axis(at - 0.3, at + 0.3, 30), Axis(-0.3, 0.3, 30))
    assert pendmap.orbit(DRIVEN, 1, 0, box).sizes["orbit"] == 1


def test_without_drive_and_damping_hanging_rest_is_the_stable_one() -> None:
    found = pendmap.orbit(Pendulum(gamma=0.0, p=0.0))
    assert [str(name) for name in found["orbit"].values] == ["rest", "inverted rest"]
    assert found["stable"].values.tolist() == [1, 0]
