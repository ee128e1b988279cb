"""Sweeps of basin maps: as maps alone, attractors with one number along the parameters."""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from pendmap import Pendulum
from pendmap.analysis.basin_sweep import SCHEMA
from pendmap.analysis.sweep_tiles import branches

if TYPE_CHECKING:
    import xarray as xr

DRIVEN = Pendulum(gamma=0.1, omega=2.0)
LINE = {"p": (0.4, 1.6, 13)}
PLANE = {"p": [0.5, 0.6, 0.8, 0.9], "omega": np.geomspace(1.9, 2.1, 3)}
CELLS = 30


@pytest.fixture(scope="module")
def line() -> xr.Dataset:
    return pendmap.sweep(DRIVEN, LINE, grid=CELLS)


def test_each_map_is_that_of_the_model_alone(line: xr.Dataset) -> None:
    for k in (0, 1, 5, 8, 12):
        model = dataclasses.replace(DRIVEN, p=float(line.p.values[k]))
        alone = pendmap.basins(model, CELLS, check=False)
        here = line.isel(p=k)
        there = np.flatnonzero(here.exists.values)
        assert sorted(alone.n.values) == sorted(here.n.values[there])
        # The number of each attractor of the map alone is that of its point in the sweep.
        number = {}
        for point, own in zip(alone.theta_point.values, alone.id.values, strict=True):
            gap = np.abs(here.theta_point.values - point)
            number[int(own)] = int(np.nanargmin(gap)) + 1
            assert np.nanmin(gap) < 1e-9
        moved = np.array([number[int(label)] for label in alone.label.values.ravel()])
        np.testing.assert_array_equal(here.label.values.ravel(), moved)
        share = here.fraction.values[[number[int(own)] - 1 for own in alone.id.values]]
        np.testing.assert_allclose(share, alone.fraction.values)
        assert float(here.basin_entropy) == float(alone.basin_entropy)


def test_maps_of_the_json_have_shares_that_add_up(line: xr.Dataset) -> None:
    whole = SCHEMA.json(line)
    assert [one["id"] for one in whole["attractors"]] == line.id.values.tolist()
    for one in whole["maps"]:
        assert sum(a["fraction"] for a in one["attractors"]) + one["undecided"] == pytest.approx(1)


def test_an_attractor_keeps_its_number_until_it_ends_and_through_its_doubling() -> None:
    # The rotation 1:1 doubles its period near p = 1.35: its orbit repels from there on.
    found = pendmap.sweep(DRIVEN, {"p": (1.2, 1.45, 11)}, grid=20)
    for sign in (1, -1):
        own = [k for k, w in enumerate(found.w.values[0]) if w == sign]
        assert len(own) == 1
        n = found.n.values[:, own[0]]
        assert found.exists.values[:, own[0]].all()
        assert set(n) == {1, 2}
        assert (np.diff(n) >= 0).all()
        np.testing.assert_array_equal(found.w.values[:, own[0]], sign * n)
    twins = found.twin.values
    np.testing.assert_array_equal(twins[twins - 1], found.id.values)


def test_over_two_parameters_rows_and_columns_agree_with_lines() -> None:
    both = pendmap.sweep(DRIVEN, PLANE, grid=16, check=False)
    assert both["p_bounds"].values[1].tolist() == pytest.approx([0.55, 0.7])
    model = dataclasses.replace(DRIVEN, omega=float(both.omega.values[1]))
    along = pendmap.sweep(model, {"p": PLANE["p"]}, grid=16, check=False)
    here = both.isel(omega=1)
    for k in range(along.sizes["p"]):
        pairs = {*zip(here.label.values[k].ravel(), along.label.values[k].ravel(), strict=True)}
        assert len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs})
        np.testing.assert_allclose(
            sorted(here.fraction.values[k][here.exists.values[k] > 0]),
            sorted(along.fraction.values[k][along.exists.values[k] > 0]),
        )


def test_a_plane_of_chaos_alone() -> None:
    chaos = pendmap.sweep(DRIVEN, {"p": (1.9, 2.0, 3)}, grid=20)
    assert [str(name) for name in chaos.attractor.values] == ["tumbling chaos"]
    assert (chaos.fraction.values == 1).all()
    assert (chaos.plane.values == 1).all()


@pytest.mark.parametrize(
    ("theta_r", "ranges"),
    [
        (0.0, {"gamma": (0.06, 0.14, 3), "p": (0.6, 1.0, 4)}),
        (0.01, {"omega": (1.8, 2.0, 3), "p": (0.4, 0.8, 4)}),
        (0.0, {"torque": (-0.03, 0.03, 3), "p": (0.9, 1.3, 4)}),
    ],
)
def test_numbers_do_not_depend_on_the_direction_of_a_parameter(
    theta_r: float, ranges: dict[str, tuple[float, float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []

    def noted(*given: Any) -> Any:  # noqa: ANN401
        seen[:] = given
        return branches(*given)

    monkeypatch.setattr("pendmap.analysis.basin_sweep.branches", noted)
    model = Pendulum(0.1, 0.9, 1.9, theta_r=theta_r)
    swept = functools.partial(pendmap.sweep, model, grid=12, check=False)
    rising = swept(ranges)
    falling = swept({name: (high, low, n) for name, (low, high, n) in ranges.items()})
    assert falling.drop_attrs(deep=False).identical(rising.drop_attrs(deep=False))
    job, maps = seen
    turned = {at: tuple(n - 1 - k for n, k in zip(job.shape, at, strict=True)) for at in maps}
    axes = tuple([(name, values[::-1]) for name, values in axis] for axis in job.varied)
    there = branches(
        dataclasses.replace(job, varied=axes), {turned[at]: one for at, one in maps.items()}
    )
    pairs, symmetric = set(), {}
    for at, numbers in branches(job, maps).items():
        pairs |= {*zip(numbers, there[turned[at]], strict=True)}
        for k, (number, own) in enumerate(zip(numbers, maps[at].found, strict=True), 1):
            symmetric.setdefault(number, set()).update({own.twin == k} if own.twin else ())
    assert len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs})
    assert max(len(both) for both in symmetric.values()) == 1


def test_an_orbit_keeps_its_number_across_the_pitchforks_beside_it() -> None:
    """Mirror images exist at gamma 0.06 to 0.08 alone, the symmetric orbit from 0.09 on."""
    found = pendmap.sweep(Pendulum(p=1.25, omega=2.0), {"gamma": (0.14, 0.06, 5)}, grid=16)
    swings = found.isel(attractor=found.w.values.any(axis=0) == 0)
    own = swings.id.values == swings.twin.values
    exists = swings.exists.values > 0
    assert exists[:, own].sum(axis=1).tolist() == [0, 0, 1, 1, 1]
    assert exists[:, ~own].sum(axis=1).tolist() == [2, 2, 0, 0, 0]
    assert (own.sum(), (~own).sum()) == (1, 2)


@pytest.mark.parametrize("seed", range(3))
def test_a_phase_of_the_drive_is_no_change_of_attractors(seed: int) -> None:
    # It shifts time alone: a pair of mirror images stays two branches however it moves.
    draw = np.random.default_rng(seed)
    phases = np.linspace(0, 6.2, draw.integers(5, 10))
    found = pendmap.sweep(
        Pendulum(0.1, draw.uniform(1.275, 1.285), 2.0), {"phase": phases}, grid=12, check=False
    )
    names = ["oscillation 2:0 (-)", "oscillation 2:0 (+)", "rotation 1:-1", "rotation 1:+1"]
    assert found["attractor"].values.tolist() == names
