"""Critical curves against reference values, Mathieu's functions and scipy; in figures and files."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.path import Path as Outline
from scipy.integrate import solve_ivp
from scipy.special import mathieu_a, mathieu_b

import pendmap
from drawn import made, named, plain
from pendmap import Effect, Formula, Pendulum
from pendmap.analysis import critical_curves
from pendmap.charts import tongues as drawn

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from conftest import Run

DAMPED = Pendulum(gamma=0.1)


def found_at(model: Pendulum, omega: float, p_max: float = 6.0) -> list[tuple[float, int]]:
    found = pendmap.tongues(model, omega, p_max, inverted=False)
    return list(zip(found["p"].values, found["multiplier"].values, strict=True))


def test_the_onset_of_resonance_is_found_to_1e_9(truths: dict[str, Any]) -> None:
    for row in truths["rest_onset"].values():
        p, multiplier = found_at(DAMPED, row["omega"])[0]
        assert abs(p - row["p_onset"]) < 1e-9
        assert multiplier == -1


def test_folds_to_1e_9_where_the_onset_is_subcritical(truths: dict[str, Any]) -> None:
    onsets = list(truths["rest_onset"].values())
    found = pendmap.tongues(DAMPED, [row["omega"] for row in onsets])
    for row, fold in zip(onsets, found["fold"].values, strict=True):
        if row["criticality"] == "supercritical":
            assert math.isnan(fold)
        else:
            assert abs(fold - float(row["p_fold"])) < 1e-9


def test_without_damping_they_are_mathieus_characteristic_curves() -> None:
    # 4/omega^2 = a_r(q) or b_r(q), q = 2 p/omega^2: curves of both kinds, thin tongues included.
    omegas = [0.52, 0.66, 0.71, 0.99, 1.03, 1.7, 2.3]
    found = pendmap.tongues(Pendulum(gamma=0.0), omegas, 2.0)
    assert found.sizes["critical"] > 8
    for k, p, m in zip(
        found["index"].values, found["p"].values, found["multiplier"].values, strict=True
    ):
        level, q = 4 / omegas[k] ** 2, 2 * p / omegas[k] ** 2
        orders = range(0, 8, 2) if m > 0 else range(1, 8, 2)
        values = [float(mathieu_a(r, q)) for r in orders]
        values += [float(mathieu_b(r, q)) for r in orders if r]
        assert min(abs(value - level) for value in values) < 1e-8 * level


def test_narrow_tongues_are_not_missed() -> None:
    # Near omega = 1/2 the fourth tongue is narrower than 1e-7 in p at p near 0.1.
    for omega in (0.499, 0.4999):
        found = found_at(Pendulum(gamma=0.0), omega, 0.4)
        first = [p for p, m in found if m == 1][:2]
        assert len(first) == 2, found
        assert first[1] - first[0] < 0.05
    # The strip between two tongues at omega = 0.6, of width 0.0026, is in the reference values.


def largest_multiplier(p: float, omega: float, gamma: float, gravity: float = 1.0) -> float:
    """Return the largest multiplier of rest by scipy; a gravity of -1 gives inverted rest."""
    ends = []
    for start in ((1.0, 0.0), (0.0, 1.0)):
        run = solve_ivp(
            lambda t, y: [y[1], -gamma * y[1] - gravity * (1 + p * math.cos(omega * t)) * y[0]],
            (0.0, math.tau / omega),
            start,
            rtol=1e-10,
            atol=1e-12,
        )
        ends.append(run.y[:, -1])
    return float(np.abs(np.linalg.eigvals(np.array(ends).T)).max())


def test_stable_means_that_motions_decay() -> None:
    omega = 0.8
    found = pendmap.tongues(DAMPED, omega)
    edges = [0.0, *found["p"].values, 6.0]
    stable = [int(found["stable_at_first"][0]), *found["stable_above"].values]
    for low, high, yes in zip(edges[:-1], edges[1:], stable, strict=True):
        assert (largest_multiplier((low + high) / 2, omega, 0.1) < 1) == bool(yes)


@pytest.mark.parametrize("seed", range(3))
def test_inverted_rest_is_stable_where_its_motions_decay(seed: int) -> None:
    random = np.random.default_rng(seed)
    omega, gamma = float(random.uniform(1.2, 9.0)), float(random.choice([0.0, 0.02, 0.5]))
    found = pendmap.tongues(Pendulum(gamma=gamma), omega, 30.0)
    edges = [0.0, *found["inverted_p"].values, 30.0]
    stable = [0, *found["inverted_stable_above"].values]
    assert 1 in stable
    for low, high, yes in zip(edges[:-1], edges[1:], stable, strict=True):
        for p in random.uniform(low, high, 4):
            assert (largest_multiplier(p, omega, gamma, -1.0) < 1 + 1e-6) == bool(yes), p


def test_hanging_rest_alone_is_computed_where_upright_is_no_rest() -> None:
    push = Formula("push", "k*(1 - cos(theta))", {"k": 2})
    pushed = Pendulum(gamma=0.1, effects=(push(k=0.1),))
    found = pendmap.tongues(pushed, 6.0, 20.0)
    assert found["inverted_rest"].item() == 0
    assert found.sizes["inverted"] == 0
    assert found.sizes["critical"] > 0
    assert "nverted" not in found.attrs["summary"]


def period_of(
    x: NDArray[np.float64], p: float, omega: float, torque: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the state after a period and its derivative, at gamma = 0.1, by scipy."""

    def slope(t: float, y: NDArray[np.float64]) -> list[float]:
        gravity = 1 + p * math.cos(omega * t)
        k = gravity * math.cos(y[0])
        velocity = torque - 0.1 * y[1] - gravity * math.sin(y[0])
        return [y[1], velocity, y[4], y[5], -k * y[2] - 0.1 * y[4], -k * y[3] - 0.1 * y[5]]

    start = [*x, 1.0, 0.0, 0.0, 1.0]
    end = solve_ivp(slope, (0, math.tau / omega), start, "DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
    return end[:2], end[2:].reshape(2, 2)


def orbits_near(
    angle: float, p: float, omega: float, torque: float
) -> list[NDArray[np.complex128]]:
    """Return the multipliers of the orbits of the drive's period found by Newton's method."""
    found: dict[tuple[float, float], NDArray[np.complex128]] = {}
    for start in angle + np.linspace(-0.6, 0.6, 5):
        x = np.array([start, 0.0])
        for _ in range(12):
            end, monodromy = period_of(x, p, omega, torque)
            if np.abs(end - x).max() < 1e-9:
                found[round(x[0], 5), round(x[1], 5)] = np.linalg.eigvals(monodromy)
                break
            x = x - np.linalg.solve(monodromy - np.eye(2), end - x)
            if abs(x[0] - angle) > 2:
                break
    return list(found.values())


@pytest.mark.parametrize(("omega", "torque"), [(6.0, 0.3), (2.0, 0.05), (9.0, -0.6)])
def test_under_a_torque_orbits_are_stable_where_scipy_finds_them_so(
    omega: float, torque: float
) -> None:
    found = pendmap.tongues(Pendulum(gamma=0.1, torque=torque), omega, 45.0 if omega > 3 else 5.0)
    low, high = found["inverted_p"].values[:2]
    assert found["inverted_multiplier"].values[:2].tolist() == [1, -1]
    assert found["inverted_stable_above"].values[:2].tolist() == [1, 0]

    def stable(angle: float, p: float) -> bool:
        return any(abs(m).max() < 1 for m in orbits_near(angle, p, omega, torque))

    # The orbit begins at a fold, and ends with a period doubling.
    assert [stable(math.pi, p) for p in (0.995 * low, 1.002 * low)] == [False, True]
    assert [stable(math.pi, p) for p in (0.998 * high, 1.002 * high)] == [True, False]
    assert min(abs(m + 1).min() for m in orbits_near(math.pi, high, omega, torque)) < 1e-6
    first = float(found["p"].values[0])
    assert found["multiplier"].values[0] == -1
    assert found["stable_at_first"].values[0] == 1
    rest = math.asin(torque)
    assert min(abs(m + 1).min() for m in orbits_near(rest, first, omega, torque)) < 1e-6
    assert stable(rest, 0.99 * first)


def test_the_curves_of_a_small_torque_are_those_without() -> None:
    # Folds shift with the torque to the power 2/3, the others with its square. The torque replaces
    # a pitchfork of rest by a period-1 orbit that continues.
    for omega in (2.0, 6.0):
        level, tilted = (
            pendmap.tongues(Pendulum(gamma=0.1, torque=torque), omega, 20.0)
            for torque in (0.0, 1e-6)
        )
        assert np.allclose(level["inverted_p"][:2], tilted["inverted_p"][:2], atol=2e-3)
        for prefix in ("", "inverted_"):
            doubled = level[f"{prefix}p"].values[level[f"{prefix}multiplier"].values < 0]
            assert all(abs(tilted[f"{prefix}p"].values - p).min() < 1e-7 for p in doubled)


def test_a_mirrored_torque_has_the_same_curves_and_no_orbit_is_counted_twice() -> None:
    omega = np.linspace(1.55, 1.75, 5)
    one, other = (
        pendmap.tongues(Pendulum(gamma=0.1, torque=torque), omega, 8.0) for torque in (0.2, -0.2)
    )
    assert np.allclose(one["p"], other["p"], atol=1e-8)
    assert np.allclose(one["inverted_p"], other["inverted_p"], atol=1e-8)
    for k in range(omega.size):
        assert (np.diff(one["p"].values[one["index"].values == k]) > 1e-6).all()


@pytest.mark.parametrize("name", list(critical_curves.CURVES))
def test_errors_of_asymptotic_curves_have_their_order(name: str) -> None:
    multiplier, formula = critical_curves.CURVES[name]
    # Toward the tip, with damping in proportion: detuning, p and gamma (or its root) are all small.
    errors = []
    for size in (0.08, 0.04):
        near = 2.0 if multiplier < 0 else 1.0
        omega = near * (1 + (size if multiplier < 0 else size**2))
        gamma = (0.5 * size) if multiplier < 0 else 0.5 * size**2
        exact = next(p for p, m in found_at(Pendulum(gamma=gamma), omega) if m == multiplier)
        errors.append(abs(float(formula(np.array([omega]), gamma)[0]) - exact) / exact)
    order = math.log2(errors[0] / errors[1])
    assert order > {"tongue 1, first order": 0.8}.get(name, 1.7), (order, errors)


def test_added_damping_is_damping_and_effects_are_included() -> None:
    plain = found_at(Pendulum(gamma=0.1), 1.5)
    added = found_at(Pendulum(gamma=0.0, effects=(Effect("viscous_damping", {"gamma": 0.1}),)), 1.5)
    assert np.allclose(plain, added, atol=1e-9)
    # Drag and damping of higher order vanish at rest.
    drag = (Effect("quadratic_drag", {"q": 0.3}),)
    assert np.allclose(plain, found_at(Pendulum(gamma=0.1, effects=drag), 1.5), atol=1e-8)


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"theta_r": 0.05}, "theta_r must be 0, got 0.05: friction holds"),
        ({"effects": (Effect("coulomb_friction", {"theta_r": 0.05}),)}, "friction holds"),
        (
            {"effects": (Effect("lateral_drive", {"e": 0.1, "phase": 0.0}),)},
            "a sideways drive or an effect moves it",
        ),
        ({"effects": (Effect("drive_chirp", {"r": 0.001}),)}, "drive_chirp"),
    ],
)
def test_models_without_critical_curves_are_refused(given: dict[str, Any], match: str) -> None:
    with pytest.raises(pendmap.InputError, match=match):
        pendmap.tongues(Pendulum(**given), 2.0)


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"omega": [2.0, 1.0]}, "ascending"),
        ({"omega": 0.0}, "above 0"),
        ({"p_max": 0.0}, "p_max must be .*, got 0"),
        ({"p_max": 2.1e5, "omega": [2.0, 3.0]}, "up to 50000 times the square of the lowest omega"),
        ({"plane": "q-a"}, "e-alpha2"),
    ],
)
def test_bad_values_are_named(given: dict[str, Any], match: str) -> None:
    with pytest.raises(pendmap.InputError, match=match):
        pendmap.tongues(DAMPED, **given)


