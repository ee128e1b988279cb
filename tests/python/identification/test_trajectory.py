"""The trajectory method on motions integrated with scipy."""

from __future__ import annotations

import dataclasses
import math
import os
from pathlib import Path

import numpy as np
import pytest

from driven_decays import motion
from fits import joint_fit, trajectory_of
from pendmap import InputError
from pendmap.identification.fit import fit_runs
from pendmap.identification.readings import reading_of
from pendmap.identification.runs import FitRun, Pivot
from pendmap.identification.sensitivity import sensitivities
from pendmap.identification.turning import rough_start
from pendmap.model import Effect, Rig

TIME = np.arange(3000) * 0.01
TRUTH = {"w0": 6.2, "c_over_m": 0.062, "friction": 0.1}
NAMES = {"w0": "w0", "c_over_m": "c_over_m", "Tr": "friction"}
OFFSET = Effect("encoder_offset", {"d": 0.0})


@pytest.fixture(scope="module")
def decay() -> np.ndarray:
    return motion(TIME, (3.0, 0.0), **TRUTH)


def noisy(theta: np.ndarray, sigma: float, seed: int) -> np.ndarray:
    return theta + np.random.default_rng(seed).normal(0, sigma, theta.shape)


def test_a_record_without_noise_gives_its_parameters_back(decay: np.ndarray) -> None:
    found = trajectory_of(TIME, decay + 0.002, sigma=1e-6)
    for name, own in NAMES.items():
        assert found[name] == pytest.approx(TRUTH[own], rel=1e-8)
    assert found["offset"] == pytest.approx(0.002, abs=1e-9)
    names, covariance = found.covariance or ((), np.empty(0))
    assert names == ("w0", "c_over_m", "Tr", "offset")
    for k, name in enumerate(names):
        estimate = found.estimates[name]
        assert estimate.stderr == pytest.approx(math.sqrt(covariance[k, k]))
        low, high = estimate.ci95 or (math.nan, math.nan)
        assert high - low == pytest.approx(3.92 * math.sqrt(covariance[k, k]), rel=0.05)
    assert found.rig.Tr == found["Tr"]
    assert "3000 readings of 3000" in found.used


@pytest.mark.parametrize(("w0", "damping"), [(1.05, 3.0), (0.95, 1 / 3)])
def test_the_search_converges_from_far(decay: np.ndarray, w0: float, damping: float) -> None:
    start = Rig(w0=6.2 * w0, c_over_m=0.062 * damping, Tr=0.1 / damping)
    found = trajectory_of(TIME, noisy(decay, 2e-3, 1), start=start)
    best = trajectory_of(TIME, noisy(decay, 2e-3, 1))
    for name in NAMES:
        allowed = 0.02 * (best.estimates[name].stderr or 0)
        assert found[name] == pytest.approx(best[name], abs=allowed)
    assert not found.warnings


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


def test_the_standard_error_is_the_cramer_rao_bound(decay: np.ndarray) -> None:
    # The covariance against the information from finite differences by scipy, state included.
    found = trajectory_of(TIME, noisy(decay, 1e-3, 2), sigma=1e-3)
    columns = [np.ones_like(TIME)]
    for name in ("w0", "c_over_m", "friction"):
        ends = [motion(TIME, (3.0, 0.0), **TRUTH | {name: TRUTH[name] + h}) for h in (1e-5, -1e-5)]
        columns.append((ends[0] - ends[1]) / 2e-5)
    for start in ((1e-5, 0.0), (0.0, -1e-5)):
        end = motion(TIME, (3.0 + start[0], start[1]), **TRUTH)
        columns.append((end - decay) / 1e-5)
    jacobian = np.stack(columns, axis=1) / 1e-3
    limits = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    for name, limit in zip(("offset", "w0", "c_over_m", "Tr"), limits[:4], strict=True):
        assert found.estimates[name].stderr == pytest.approx(limit, rel=0.02)


