"""Recordings that step through a parameter, read back: orbits at its values, markers, layout."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from pendmap import Effect, Pendulum, Rig
from recordings import ReadBack, recorded

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.usefixtures("strict_recordings")

BASE = Pendulum(gamma=0.1, omega=2.0)
NEAR = 5e-3  # Lines between orbits that were computed are straight


def steps(back: ReadBack, entity: str, timeline: str) -> np.ndarray:
    """Return the values of the parameter at which an entity was logged."""
    return np.array([one.total_seconds() for one in back.columns[entity][timeline]])


def at(back: ReadBack, panel: str, timeline: str, value: float) -> dict[str, np.ndarray]:
    """Return the points that each entity of a panel shows at the value nearest to another."""
    shown = {}
    for entity, columns in back.columns.items():
        if entity.startswith(f"/{panel}/data/now/"):
            nearest = int(np.abs(steps(back, entity, timeline) - value).argmin())
            rows = [row for row in columns["Points2D:positions"] if row is not None]
            name = entity.removeprefix(f"/{panel}/data/now/")
            shown[name] = np.array(rows[nearest]).reshape(-1, 2)
    return shown


def distances(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the distances of all points of one set from those of another, on the cylinder."""
    gap = one[:, None] - other[None]
    gap[..., 0] = np.remainder(gap[..., 0] + math.pi, 2 * math.pi) - math.pi
    return np.hypot(gap[..., 0], gap[..., 1])


@pytest.fixture(scope="module")
def branches(tmp_path_factory: pytest.TempPathFactory) -> ReadBack:
    result = pendmap.continuation(BASE, {"p": (0.3, 1.5)}, up_to=1)
    return recorded(result, tmp_path_factory.mktemp("branches"))


def test_the_orbits_at_a_value_are_those_that_orbit_finds(branches: ReadBack) -> None:
    every = steps(branches, "/phase/data/now/1_1", "p")
    assert every[0] == pytest.approx(0.3)
    assert every[-1] == pytest.approx(1.5)
    for value in (0.6, 1.2):
        p = float(every[np.abs(every - value).argmin()])
        shown = at(branches, "phase", "p", p)
        for stable in (True, False):
            exact = []
            for w in (0, 1, -1):
                orbits = pendmap.orbit(Pendulum(gamma=0.1, omega=2.0, p=p), n=1, w=w)
                mine = orbits["stable"].values == stable
                parts = (orbits[f"{part}_point"].values[mine] for part in ("theta", "velocity"))
                exact.append(np.stack([*parts], axis=1))
            drawn = [x for name, x in shown.items() if ("unstable" not in name) == stable]
            gap = distances(np.concatenate(drawn), np.concatenate(exact))
            assert gap.shape[0] == gap.shape[1] > 0
            assert max(gap.min(0).max(), gap.min(1).max()) < NEAR


def test_a_fold_is_a_step_and_before_it_nothing_is_shown(branches: ReadBack) -> None:
    every = steps(branches, "/phase/data/now/1_1", "p")
    assert np.abs(every - 0.416787572822).min() < 1e-9
    assert not at(branches, "phase", "p", 0.35)["1_1"].size
    both = at(branches, "phase", "p", 0.416787572822)
    # One point of each sense of the rotation: where two pieces meet there are no two.
    assert len(both["1_1"]) + len(both["1_1/unstable"]) == 2


def test_the_diagrams_have_a_marker_at_the_value(branches: ReadBack) -> None:
    phase = at(branches, "phase", "p", 1.0)
    for column, panel in enumerate(("theta", "velocity")):
        marked = at(branches, panel, "p", 1.0)
        assert marked.keys() == phase.keys()
        for name, points in marked.items():
            assert np.allclose(points[:, 0], 1.0, atol=2e-3)
            assert np.allclose(points[:, 1], phase[name][:, column])
    sizes = [
        abs(branches.one(f"/phase/data/now/{name}", "Points2D:radii"))
        for name in ("1_1", "1_1/unstable")
    ]
    assert sizes[0] > sizes[1]
    colours = [
        branches.one(entity, f"{kind}:colors")
        for entity, kind in (
            ("/phase/data/now/1_1", "Points2D"),
            ("/phase/data/now/1_1/unstable", "Points2D"),
        )
    ]
    assert colours[0] == colours[1]
    assert {"/phase", "/theta", "/velocity"} <= branches.views.keys()


def test_in_a_plane_the_second_parameter_is_the_timeline(tmp_path: Path) -> None:
    result = pendmap.continuation(BASE, {"p": (0.3, 1.6), "omega": (1.9, 2.1)}, up_to=1)
    back = recorded(result, tmp_path)
    every = steps(back, "/curves/data/now/1_1", "omega")
    omega = float(every[np.abs(every - 1.95).argmin()])
    mine = at(back, "curves", "omega", omega)["1_1"]
    along = pendmap.continuation(Pendulum(gamma=0.1, omega=omega), {"p": (0.3, 1.6)}, 1, 1)
    first = along["event_n"].values == 1
    exact = np.sort(along["event_value"].values[first])
    assert np.sort(mine[:, 0]) == pytest.approx(exact, abs=NEAR)
    assert np.allclose(mine[:, 1], omega)
    where = np.stack([along[f"event_{part}"].values[first] for part in ("theta", "velocity")], 1)
    assert distances(at(back, "phase", "omega", omega)["1_1"], where).min(1).max() < 5 * NEAR
    assert back.views.keys() >= {"/phase", "/curves"}


def test_a_diagram_shows_attractors_and_unstable_orbits_at_its_values(tmp_path: Path) -> None:
    result = pendmap.bifurcation(BASE, {"p": (1.2, 1.3, 6)}, branches=2)
    back = recorded(result, tmp_path)
    p = float(result["p"].values[-1])
    shown = at(back, "phase", "p", p)
    attractors = [points for name, points in shown.items() if "unstable" not in name]
    here = result["point_value"].values == p
    parts = [result[f"point_{part}"].values[here] for part in ("theta", "velocity")]
    gap = distances(np.concatenate(attractors), np.stack(parts, axis=1))
    assert gap.shape[0] == gap.shape[1] > 0
    assert gap.min(1).max() < 1e-6
    # Beyond its symmetry breaking the symmetric oscillation is unstable.
    orbits = pendmap.orbit(Pendulum(gamma=0.1, omega=2.0, p=p), n=2, w=0)
    owner = orbits["id"].values[orbits["stable"].values == 0]
    mine = np.isin(orbits["point_orbit"].values, owner)
    exact = np.stack([orbits[f"point_{part}"].values[mine] for part in ("theta", "velocity")], 1)
    gap = distances(shown["2_0/unstable"], exact)
    assert gap.shape[0] == gap.shape[1] == 2
    assert gap.min(1).max() < NEAR


DRAG = Effect("quadratic_drag", {"q": 0.1})


@pytest.mark.parametrize(
    ("model", "name", "ends"),
    [
        (Pendulum(gamma=0.1, p=0.6, omega=2.0, effects=[DRAG]), "quadratic_drag.q", (0.0, 0.02)),
        (Rig(w0=6.2, c_over_m=0.62, p=0.6, Omega=12.4), "frequency_hz", (1.6, 2.0)),
    ],
)
def test_other_parameters_are_timelines_too(
    model: Pendulum | Rig, name: str, ends: tuple[float, float], tmp_path: Path
) -> None:
    result = pendmap.continuation(model, {name: ends}, 1, 1, longest=1)
    every = steps(recorded(result, tmp_path), "/phase/data/now/1_1", name)
    assert (every[0], every[-1]) == pytest.approx(ends)
