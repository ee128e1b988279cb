"""Parameter maps: regimes, layers, figures, files, command; the Rust tests cover the physics."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from drawn import made, named, titles
from pendmap import Effect, Grid, Pendulum, Rig
from pendmap._core import Attractor
from pendmap.analysis.cell_search import spread
from pendmap.analysis.orbit_table import attractors_of
from pendmap.analysis.parameter_map import regimes
from pendmap.charts import parameter_map as drawn
from recordings import recorded

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr


RANGES = {"p": (0.2, 2.0, 10), "omega": (1.4, 2.4, 6)}


@pytest.fixture(scope="module")
def plane() -> xr.Dataset:
    return pendmap.parameter_map(Pendulum(), RANGES)


def by_cell(plane: xr.Dataset) -> Any:  # noqa: ANN401 (an array of words)
    """Return the attractor kinds of each cell in words; regimes are numbered by their shares."""
    return np.array([" and ".join(kinds) for kinds in drawn.sets(plane)])[plane["regime"].values]


def test_regimes_and_their_shares(plane: xr.Dataset) -> None:
    assert plane["regime"].dims == ("omega", "p")
    shares = plane["regime_share"].values
    assert shares.sum() == pytest.approx(1)
    assert (np.diff(shares) <= 0).all()
    counts = np.bincount(plane["regime"].values.ravel())
    assert np.allclose(counts / 60, shares)
    # The kinds of a cell's attractors are those of its regime.
    names, cell = plane["kind"].values, plane["entry_cell"].values
    for index in range(60):
        own = {str(names[k]) for k in plane["entry_kind"].values[cell == index]}
        said = drawn.sets(plane)[plane["regime"].values.ravel()[index]]
        assert own == set(said) - {"undecided"}
    total = plane["share"].sum("kind") + plane["undecided"] + plane["failed"]
    assert np.allclose(total, 1)
    exponent, largest = plane["entry_exponent"].values, plane["exponent"].values.ravel()
    assert plane["attractors"].values.ravel().tolist() == np.bincount(cell, minlength=60).tolist()
    for index in np.unique(cell):
        assert largest[index] == pytest.approx(exponent[cell == index].max(), nan_ok=True)


def test_a_cell_is_the_pendulum_with_its_parameters(plane: xr.Dataset) -> None:
    there = plane.sel(p=1.0, omega=2.0, method="nearest")
    model = Pendulum(p=float(there["p"]), omega=float(there["omega"]))
    basins = pendmap.basins(model, Grid.square(40), check=False)
    said = drawn.sets(plane)[int(there["regime"])]
    assert set(said) == {one.pair for one in attractors_of(basins)}


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


@pytest.mark.parametrize(
    ("ranges", "match"),
    [
        ({"p": (0, 1, 3)}, "must be a mapping"),
        ([1, 2], "must be a mapping"),
        ({"p": (0, 1, 3), "Omega": (1, 2, 3)}, "'Omega' is no parameter of this model"),
        ({"p": (0, 1, 3), "viscous_damping.gamma": (0, 1, 3)}, "is no parameter of this model"),
        ({"p": (0, 1, 3), "gamma": (-1, 2, 3)}, "gamma = -1: gamma must be 0 or more, got -1"),
        ({"p": (0, 1, 3), "omega": (0, 2, 3)}, "omega must be a number above 0, got 0"),
        ({"p": (1, 1, 3), "omega": (1, 2, 3)}, "two finite values a finite distance apart"),
        ({"p": (0, math.nan, 3), "omega": (1, 2, 3)}, "p must be .*, got nan"),
        ({"p": (0, 1, 0), "omega": (1, 2, 3)}, "how many must be .*, got 0"),
        ({"p": (0, 1), "omega": (1, 2, 3)}, "first, last, how many"),
        ({"p": (0, 1, 1), "omega": (1, 2, 2)}, "p is 0 to 1: one value has one bound"),
    ],
)
def test_invalid_requests_are_refused(ranges: Any, match: str) -> None:  # noqa: ANN401
    with pytest.raises(pendmap.InputError, match=match):
        pendmap.parameter_map(Pendulum(), ranges)
    for given, text in (({"starts": 0}, "starts must be .*, got 0"), ({"box": 3}, "box")):
        with pytest.raises(pendmap.InputError, match=text):
            pendmap.parameter_map(Pendulum(), RANGES, **given)


def test_names_of_attractors() -> None:
    assert Attractor("rotation", 2, -2).name == "rotation 2:-2"
    assert Attractor("rotation", 2, -2).pair == "rotation 2:2"
    assert Attractor("oscillation", 4).name == "oscillation 4:0"
    assert Attractor("oscillation", 1, lean=1).name == "oscillation 1:0 (+)"
    assert Attractor("rest", 1, turn=-1).name == "rest turn -1"
    assert Attractor("rotating_chaos", w=-1).name == "rotating chaos -"
    with pytest.raises(ValueError, match="no kind"):
        Attractor("chaos")
    raw: Any = SimpleNamespace(cell=np.array([0, 2]), kind=np.array([0, 1]), kinds=[None, None])
    sets, regime, share = regimes(raw, 4)
    assert sets == [(), (0,), (1,)]
    assert regime.tolist() == [1, 0, 2, 0]
    assert share.tolist() == [0.5, 0.25, 0.25]


def test_starts_cover_the_box_and_have_no_mirror_images() -> None:
    theta, velocity = spread(Grid.square(10), 2000)
    counts, _, _ = np.histogram2d(theta, velocity, bins=5, range=[[-math.pi, math.pi], [-3, 3]])
    assert 60 < counts.min() < counts.max() < 100
    nine = np.stack(spread(Grid.square(10), 9), axis=1)
    assert np.abs(nine[:, None] + nine[None]).max(axis=2).min() > 1e-3


def test_the_figure_has_stripes_where_kinds_coexist(plane: xr.Dataset) -> None:
    figure = made(plane)
    assert titles(figure)[0].startswith("kinds of attractor")
    assert any(text.startswith("tumbling chaos") for text in named(figure))
    image, listed = drawn.striped(plane, 300, 6), drawn.kinds(plane)
    blocks = image.reshape(6, image.shape[0] // 6, 10, image.shape[1] // 10)
    for j, i in np.ndindex(6, 10):
        seen = {name for k in np.unique(blocks[j, :, i]) for name in listed[k].members}
        assert set(drawn.sets(plane)[int(plane["regime"][j, i])]) <= seen
    for layer in ("attractors", "period", "winding", "undecided", "share rest"):
        assert len(made(plane, layer).axes) == 2
    ticks = made(plane, "exponent").axes[1].get_yticks()
    assert min(ticks) < 0 < max(ticks)  # both halves of the scale have ticks
    with pytest.raises(pendmap.InputError, match=r"no layer 'nothing'.*kinds, exponent"):
        made(plane, "nothing")


@pytest.mark.usefixtures("strict_recordings")
def test_no_curve_of_the_recording_leaps_from_one_tongue_to_the_next(tmp_path: Path) -> None:
    # The fold below the first tongue ends at omega = 1.26, that below the second begins at 0.97.
    plane = {"p": (0.1, 1.0, 3), "omega": (0.8, 2.2, 3)}
    found = pendmap.parameter_map(Pendulum(), plane, curves=True)
    back = recorded(found, tmp_path)
    columns = [back.columns[f"/kinds/data/curves/{k}"] for k in range(3)]
    strips = [part for one in columns for part in one["LineStrips2D:strips"][0]]
    assert len(strips) >= 4
    for strip in strips:
        step = np.abs(np.diff(np.asarray(strip), axis=0))
        assert step.max() < 0.2
    legend = str(back.one("/legend", "TextDocument:text"))
    assert "- rest: multiplier +1: magenta" in legend


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


def test_undamped_motion_has_no_attractors() -> None:
    found = pendmap.parameter_map(Pendulum(omega=1.0), {"p": (0.0, 1.0, 3), "gamma": (0.0, 0.2, 3)})
    assert (found["undecided"].values[0] == 1.0).all()
    assert found["entry_cell"].values.min() >= 3
    assert "Without damping (gamma = 0) there are no attractors" in found.attrs["summary"]


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


def test_curves_and_cells_move_one_progress() -> None:
    seen: list[tuple[int, int]] = []
    pendmap.parameter_map(
        Pendulum(),
        {"p": (0.5, 1.0, 3), "omega": (1.8, 2.2, 3)},
        curves=True,
        progress=lambda done, total: seen.append((done, total)),
    )
    shares = [done / total for done, total in seen]
    assert shares == sorted(shares)
    assert any(0 < share < 0.5 for share in shares)  # while curves are computed
    assert shares[-1] <= 1
