"""Curves in the plane of two parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from pendmap.analysis import continuation, curves
from pendmap.charts import registry
from pendmap.charts.marks import Line

if TYPE_CHECKING:
    import xarray as xr

PENDULUM = pendmap.Pendulum(gamma=0.1, omega=2.0)
RANGES = {"p": (0.0, 1.6), "omega": (1.8, 2.2)}


@pytest.fixture(scope="module")
def plane() -> xr.Dataset:
    return pendmap.continuation(PENDULUM, RANGES, up_to=1, threads=1)


def test_curves_of_fixed_points_hold_known_folds_and_doublings(plane: xr.Dataset) -> None:
    kinds = plane.curve_kind.values.tolist()
    assert {"fold", "period_doubling"} <= set(kinds)
    owner, p, omega = (plane[name].values for name in ("place_curve", "place_p", "place_omega"))
    assert (p >= 0).all()
    assert (p <= 1.6).all()
    assert (omega >= 1.8).all()
    assert (omega <= 2.2).all()
    # The fold of rotation 1:1 at omega 2, between neighbours of its curve.
    for number in np.flatnonzero(plane.curve_kind.values == "fold"):
        mine = owner == number
        order = np.argsort(omega[mine])
        if abs(np.interp(2.0, omega[mine][order], p[mine][order]) - 0.416787572822) < 1e-3:
            break
    else:
        pytest.fail("no curve of folds near the known one")


def test_the_doubling_of_rest_changes_where_a_fold_begins(plane: xr.Dataset) -> None:
    kinds = plane.degenerate_kind.values == "generalised_doubling"
    at = [plane[f"degenerate_{name}"].values[kinds] for name in ("p", "omega")]
    # By heyoka's variational equations of second order.
    near = np.hypot(at[0] - 0.200032729604, at[1] - 1.993746585880) < 1e-8
    assert near.any()


def test_regions_say_how_many_orbits_are_stable(plane: xr.Dataset) -> None:
    def listed(p: float, omega: float) -> list[tuple[str, int | None]]:
        every = continuation.stable_orbits(plane, {"p": p, "omega": omega})
        return sorted((one["name"], one["stable"]) for one in every)

    rotations = [("rotation 1:+1", 1), ("rotation 1:-1", 1)]
    # At omega 2 born at .416787572822 and doubled at 1.346858522521: nearer than the lattice.
    assert listed(0.41678, 2.0) == []
    assert listed(0.41680, 2.0) == rotations
    assert listed(1.34685, 2.0) == rotations
    assert listed(1.34687, 2.0) == []
    assert listed(0.1, 1.85) == [("rest", 1)]
    assert listed(1.7, 2.0) == []
    regions = continuation.SCHEMA.json(plane)["regions"]
    assert {"name", "n", "w", "stable", "part", "values"} <= set(regions[0])
    whole = sum(one["part"] for one in regions if one["name"] == "rest")
    assert whole == pytest.approx(1.0, abs=0.01)


def test_the_json_object_has_curves_and_points(plane: xr.Dataset) -> None:
    answer = continuation.SCHEMA.json(plane)
    assert len(answer["curves"]) == plane.sizes["curve"]
    assert {"kind", "n", "w", "values", "ends"} <= set(answer["curves"][0])
    assert set(answer["curves"][0]["values"]) == {"p", "omega"}
    assert {"kind", "n", "w", "values"} <= set(answer["points"][0])
    assert answer["branches"] == []


@pytest.fixture(scope="module")
def rough() -> xr.Dataset:
    pendulum = pendmap.Pendulum(gamma=0.05, omega=1.0, theta_r=0.4)
    ranges = {"p": (2.3, 2.5), "omega": (1.1, 1.2)}
    return pendmap.continuation(pendulum, ranges, up_to=1, threads=1)


def test_a_doubling_reaches_the_curve_where_its_multiplier_begins_to_jump(
    rough: xr.Dataset,
) -> None:
    answer = continuation.SCHEMA.json(rough)
    curves = {one["kind"]: one for one in answer["curves"] if one["n"] == one["w"] == 1}
    grazing, doubling = curves["grazing"], curves["period_doubling"]
    (point,) = [one for one in answer["points"] if one["kind"] == "period_doubling_at_event"]
    assert "slips and sticks change" in doubling["ends"]
    ends = [[doubling["values"][name][k] for name in ("p", "omega")] for k in (0, -1)]
    at = [point["values"][name] for name in ("p", "omega")]
    assert min(np.hypot(*np.subtract(end, at)) for end in ends) < 1e-5
    # The doubling jumps on one side of the point alone.
    jumps = [one == "period_doubling" for one in grazing["jumps"]]
    beyond = [p > at[0] for p in grazing["values"]["p"]]
    away = np.abs(np.subtract(grazing["values"]["p"], at[0])) > 1e-9
    assert np.array_equal(np.array(jumps)[away], np.array(beyond)[away])
    assert len(set(jumps)) == 2


def test_a_curve_goes_on_where_slips_change_elsewhere_on_its_orbit() -> None:
    pendulum = pendmap.Pendulum(gamma=0.1, theta_r=0.05)
    ranges = {"p": (1.45, 1.5), "omega": (1.2, 1.3)}
    plane = pendmap.continuation(pendulum, ranges, up_to=2, threads=1)
    ends = (plane[f"curve_{side}"].values for side in ("begin", "end"))
    assert {str(end) for both in ends for end in both} == {"end of the range"}
    places = [plane[f"place_{name}"].values for name in ("p", "omega", "curve")]
    kink = np.flatnonzero(np.hypot(np.diff(places[0]), np.diff(places[1])) < 1e-7)[0]
    p, omega = (place[places[2] == places[2][kink]] for place in places[:2])
    assert plane["curve_kind"].values[places[2][kink]] == "stick_onset"
    # A point beyond the kink is an onset along one parameter.
    beyond = int(np.flatnonzero((omega > 1.22) & (omega < 1.29))[0])
    alone = pendmap.continuation(
        pendmap.Pendulum(gamma=0.1, theta_r=0.05, omega=float(omega[beyond])),
        {"p": (float(p[beyond]) - 0.01, float(p[beyond]) + 0.01)},
        n=2,
        w=1,
        threads=1,
    )
    onset = alone["event_value"].values[alone["event_kind"].values == "stick_onset"]
    assert np.abs(onset - p[beyond]).min() < 1e-8


def test_an_oscillation_begins_where_friction_ceases_to_hold_the_pendulum() -> None:
    pendulum = pendmap.Pendulum(gamma=0.1, theta_r=0.1, torque=0.2)
    ranges = {"p": (0.4, 0.6), "omega": (1.9, 2.1)}
    plane = pendmap.continuation(pendulum, ranges, up_to=1, threads=1)
    # Rest at the angle of least load is held while p torque < theta_r.
    for p, stable in ((0.49, 0), (0.51, 1)):
        orbits = continuation.stable_orbits(plane, {"p": p, "omega": 2.0})
        assert sum(one["stable"] for one in orbits if one["kind"] == "oscillation") == stable
    assert (plane.region_stable.values >= 0).all()


def test_beyond_p_1_an_oscillation_begins_at_equal_loads() -> None:
    # Loads in both senses are equal where sin theta is the torque, there p times the torque.
    model = pendmap.Pendulum(gamma=0.1, omega=1.4, torque=0.1, theta_r=0.2)
    found = pendmap.continuation(model, {"p": (1.9, 2.05)}, n=1, w=0)
    first, *_ = found.event_value.values[found.event_kind.values == "rest_boundary"]
    assert first == pytest.approx(2.0, abs=1e-10)
    assert (found.orbit_value.values > 2.0 - 1e-10).all()


def test_an_oscillation_begins_at_equal_loads_under_a_sideways_drive() -> None:
    # The load is torque - sin theta - p (sin theta cos a + e cos theta cos(a + phase)).
    p, torque, e, phase = 1.2, 0.1, 0.2, 2.0
    effects = (pendmap.Effect("lateral_drive", {"e": e, "phase": phase}),)
    model = pendmap.Pendulum(gamma=0.1, p=p, omega=1.4, torque=torque, effects=effects)
    found = pendmap.continuation(model, {"theta_r": (0.05, 0.5)}, n=1, w=0, longest=1)
    across = e * np.sqrt(1 - torque**2)
    swing = p * np.sqrt(torque**2 + across**2 + 2 * torque * across * np.cos(phase))
    events = found.event_value.values[found.event_kind.values == "rest_boundary"]
    assert np.abs(events - swing).min() < 1e-10


def test_a_doubled_orbit_is_followed_from_a_jump_over_minus_1() -> None:
    model = pendmap.Pendulum(gamma=0.05, theta_r=0.4, omega=1.17)
    found = pendmap.continuation(model, {"p": (2.3, 2.5)}, n=1, w=1, longest=2)
    doubled = found.event_value.values[found.event_kind.values == "period_doubling"]
    (branch,) = np.flatnonzero(found.branch_n.values == 2)
    ends = [found[f"branch_{end}"].values[branch] for end in ("first", "last")]
    assert ends == pytest.approx(sorted(doubled), abs=1e-8)
    # The search of orbits finds it too, on both of its sides before it turns back.
    of = found.orbit_branch.values == branch
    value, theta = (
        found.orbit_value.values[of],
        found.point_theta.values[
            np.flatnonzero(np.isin(found.point_orbit.values, np.flatnonzero(of)))[::2]
        ],
    )
    at, turn = 0.5 * (value.min() + ends[0]), int(value.argmin())
    model = pendmap.Pendulum(gamma=0.05, theta_r=0.4, omega=1.17, p=at)
    every = pendmap.orbit(model, 2, 2).point_theta.values
    for side in (slice(0, turn + 1), slice(turn, None)):
        order = np.argsort(value[side])
        guess = np.interp(at, value[side][order], np.unwrap(theta[side])[order])
        assert np.abs(np.sin(0.5 * (every - guess))).min() < 1e-3


def test_the_figure_names_changes_of_slips_and_sticks(rough: xr.Dataset) -> None:
    (panel,) = registry.build(registry.ready(rough)).panels
    shown = {mark.name for mark in panel.marks if isinstance(mark, Line)}
    assert {"grazing", "thick: a multiplier jumps"} <= shown


def test_a_period_out_of_range_is_refused() -> None:
    with pytest.raises(pendmap.InputError, match="up_to"):
        pendmap.continuation(PENDULUM, RANGES, up_to=17)


@pytest.mark.parametrize("option", [{"n": 2}, {"w": 0}, {"start": (1.0, 0.0)}, {"longest": 4}])
def test_what_one_parameter_alone_has_is_refused_with_two(option: dict[str, Any]) -> None:
    with pytest.raises(pendmap.InputError, match="must not be given with two parameters"):
        pendmap.continuation(PENDULUM, RANGES, up_to=1, **option)


def test_a_summary_lists_some_points_and_counts_the_others(plane: xr.Dataset) -> None:
    many = plane.isel(degenerate=[0] * 20)
    lines = curves.degenerate_lines(many, ("p", "omega"))
    assert len(lines) == curves.LISTED + 1
    assert lines[-1] == "4 more points are in the result."
    few = curves.degenerate_lines(plane.isel(degenerate=[0]), ("p", "omega"))
    assert len(few) == 1
