"""The trajectory method on motions integrated with scipy; the noise that its weights are from."""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
from pathlib import Path

import numpy as np
import pytest

from decays import decay, record
from driven_decays import motion
from fits import TRUTH, agrees, joint_fit, scores, trajectory_of
from pendmap import InputError
from pendmap.identification.fit import fit_runs
from pendmap.identification.methods.trajectory import fit_from_start, identification_of
from pendmap.identification.readings import reading_of
from pendmap.identification.runs import FitRun, Pivot
from pendmap.identification.sensitivity import sensitivities
from pendmap.model import Effect, Rig
from pendmap.records.noise import noise_of
from pendmap.records.summary import noise_said

TIME = np.arange(3000) * 0.01
GIVEN = {"w0": 6.2, "c_over_m": 0.062, "friction": 0.1}
NAMES = {"w0": "w0", "c_over_m": "c_over_m", "Tr": "friction"}
FINE = np.arange(-200, 60_200) / 2000
FREE = (*TRUTH, "encoder_offset.d")
DAMPED = {"w0": 6.2, "c_over_m": 0.062, "Tr": 0.03}
OFFSET, DRAG = Effect("encoder_offset", {"d": 0.0}), Effect("quadratic_drag", {"q": 0.0})


@pytest.fixture(scope="module")
def swing() -> np.ndarray:
    return motion(TIME, (3.0, 0.0), **GIVEN)


def noisy(theta: np.ndarray, sigma: float, seed: int) -> np.ndarray:
    return theta + np.random.default_rng(seed).normal(0, sigma, theta.shape)


def test_a_record_without_noise_gives_its_parameters_back(swing: np.ndarray) -> None:
    found = trajectory_of(TIME, swing + 0.002, sigma=1e-6)
    for name, own in NAMES.items():
        assert found[name] == pytest.approx(GIVEN[own], rel=1e-8)
    assert found["offset"] == pytest.approx(0.002, abs=1e-9)
    assert found.rig.Tr == found["Tr"]
    assert "3000 readings of 3000" in found.used


def test_intervals_have_their_coverage() -> None:
    covered = []
    for seed in range(8):
        rng = np.random.default_rng([5, seed])
        truth = {"w0": rng.uniform(5, 7), "friction": rng.uniform(0.02, 0.3)}
        truth["c_over_m"] = 2 * truth["w0"] * rng.uniform(0.002, 0.01)
        theta = motion(TIME, (rng.uniform(2.9, 3.05), 0.0), **truth)
        for again in range(3):
            sigma = math.radians(rng.uniform(0.05, 0.5))
            found = trajectory_of(TIME, noisy(theta, sigma, 100 * seed + again))
            for name, own in NAMES.items():
                low, high = found.estimates[name].ci95 or (math.nan, math.nan)
                covered.append(low <= truth[own] <= high)
    # 68 of 72 are expected; the three intervals of a record are correlated.
    assert 61 <= sum(covered) <= 72


def test_the_standard_error_is_the_cramer_rao_bound(swing: np.ndarray) -> None:
    # The covariance against the information from finite differences by scipy, state included.
    found = trajectory_of(TIME, noisy(swing, 1e-3, 2), sigma=1e-3)
    columns = [np.ones_like(TIME)]
    for name in ("w0", "c_over_m", "friction"):
        ends = [motion(TIME, (3.0, 0.0), **GIVEN | {name: GIVEN[name] + h}) for h in (1e-5, -1e-5)]
        columns.append((ends[0] - ends[1]) / 2e-5)
    for start in ((1e-5, 0.0), (0.0, -1e-5)):
        end = motion(TIME, (3.0 + start[0], start[1]), **GIVEN)
        columns.append((end - swing) / 1e-5)
    jacobian = np.stack(columns, axis=1) / 1e-3
    limits = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    for name, limit in zip(("offset", "w0", "c_over_m", "Tr"), limits[:4], strict=True):
        assert found.estimates[name].stderr == pytest.approx(limit, rel=0.02)


def test_a_missing_effect_gives_a_warning() -> None:
    theta = noisy(motion(TIME, (2.5, 0.0), w0=6.0, friction=0.05, drag=0.05), 2e-4, 3)
    found = trajectory_of(TIME, theta)
    assert any("does not fit" in warning for warning in found.warnings)
    assert (found["Tr"], found.estimates["Tr"].stderr) == (0.0, None)
    assert any(warning.startswith("Tr is -") for warning in found.warnings)
    assert found.rig.Tr == 0
    better = trajectory_of(TIME, theta, effects=[DRAG])
    assert better["quadratic_drag.q"] == pytest.approx(0.05, rel=0.02)
    assert better["Tr"] == pytest.approx(0.05, rel=0.02)
    agrees(better, {"c_over_m": 0.0})


