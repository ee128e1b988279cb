"""Noise of residuals: its spectrum at high frequencies, its level at low ones, and weights."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.fft import idct
from scipy.signal import lfilter

from driven_decays import motion
from hidden import diagnosed
from pendmap import Rig
from pendmap.comparison.data import DataSplit, split_records
from pendmap.diagnosis import Thresholds
from pendmap.diagnosis.fitted_model import FittedModel, model_errors, weight_records
from pendmap.identification.runs import FitRun
from pendmap.records import Experiment, Run

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

INTERVAL, W0 = 0.02, 6.0
RUNS, SAMPLES = 4, 800
CHANCE = Thresholds().rest
PHASE = W0 * INTERVAL * np.arange(SAMPLES)
SWING = np.linalg.qr(np.column_stack([np.cos(PHASE), np.sin(PHASE)]))[0].T
"""Orthonormal basis of swings of one frequency."""
SIGMA = np.where(np.arange(SAMPLES) < SAMPLES // 2, 1.0, 2.0)
SIGNS = np.where(np.arange(SAMPLES) % 2, 1.0, -1.0)


def density(correlation: float, phase: float = W0 * INTERVAL) -> float:
    """Spectral density of AR(1) noise of unit variance (Priestley 1981, eq. 3.5.18)."""
    around = 1 + correlation**2 - 2 * correlation * np.cos(phase)
    return float((1 - correlation**2) / around)


def coloured(rng: np.random.Generator, correlation: float) -> Floats:
    drawn = rng.standard_normal((RUNS, SAMPLES))
    drawn[:, 1:] *= np.sqrt(1 - correlation**2)
    return np.asarray(lfilter([1.0], [1.0, -correlation], drawn), np.float64)


def counted(rng: np.random.Generator, noise: Floats) -> Floats:
    """Return noise rounded to counts of 1 about swings of 300, the exact swing subtracted."""
    swings = 300 * np.sin(PHASE + rng.uniform(0, math.tau, (RUNS, 1)))
    return np.asarray(np.round(swings + noise) - swings, np.float64)


def fitted_to(residuals: Floats, floor: float = 0.0) -> FittedModel:
    """Return a fit with the given residuals, one run a row; ``floor`` is the share of rounding."""
    count, samples = residuals.shape
    runs = tuple(FitRun(INTERVAL * np.arange(samples), np.zeros(samples), 1.0) for _ in residuals)
    fit = SimpleNamespace(
        white=residuals,
        chi2=float(np.sum(residuals**2)),
        names=(),
        curves=[np.vstack([np.zeros(samples), W0 * SWING[0]])] * count,
        windows=[(k, 0, samples, 0.0, 0.0) for k in range(count)],
        estimates={},
        model=Rig(w0=W0),
    )
    return FittedModel(fit, (), (), runs, (floor,) * count)  # type: ignore[arg-type]


def left_of(noise: Floats) -> Floats:
    """Return what a fit of the initial states leaves of noise."""
    return np.asarray(noise - noise @ SWING.T @ SWING)


def test_the_chance_of_slow_residuals_is_that_of_noise_alone() -> None:
    # In one run the noise is stronger than stated.
    rng = np.random.default_rng(2)
    swell = np.array([1.15, 1.0, 1.0, 1.0])[:, None]
    noises = [left_of(coloured(rng, 0.0) * swell) for _ in range(100)]
    chances = np.array([fitted_to(noise).noise.chance for noise in noises])
    assert np.mean(chances < 0.1) < 0.18  # more than two standard errors above a tenth
    assert np.mean(chances < 0.5) > 0.2
    assert chances.min() > CHANCE
    assert fitted_to(noises[0] + 0.25 * np.sqrt(SAMPLES) * SWING[0]).noise.chance < CHANCE


def test_white_noise_is_estimated_as_white() -> None:
    rng = np.random.default_rng(7)
    fits = [fitted_to(left_of(coloured(rng, 0.0))) for _ in range(100)]
    assert sum(abs(one.noise.colour) > 0.02 for one in fits) <= 2
    levels = np.array([one.noise.level for one in fits])
    # Each is the mean of about 2,000 squares.
    assert np.std(levels) < 1.3 * np.sqrt(2 / 2000)
    assert np.mean(levels) == pytest.approx(1, abs=0.01)
    independent = np.mean([one.noise.independent for one in fits])
    assert independent == pytest.approx(RUNS * SAMPLES, rel=0.03)


@pytest.mark.parametrize(
    ("correlation", "noise"),
    # With coarser counts, high-frequency noise of 0.9 is rounding alone.
    [(0.0, 0.3), (0.7, 0.3), (0.5, 1.0), (0.9, 1.0), (0.3, None), (0.9, None)],
)
def test_coloured_noise_has_no_excess_of_slow_residuals(
    correlation: float, noise: float | None
) -> None:
    # With coarse counts the white rounding noise hides the slope of the coloured part.
    rng, truth = np.random.default_rng(3), density(correlation)
    noises = []
    for _ in range(40):
        drawn = coloured(rng, correlation)
        if noise is None:
            noises.append(fitted_to(left_of(drawn)).noise)
        else:
            noises.append(fitted_to(left_of(counted(rng, noise * drawn)), 1 / 12).noise)
    chances = np.array([one.chance for one in noises])
    truth = truth if noise is None else noise**2 * truth + 1 / 12
    # A verdict tests four directions.
    assert chances.min() > CHANCE / 4
    assert np.mean(chances < 0.01) <= 2 / 40
    level = np.median([one.level for one in noises])
    assert level == pytest.approx(truth, rel=0.4 if correlation > 0.8 else 0.2)


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
def test_a_missing_effect_shows_in_coloured_noise(correlation: float) -> None:
    # The effect adds 300 a run to the sum of squares, whatever the colour of the noise.
    rng = np.random.default_rng(5)
    slow = np.sin(0.5 * PHASE)
    error = np.sqrt(300 * density(correlation, 0.5 * W0 * INTERVAL) / np.sum(slow**2)) * slow
    for _ in range(5):
        noise = fitted_to(left_of(coloured(rng, correlation) + error)).noise
        assert noise.z > 1 or correlation > 0.5
        assert noise.chance_of(300 * density(correlation), 1) < 1e-6


def test_the_chance_of_a_gain_is_that_of_noise_alone() -> None:
    # The gain of one number: squared product with a column of unit length at the swing's frequency.
    rng = np.random.default_rng(8)
    for correlation in (0.0, 0.5):
        noises = [coloured(rng, correlation) for _ in range(120)]
        gains = [float(noise[0] @ SWING[0]) ** 2 for noise in noises]
        models = [fitted_to(left_of(noise)).noise for noise in noises]
        chances = np.array([m.chance_of(g, 1) for m, g in zip(models, gains, strict=True)])
        assert 0.4 < chances.mean() < 0.6
        assert 0.03 < np.mean(chances < 0.1) < 0.18
        assert chances.min() > 1e-4


@pytest.mark.parametrize("count", [1, 5])
def test_residuals_that_oscillate_are_few_independent_readings(count: int) -> None:
    # Cosines of the DFT, equally strong: 3 (count P)^2 / (count P^2) independent readings.
    amplitudes = np.zeros((1, SAMPLES))
    amplitudes[0, 40 : 40 + count] = math.sqrt(SAMPLES / count)
    fitted = fitted_to(np.asarray(idct(amplitudes, type=2, norm="ortho")))
    assert fitted.noise.independent == pytest.approx(3 * count)
    assert fitted.level == pytest.approx(SAMPLES / (3 * count))


@pytest.mark.thorough
@pytest.mark.parametrize(("seed", "correlation"), [(2, 0.5), (3, 0.7), (4, 0.5)])
def test_coloured_noise_of_an_encoder_is_no_effect(seed: int, correlation: float) -> None:
    given = {"free": 3, "forced": 0, "noise": 0.15, "counts": 2048}
    result, _ = diagnosed(seed=seed, correlation=correlation, **given)
    assert result.verdict == "none"
    # Errors of adjacent readings are correlated: they carry less information than independent ones.
    assert result.level > 2


@pytest.mark.thorough
def test_intervals_have_their_coverage_in_coloured_noise() -> None:
    given = {"size": 3.0, "free": 3, "forced": 0, "noise": 0.1, "counts": 4096}
    inside = []
    for seed in range(1, 9):
        result, truth = diagnosed("quadratic_drag", seed=seed, correlation=0.7, **given)
        for effect in result.effects:
            if effect.name == "quadratic_drag":
                low, high = effect.ci95["q"]
                inside.append(low <= truth["quadratic_drag"]["q"] <= high)
    assert len(inside) >= 6
    # By the stated noise, too small by a factor of three, half of the intervals would miss.
    assert sum(inside) >= len(inside) - 1


def data(*runs: FitRun, doubt: float = 0.0) -> DataSplit:
    """Return runs from separate records; the first is held out too."""
    time, good = np.arange(SAMPLES) * 0.01, np.ones(SAMPLES, bool)
    angle = motion(time, (1.0, 0.0), w0=6.2, c_over_m=0.05, friction=0.03)
    records = tuple(Run(f"{k}", "a.csv", "free", time, angle, good) for k in range(len(runs)))
    split = split_records(Experiment(Path("there"), records))
    readings = tuple(dataclasses.replace(r, doubt=doubt) for r in split.readings)
    given = {"readings": readings, "fitted": runs, "fitted_of": tuple(range(len(runs)))}
    return dataclasses.replace(split, held=runs[:1], held_of=(0,), **given)


def run(sigma: Floats | float, **given: object) -> FitRun:
    return FitRun(np.arange(SAMPLES) * 0.01, np.zeros(SAMPLES), sigma, **given)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("one", "square", "doubt", "error"),
    [
        # Half are sqrt(5) at sigma = 1, half sqrt(8) at 2: the mean square is 6.5.
        (run(SIGMA), np.where(SIGMA == 1, 5.0, 8.0), 0.0, math.sqrt(6.5)),
        # Residuals of the stated noise give no error.
        (run(SIGMA), SIGMA**2, 0.0, 0.0),
        # Rounding to a count of sqrt(12) has variance 1: 2 is noise, 6 is more.
        (run(1.0, count=math.sqrt(12)), 2.0, 0.0, 0.0),
        (run(1.0, count=math.sqrt(12)), 6.0, 0.0, math.sqrt(6)),
        # 1 + 4 sqrt(2 / 800 + 4 doubt^2) is 1.2 or 1.8.
        (run(1.0), 1.5, 0.0, math.sqrt(1.5)),
        (run(1.0), 1.5, 0.1, 0.0),
    ],
)
def test_the_error_of_a_model_is_the_root_mean_square_of_its_residuals(
    one: FitRun, square: Floats | float, doubt: float, error: float
) -> None:
    left = SIGNS * np.sqrt(square)
    left[7] = 1e3  # an untrusted reading
    trusted = dataclasses.replace(one, trusted=np.arange(SAMPLES) != 7)
    fitted = SimpleNamespace(fit=SimpleNamespace(residuals=[left]))
    errors = model_errors(data(trusted, doubt=doubt), fitted)  # type: ignore[arg-type]
    assert errors == pytest.approx((error,), rel=2e-4, abs=1e-9)


def test_readings_of_a_run_that_a_model_misses_have_equal_weights() -> None:
    records = data(run(SIGMA), run(3.0, count=math.sqrt(12)), run(1.0))
    weighted = weight_records(records, (2.0, 4.0, 0.0))
    one, two, three = weighted.fitted
    assert one.sigma == pytest.approx(np.full(SAMPLES, 2.0))
    # Rounding is included, and readings are no longer intervals.
    assert two.sigma == pytest.approx(np.full(SAMPLES, 4.0))
    assert two.count is None
    assert three is records.fitted[2]
    assert weighted.held[0].sigma == pytest.approx(np.full(SAMPLES, 2.0))
    # A run held out as a whole has its noise and the excess of the others over theirs: 4 - 2.5, 16
    # - 10 and 0.
    apart = dataclasses.replace(records, held=(run(1.0),), held_of=(9,))
    (held,) = weight_records(apart, (2.0, 4.0, 0.0)).held
    assert np.square(held.sigma) == pytest.approx(1 + (1.5 + 6.0) / 3)
