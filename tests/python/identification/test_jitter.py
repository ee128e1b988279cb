"""Clocks with jitter: noise that grows with speed, and fits weighted accordingly."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from driven_decays import motion
from fits import trajectory_of
from pendmap.identification.fit import fit_runs
from pendmap.identification.methods.trajectory import fit_from_start
from pendmap.identification.readings import reading_of
from pendmap.identification.runs import FitRun
from pendmap.model import Rig
from pendmap.records.noise import noise_of
from pendmap.records.summary import noise_said
from pendmap.signal.local_polynomial import smoothed_velocity

FINE = np.arange(-200, 60_200) / 2000
TIME = np.arange(3000) * 0.01
TRUTH = {"w0": 6.2, "c_over_m": 0.062, "friction": 0.03}
NAMES = {"w0": "w0", "c_over_m": "c_over_m", "Tr": "friction"}


@pytest.fixture(scope="module")
def fine() -> np.ndarray:
    """Return the motion at 2000 Hz, held at its release before time 0."""
    released = motion(FINE[200:], (2.0, 0.0), **TRUTH)
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


@pytest.mark.parametrize("sigma", [3e-4, 3e-3, 2e-2])
def test_noise_independent_of_speed_gives_equal_weights(fine: np.ndarray, sigma: float) -> None:
    for seed in range(4):
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
    mean = np.mean([late(fine, tau, 0.0, seed) for seed in range(200)], axis=0)
    law = noise_of(TIME, late(fine, tau, 1e-3, 1)).law
    assert law is not None
    moved, theta = mean - fine[200:60_200:20], fine[200:60_200:20]
    # The factor by least squares between the actual scatter and that of the law.
    shift = law.shift(TIME, theta)
    assert float(moved @ shift / (shift @ shift)) == pytest.approx(1.0, abs=0.25)


def test_weights_halve_the_errors_and_match_the_scatter(fine: np.ndarray) -> None:
    scores: dict[str, list[float]] = {name: [] for name in NAMES}
    ratios: dict[str, list[tuple[float, float]]] = {name: [] for name in NAMES}
    for seed in range(8):
        theta = late(fine, 2.5e-3, 1e-3, seed)
        reading = reading_of(TIME, theta, count=0.0)
        alike = dataclasses.replace(reading, each=np.full(TIME.shape, reading.sigma))
        found = trajectory_of(TIME, theta)
        plain, _ = fit_from_start([FitRun(TIME, theta, alike.each)], [alike])
        assert any("missed their stamps by 2." in warning for warning in found.warnings)
        for name, own in NAMES.items():
            off = found[name] - TRUTH[own]
            scores[name].append(off / (found.estimates[name].stderr or np.nan))
            ratios[name].append((off, plain.estimates[name].value - TRUTH[own]))
    for name in NAMES:
        # The sum of 8 squares is beyond each bound once in 3000 times.
        assert 0.4 < float(np.sum(np.square(scores[name]))) < 30.0
    for name in ("c_over_m", "Tr"):
        weighted, plain_one = np.sqrt(np.mean(np.square(ratios[name]), axis=0))
        assert weighted < 0.75 * plain_one


def test_velocities_are_those_of_polynomials_through_each_window() -> None:
    rng = np.random.default_rng(3)
    even = np.arange(400) * 0.01
    for time in (even, even + 2e-3 * rng.uniform(-1, 1, even.size)):
        theta = np.sin(5 * time) + 1e-3 * rng.standard_normal(time.size)
        speed, gain = smoothed_velocity(time, theta, 0.08)
        for k in (0, 3, 150, 399):
            first = min(max(k - 8, 0), time.size - 17)
            window = slice(first, first + 17)
            lag = time[window] - time[k]
            fitted, square = np.polyfit(lag, theta[window], 4, cov="unscaled")
            assert speed[k] == pytest.approx(fitted[-2], rel=1e-7)
            assert gain[k] == pytest.approx(np.sqrt(square[-2, -2]), rel=1e-6)


def test_readings_have_equal_weights_where_model_error_exceeds_the_noise(fine: np.ndarray) -> None:
    # A gain of 3 % is no clock jitter: by its law the few readings at rest would dominate.
    theta = late(fine, 2e-3, 3e-4, 1) + 0.03 * fine[200:60_200:20] ** 3
    reading = reading_of(TIME, theta, count=0.0)
    assert reading.law is not None
    by_law = fit_runs(
        [FitRun(TIME, theta, reading.each)], Rig(TRUTH["w0"], 0.05, 0.05), ["w0", "c_over_m", "Tr"]
    )
    fit, (used,) = fit_from_start([FitRun(TIME, theta, reading.each)], [reading])
    assert used.law is None
    assert np.ptp(used.each) == 0
    assert fit.rms < 0.9 * by_law.rms


def test_wrong_stamps_cause_no_bias(fine: np.ndarray) -> None:
    """The clock samples regularly and its stamps err: a weight must not depend on the error."""
    tau, sigma, decays = 2e-3, 1e-3, 8
    exact = fine[200::20][: TIME.size]
    away = []
    for seed in range(decays):
        rng = np.random.default_rng(seed)
        stamps = TIME + tau * rng.standard_normal(TIME.size)
        order = np.argsort(stamps)
        theta = exact + sigma * rng.standard_normal(TIME.size)
        fit = trajectory_of(stamps[order], theta[order])
        assert fit.misfit == pytest.approx(1.0, abs=0.15)
        away.append(
            [
                (fit.estimates[n].value - TRUTH[t]) / fit.estimates[n].stderr
                for n, t in NAMES.items()
            ]
        )
    mean = np.mean(away, axis=0)
    assert np.all(np.abs(mean) < 3 / np.sqrt(decays)), mean
    assert np.sqrt(np.mean(np.square(away))) < 1.35


@pytest.mark.parametrize(("every", "few"), [(10, True), (12, True), (3, False), (1, False)])
def test_the_noise_of_few_samples_a_period_is_a_bound(
    fine: np.ndarray, every: int, *, few: bool
) -> None:
    """With exact stamps the part that grows with speed is motion that polynomials do not follow."""
    for seed in range(4):
        floor = noise_of(TIME[::every], late(fine, 0.0, 2.5e-3, seed)[::every])
        assert floor.bound == few
        assert floor.law is None
        if few:
            assert noise_said(floor).startswith("at most")
            assert floor.sigma > 0.9 * 2.5e-3
        else:
            assert floor.sigma == pytest.approx(2.5e-3, rel=0.15)