def test_the_score_shows_the_missing_effect_and_its_size() -> None:
    theta = motion(TIME, (2.5, 0.0), w0=6.0, c_over_m=0.03, friction=0.05, drag=2e-3)
    run = FitRun(TIME, noisy(theta, 2e-3, 4), 2e-3)
    base = Rig(w0=6.01, c_over_m=0.05, Tr=0.05, effects=(OFFSET,))
    free = ["w0", "c_over_m", "Tr", "encoder_offset.d"]
    fit = fit_runs([run], base, free)
    sizes = {"quadratic_drag": "q", "load_dependent_friction": "k", "elastic_restoring": "k"}
    names = [f"{name}.{size}" for name, size in sizes.items()]
    extra = tuple(Effect(name, {size: 0.0}) for name, size in sizes.items())
    wide = dataclasses.replace(base, effects=(OFFSET, *extra))
    seen = sensitivities(fit, [run], names, wide)
    old, new = np.split(seen.columns, [len(free)], axis=1)
    q, _ = np.linalg.qr(old / np.linalg.norm(old, axis=0))
    rest = new - q @ (q.T @ new)
    pull, information = rest.T @ seen.residual, np.diag(rest.T @ rest)
    better = fit_runs([run], wide, [*free, names[0]])
    assert np.argmax(pull**2 / information) == 0
    assert pull[0] ** 2 / information[0] == pytest.approx(fit.chi2 - better.chi2, rel=0.15)
    assert pull[0] / information[0] == pytest.approx(better[names[0]], rel=0.15)
    error = better.estimates[names[0]].stderr
    assert 1 / math.sqrt(information[0]) == pytest.approx(error, rel=0.15)


def test_an_unknown_drive_is_fitted() -> None:
    time = np.arange(1500) * 0.02
    p, big_omega, phi = 0.3, 11.0, 0.7
    forced = motion(
        time, (0.5, 1.0), w0=6.2, c_over_m=0.062,
        pivot=lambda t: (p * math.cos(big_omega * t + phi), 0.0),
    )  # fmt: skip
    run = FitRun(time, forced, 1e-6, drive={"p": 0.28, "Omega": 11.02, "phi": None})
    names = ["w0", "c_over_m", "p", "Omega"]
    fit = fit_runs([run], Rig(w0=6.3, c_over_m=0.1), names, start={"phi": 0.5})
    assert fit["p"] == pytest.approx(p, rel=1e-7)
    assert fit["Omega"] == pytest.approx(big_omega, rel=1e-8)
    assert fit["phi"] == pytest.approx(phi, rel=1e-7)
    # Forced motions may be chaotic: their windows are kept short.
    assert len(fit.windows) == 11


def test_a_recorded_pivot_motion_drives_the_model() -> None:
    time = np.arange(1000) * 0.02

    def pivot(t: float) -> tuple[float, float]:
        return 0.3 * math.sin(5 * t), 0.2 * math.cos(3 * t)

    theta = motion(time, (1.0, 0.0), w0=6.2, c_over_m=0.1, pivot=pivot)
    up, side = np.array([pivot(t) for t in time]).T * 9.81
    run = FitRun(time, theta, 1e-5, pivot=Pivot(time, up, side))
    fit = fit_runs([run], Rig(w0=6.4, c_over_m=0.05, gravity=9.81), ["w0", "c_over_m"])
    assert fit["w0"] == pytest.approx(6.2, rel=1e-6)
    assert fit["c_over_m"] == pytest.approx(0.1, rel=1e-5)


def test_bad_fits_are_refused(swing: np.ndarray) -> None:
    run, model = FitRun(TIME, swing, 1e-3), Rig(w0=6.2)
    with pytest.raises(InputError, match="after the one before"):
        fit_runs([FitRun(TIME[::-1], swing[::-1], 1e-3)], model, ["w0"])
    with pytest.raises(InputError, match=r"free must be among .*, got 'quadratic_drag.q'"):
        fit_runs([run], model, ["quadratic_drag.q"])
    for window in ((0, 0, TIME.size + 1), (1, 0, 20)):
        with pytest.raises(InputError, match="must be samples of a run"):
            fit_runs([run], model, ["w0"], windows=((*window, 0.1, 0.0),))
    with pytest.raises(InputError, match="two half swings or more"):
        joint_fit(TIME[:40], swing[:40])


@pytest.mark.parametrize(("noise", "rate"), [(0.0, 100), (0.3, 300)])
def test_errors_of_coarse_counts_are_those_of_intervals(noise: float, rate: float) -> None:
    count, away, intervals, values = math.tau / 256, [], [], []
    for seed in range(10):
        time, theta = record(
            decay(release=1.2 + 0.15 * seed, until=30.0), seconds=25, rate=rate, counts=256,
            noise_deg=math.degrees(noise * count), offset=0.37 * count, seed=seed,
        )  # fmt: skip
        joint = joint_fit(time, theta)
        fit, (reading,) = joint.fit, joint.readings
        assert reading.coarse
        assert reading.count == pytest.approx(count)
        assert any("count" in warning for warning in identification_of(joint).warnings)
        assert fit.widening == 1
        away.append(scores(fit, TRUTH))
        alone = [FitRun(time, theta, reading.sigma)]
        other = fit_runs(alone, fit.model, FREE, windows=fit.windows, profiled=())
        intervals.append([(fit[name] - true) / true for name, true in TRUTH.items()])
        values.append([(other[name] - true) / true for name, true in TRUTH.items()])
    assert np.log(np.std(intervals, axis=0) / np.std(values, axis=0)).mean() < 0.05
    assert np.sqrt(np.mean(np.square(away))) < 1.4


