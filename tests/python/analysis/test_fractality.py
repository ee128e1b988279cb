"""Basin entropies and uncertainty exponents of planes and maps with known values."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from pendmap import Grid, InputError, Pendulum
from pendmap.analysis.basins import SCHEMA
from pendmap.analysis.fractality import fitted

if TYPE_CHECKING:
    import numpy.typing as npt

    Labels = npt.NDArray[np.int64]


def centres(side: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return the centres of side x side cells of the unit square."""
    middle = (np.arange(side) + 0.5) / side
    return np.meshgrid(middle, middle)[0], np.meshgrid(middle, middle)[1]


def line(side: int, seed: int) -> Labels:
    """Return two labels on both sides of a straight line: dimension 1."""
    rng = np.random.default_rng(seed)
    x, y = centres(side)
    angle, shift = rng.uniform(0, 2 * np.pi), rng.uniform(-0.1, 0.1)
    return np.where((x - 0.5) * np.cos(angle) + (y - 0.5) * np.sin(angle) > shift, 1, 2)


def disc(side: int, seed: int) -> Labels:
    """Return the labels of a disc at a random place: dimension 1."""
    rng = np.random.default_rng(seed)
    x, y = centres(side)
    radius, (left, low) = rng.uniform(0.2, 0.35), rng.uniform(0.4, 0.6, 2)
    return np.where((x - left) ** 2 + (y - low) ** 2 < radius**2, 1, 2)


def cantor(side: int, seed: int, ratio: float) -> Labels:
    """Return labels of a Cantor set's gaps times an interval: dimension 1 + ln 2 / ln(1/ratio)."""
    rng = np.random.default_rng(seed)
    u = (centres(side)[0] + rng.uniform(0.1, 0.4)) / rng.uniform(1.5, 2.0)
    label, inside = np.ones(u.shape, dtype=np.int64), np.ones(u.shape, dtype=bool)
    for generation in range(24):
        gap = inside & (u > ratio) & (u < 1 - ratio)
        label[gap] = 1 + generation % 2
        inside &= ~gap
        u = np.where(u >= 0.5, (u - (1 - ratio)) / ratio, u / ratio)
    return label


def spread(side: int, seed: int, labels: int) -> Labels:
    """Return random labels: dimension 2."""
    return np.random.default_rng(seed).integers(1, labels + 1, (side, side))


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
        found = pendmap.basin_entropy(spread(500, 4, labels))
        assert found.boundary_boxes == found.boxes == 10_000
        assert abs(found.boundary - expected) < 4 * found.boundary_stderr
        assert found.boundary_stderr < 0.002
        assert math.log(labels) - 0.06 < expected < math.log(labels)
        assert found.is_fractal is (labels == 3)


def test_unknown_ends_and_broken_boxes_are_left_out() -> None:
    labels = disc(60, 1)
    whole = pendmap.basin_entropy(labels)
    wider = np.pad(labels, ((0, 3), (0, 4)), constant_values=9)
    assert pendmap.basin_entropy(wider) == whole
    holes = labels.copy()
    holes[10:25, 20:40] = 0
    holes[0, 0] = -1
    assert pendmap.basin_entropy(holes).boxes == whole.boxes - 12


PLANES = {
    "line": (line, 1.0),
    "disc": (disc, 1.0),
    "thirds": (lambda side, seed: cantor(side, seed, 1 / 3), 1 - math.log(2, 3)),
    "wide": (lambda side, seed: cantor(side, seed, 0.45), 1 - math.log(2, 1 / 0.45)),
    "random": (lambda side, seed: spread(side, seed, 3), 0.0),
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


def test_three_basins_of_the_paper_s_kind_pass_the_log2_criterion() -> None:
    result = pendmap.basins(Pendulum(p=1.0), Grid.square(200))
    again = pendmap.basin_entropy(result.label.values)
    assert again.value == result["basin_entropy"].item()
    assert again.boundary == result["boundary_basin_entropy"].item()
    assert again.is_fractal
    assert "log 2 criterion" in result.attrs["summary"]
    fields = SCHEMA.json(result)
    exponent = fields["uncertainty_exponent"]
    assert exponent["ci95"][0] < exponent["value"] < exponent["ci95"][1]
    assert 0 < fields["basin_entropy"] < fields["boundary_basin_entropy"] < math.log(10)
    assert fields["log2_criterion"] is True


@pytest.mark.parametrize(
    "model", [Pendulum(gamma=0, p=0.5), pendmap.PRESETS["fig2b"], Pendulum(p=0.1)]
)
def test_maps_without_meaningful_labels_have_no_exponent(model: Pendulum) -> None:
    result = pendmap.basins(model, Grid.square(20))
    assert "uncertainty_exponent" not in result
    assert SCHEMA.json(result)["uncertainty_exponent"] is None
    with pytest.raises(InputError, match="uncertain"):
        pendmap.uncertainty_exponent(result)
