"""Weights of readings: model error in addition to noise, numbers of independent readings."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.fft import idct

from driven_decays import motion
from leftovers import RUNS, SAMPLES, coloured, fitted_to
from pendmap.comparison.data import DataSplit, split_records
from pendmap.diagnosis.fitted_model import model_errors, weight_records
from pendmap.identification.runs import FitRun
from pendmap.records import Experiment, Run

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.diagnosis.fitted_model import FittedModel

    Floats = NDArray[np.float64]

N = 800
SIGMA = np.where(np.arange(N) < N // 2, 1.0, 2.0)
SIGNS = np.where(np.arange(N) % 2, 1.0, -1.0)


def data(*runs: FitRun, doubt: float = 0.0) -> DataSplit:
    """Return runs from separate records; the first is held out too."""
    time = np.arange(N) * 0.01
    angle = motion(time, (1.0, 0.0), w0=6.2, c_over_m=0.05, friction=0.03)
    good = np.ones(N, bool)
    records = tuple(Run(f"{k}", f"{k}.csv", "free", time, angle, good) for k in range(len(runs)))
    found = split_records(Experiment(Path("there"), records))
    readings = tuple(dataclasses.replace(r, doubt=doubt) for r in found.readings)
    return dataclasses.replace(
        found,
        readings=readings,
        fitted=runs,
        fitted_of=tuple(range(len(runs))),
        held=runs[:1],
        held_of=(0,),
    )


def run(sigma: Floats | float, **given: object) -> FitRun:
    return FitRun(np.arange(N) * 0.01, np.zeros(N), sigma, **given)  # type: ignore[arg-type]


def leaving(*residuals: Floats) -> FittedModel:
    return SimpleNamespace(fit=SimpleNamespace(residuals=residuals))  # type: ignore[return-value]


def test_the_error_of_a_model_is_the_root_mean_square_of_its_residuals() -> None:
    # Half are sqrt(5) at sigma = 1, half sqrt(8) at 2: the mean square is 6.5.
    left = SIGNS * np.where(SIGMA == 1, math.sqrt(5), math.sqrt(8))
    # Residuals of the stated noise give no error.
    errors = model_errors(data(run(SIGMA), run(SIGMA)), leaving(left, SIGNS * SIGMA))
    assert errors == pytest.approx((math.sqrt(6.5), 0.0), abs=1e-9)


def test_untrusted_readings_and_rounding_are_no_error() -> None:
    trusted = np.arange(N) != 7
    # Rounding to a count of sqrt(12) has variance 1: 2 is noise, 6 is more.
    counted = run(1.0, count=math.sqrt(12), trusted=trusted)
    for square, error in ((2.0, 0.0), (6.0, math.sqrt(6))):
        left = SIGNS * math.sqrt(square)
        left[7] = 1e3
        found = model_errors(data(counted), leaving(left))
        assert found == pytest.approx((error,), abs=1e-9)


@pytest.mark.parametrize(("doubt", "error"), [(0.0, math.sqrt(1.5)), (0.1, 0.0)])
def test_uncertain_noise_allows_larger_residuals(doubt: float, error: float) -> None:
    # 1 + 4 sqrt(2 / 800 + 4 doubt^2) is 1.2 or 1.8; the remainder is 1.5.
    left = SIGNS * math.sqrt(1.5)
    found = model_errors(data(run(1.0), doubt=doubt), leaving(left))
    assert found == pytest.approx((error,), abs=1e-9)


def test_readings_of_a_run_that_a_model_misses_have_equal_weights() -> None:
    records = data(run(SIGMA), run(3.0, count=math.sqrt(12)), run(1.0))
    found = weight_records(records, (2.0, 4.0, 0.0))
    one, two, three = found.fitted
    assert one.sigma == pytest.approx(np.full(N, 2.0))
    # Rounding is included, and readings are no longer intervals.
    assert two.sigma == pytest.approx(np.full(N, 4.0))
    assert two.count is None
    assert three is records.fitted[2]
    (held,) = found.held
    assert held.sigma == pytest.approx(np.full(N, 2.0))
    # A run held out as a whole has its noise and the excess of the others over theirs: 4 - 2.5, 16
    # - 10 and 0.
    apart = dataclasses.replace(records, held=(run(1.0),), held_of=(9,))
    (held,) = weight_records(apart, (2.0, 4.0, 0.0)).held
    assert np.square(held.sigma) == pytest.approx(1 + (1.5 + 6.0) / 3)


def test_each_reading_of_white_noise_is_independent() -> None:
    rng = np.random.default_rng(4)
    found = [fitted_to(coloured(rng, 0.0)) for _ in range(20)]
    assert np.mean([one.noise.independent for one in found]) == pytest.approx(
        RUNS * SAMPLES, rel=0.03
    )
    assert np.mean([one.level for one in found]) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_residuals_that_oscillate_are_few_independent_readings(count: int) -> None:
    # Cosines of the DFT, equally strong: 3 (count P)^2 / (count P^2) independent readings.
    amplitudes = np.zeros((1, SAMPLES))
    amplitudes[0, 40 : 40 + count] = math.sqrt(SAMPLES / count)
    found = fitted_to(idct(amplitudes, type=2, norm="ortho"))
    assert found.chi2 == pytest.approx(SAMPLES)
    assert found.noise.independent == pytest.approx(3 * count)
    assert found.level == pytest.approx(SAMPLES / (3 * count))
