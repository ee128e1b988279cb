"""Noise of readings: coarse counts, whose readings are intervals, and clocks with jitter."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import norm

from decays import decay, record
from driven_decays import motion
from fits import joint_fit, trajectory_of
from pendmap import Rig
from pendmap.identification.fit import TrajectoryFit, fit_runs
from pendmap.identification.methods.trajectory import fit_from_start
from pendmap.identification.readings import reading_of
from pendmap.identification.runs import FitRun
from pendmap.model import Effect
from pendmap.records.noise import noise_of
from pendmap.records.summary import noise_said
from pendmap.signal.local_polynomial import smoothed_velocity

FINE = np.arange(-200, 60_200) / 2000
TIME = np.arange(3000) * 0.01
TRUTH = {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.08}
FREE = (*TRUTH, "encoder_offset.d")
DAMPED = {"w0": 6.2, "c_over_m": 0.062, "Tr": 0.03}


def coarse(
    counts: int, noise: float, seed: int, rate: float = 100
) -> tuple[np.ndarray, np.ndarray]:
    """Return a decay in counts, with noise in counts before the rounding."""
    release = 1.2 + 0.15 * (seed % 10)
    degrees = 360 / counts
    return record(
        decay(release=release, until=30.0), seconds=25, rate=rate, noise_deg=noise * degrees,
        counts=counts, offset=0.37 * math.radians(degrees), seed=seed,
    )  # fmt: skip


def test_the_sum_is_the_likelihood_of_the_counts() -> None:
    time, theta = coarse(256, 0.2, 3)
    count = math.tau / 256
    run = FitRun(time, theta, count * math.hypot(0.2, 1 / math.sqrt(12)), count=count)
    model = Rig(w0=6.2, c_over_m=0.05, Tr=0.08, effects=(Effect("encoder_offset", {"d": 0.0}),))
    fit = fit_runs([run], model, FREE, profiled=())
    assert fit.converged

    def deviance(result: TrajectoryFit) -> float:
        ends = [(result.residuals[0] + side * count) / (0.2 * count) for side in (-0.5, 0.5)]
        return float(-2 * np.sum(np.log(norm.cdf(ends[1]) - norm.cdf(ends[0]))))

    # The fitted model with another natural frequency, not adapted to the record.
    start = {name: fit[name] for name in fit.names} | {"w0": fit["w0"] * 1.0003}
    held = {"start": start, "windows": fit.windows, "hold": True, "steps": 0, "profiled": ()}
    other = fit_runs([run], fit.model, FREE, **held)  # type: ignore[arg-type]
    rise = deviance(other) - deviance(fit)
    assert rise > 10
    assert other.chi2 - fit.chi2 == pytest.approx(rise, rel=1e-6)
    # The mean is 1 per reading, as for squares; the slopes have the stated variance.
    assert fit.chi2 / fit.degrees == pytest.approx(1, abs=0.05)
    assert np.mean(fit.white[0] ** 2) == pytest.approx(1, abs=0.15)


@pytest.mark.parametrize(("noise", "rate"), [(0.0, 100), (0.3, 300)])
def test_errors_of_intervals_are_below_those_of_values_and_match_the_scatter(
    noise: float, rate: float
) -> None:
    whole, plain, scores = [], [], []
    for seed in range(10):
        time, theta = coarse(256, noise, seed, rate)
        joint = joint_fit(time, theta)
        fit, (reading,) = joint.fit, joint.readings
        assert reading.coarse
        assert fit.widening == 1
        alone = FitRun(time, theta, reading.sigma)
        other = fit_runs([alone], fit.model, FREE, windows=fit.windows, profiled=())
        for name, true in TRUTH.items():
            whole.append((fit[name] - true) / true)
            plain.append((other[name] - true) / true)
            scores.append((fit[name] - true) / (fit.estimates[name].stderr or math.nan))
    both = np.std(np.reshape([whole, plain], (2, -1, 3)), axis=1)
    assert np.log(both[0] / both[1]).mean() < 0.05
    assert np.sqrt(np.mean(np.square(scores))) < 1.4


def test_samples_at_rest_on_one_count_add_no_information() -> None:
    made = decay(w0=6.2, c_over_m=0.2, tr=0.5, release=1.5, until=60.0)
    errors = []
    for more in (0.5, 30.0):
        seconds = float(made.peak_time[-1]) + more
        time, theta = record(made, seconds=seconds, noise_deg=0.0, counts=360)
        fit = joint_fit(time, theta).fit
        errors.append(fit.estimates["encoder_offset.d"].stderr or 0.0)
    assert errors[1] > 0.9 * errors[0]


def test_readings_of_a_fine_count_are_not_intervals() -> None:
    reading = reading_of(*coarse(1024, 0.5, 1))
    assert not reading.coarse
    assert reading.interval is None
    assert dataclasses.replace(reading, coarse=True).interval == pytest.approx(math.tau / 1024)


@pytest.fixture(scope="module")
def fine() -> np.ndarray:
    """Return the motion at 2000 Hz, held at its release before time 0."""
    released = motion(FINE[200:], (2.0, 0.0), w0=6.2, c_over_m=0.062, friction=0.03)
    return np.concatenate((np.full(200, released[0]), released))


def late(fine: np.ndarray, tau: float, sigma: float, seed: int) -> np.ndarray:
    """Return readings with a clock jitter of tau, s, and noise of sigma, rad."""
    rng = np.random.default_rng(seed)
    missed = TIME + tau * rng.standard_normal(TIME.size)
    return np.interp(missed, FINE, fine) + sigma * rng.standard_normal(TIME.size)


@pytest.mark.parametrize("tau", [5e-4, 2e-3])
def test_the_scatter_of_instants_about_their_stamps_is_estimated(
    fine: np.ndarray, tau: float
) -> None:
    for seed in range(3):
        law = noise_of(TIME, late(fine, tau, 1e-3, seed)).law
        assert law is not None
        assert abs(law.tau - tau) < 4 * law.stderr < 0.3 * tau
        assert law.still == pytest.approx(1e-3, rel=0.3)


@pytest.mark.parametrize("sigma", [3e-4, 2e-2])
def test_noise_independent_of_speed_gives_equal_weights(fine: np.ndarray, sigma: float) -> None:
    for seed in range(5):
        reading = reading_of(TIME, late(fine, 0.0, sigma, seed), count=0.0)
        assert reading.law is None
        assert np.ptp(reading.each) == 0
        assert np.all(reading.shift == 0)


def test_a_fast_start_is_no_outlier_of_a_long_rest(fine: np.ndarray) -> None:
    time = np.arange(12_000) * 0.01
    theta = np.concatenate((late(fine, 3e-3, 1e-4, 1), np.full(9000, fine[-1])))
    theta[3000:] += 1e-4 * np.random.default_rng(2).standard_normal(9000)
    law = noise_of(time, theta).law
    assert law is not None
    assert law.tau == pytest.approx(3e-3, rel=0.1)


def test_readings_at_missed_instants_are_moved_toward_rest(fine: np.ndarray) -> None:
    tau = 3e-3
    mean = np.mean([late(fine, tau, 0.0, seed) for seed in range(400)], axis=0)
    law = noise_of(TIME, late(fine, tau, 1e-3, 1)).law
    assert law is not None
    moved, theta = mean - fine[200:60_200:20], fine[200:60_200:20]
    # The factor by least squares between the actual scatter and that of the law.
    shift = law.shift(TIME, theta)
    assert float(moved @ shift / (shift @ shift)) == pytest.approx(1.0, abs=0.25)


def test_weights_halve_the_errors_and_match_the_scatter(fine: np.ndarray) -> None:
    scores, weighted, plain = [], [], []
    for seed in range(10):
        theta = late(fine, 2.5e-3, 1e-3, seed)
        reading = reading_of(TIME, theta, count=0.0)
        alike = dataclasses.replace(reading, each=reading.alike)
        result = trajectory_of(TIME, theta)
        other, _ = fit_from_start([FitRun(TIME, theta, alike.each)], [alike])
        assert any("missed their stamps by 2." in warning for warning in result.warnings)
        weighted.append([result[name] - true for name, true in DAMPED.items()])
        plain.append([other[name] - true for name, true in DAMPED.items()])
        errors = [result.estimates[name].stderr or math.nan for name in DAMPED]
        scores.append(np.array(weighted[-1]) / errors)
    # The sum of 10 squares is beyond each bound once in 10 000 times.
    squares = np.sum(np.square(scores), axis=0)
    assert np.all((squares > 0.6) & (squares < 36.0))
    ratio = np.sqrt(np.mean(np.square(weighted), axis=0) / np.mean(np.square(plain), axis=0))
    assert np.all(ratio[1:] < 0.75)


def test_velocities_are_those_of_polynomials_through_each_window() -> None:
    rng = np.random.default_rng(3)
    even = np.arange(400) * 0.01
    for time in (even, even + 2e-3 * rng.uniform(-1, 1, even.size)):
        theta = np.sin(5 * time) + 1e-3 * rng.standard_normal(time.size)
        speed, gain = smoothed_velocity(time, theta, 0.08)
        for k in (0, 3, 150, 399):
            first = min(max(k - 8, 0), time.size - 17)
            window = slice(first, first + 17)
            fitted, square = np.polyfit(time[window] - time[k], theta[window], 4, cov="unscaled")
            assert speed[k] == pytest.approx(fitted[-2], rel=1e-7)
            assert gain[k] == pytest.approx(np.sqrt(square[-2, -2]), rel=1e-6)


def test_readings_have_equal_weights_where_model_error_exceeds_the_noise(fine: np.ndarray) -> None:
    # A gain of 3 % is no clock jitter: by its law the few readings at rest would dominate.
    theta = late(fine, 2e-3, 3e-4, 1) + 0.03 * fine[200:60_200:20] ** 3
    reading = reading_of(TIME, theta, count=0.0)
    assert reading.law is not None
    run = FitRun(TIME, theta, reading.each)
    by_law = fit_runs([run], Rig(6.2, 0.05, 0.05), list(DAMPED))
    fit, (used,) = fit_from_start([run], [reading])
    assert used.law is None
    assert np.ptp(used.each) == 0
    assert fit.rms < 0.9 * by_law.rms


def test_wrong_stamps_cause_no_bias(fine: np.ndarray) -> None:
    """The clock samples regularly and its stamps err: a weight must not depend on the error."""
    exact = fine[200::20][: TIME.size]
    away = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        stamps = TIME + 2e-3 * rng.standard_normal(TIME.size)
        order = np.argsort(stamps)
        theta = exact + 1e-3 * rng.standard_normal(TIME.size)
        fit = trajectory_of(stamps[order], theta[order])
        assert fit.misfit == pytest.approx(1.0, abs=0.15)
        scores = [(fit[n] - t) / (fit.estimates[n].stderr or 0.0) for n, t in DAMPED.items()]
        away.append(scores)
    mean = np.mean(away, axis=0)
    assert np.all(np.abs(mean) < 3 / np.sqrt(len(away))), mean
    assert np.sqrt(np.mean(np.square(away))) < 1.35


@pytest.mark.parametrize(("every", "few"), [(12, True), (3, False)])
def test_the_noise_of_few_samples_a_period_is_a_bound(
    fine: np.ndarray, every: int, *, few: bool
) -> None:
    """With exact stamps the part that grows with speed is motion that polynomials do not follow."""
    for seed in range(5):
        floor = noise_of(TIME[::every], late(fine, 0.0, 2.5e-3, seed)[::every])
        assert floor.bound == few
        assert floor.law is None
        if few:
            assert noise_said(floor).startswith("at most")
            assert floor.sigma > 0.9 * 2.5e-3
        else:
            assert floor.sigma == pytest.approx(2.5e-3, rel=0.15)
