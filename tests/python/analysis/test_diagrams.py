"""Bifurcation diagrams: branches, sweeps, figures, files, command; Rust tests cover the physics."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from drawn import made, named
from pendmap import Pendulum
from pendmap.charts import bifurcation as drawn
from pendmap.charts import palette

if TYPE_CHECKING:
    from typing import Any

    import xarray as xr


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


def test_entries_points_and_branches_fit(diagram: xr.Dataset) -> None:
    owner = diagram["point_entry"].values
    values = diagram["p"].values[diagram["entry_cell"].values]
    assert (diagram["point_value"].values == values[owner]).all()
    counts = np.bincount(owner, minlength=diagram.sizes["entry"])
    n = diagram["entry_n"].values
    assert (counts[n > 0] == n[n > 0]).all()
    assert (counts[n == 0] > 20).all()
    for branch in range(diagram.sizes["branch"]):
        cells = diagram["entry_cell"].values[diagram["entry_branch"].values == branch]
        assert (np.diff(cells) == 1).all()
    for sweep in ("up", "down"):
        on = diagram[sweep].values
        assert (diagram["entry_cell"].values[on[on >= 0]] == np.flatnonzero(on >= 0)).all()


def test_sweeps_start_where_they_are_told_and_report_mirror_images() -> None:
    ranges = {"p": (0.5, 0.6, 3)}
    kinds = []
    for start in ((1.2, -2.3), (-1.196, 0.29)):
        found = pendmap.bifurcation(Pendulum(), ranges, start=start)
        kinds.append(str(found["kind"].values[found["entry_kind"].values[found["up"].values[0]]]))
    assert kinds == ["rotation 1:-1", "oscillation 2:0"]
    found = pendmap.bifurcation(Pendulum(), {"p": (1.0, 1.5, 26)})
    on = [found[sweep].values[found["p"].values > 1.4] for sweep in ("up", "down")]
    assert (found["entry_w"].values[on[0]] == -found["entry_w"].values[on[1]]).all()
    assert "mirror images of one another at p = 1.36 to 1.5" in found.attrs["summary"]


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
        assert "hysteresis" not in found.attrs["summary"]


def test_the_figure_names_its_attractors_and_chaos_in_few_cells(
    diagram: xr.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = made(diagram)
    assert {"rotation 1:+1", "tumbling chaos"} <= set(named(figure))
    assert [t.get_text() for t in figure.axes[1].get_yticklabels()] == ["up \u2192", "\u2190 down"]
    assert made(diagram, "velocity").axes[0].get_ylabel()
    with pytest.raises(pendmap.InputError, match=r"no layer 'labels'.*theta, sweeps, exponent"):
        made(diagram, "labels")
    monkeypatch.setattr(drawn, "MOST", 4)
    every = drawn.families(diagram)
    chaotic = [k for k, one in enumerate(every) if "chaos" in one.name]
    assert chaotic
    assert max(chaotic) < drawn.MOST < len(every)
    assert all(every[k].colour != palette.UNNAMED for k in chaotic)
    assert all(one.colour == palette.UNNAMED for one in every[drawn.MOST :])


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
    assert "loose" not in found.sizes
    assert len(found.to_dataframe()) > 0


def test_nothing_attracts_without_damping() -> None:
    found = pendmap.bifurcation(Pendulum(gamma=0.0), {"p": (0.2, 2.0, 5)})
    assert found.sizes["branch"] == 0
    assert "same attractors" not in found.attrs["summary"]
    assert "sweep, undecided" in named(made(found))