def test_the_noise_of_few_readings_is_that_of_their_swings() -> None:
    time, theta = record(decay(release=2.0), seconds=2.4, rate=10, noise_deg=0.05)
    joint = joint_fit(time, theta)
    assert joint.noise == pytest.approx(math.radians(0.05), rel=0.7)
    assert joint.fit.widening < 4


def test_samples_at_rest_on_one_count_add_no_information() -> None:
    made = decay(w0=6.2, c_over_m=0.2, tr=0.5, release=1.5, until=60.0)
    errors = []
    for more in (0.5, 30.0):
        seconds = float(made.peak_time[-1]) + more
        time, theta = record(made, seconds=seconds, noise_deg=0.0, counts=360)
        fit = joint_fit(time, theta).fit
        errors.append(fit.estimates["encoder_offset.d"].stderr or 0.0)
    assert errors[1] > 0.9 * errors[0]


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


def test_the_scatter_of_instants_about_their_stamps_is_estimated(fine: np.ndarray) -> None:
    for tau, gap, seed in itertools.product((5e-4, 2e-3), (0, 60), range(3)):
        keep = np.r_[0:1000, 1000 + gap : TIME.size]
        law = noise_of(TIME[keep], late(fine, tau, 1e-3, seed)[keep]).law
        assert law is not None
        assert abs(law.tau - tau) < 4 * law.stderr < 0.3 * tau
        assert law.still == pytest.approx(1e-3, rel=0.3)


def test_noise_independent_of_speed_gives_equal_weights(fine: np.ndarray) -> None:
    for sigma, seed in itertools.product((3e-4, 2e-2), range(5)):
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
    away, weighted, plain = [], [], []
    for seed in range(10):
        theta = late(fine, 2.5e-3, 1e-3, seed)
        reading = reading_of(TIME, theta, count=0.0)
        alike = dataclasses.replace(reading, each=np.full_like(reading.each, reading.sigma))
        result = trajectory_of(TIME, theta)
        other, _ = fit_from_start([FitRun(TIME, theta, alike.each)], [alike])
        assert any("missed their stamps by 2." in warning for warning in result.warnings)
        weighted.append([result[name] - true for name, true in DAMPED.items()])
        plain.append([other[name] - true for name, true in DAMPED.items()])
        away.append(scores(result, DAMPED))
    # The sum of 10 squares is beyond each bound once in 10 000 times.
    squares = np.sum(np.square(away), axis=0)
    assert np.all((squares > 0.6) & (squares < 36.0))
    ratio = np.sqrt(np.mean(np.square(weighted), axis=0) / np.mean(np.square(plain), axis=0))
    assert np.all(ratio[1:] < 0.75)


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
        away.append(scores(fit, DAMPED))
    mean = np.mean(away, axis=0)
    assert np.all(np.abs(mean) < 3 / np.sqrt(len(away))), mean
    assert np.sqrt(np.mean(np.square(away))) < 1.35


def test_the_noise_of_few_samples_a_period_is_a_bound(fine: np.ndarray) -> None:
    """With exact stamps the part that grows with speed is motion that polynomials do not follow."""
    for seed in range(5):
        theta = late(fine, 0.0, 2.5e-3, seed)
        few, many = noise_of(TIME[::12], theta[::12]), noise_of(TIME[::3], theta[::3])
        assert (few.bound, many.bound) == (True, False)
        assert few.law is many.law is None
        assert noise_said(few).startswith("at most")
        assert few.sigma > 0.9 * 2.5e-3
        assert many.sigma == pytest.approx(2.5e-3, rel=0.15)


RECORDS = os.environ.get("PENDMAP_RECORDS", "")


@pytest.mark.skipif(not RECORDS, reason="PENDMAP_RECORDS names no folder of measured records")
@pytest.mark.parametrize(
    ("name", "stretch", "limits"),
    [
        ("multiarm_single_free_large", (0.5, 55.0), (0.0281, 0.0227, 0.0185, 0.0028)),
        ("cartpend_free_long", (0.0, 284.0), (0.0114, 0.0100, 0.0074, 0.0030)),
    ],
)
def test_measured_records(
    name: str, stretch: tuple[float, float], limits: tuple[float, ...]
) -> None:
    columns = np.genfromtxt(Path(RECORDS) / f"{name}.csv", delimiter=",", names=True)
    time, theta = columns["t_s"], columns["theta_rad"]
    part = (time >= stretch[0]) & (time <= stretch[1])
    laws = itertools.product([["Tr"], []], [[], [DRAG]])
    for (held, effects), limit in zip(laws, limits, strict=True):
        fit = joint_fit(time[part], theta[part], held=held, effects=effects).fit
        assert fit.rms <= limit
        assert len(fit.windows) == 1
