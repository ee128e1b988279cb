"""Basin entropies and uncertainty exponents of planes and maps with known values."""

from __future__ import annotations

import itertools
import json
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import fractals
import pendmap
from pendmap import Grid, InputError, Pendulum
from pendmap.analysis.fractality import fitted

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from conftest import Run


def entropy(part: float) -> float:
    return -sum(p * math.log(p) for p in (part, 1 - part) if p > 0)


def test_a_vertical_line_leaves_known_shares_in_its_boxes() -> None:
    """For a boundary after k columns of a box, S = H(k / 5) in each of 20 boxes of 400."""
    for k in range(5):
        labels = np.where(np.arange(100) < 50 + k, 1, 2)[None, :].repeat(100, axis=0)
        found = pendmap.basin_entropy(labels)
        assert found.boxes == 400
        assert found.boundary_boxes == (20 if k else 0)
        assert found.boundary == pytest.approx(entropy(k / 5), abs=1e-12)
        assert found.value == pytest.approx(entropy(k / 5) / 20, abs=1e-12)
        assert not found.is_fractal


def test_random_labels_have_the_logarithm_of_their_number() -> None:
    """The expected value is the mean entropy over all labellings of a box of 25 cells."""
    for labels in (2, 3):
        counts = [c for c in itertools.product(range(26), repeat=labels - 1) if sum(c) <= 25]
        expected = 0.0
        for some in counts:
            shares = (*some, 25 - sum(some))
            ways = math.factorial(25) / math.prod(math.factorial(c) for c in shares)
            mean = -sum(c / 25 * math.log(c / 25) for c in shares if c)
            expected += ways / labels**25 * mean
        found = pendmap.basin_entropy(fractals.spread(500, 4, labels))
        assert found.boundary_boxes == found.boxes == 10_000
        assert abs(found.boundary - expected) < 4 * found.boundary_stderr
        assert found.boundary_stderr < 0.002
        assert math.log(labels) - 0.06 < expected < math.log(labels)
        assert found.is_fractal is (labels == 3)


def test_unknown_ends_and_broken_boxes_are_left_out() -> None:
    labels = fractals.disc(60, 1)
    whole = pendmap.basin_entropy(labels)
    wider = np.pad(labels, ((0, 3), (0, 4)), constant_values=9)
    assert pendmap.basin_entropy(wider) == whole
    holes = labels.copy()
    holes[10:25, 20:40] = 0
    holes[0, 0] = -1
    assert pendmap.basin_entropy(holes).boxes == whole.boxes - 12
    # A box with one basin and failed cells is a box of one basin.
    assert pendmap.basin_entropy(np.array([[3, 0, 3], [-1, 3, 3]])).boundary_boxes == 0
    assert pendmap.basin_entropy(labels * 1000) == whole


@pytest.mark.parametrize(
    "labels", [np.zeros(5, int), np.ones((3, 3)), np.zeros((0, 3), int), [["a"]]]
)
@pytest.mark.parametrize("measure", [pendmap.basin_entropy, pendmap.uncertainty_exponent])
def test_invalid_labels_are_refused(measure: Callable[[object], object], labels: object) -> None:
    with pytest.raises(InputError, match="labels"):
        measure(labels)


PLANES = {
    "line": (fractals.line, 1.0),
    "disc": (fractals.disc, 1.0),
    "thirds": (lambda side, seed: fractals.cantor(side, seed, 1 / 3), 1 - math.log(2, 3)),
    "wide": (lambda side, seed: fractals.cantor(side, seed, 0.45), 1 - math.log(2, 1 / 0.45)),
    "random": (lambda side, seed: fractals.spread(side, seed, 3), 0.0),
}


@pytest.mark.parametrize("which", PLANES)
def test_the_interval_of_a_grid_holds_the_known_exponent(which: str) -> None:
    """Of 40 intervals of 95 %, fewer than 34 contain the true value with probability 1/700."""
    make, known = PLANES[which]
    found = [pendmap.uncertainty_exponent(make(300, seed)) for seed in range(40)]
    held = sum(f.ci95[0] <= known <= f.ci95[1] for f in found)
    assert held >= 34, [f.value for f in found]
    mean = np.mean([f.value for f in found])
    assert abs(mean - known) < 0.04
    assert found[0].dimension == 2 - found[0].value


def test_intervals_of_the_fit_to_binomial_counts_have_their_coverage() -> None:
    rng = np.random.default_rng(8)
    eps, tried = 2.0 ** -np.arange(4, 20), np.full(16, 1500)
    for alpha, share in ((1.0, 0.3), (0.37, 0.5), (0.05, 0.7)):
        runs = [
            fitted(eps, rng.binomial(tried, share * (eps / eps[0]) ** alpha), tried)
            for _ in range(200)
        ]
        known = [run for run in runs if run is not None]
        assert len(known) == 200
        held = sum(run.ci95[0] <= alpha <= run.ci95[1] for run in known)
        assert held >= 180, (alpha, held)
        scatter = 1.483 * np.median(np.abs([run.value - alpha for run in known]))
        assert np.mean([run.stderr for run in known]) == pytest.approx(scatter, rel=0.25)