@pytest.fixture(scope="module")
def whole() -> xr.Dataset:
    return pendmap.tongues(DAMPED, np.linspace(0.5, 3.0, 60))


@pytest.mark.parametrize("plane", ["omega-p", "e-alpha2"])
def test_the_figure_in_both_planes(whole: xr.Dataset, plane: str) -> None:
    figure = made(whole.assign_attrs(plane=plane))
    axes = figure.axes[0]
    assert ("e = p" in plain(axes.get_ylabel())) == (plane == "e-alpha2")
    texts = [text.get_text() for text in figure.subfigs[0].legends[0].get_texts()]
    for name in ("multiplier", "hanging rest is stable", "inverted rest is stable"):
        assert any(name in text for text in texts)


@pytest.fixture(scope="module")
def finer() -> xr.Dataset:
    """Return curves at few frequencies and at those added for a picture."""
    return pendmap.tongues(DAMPED, np.linspace(1.1, 2.1, 11), 3.0, refine=True)


def test_added_frequencies_resolve_the_turns_of_curves(finer: xr.Dataset) -> None:
    omega, asked = finer["omega"].values, finer["asked"].values.astype(bool)
    assert np.array_equal(omega[asked], np.linspace(1.1, 2.1, 11))
    assert (np.diff(omega) > 0).all()
    index, p = finer["index"].values, finer["p"].values
    rows = [p[(index == k) & (finer["multiplier"].values < 0)] for k in range(omega.size)]
    begins = next(k for k, row in enumerate(rows) if row.size)
    # The nose of the first tongue lies between two frequencies indistinguishable in a picture.
    assert omega[begins] - omega[begins - 1] < 1e-5
    assert np.ptp(rows[begins]) < 0.02
    assert rows[begins].mean() == pytest.approx(2.3, abs=0.1)
    # Between any two frequencies the curves are straight within the resolution of a picture.
    for k in range(begins + 1, omega.size - 1):
        middle = (omega[k] + omega[k + 1]) / 2
        exact = [q for q, m in found_at(DAMPED, middle, 3.0) if m < 0]
        if rows[k].size == rows[k + 1].size == len(exact) and k % 7 == 0:
            assert np.allclose((rows[k] + rows[k + 1]) / 2, exact, atol=0.01)


