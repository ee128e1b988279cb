"""Critical curves against Mathieu's functions and scipy; Rust tests have the reference values."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from matplotlib.path import Path as Outline
from scipy.special import mathieu_a, mathieu_b

import pendmap
from by_scipy import decays, poincare
from pendmap import Formula, Pendulum
from pendmap.analysis.tongues import CURVES, SCHEMA
from pendmap.charts import tongues as drawn

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

DAMPED = Pendulum(gamma=0.1)


NAMES = ("index", "p", "multiplier", "stable_above")


def rest(found: xr.Dataset, *, inverted: bool = False) -> list[NDArray[np.float64]]:
    """Return the columns of the critical amplitudes of a rest: its :data:`NAMES`."""
    mine = found["critical_inverted"].values == inverted
    return [found[f"critical_{name}"].values[mine] for name in NAMES]


def test_without_damping_they_are_mathieus_characteristic_curves() -> None:
    # 4/omega^2 = a_r(q) or b_r(q), q = 2 p/omega^2: curves of both kinds, thin tongues included.
    omegas = [0.52, 0.66, 0.71, 0.99, 1.03, 1.7, 2.3]
    found = pendmap.tongues(Pendulum(gamma=0.0), omegas, 2.0)
    index, amplitudes, multipliers, _ = rest(found)
    assert index.size > 8
    for k, p, m in zip(index, amplitudes, multipliers, strict=True):
        level, q = 4 / omegas[k] ** 2, 2 * p / omegas[k] ** 2
        orders = range(0, 8, 2) if m > 0 else range(1, 8, 2)
        values = [float(mathieu_a(r, q)) for r in orders]
        values += [float(mathieu_b(r, q)) for r in orders if r]
        assert min(abs(value - level) for value in values) < 1e-8 * level


@pytest.mark.parametrize(
    ("omega", "gamma", "theta", "p_max"),
    [(0.8, 0.1, 0.0, 6.0), (2.5, 0.0, math.pi, 30.0), (6.0, 0.5, math.pi, 30.0)],
)
def test_stable_means_that_motions_decay(
    omega: float, gamma: float, theta: float, p_max: float
) -> None:
    found = pendmap.tongues(Pendulum(gamma=gamma), omega, p_max)
    _, amplitudes, _, above = rest(found, inverted=theta > 0)
    edges = [0.0, *amplitudes, p_max]
    stable = [0 if theta else int(found["stable_at_first"][0]), *above]
    assert 1 in stable
    for low, high, yes in zip(edges[:-1], edges[1:], stable, strict=True):
        for p in (low + (high - low) * part for part in (0.2, 0.5, 0.9)):
            assert decays(Pendulum(gamma, p, omega), theta) == bool(yes), p


def test_hanging_rest_alone_is_computed_where_upright_is_no_rest() -> None:
    push = Formula("push", "k*(1 - cos(theta))", {"k": 2})
    pushed = Pendulum(gamma=0.1, effects=(push(k=0.1),))
    found = pendmap.tongues(pushed, 6.0, 20.0)
    assert found["inverted_rest"].item() == 0
    assert found.sizes["critical"] > 0
    assert not found["critical_inverted"].any()
    assert "nverted" not in found.attrs["summary"]


def orbits_near(angle: float, model: Pendulum) -> list[NDArray[np.complex128]]:
    """Return the multipliers of the orbits of the drive's period found by Newton's method."""
    found: dict[tuple[float, float], NDArray[np.complex128]] = {}
    for start in angle + np.linspace(-0.6, 0.6, 5):
        x = np.array([start, 0.0])
        for _ in range(12):
            end, monodromy = poincare(model, x, tol=1e-10)
            if np.abs(end - x).max() < 1e-9:
                found[round(x[0], 5), round(x[1], 5)] = np.linalg.eigvals(monodromy)
                break
            x = x - np.linalg.solve(monodromy - np.eye(2), end - x)
            if abs(x[0] - angle) > 2:
                break
    return list(found.values())


@pytest.mark.parametrize(("omega", "torque"), [(6.0, 0.3), (9.0, -0.6)])
def test_under_a_torque_orbits_are_stable_where_scipy_finds_them_so(
    omega: float, torque: float
) -> None:
    model = Pendulum(gamma=0.1, omega=omega, torque=torque)
    found = pendmap.tongues(model, omega, 45.0)
    _, p, multiplier, above = rest(found, inverted=True)
    low, high = p[:2]
    assert multiplier[:2].tolist() == [1, -1]
    assert above[:2].tolist() == [1, 0]

    def multipliers(angle: float, p: float) -> list[NDArray[np.complex128]]:
        return orbits_near(angle, dataclasses.replace(model, p=p))

    def stable(angle: float, p: float) -> bool:
        return any(abs(m).max() < 1 for m in multipliers(angle, p))

    # The orbit begins at a fold, and ends with a period doubling.
    assert [stable(math.pi, p) for p in (0.995 * low, 1.002 * low)] == [False, True]
    assert [stable(math.pi, p) for p in (0.998 * high, 1.002 * high)] == [True, False]
    assert min(abs(m + 1).min() for m in multipliers(math.pi, high)) < 1e-6
    _, amplitudes, multiplier, _ = rest(found)
    first = float(amplitudes[0])
    assert multiplier[0] == -1
    assert found["stable_at_first"].values[0] == 1
    at_rest = math.asin(torque)
    assert min(abs(m + 1).min() for m in multipliers(at_rest, first)) < 1e-6
    assert stable(at_rest, 0.99 * first)


def test_a_mirrored_torque_has_the_same_curves_and_no_orbit_is_counted_twice() -> None:
    omega = np.linspace(1.55, 1.75, 5)
    one, other = (
        pendmap.tongues(Pendulum(gamma=0.1, torque=torque), omega, 8.0) for torque in (0.2, -0.2)
    )
    assert np.allclose(one["critical_p"], other["critical_p"], atol=1e-8)
    index, p, *_ = rest(one)
    for k in range(omega.size):
        assert (np.diff(p[index == k]) > 1e-6).all()


@pytest.mark.parametrize("name", CURVES)
def test_errors_of_asymptotic_curves_have_their_order(name: str) -> None:
    multiplier, formula = CURVES[name]
    # Toward the tip, with damping in proportion: detuning, p and gamma (or its root) are all small.
    errors = []
    for size in (0.08, 0.04):
        near = 2.0 if multiplier < 0 else 1.0
        omega = near * (1 + (size if multiplier < 0 else size**2))
        gamma = (0.5 * size) if multiplier < 0 else 0.5 * size**2
        _, p, m, _ = rest(pendmap.tongues(Pendulum(gamma=gamma), omega))
        exact = p[m == multiplier][0]
        errors.append(abs(float(formula(np.array([omega]), gamma)[0]) - exact) / exact)
    order = math.log2(errors[0] / errors[1])
    assert order > 1.7, (order, errors)


@pytest.fixture(scope="module")
def coarse() -> xr.Dataset:
    return pendmap.tongues(DAMPED, np.linspace(1.1, 2.1, 5), 3.0)


def test_curves_are_followed_around_their_turns_between_frequencies(coarse: xr.Dataset) -> None:
    doubling = np.flatnonzero(coarse["curve_kind"].values == "period_doubling")
    owner, omega, p = (coarse[f"place_{name}"].values for name in ("curve", "omega", "p"))
    nose = min(doubling, key=lambda k: np.abs(p[owner == k] - 2.3).min())
    least = omega[owner == nose].argmin()
    assert p[owner == nose][least] == pytest.approx(2.3, abs=0.1)
    assert 1.1 < omega[owner == nose][least] < 1.35
    # The fold of the oscillation begins where the doubling changes its side.
    assert "fold" in coarse["curve_kind"].values
    at = coarse["degenerate_omega"].values[coarse["degenerate_kind"].values != "cusp"]
    assert at == pytest.approx([1.993746585880], abs=1e-8)


def test_a_kink_has_critical_amplitudes_and_no_curves() -> None:
    kinked = Pendulum(gamma=0.2, effects=(pendmap.Effect("asymmetric_viscous", {"b": 0.1}),))
    found = pendmap.tongues(kinked, [1.8, 2.0], 1.0)
    assert found.sizes["critical"] == 2
    assert "curve_kind" not in found
    names = [mark.name for mark in drawn.chart(found).panels[0].marks]
    assert "multiplier \N{MINUS SIGN}1" in names


def test_steep_strips_of_stability_are_shaded_between_frequencies_too() -> None:
    # Between the first two tongues a strip rises by its own width from one frequency to the next.
    omega = np.linspace(0.8, 3.0, 60)
    stable = drawn.chart(pendmap.tongues(DAMPED, omega)).panels[0].marks[0]
    areas = [Outline(area) for area in stable.shapes]
    middles = (omega[:-1] + omega[1:]) / 2
    index, p, _, above = rest(pendmap.tongues(DAMPED, middles))
    looked = 0
    for k in np.flatnonzero(above):
        high = p[k + 1] if k + 1 < p.size and index[k + 1] == index[k] else 6.0
        if high - p[k] > 0.2:
            looked += 1
            at = (float(middles[index[k]]), float(p[k] + high) / 2)
            assert any(area.contains_point(at) for area in areas), at
    assert looked >= 5


def test_json_lists_the_frequencies_that_were_asked_for(coarse: xr.Dataset) -> None:
    content = SCHEMA.json(coarse)
    for key in ("curves", "inverted"):
        assert [row["omega"] for row in content[key]] == np.linspace(1.1, 2.1, 5).tolist()
    _, p, multiplier, _ = rest(coarse)
    assert [x for row in content["curves"] for x in row["p"]] == p.tolist()
    assert [x for row in content["curves"] for x in row["multiplier"]] == multiplier.tolist()


def test_undamped_rest_is_unstable_from_no_drive_on_where_omega_is_2() -> None:
    found = pendmap.tongues(Pendulum(gamma=0.0), [1.9, 2.0, 2.1], p_max=1.0)
    assert found["stable_at_first"].values.tolist() == [1, 0, 1]
    assert "unstable from p = 0 on at omega = 2." in found.attrs["summary"]
    assert "soonest" not in found.attrs["summary"]
    assert found.attrs["title"] == "\N{GREEK SMALL LETTER GAMMA} = 0"


@pytest.mark.parametrize(("omega", "strips"), [([0.7], 2), ([1.1, 1.2, 1.3], 1)])
def test_orbits_of_both_balances_under_a_torque_are_distinct(
    omega: list[float], strips: int
) -> None:
    found = pendmap.tongues(Pendulum(gamma=0.1, torque=0.2), omega)
    for place in range(len(omega)):
        hanging, inverted = (
            p[index == place] for index, p, *_ in (rest(found, inverted=up) for up in (False, True))
        )
        # A strip is found at every frequency at which it exists, however narrow.
        assert inverted.size == 2 * strips, omega[place]
        assert np.abs(np.subtract.outer(hanging, inverted)).min() > 1e-3, omega[place]
