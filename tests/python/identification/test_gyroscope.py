"""Damping from a gyroscope alone, with white noise and a bias, against decays of scipy."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
from decays import decay, record
from pendmap import InputError, render
from pendmap.comparison import compare
from pendmap.comparison.data import split_records
from pendmap.identification import identified_model, identify
from pendmap.identification.methods.trajectory import fit_together
from pendmap.records import Experiment, Run
from pendmap.records.summary import as_json, as_text

if TYPE_CHECKING:
    import numpy.typing as npt

    from pendmap.identification import Identification

    Floats = npt.NDArray[np.float64]

TRUTH = {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.08}


def rates(  # noqa: PLR0913 (the release and the sensor)
    *,
    release: float = 2.2,
    noise: float = 5e-3,
    bias: float = 0.01,
    seconds: float = 30.0,
    per_second: float = 100.0,
    seed: int = 0,
) -> tuple[Floats, Floats]:
    """Return times and the readings of a gyroscope in a decay, rad/s."""
    made = decay(w0=6.2, c_over_m=0.0496, tr=0.08, release=release)
    time = np.arange(round(seconds * per_second) + 1) / per_second
    last = made.spline.x[-1]
    rate = np.where(time < last, made.spline(np.minimum(time, last), 1), 0.0)
    drawn = np.random.default_rng(seed).standard_normal(time.size)
    return time, rate + bias + noise * drawn


def written(path: Path, time: Floats, rate: Floats, name: str = "Gyroscope z (rad/s)") -> Path:
    table = np.stack([time, rate], axis=1)
    np.savetxt(path, table, delimiter=",", header=f"t_s,{name}", comments="", fmt="%.8g")
    return path


def read(folder: Path, time: Floats, rate: Floats, name: str = "Gyroscope z (rad/s)") -> Run:
    return pendmap.read_experiment(written(folder / "run.csv", time, rate, name)).runs[0]


def fit_model(*runs: Run) -> Identification:
    best = identify(Experiment(Path(), runs), methods=["trajectory"]).best
    assert best.method == "trajectory", best.warnings
    return best


def agrees(best: Identification, truth: dict[str, float], sigmas: float = 3.5) -> None:
    assert not any("does not fit" in warning for warning in best.warnings), best.warnings
    for name, true in truth.items():
        found = best.estimates[name]
        assert found.stderr is not None
        assert abs(found.value - true) < sigmas * found.stderr, (name, found)


@pytest.mark.parametrize("release", [0.3, 1.0, 2.2, 2.9])
def test_the_truth_is_found_at_any_amplitude(tmp_path: Path, release: float) -> None:
    """The record continues at rest, where integrated noise resembles motion."""
    best = fit_model(read(tmp_path, *rates(release=release, seconds=40)))
    agrees(best, TRUTH | {"bias": 0.01})
    assert best.misfit == pytest.approx(1, abs=0.1)
    assert "offset" not in best.estimates


@pytest.mark.parametrize("bias", [-0.3, 0.1])
def test_a_large_bias_of_a_gyroscope_is_fitted(tmp_path: Path, bias: float) -> None:
    run = read(tmp_path, *rates(release=1.0, bias=bias))
    assert run.gyroscope is not None
    assert run.gyroscope.bias == pytest.approx(bias, abs=2e-3)
    agrees(fit_model(run), TRUTH | {"bias": bias})


def test_a_gain_is_fitted_on_demand(tmp_path: Path) -> None:
    # The sensor reads three quarters of the true rate, bias included.
    time, rate = rates()
    run = read(tmp_path, time, 0.75 * rate)
    (said,) = [each.text for each in run.findings if each.what == "angle-scale"]
    assert "--effect encoder_gain fits it" in said
    experiment = Experiment(Path(), (run,))
    best = identify(experiment, methods=["trajectory"], effects=["encoder_gain"]).best
    agrees(best, {**TRUTH, "encoder_gain.e": -0.25, "bias": 0.01})
    # A drag that adds energy would compensate a part of it.
    assert identify(experiment, methods=["trajectory"]).with_drag is None
    best = identify(experiment, methods=["trajectory"], effects=["quadratic_drag"]).best
    assert any(w.startswith("quadratic_drag.q is -") for w in best.warnings)


def test_intervals_hold_the_truth(tmp_path: Path) -> None:
    """Of 120 intervals of 95 % from forty short decays 114 +- 2.4 contain the true value."""
    held = 0
    for seed in range(40):
        run = read(tmp_path, *rates(release=0.6, seconds=12, per_second=50, seed=seed))
        best = fit_model(run)
        for name, true in TRUTH.items():
            bounds = best.estimates[name].ci95
            assert bounds is not None, (seed, name, best.warnings)
            held += bounds[0] <= true <= bounds[1]
    assert 107 <= held <= 119


def test_errors_are_what_the_information_allows(tmp_path: Path) -> None:
    """For small swings an angle with noise sigma / w0 gives the same information."""
    time, rate = rates(release=0.5)
    best = fit_model(read(tmp_path, time, rate))
    _, angle = record(
        decay(release=0.5), seconds=30.0, noise_deg=math.degrees(5e-3 / TRUTH["w0"]), seed=1
    )
    table = np.stack([time, angle], axis=1)
    beside = tmp_path / "angle.csv"
    np.savetxt(beside, table, delimiter=",", header="t_s,theta_rad", comments="")
    other = fit_model(pendmap.read_experiment(beside).runs[0])
    for name in TRUTH:
        one, two = best.estimates[name].stderr, other.estimates[name].stderr
        assert one is not None
        assert two is not None
        assert 0.8 < one / two < 1.25, name


def test_a_gyroscope_in_degrees_per_second(tmp_path: Path) -> None:
    """The unit follows from the heading, or from the period if there is none."""
    time, rate = rates()
    for name in ("Gyroscope z (deg/s)", "gyro_z"):
        run = read(tmp_path, time, rate * 180 / math.pi, name)
        assert run.velocity is not None
        np.testing.assert_allclose(run.velocity, rate, atol=1e-6)
        agrees(fit_model(run), TRUTH | {"bias": 0.01})


def test_a_gyroscope_with_times_in_milliseconds(tmp_path: Path) -> None:
    time, rate = rates()
    text = "\n".join(f"{1e3 * t:.3f},{v:.8g}" for t, v in zip(time, rate, strict=True))
    path = tmp_path / "run.csv"
    path.write_text(f"time,gyro_z (rad/s)\n{text}\n", encoding="utf-8")
    agrees(fit_model(pendmap.read_experiment(path).runs[0]), TRUTH | {"bias": 0.01})


def test_clipped_and_false_readings_are_left_out(tmp_path: Path) -> None:
    """Sensors for 500 degrees a second clip a wide swing; clipped readings are left out."""
    time, rate = rates()
    end = math.radians(500)
    rate[[700, 1500]] += 3.0
    run = read(tmp_path, time, np.clip(rate, -end, end))
    said = {found.what: found.text for found in run.findings}
    assert "8.727 rad/s" in said["clipped"]
    assert "rad/s" in said["outliers"]
    assert not run.trusted[[700, 1500]].any()
    agrees(fit_model(run), TRUTH | {"bias": 0.01})


def test_drift_at_rest_is_no_release(tmp_path: Path) -> None:
    """The drift of the integrated angle at rest is not taken for motion."""
    time = np.arange(4001) / 100
    made = decay(c_over_m=0.05, tr=0.5, release=1.0)
    last = float(made.spline.x[-1])
    rate = np.where(time < last, made.spline(np.minimum(time, last), 1), 0.0)
    rate += 0.01 + 5e-3 * np.random.default_rng(3).standard_normal(time.size)
    run = read(tmp_path, time, rate)
    said = {found.what for found in run.findings}
    assert "rest-tail" in said
    assert "several-releases" not in said
    assert run.segments[-1].from_s == pytest.approx(last, abs=2.0)
    agrees(fit_model(run), {"w0": 6.2, "c_over_m": 0.05, "Tr": 0.5, "bias": 0.01})


def forced(time: Floats) -> Floats:
    """Return the velocity of a pendulum without dry friction on a vertically moving pivot."""

    def slope(t: float, y: Floats) -> list[float]:
        lift = 1 + 0.3 * math.cos(11.0 * t + 0.5)
        return [y[1], -0.3 * y[1] - TRUTH["w0"] ** 2 * lift * math.sin(y[0])]

    found = solve_ivp(slope, (0, time[-1]), [1.0, 0.0], "DOP853", time, rtol=1e-11, atol=1e-12)
    return np.asarray(found.y[1])


def test_a_gyroscope_in_a_forced_run(tmp_path: Path) -> None:
    """The motion of the pivot does not affect a rate."""
    time = np.arange(2000) / 100
    noise = 5e-3 * np.random.default_rng(0).standard_normal(time.size)
    written(tmp_path / "run.csv", time, forced(time) + 0.01 + noise)
    drive = "drive = { p = 0.3, Omega = 11.0, phi = 0.5 }"
    text = f'[[run]]\nfile = "run.csv"\nkind = "forced"\n{drive}\n'
    (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
    runs = pendmap.read_experiment(tmp_path).runs
    fit = fit_together(runs, start=pendmap.Rig(w0=6.2, c_over_m=0.2, Tr=0.01)).fit
    assert fit.widening == 1
    for name, true in {"w0": 6.2, "c_over_m": 0.3, "Tr": 0.0, "bias": 0.01}.items():
        stderr = fit.estimates[name].stderr
        assert stderr is not None
        assert abs(fit[name] - true) < 3.5 * stderr, name


def test_a_rate_in_coarse_steps(tmp_path: Path) -> None:
    """Rounding errors of steps of ten times the noise have the deviation step / sqrt(12)."""
    time, rate = rates(noise=2e-3)
    run = read(tmp_path, time, 0.02 * np.round(rate / 0.02))
    assert pendmap.noise_floor(run).sigma == pytest.approx(0.02 / math.sqrt(12), rel=0.1)
    best = fit_model(run)
    for name, true in TRUTH.items():
        assert best[name] == pytest.approx(true, rel=0.02)


def test_the_bias_of_a_sensor_has_its_unit(tmp_path: Path) -> None:
    run = read(tmp_path, *rates(release=1.0))
    report = identify(Experiment(Path(), (run,)), methods=["trajectory"])
    for each in (report, report.best):
        units = each.to_dataframe().unit
        assert units["w0"] == units["bias"] == each.unit("bias[0]") == "rad/s"


def test_the_noise_of_an_experiment_is_that_of_its_run(tmp_path: Path) -> None:
    run = read(tmp_path, *rates(release=1.0))
    assert pendmap.noise_floor(Experiment(Path(), (run,))) == pendmap.noise_floor(run)
    for given, said in ((Experiment(Path(), (run, run)), "got 2 runs"), ("a.csv", "got 'a.csv'")):
        with pytest.raises(InputError, match=f"must be one run, like .*{said}"):
            pendmap.noise_floor(given)


def test_look_reports_noise_and_bias_of_a_gyroscope(tmp_path: Path) -> None:
    there = written(tmp_path / "run.csv", *rates())
    experiment = pendmap.read_experiment(there)
    (run,) = as_json(experiment)["runs"]
    assert run["noise"]["sigma"] == pytest.approx(5e-3, rel=0.05)
    assert run["noise"]["unit"] == "rad/s"
    assert run["gyroscope_bias"] == pytest.approx(0.01, abs=5e-4)
    json.dumps(run, allow_nan=False)
    text = as_text(experiment)
    assert "rad/s (0.2" in text
    assert "+0.0" in next(line for line in text.splitlines() if "  bias " in line)
    render.draw(experiment, tmp_path / "record.png")


def test_an_angle_is_preferred_to_a_gyroscope(tmp_path: Path) -> None:
    time, rate = rates(release=1.0)
    _, angle = record(decay(release=1.0), seconds=30.0, offset=0.01)
    path = tmp_path / "both.csv"
    table = np.stack([time, angle, rate], axis=1)
    np.savetxt(path, table, delimiter=",", header="t_s,theta_rad,gyro_z (rad/s)", comments="")
    run = pendmap.read_experiment(path).runs[0]
    assert run.gyroscope is None
    best = fit_model(run)
    agrees(best, TRUTH | {"offset": 0.01})
    assert "bias" not in best.estimates


def test_an_angle_and_a_gyroscope_are_fitted_together(tmp_path: Path) -> None:
    one = read(tmp_path, *rates())
    time, angle = record(decay(release=1.0), seconds=30.0, offset=0.01)
    path = tmp_path / "angle.csv"
    table = np.stack([time, angle], axis=1)
    np.savetxt(path, table, delimiter=",", header="t_s,theta_rad", comments="")
    other = pendmap.read_experiment(path).runs[0]
    agrees(fit_model(one, other), TRUTH | {"offset": 0.01, "bias[0]": 0.01})


def test_figure_model_and_comparison_of_a_gyroscope(tmp_path: Path) -> None:
    there = pendmap.read_experiment(written(tmp_path / "run.csv", *rates(release=1.0, seconds=40)))
    report = identify(there)
    assert report.best.method == "trajectory"
    render.draw(report, tmp_path / "sheet.png")
    assert "bias" not in identified_model(report).notes["covariance"]["names"]
    # The other methods read the integrated angle, and are less accurate.
    for name in ("energy_balance", "combined_repaired"):
        assert report.methods[name]["w0"] == pytest.approx(TRUTH["w0"], rel=0.01)
    # The residual of the true model is the noise over w0; of another w0 it is larger.
    level = 5e-3 / TRUTH["w0"]
    assert compare(pendmap.Rig(**TRUTH), there).runs[0].rms == pytest.approx(level, rel=0.05)
    other = pendmap.Rig(w0=6.21, c_over_m=0.0496, Tr=0.08)
    assert compare(other, there).runs[0].rms > 3 * level


def test_diagnose_requires_an_angle(tmp_path: Path) -> None:
    there = pendmap.read_experiment(written(tmp_path / "run.csv", *rates()))
    with pytest.raises(InputError, match="its angle is an integrated velocity") as fault:
        split_records(there)
    assert "\n" not in str(fault.value)