def test_a_missing_effect_gives_a_warning(decay: np.ndarray) -> None:
    del decay
    theta = motion(TIME, (2.5, 0.0), w0=6.0, friction=0.05, drag=0.05)
    found = trajectory_of(TIME, noisy(theta, 2e-4, 3))
    assert any("does not fit" in warning for warning in found.warnings)
    assert (found["Tr"], found.estimates["Tr"].stderr) == (0.0, None)
    assert any(warning.startswith("Tr is -") for warning in found.warnings)
    assert found.rig.Tr == 0
    drag = Effect("quadratic_drag", {"q": 0.0})
    better = trajectory_of(TIME, noisy(theta, 2e-4, 3), effects=[drag])
    assert better["quadratic_drag.q"] == pytest.approx(0.05, rel=0.02)
    assert better["Tr"] == pytest.approx(0.05, rel=0.02)
    assert abs(better["c_over_m"]) < 4 * (better.estimates["c_over_m"].stderr or 0)


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
    own = new - q @ (q.T @ new)
    pull, information = own.T @ seen.residual, own.T @ own
    gain = pull**2 / np.diag(information)
    better = fit_runs([run], wide, [*free, names[0]])
    assert gain[0] == max(gain)
    assert gain[0] == pytest.approx(fit.chi2 - better.chi2, rel=0.15)
    assert pull[0] / information[0, 0] == pytest.approx(better[names[0]], rel=0.15)
    assert 1 / math.sqrt(information[0, 0]) == pytest.approx(
        better.estimates[names[0]].stderr, rel=0.15
    )


def test_several_runs_share_the_parameters_of_the_pendulum() -> None:
    time = np.arange(1500) * 0.02
    p, big_omega, phi = 0.3, 11.0, 0.7
    free = motion(time, (2.8, 0.0), **TRUTH)
    forced = motion(
        time,
        (0.5, 1.0),
        w0=6.2,
        c_over_m=0.062,
        pivot=lambda t: (p * math.cos(big_omega * t + phi), 0.0),
    )
    runs = [
        FitRun(time, free, 1e-6),
        FitRun(time, forced, 1e-6, drive={"p": 0.28, "Omega": 11.02, "phi": None}),
    ]
    model = Rig(w0=6.3, c_over_m=0.1)
    # Friction would belong to both: here the forced one has none, so it is fitted alone.
    fit = fit_runs(runs[1:], model, ["w0", "c_over_m", "p", "Omega"], start={"phi": 0.5})
    assert fit["p"] == pytest.approx(p, rel=1e-7)
    assert fit["Omega"] == pytest.approx(big_omega, rel=1e-8)
    assert fit["phi"] == pytest.approx(phi, rel=1e-7)
    # Forced motions may be chaotic: their windows are kept short.
    assert len(fit.windows) == 11
    both = fit_runs(runs, dataclasses.replace(model, Tr=0.05), ["w0", "c_over_m", "Tr"])
    assert both.names == ("w0", "c_over_m", "Tr", "phi[1]")
    assert both.widening > 1


def test_a_recorded_pivot_motion_drives_the_model(decay: np.ndarray) -> None:
    del decay
    time = np.arange(1000) * 0.02

    def pivot(t: float) -> tuple[float, float]:
        return 0.3 * math.sin(5 * t), 0.2 * math.cos(3 * t)

    theta = motion(time, (1.0, 0.0), w0=6.2, c_over_m=0.1, pivot=pivot)
    up, side = np.array([pivot(t) for t in time]).T * 9.81
    run = FitRun(time, theta, 1e-5, pivot=Pivot(time, up, side))
    fit = fit_runs([run], Rig(w0=6.4, c_over_m=0.05, gravity=9.81), ["w0", "c_over_m"])
    assert fit["w0"] == pytest.approx(6.2, rel=1e-6)
    assert fit["c_over_m"] == pytest.approx(0.1, rel=1e-5)


