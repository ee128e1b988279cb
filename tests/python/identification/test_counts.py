"""Counts coarser than the noise, where each reading is an interval."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import norm

from decays import decay, record
from fits import joint_fit
from pendmap import Rig
from pendmap.identification.fit import TrajectoryFit, fit_runs
from pendmap.identification.readings import reading_of
from pendmap.identification.runs import FitRun
from pendmap.model import Effect

TRUTH = {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.08}
NAMES = ("w0", "c_over_m", "Tr", "encoder_offset.d")


def coarse(
    counts: int, noise: float, seed: int, *, rate: float = 100, seconds: float = 25
) -> tuple[np.ndarray, np.ndarray]:
    """Return a decay in counts, with noise in counts before the rounding."""
    release = 1.2 + 0.15 * (seed % 10)
    degrees = 360 / counts
    return record(
        decay(release=release, until=30.0), seconds=seconds, rate=rate,
        noise_deg=noise * degrees, counts=counts, offset=0.37 * math.radians(degrees), seed=seed,
    )  # fmt: skip


def run_of(time: np.ndarray, theta: np.ndarray, count: float | None, sigma: float) -> FitRun:
    return FitRun(time, theta, sigma, count=count)


def evaluate_hold_out(run: FitRun, fit: TrajectoryFit, w0: float) -> TrajectoryFit:
    """Evaluate a fit's model with another natural frequency, without adapting it to the record."""
    start = {name: fit[name] for name in fit.names} | {"w0": w0}
    return fit_runs(
        [run], fit.model, NAMES, start=start, windows=fit.windows, hold=True, steps=0, profiled=()
    )


def test_the_sum_is_the_likelihood_of_the_counts() -> None:
    time, theta = coarse(256, 0.2, 3)
    count = math.tau / 256
    run = run_of(time, theta, count, count * math.hypot(0.2, 1 / math.sqrt(12)))
    model = Rig(w0=6.2, c_over_m=0.05, Tr=0.08, effects=(Effect("encoder_offset", {"d": 0.0}),))
    fit = fit_runs([run], model, NAMES, profiled=())
    assert fit.converged

    def deviance(found: TrajectoryFit) -> float:
        ends = [(found.residuals[0] + side * count) / (0.2 * count) for side in (-0.5, 0.5)]
        return float(-2 * np.sum(np.log(norm.cdf(ends[1]) - norm.cdf(ends[0]))))

    other = evaluate_hold_out(run, fit, fit["w0"] * 1.0003)
    rise = deviance(other) - deviance(fit)
    assert rise > 10
    assert other.chi2 - fit.chi2 == pytest.approx(rise, rel=1e-6)
    # The mean is 1 per reading, as for squares; the slopes have the stated variance.
    assert fit.chi2 / fit.degrees == pytest.approx(1, abs=0.05)
    assert np.mean(fit.white[0] ** 2) == pytest.approx(1, abs=0.15)


@pytest.mark.parametrize(("noise", "rate"), [(0.0, 100), (0.15, 100), (0.3, 300)])
def test_errors_of_intervals_are_below_those_of_values_and_match_the_scatter(
    noise: float, rate: float
) -> None:
    own, plain, z = [], [], []
    for seed in range(8):
        time, theta = coarse(256, noise, seed, rate=rate)
        found = joint_fit(time, theta)
        fit, (reading,) = found.fit, found.readings
        assert reading.coarse
        assert fit.widening == 1
        alone = run_of(time, theta, None, reading.sigma)
        other = fit_runs([alone], fit.model, NAMES, windows=fit.windows, profiled=())
        for name, true in TRUTH.items():
            own.append((fit[name] - true) / true)
            plain.append((other[name] - true) / true)
            z.append((fit[name] - true) / (fit.estimates[name].stderr or math.nan))
    own, plain = np.array(own).reshape(-1, 3), np.array(plain).reshape(-1, 3)
    better = np.log(np.std(own, axis=0) / np.std(plain, axis=0))
    assert better.mean() < 0.05
    assert np.sqrt(np.mean(np.square(z))) < 1.4


def test_samples_at_rest_on_one_count_add_no_information() -> None:
    made = decay(w0=6.2, c_over_m=0.2, tr=0.5, release=1.5, until=60.0)
    rests = float(made.peak_time[-1])
    errors = []
    for more in (0.5, 30.0):
        time, theta = record(made, seconds=rests + more, noise_deg=0.0, counts=360)
        fit = joint_fit(time, theta).fit
        errors.append(fit.estimates["encoder_offset.d"].stderr)
    assert errors[1] > 0.9 * errors[0]


def test_readings_of_a_fine_count_are_not_intervals() -> None:
    time, theta = coarse(1024, 0.5, 1)
    reading = reading_of(time, theta)
    assert not reading.coarse
    assert reading.interval is None
    assert dataclasses.replace(reading, coarse=True).interval == pytest.approx(math.tau / 1024)
