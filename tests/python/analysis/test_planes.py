"""Parameter maps and bifurcation diagrams; the Rust tests cover the physics of single cells."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from drawn import made, named, titles
from pendmap import Effect, Grid, Pendulum, Rig
from pendmap._core import Attractor
from pendmap.analysis.orbit_table import attractors_of
from pendmap.charts import bifurcation
from pendmap.charts import parameter_map as drawn
from recordings import recorded

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr


@pytest.fixture(scope="module")
def plane() -> xr.Dataset:
    return pendmap.parameter_map(Pendulum(), {"p": (0.2, 2.0, 10), "omega": (1.4, 2.4, 6)})


def by_cell(plane: xr.Dataset) -> Any:  # noqa: ANN401 (an array of words)
    """Return the attractor kinds of each cell in words; regimes are numbered by their shares."""
    return np.array([" and ".join(kinds) for kinds in drawn.sets(plane)])[plane["regime"].values]


def test_regimes_and_their_shares(plane: xr.Dataset) -> None:
    assert plane["regime"].dims == ("omega", "p")
    shares = plane["regime_share"].values
    assert (np.diff(shares) <= 0).all()
    counts = np.bincount(plane["regime"].values.ravel())
    assert np.allclose(counts / 60, shares)
    # The kinds of a cell's attractors are those of its regime.
    names, cell = plane["kind"].values, plane["entry_cell"].values
    for index in range(60):
        kinds = {str(names[k]) for k in plane["entry_kind"].values[cell == index]}
        regime = drawn.sets(plane)[plane["regime"].values.ravel()[index]]
        assert kinds == set(regime) - {"undecided"}
    total = plane["share"].sum("kind") + plane["undecided"] + plane["failed"]
    assert np.allclose(total, 1)


def test_a_cell_is_the_pendulum_with_its_parameters(plane: xr.Dataset) -> None:
    there = plane.sel(p=1.0, omega=2.0, method="nearest")
    model = Pendulum(p=float(there["p"]), omega=float(there["omega"]))
    basins = pendmap.basins(model, Grid.square(40), check=False)
    assert set(drawn.sets(plane)[int(there["regime"])]) == {x.pair for x in attractors_of(basins)}


def test_parameters_of_effects_vary_too() -> None:
    drag = Effect("quadratic_drag", {"q": 0.1})
    ranges = {"quadratic_drag.q": (0.0, 0.4, 3), "p": (0.7, 1.0, 2)}
    rig = Rig(w0=5.0, p=1.0, Omega=10.0, c_over_m=0.5, effects=(drag,))
    found, added, si = (
        pendmap.parameter_map(model, ranges, starts=5)
        for model in (Pendulum(effects=(drag,)), Pendulum(), rig)
    )
    free = pendmap.parameter_map(Pendulum(), {"p": (0.7, 1.0, 2), "omega": (2.0, 2.0, 1)}, starts=5)
    assert (by_cell(found)[:, 0] == by_cell(free)[0]).all()
    assert (by_cell(added) == by_cell(found)).all()
    assert (by_cell(si) == by_cell(found)).all()
    assert found.attrs["title"].endswith("quadratic_drag")
    assert "0.1" not in drawn.chart(found).subtitle.replace("γ = 0.1", "")


def test_names_of_attractors() -> None:
    assert Attractor("rotation", 2, -2).name == "rotation 2:-2"
    assert Attractor("rotation", 2, -2).pair == "rotation 2:2"
    assert Attractor("oscillation", 4).name == "oscillation 4:0"
    assert Attractor("oscillation", 1, lean=1).name == "oscillation 1:0 (+)"
    assert Attractor("rest", 1, turn=-1).name == "rest turn -1"
    assert Attractor("rotating_chaos", w=-1).name == "rotating chaos -"


def test_the_figure_has_stripes_where_kinds_coexist(plane: xr.Dataset) -> None:
    figure = made(plane)
    assert titles(figure)[0].startswith("kinds of attractor")
    assert any(text.startswith("tumbling chaos") for text in named(figure))
    image, listed = drawn.striped(plane, 300, 6), drawn.kinds(plane)
    blocks = image.reshape(6, image.shape[0] // 6, 10, image.shape[1] // 10)
    for j, i in np.ndindex(6, 10):
        seen = {name for k in np.unique(blocks[j, :, i]) for name in listed[k].members}
        assert set(drawn.sets(plane)[int(plane["regime"][j, i])]) <= seen
    ticks = made(plane, "exponent").axes[1].get_yticks()
    assert min(ticks) < 0 < max(ticks)  # both halves of the scale have ticks


@pytest.mark.usefixtures("strict_recordings")
def test_curves_share_the_progress_and_are_recorded(tmp_path: Path) -> None:
    plane, seen = {"p": (0.1, 1.0, 3), "omega": (1.7, 2.2, 3)}, []
    found = pendmap.parameter_map(
        Pendulum(), plane, curves=True, progress=lambda *x: seen.append(x[0] / x[1])
    )
    assert seen == sorted(seen)
    assert seen[-1] <= 1
    back = recorded(found, tmp_path)
    paths = [name for name in back.columns if name.startswith("/kinds/data/rest/period_doubling/")]
    assert len(paths) == 2  # super- and subcritical
    for path in paths:
        for strip in back.columns[path]["LineStrips2D:strips"][0]:
            assert np.abs(np.diff(np.asarray(strip), axis=0)).max() < 0.2
    legend = str(back.one("/legend", "TextDocument:text"))
    assert "- period doubling: indigo" in legend
    # The fold of the rotation and that of the oscillation bound their kinds.
    folds = found["curve_kind"].values == "fold"
    both = (found[name].values[folds].tolist() for name in ("curve_n", "curve_w"))
    assert {(1, 1), (2, 0)} <= {*zip(*both, strict=True)}


def test_friction_holds_rest_in_every_cell() -> None:
    """Whether a given start comes to rest depends on the sample; that rest exists does not."""
    plane = {"gamma": (0.05, 0.4, 6), "p": (0.2, 2.0, 6)}
    found = pendmap.parameter_map(Pendulum(theta_r=0.02), plane)
    kinds = [str(kind) for kind in found["kind"].values]
    entry = found["entry_kind"].values
    for name in ("rest", "inverted rest"):
        cells = found["entry_cell"].values[entry == kinds.index(name)]
        assert np.array_equal(np.unique(cells), np.arange(36))
    assert "p = 1" not in found.attrs["title"]
    assert "otherwise \N{GREEK SMALL LETTER OMEGA} = 2" in found.attrs["title"]


def test_chaos_that_friction_ends_is_no_attractor() -> None:
    # Tumbling lasts some 6000 periods: longer than the search, but not for ever.
    plane = {"gamma": (0.08, 0.14, 3), "p": (1.9, 2.0, 3)}
    found = pendmap.parameter_map(Pendulum(theta_r=0.02), plane)
    assert "tumbling chaos" not in found["kind"].values
    # Rotating chaos, in one cell, is persistent: it never comes near rest.
    theta, velocity = (
        found[f"entry_{name}"].values[found["entry_n"].values == 0]
        for name in ("theta", "velocity")
    )
    model = Pendulum(gamma=0.14, p=1.9, theta_r=0.02)
    turns = pendmap.advance(model, theta, velocity, 10_000)[2]
    assert sorted(turns) == [-10_000, 10_000]
    assert found["undecided"].values.mean() > 0.1


# Bifurcation diagrams


@pytest.fixture(scope="module")
def diagram() -> xr.Dataset:
    return pendmap.bifurcation(Pendulum(), {"p": (1.2, 1.9, 71)})


def test_branches_end_where_their_orbits_do(diagram: xr.Dataset, truths: dict[str, Any]) -> None:
    known = truths["bifurcations_gamma0.1_omega2"]
    step = 0.7 / 70
    kinds = diagram["kind"].values[diagram["branch_kind"].values]
    rotations = np.flatnonzero(kinds == "rotation 1:+1")
    last = diagram["branch_last"].values[rotations].max()
    assert abs(last - float(known["rot_PD1"]["p"])) < step
    doubled = np.flatnonzero(kinds == "rotation 2:+2")
    first = diagram["branch_first"].values[doubled].min()
    assert abs(first - float(known["rot_PD1"]["p"])) < step
    twins = np.flatnonzero(np.strings.startswith(kinds.astype(str), "oscillation 2:0"))
    assert len(twins) == 2  # one continues through the symmetry breaking, its twin begins there
    begun = np.sort(diagram["branch_first"].values[twins])
    assert abs(begun[1] - float(known["osc_SB"]["p"])) < step


def test_sweeps_start_where_they_are_told_and_mirror_images_are_no_difference() -> None:
    ranges = {"p": (0.5, 0.6, 3)}
    for start, kind in (((1.2, -2.3), "rotation 1:-1"), ((-1.196, 0.29), "oscillation 2:0")):
        found = pendmap.bifurcation(Pendulum(), ranges, start=start)
        assert found["kind"].values[found["entry_kind"].values[found["up"].values[0]]] == kind
    found = pendmap.bifurcation(Pendulum(), {"p": (1.0, 1.5, 26)})
    on = [found[sweep].values[found["p"].values > 1.4] for sweep in ("up", "down")]
    assert (found["entry_w"].values[on[0]] == -found["entry_w"].values[on[1]]).all()
    # From p = 1.36 on they are mirror images of one another.
    assert "Hysteresis: up and down differ at p = 1 to 1.34" in found.attrs["summary"]


@pytest.mark.parametrize("offset", [0.0, 0.37])
def test_sweeps_settle_at_supercritical_bifurcations(truths: dict[str, Any], offset: float) -> None:
    known = truths["bifurcations_gamma0.1_omega2"]
    onset = float(truths["rest_onset"]["res_w2.2"]["p_onset"])
    places = [(2.2, onset), (2.0, float(known["rot_PD1"]["p"])), (2.0, float(known["osc_SB"]["p"]))]
    for omega, place in places:
        step = 2e-3
        first = place + (offset - 5.5) * step
        ranges = {"p": (first, first + 11 * step, 12)}
        found = pendmap.bifurcation(Pendulum(omega=omega), ranges)
        assert min(found["up"].values.min(), found["down"].values.min()) >= 0
        assert "Hysteresis" not in found.attrs["summary"]


def test_rest_under_a_torque_is_followed_to_its_fold_and_the_running_state_is_found() -> None:
    # Rest at asin(torque) exists up to torque = 1; the sweep down runs until damping stops it.
    found = pendmap.bifurcation(Pendulum(p=0.0), {"torque": (0.0, 1.19, 25)})
    torque = found["torque"].values
    kinds = found["kind"].values[found["entry_kind"].values]
    cells = found["entry_cell"].values
    assert set(cells[kinds == "rest"]) == set(np.flatnonzero(torque < 0.999))
    rest = found["entry_theta"].values[kinds == "rest"]
    assert np.allclose(rest, np.arcsin(torque[cells[kinds == "rest"]]), atol=1e-9)
    up, down = (found[sweep].values for sweep in ("up", "down"))
    # The last step is too large to follow it.
    assert (kinds[up[torque < 0.95]] == "rest").all()
    assert (kinds[down[torque > 0.2]] == "rotation 1:+1").all()
    assert (kinds[down[torque < 0.1]] == "rest").all()


def test_followed_branches_are_in_the_result_and_its_chart(tmp_path: Path) -> None:
    plain = pendmap.bifurcation(Pendulum(gamma=0.1, omega=2.0), {"p": (0.3, 1.3, 21)})
    assert pendmap.analysis.bifurcation.SCHEMA.json(plain)["events"] == []
    found = pendmap.bifurcation(Pendulum(gamma=0.1, omega=2.0), {"p": (0.3, 1.3, 21)}, branches=2)
    pendmap.save(found, tmp_path / "one.nc")
    again = pendmap.load(tmp_path / "one.nc")
    events = pendmap.analysis.bifurcation.SCHEMA.json(again)["events"]
    chart = bifurcation.chart(again)
    folds = {round(one["value"], 9) for one in events if (one["kind"], one["n"]) == ("fold", 1)}
    assert folds == {0.416787573}
    names = {mark.name for row in chart.rows for panel in row for mark in panel.marks}
    assert {"unstable", "fold", "symmetry breaking"} <= names