def test_steep_strips_of_stability_are_shaded_between_frequencies_too() -> None:
    # Between the first two tongues a strip rises by its own width from one frequency to the next.
    omega = np.linspace(0.8, 3.0, 60)
    stable = drawn.chart(tongues_of(omega)).panels[0].marks[0]
    areas = [Outline(area) for area in stable.shapes]
    middles = (omega[:-1] + omega[1:]) / 2
    between = tongues_of(middles)
    index, p = between["index"].values, between["p"].values
    looked = 0
    for k in np.flatnonzero(between["stable_above"].values):
        high = p[k + 1] if k + 1 < p.size and index[k + 1] == index[k] else 6.0
        if high - p[k] > 0.2:
            looked += 1
            at = (float(middles[index[k]]), float(p[k] + high) / 2)
            assert any(area.contains_point(at) for area in areas), at
    assert looked >= 5


def tongues_of(omega: NDArray[np.float64]) -> xr.Dataset:
    return pendmap.tongues(DAMPED, omega, 6.0, inverted=False)


def test_json_lists_the_frequencies_that_were_asked_for(pendmap_command: Run) -> None:
    told = [
        json.loads(pendmap_command("tongues", "--omega", span, "--json", *more).stdout)
        for span, *more in (("1.2:1.4:5",), ("1.2:1.4:5", "--plot", "noses.png"), ("1.4:1.2:5",))
    ]
    for key in ("curves", "inverted", "asymptotic"):
        assert told[0][key] == told[1][key] == told[2][key]