def test_the_noise_of_a_coarse_sensor_is_at_least_that_of_its_count(decay: np.ndarray) -> None:
    count = math.tau / 500
    theta = np.round((decay + 0.3 * count) / count) * count
    reading = reading_of(TIME, theta)
    assert reading.coarse
    assert reading.count == pytest.approx(count)
    assert reading.sigma == pytest.approx(count / math.sqrt(12), rel=0.3)
    found = trajectory_of(TIME, theta)
    assert any("count" in warning for warning in found.warnings)
    for name, own in NAMES.items():
        estimate = found.estimates[name]
        assert abs(estimate.value - TRUTH[own]) < 4 * (estimate.stderr or 0)


@pytest.mark.parametrize("seconds", [4.0, 10.0, 30.0])
def test_half_swings_give_starting_values(decay: np.ndarray, seconds: float) -> None:
    count = int(100 * seconds)
    start = rough_start(TIME[:count], noisy(decay, 5e-3, 7)[:count], 5e-3)
    assert start is not None
    assert start["w0"] == pytest.approx(6.2, rel=0.02)
    assert start["c_over_m"] > 0
    assert start["Tr"] > 0
    if seconds >= 30:
        for name, own in NAMES.items():
            assert start[name] == pytest.approx(TRUTH[own], rel=0.5)


def test_untrusted_samples_are_left_out(decay: np.ndarray) -> None:
    theta, trusted = noisy(decay, 1e-3, 8), np.ones(TIME.shape, bool)
    trusted[500:700] = False
    theta[500:700] = 4.0
    found = trajectory_of(TIME, theta, sigma=1e-3, trusted=trusted)
    assert not found.warnings
    for name, own in NAMES.items():
        estimate = found.estimates[name]
        assert abs(estimate.value - TRUTH[own]) < 4 * (estimate.stderr or 0)


def test_bad_fits_are_refused(decay: np.ndarray) -> None:
    with pytest.raises(InputError, match="after the one before"):
        fit_runs([FitRun(TIME[::-1], decay[::-1], 1e-3)], Rig(w0=6.0), ["w0"])
    run = FitRun(TIME, decay, 1e-3)
    with pytest.raises(InputError, match=r"free must be among .*, got 'quadratic_drag.q'"):
        fit_runs([run], Rig(w0=6.2), ["quadratic_drag.q"])
    with pytest.raises(InputError, match="two half swings or more"):
        joint_fit(TIME[:40], decay[:40])


RECORDS = os.environ.get("PENDMAP_RECORDS", "")
LAWS = {
    "viscous": (False, False),
    "coulomb": (True, False),
    "quadratic": (False, True),
    "all": (True, True),
}


@pytest.mark.parametrize("window", [(0, 0, 21), (1, 0, 20)])
def test_windows_beyond_their_runs_are_refused(window: tuple[int, int, int]) -> None:
    run = FitRun(np.arange(20.0) * 0.05, 0.1 * np.cos(0.3 * np.arange(20)), 1e-3)
    with pytest.raises(InputError, match="must be samples of a run"):
        fit_runs([run], Rig(w0=6.0), ["w0"], windows=((*window, 0.1, 0.0),))


@pytest.mark.skipif(not RECORDS, reason="PENDMAP_RECORDS names no folder of measured records")
@pytest.mark.parametrize(
    ("name", "stretch", "limits"),
    [
        ("multiarm_single_free_large", (0.5, 55.0), (0.0281, 0.0185, 0.0227, 0.0028)),
        ("cartpend_free_long", (0.0, 284.0), (0.0114, 0.0074, 0.0100, 0.0030)),
    ],
)
def test_measured_records(
    name: str, stretch: tuple[float, float], limits: tuple[float, ...]
) -> None:
    columns = np.genfromtxt(Path(RECORDS) / f"{name}.csv", delimiter=",", names=True)
    time, theta = columns["t_s"], columns["theta_rad"]
    part = (time >= stretch[0]) & (time <= stretch[1])
    drag = Effect("quadratic_drag", {"q": 0.0})
    for (friction, quadratic), limit in zip(LAWS.values(), limits, strict=True):
        effects = [drag] if quadratic else []
        held = [] if friction else ["Tr"]
        fit = joint_fit(time[part], theta[part], held=held, effects=effects).fit
        assert fit.rms <= limit
        assert len(fit.windows) == 1