def test_a_power_law_with_a_cutoff_is_fitted_below_the_cutoff() -> None:
    eps, tried = 2.0 ** -np.arange(2, 20), np.full(18, 100_000)
    share = np.minimum(0.4 * (eps / 2**-6) ** 0.5, 0.4)
    found = fitted(eps, np.round(share * tried), tried)
    assert found is not None
    assert found.value == pytest.approx(0.5, abs=0.01)
    assert found.eps[found.scales - 1] <= 2**-5


def test_without_a_boundary_there_is_no_exponent() -> None:
    with pytest.raises(InputError, match="no boundary"):
        pendmap.uncertainty_exponent(np.ones((50, 50), int))
    assert fitted([0.1, 0.01], [5, 2], [100, 100]) is None


def test_a_periodic_axis_continues_at_its_other_end() -> None:
    """Of two halves, there are two boundaries on a periodic axis and one on an open axis."""
    labels = np.where(np.arange(200) < 100, 1, 2)[:, None].repeat(200, axis=1)
    open_, closed = (
        pendmap.uncertainty_exponent(labels, periodic=(way, False)) for way in (False, True)
    )
    assert closed.share == pytest.approx(2 * open_.share)
    assert open_.share == pytest.approx(2 * open_.eps / 200)
    assert open_.value == pytest.approx(1, abs=1e-9)


def test_below_the_homoclinic_tangency_the_boundary_is_smooth_and_above_fractal() -> None:
    """The Melnikov threshold at gamma = 0.1, omega = 3 is 0.787: dimension 1 below, more above."""
    threshold = 4 * 0.1 * math.sinh(math.pi * 3 / 2) / (math.pi * 9)
    below, above = (pendmap.basins(Pendulum(p=p, omega=3.0), Grid.square(600)) for p in (0.7, 1.2))
    assert 0.7 < threshold < 1.2
    low, high = (below[f"uncertainty_exponent_{end}"].item() for end in ("low", "high"))
    assert low <= 1 <= high
    assert high - low < 0.9
    smooth = pendmap.uncertainty_exponent(below)
    assert smooth.value == below["uncertainty_exponent"].item()
    fractal = pendmap.uncertainty_exponent(above)
    assert fractal.ci95[1] < 0.3
    assert fractal.ci95[0] > 0.05
    # Two estimates without a common start: new starts for each distance, and the grid's labels.
    grid = pendmap.uncertainty_exponent(above.label.values, periodic=(False, True))
    assert abs(grid.value - fractal.value) < 3 * math.hypot(grid.stderr, fractal.stderr)


@pytest.mark.parametrize("seed", range(2))
def test_the_boundary_of_an_undriven_pendulum_is_smooth(seed: int) -> None:
    """Without drive the boundary is a saddle's stable manifold: the exponent is 1."""
    draw = np.random.default_rng(seed)
    pendulum = Pendulum(gamma=draw.uniform(0.05, 0.2), p=0.0, torque=draw.uniform(0.3, 0.6))
    found = pendmap.uncertainty_exponent(
        pendmap.basins(pendulum, Grid.square(400), run=pendmap.RunOptions(seed=seed))
    )
    assert abs(found.value - 1) < 0.05
    assert found.ci95[1] - found.ci95[0] < 0.15


def test_three_basins_of_the_paper_s_kind_pass_the_log2_criterion() -> None:
    result = pendmap.basins(Pendulum(p=1.0), Grid.square(200))
    again = pendmap.basin_entropy(result.label.values)
    assert again.value == result["basin_entropy"].item()
    assert again.boundary == result["boundary_basin_entropy"].item()
    assert again.is_fractal
    assert "log 2 criterion" in result.attrs["summary"]
    threads = pendmap.basins(Pendulum(p=1.0), Grid.square(200), run=pendmap.RunOptions(threads=1))
    assert threads["uncertainty_exponent"].item() == result["uncertainty_exponent"].item()


@pytest.mark.parametrize(
    "model", [Pendulum(gamma=0, p=0.5), pendmap.PRESETS["fig2b"], Pendulum(p=0.1)]
)
def test_maps_without_meaningful_labels_have_no_exponent(model: Pendulum) -> None:
    result = pendmap.basins(model, Grid.square(20))
    assert "uncertainty_exponent" not in result
    with pytest.raises(InputError, match="uncertain"):
        pendmap.uncertainty_exponent(result)


def test_the_command_reports_both_measures(tmp_path: Path, pendmap_command: Run) -> None:
    words = ("basins", "--p", "1", "--theta-r", "0.02", "--grid", "100", "--json")
    result = json.loads(pendmap_command(*words).stdout)
    exponent = result["uncertainty_exponent"]
    assert exponent["ci95"][0] < exponent["value"] < exponent["ci95"][1]
    assert 0 < result["basin_entropy"] < result["boundary_basin_entropy"] < math.log(10)
    assert isinstance(result["log2_criterion"], bool)
    plain = json.loads(pendmap_command("basins", "--p", "0.1", "--grid", "20", "--json").stdout)
    assert plain["uncertainty_exponent"] is None
    assert plain["boundary_basin_entropy"] is None
    assert plain["log2_criterion"] is None
    assert not list(tmp_path.iterdir())