def test_undamped_rest_is_unstable_from_no_drive_on_where_omega_is_2() -> None:
    found = pendmap.tongues(Pendulum(gamma=0.0), [1.9, 2.0, 2.1], p_max=1.0)
    assert found["stable_at_first"].values.tolist() == [1, 0, 1]
    assert "unstable from p = 0 on at omega = 2." in found.attrs["summary"]
    assert "soonest" not in found.attrs["summary"]
    assert found.attrs["title"] == "\N{GREEK SMALL LETTER GAMMA} = 0"


def test_the_legend_names_the_pendulum_if_it_is_in_view() -> None:
    for omega, shown in (([1.5, 2.5], True), ([6.0, 8.0], False)):
        texts = named(made(pendmap.tongues(DAMPED, omega, 6.0)))
        assert ("this pendulum" in texts) == shown


@pytest.mark.parametrize(("low", "high"), [(0.70, 0.76), (1.0, 1.3)])
def test_orbits_of_both_balances_under_a_torque_are_distinct(low: float, high: float) -> None:
    omega = np.linspace(low, high, 13)
    found = pendmap.tongues(Pendulum(gamma=0.1, torque=0.2), omega)
    for place in range(omega.size):
        hanging = found["p"].values[found["index"].values == place]
        inverted = found["inverted_p"].values[found["inverted_index"].values == place]
        # A strip is found at every frequency at which it exists, however narrow.
        assert inverted.size == 2, omega[place]
        assert np.abs(np.subtract.outer(hanging, inverted)).min() > 1e-3, omega[place]
