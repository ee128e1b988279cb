"""Spectra of residual noise, estimated at high frequencies and extrapolated to low ones."""

from __future__ import annotations

import numpy as np
import pytest

from hidden import diagnosed
from leftovers import COUNT, INTERVAL, SAMPLES, W0, coloured, counted, noise_of, swing
from pendmap.diagnosis import Thresholds

COLOURS = (0.0, 0.3, 0.5, 0.7, 0.9)
CHANCE = Thresholds().rest


def density(correlation: float, phase: float = W0 * INTERVAL) -> float:
    """Spectral density of AR(1) noise of unit variance (Priestley 1981, eq. 3.5.18)."""
    around = 1 + correlation**2 - 2 * correlation * np.cos(phase)
    return float((1 - correlation**2) / around)


@pytest.mark.parametrize("swell", [1.0, 1.15])
def test_the_chance_of_slow_residuals_is_that_of_noise_alone(swell: float) -> None:
    # Noise about swings with fitted initial states; in one run stronger than stated.
    rng = np.random.default_rng(2)
    chances = []
    for _ in range(100):
        noise = rng.standard_normal((4, SAMPLES)) * np.array([swell, 1.0, 1.0, 1.0])[:, None]
        chances.append(noise_of(noise).chance)
    assert np.mean(np.array(chances) < 0.1) < 0.18  # more than two standard errors above a tenth
    assert np.mean(np.array(chances) < 0.5) > 0.2
    assert min(chances) > CHANCE
    error = 0.25 * np.sqrt(SAMPLES) * swing()[0]
    assert noise_of(noise + error, fitted=False).chance < CHANCE


def test_white_noise_is_estimated_as_white() -> None:
    rng = np.random.default_rng(7)
    found = [noise_of(coloured(rng, 0.0)) for _ in range(100)]
    assert sum(abs(one.colour) > 0.02 for one in found) <= 2
    levels = np.array([one.level for one in found])
    # Each is the mean of about 2,000 squares.
    assert np.std(levels) < 1.3 * np.sqrt(2 / 2000)
    assert np.mean(levels) == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize(
    ("correlation", "noise"),
    # With coarser counts, high-frequency noise of 0.9 is rounding alone.
    [(c, n) for c in COLOURS for n in (0.3, 1.0, None) if n != 0.3 or c < 0.8],
)
def test_coloured_noise_has_no_excess_of_slow_residuals(
    correlation: float, noise: float | None
) -> None:
    # With coarse counts the white rounding noise hides the slope of the coloured part.
    rng = np.random.default_rng(3)
    chances, levels = [], []
    for _ in range(40):
        drawn = coloured(rng, correlation)
        if noise is None:
            found = noise_of(drawn)
        else:
            found = noise_of(counted(rng, noise * drawn), COUNT**2 / 12)
        chances.append(found.chance)
        levels.append(found.level)
    truth = density(correlation)
    if noise is not None:
        truth = noise**2 * truth + COUNT**2 / 12
    # A verdict tests four directions.
    assert min(chances) > CHANCE / 4
    assert np.mean(np.array(chances) < 0.01) <= 2 / 40
    assert np.median(levels) == pytest.approx(truth, rel=0.4 if correlation > 0.8 else 0.2)


@pytest.mark.parametrize("correlation", COLOURS)
def test_a_missing_effect_shows_in_coloured_noise(correlation: float) -> None:
    # The effect adds 300 a run to the sum of squares, whatever the colour of the noise.
    rng = np.random.default_rng(5)
    slow = np.sin(0.5 * W0 * INTERVAL * np.arange(SAMPLES))
    error = np.sqrt(300 * density(correlation, 0.5 * W0 * INTERVAL) / np.sum(slow**2)) * slow
    for _ in range(5):
        found = noise_of(coloured(rng, correlation) + error)
        assert found.z > 1 or correlation > 0.5
        assert found.chance_of(300 * density(correlation), 1) < 1e-6


def test_the_chance_of_a_gain_is_that_of_noise_alone() -> None:
    # The gain of one number: squared product with a column of unit length at the swing's frequency.
    rng = np.random.default_rng(8)
    for correlation in (0.0, 0.5):
        chances = []
        for _ in range(120):
            noise = coloured(rng, correlation)
            chances.append(noise_of(noise).chance_of(float(noise[0] @ swing()[0]) ** 2, 1))
        assert 0.4 < np.mean(chances) < 0.6
        assert 0.03 < np.mean(np.array(chances) < 0.1) < 0.18
        assert min(chances) > 1e-4


@pytest.mark.thorough
@pytest.mark.parametrize(("seed", "correlation"), [(2, 0.5), (3, 0.7), (4, 0.5)])
def test_coloured_noise_of_an_encoder_is_no_effect(seed: int, correlation: float) -> None:
    found, _ = diagnosed(
        seed=seed, free=3, forced=0, correlation=correlation, noise=0.15, counts=2048
    )
    assert found.verdict == "none"
    # Errors of adjacent readings are correlated: they carry less information than independent ones.
    assert found.level > 2


@pytest.mark.thorough
def test_intervals_have_their_coverage_in_coloured_noise() -> None:
    inside = []
    for seed in range(1, 9):
        found, truth = diagnosed(
            "quadratic_drag",
            seed=seed,
            size=3.0,
            free=3,
            forced=0,
            correlation=0.7,
            noise=0.1,
            counts=4096,
        )
        bounds = {e.name: e.ci95 for e in found.effects}
        if "quadratic_drag" in bounds:
            low, high = bounds["quadratic_drag"]["q"]
            inside.append(low <= truth["quadratic_drag"]["q"] <= high)
    assert len(inside) >= 6
    # By the stated noise, too small by a factor of three, half of the intervals would miss.
    assert sum(inside) >= len(inside) - 1
