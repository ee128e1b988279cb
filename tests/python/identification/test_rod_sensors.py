"""Damping from a gyroscope or an accelerometer alone, against decays integrated with scipy."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
from accelerations import GRAVITY, TRUTH, experiment, readings
from decays import decay, record
from fits import methods_of, written
from pendmap import InputError, render
from pendmap.comparison import compare
from pendmap.comparison.data import split_records
from pendmap.identification import identified_model, identify
from pendmap.identification.methods.trajectory import fit_together
from pendmap.identification.report import as_json, as_text
from pendmap.records import Experiment, Run, summary

if TYPE_CHECKING:
    from decays import Floats
    from pendmap.identification import Identification

TANGENTIAL = '{ name = "acc", unit = "m/s2", direction = "tangential", distance_m = %g }'


def rates(  # noqa: PLR0913 (the release and the sensor)
    *,
    release: float = 2.2,
    noise: float = 5e-3,
    bias: float = 0.01,
    friction: float = 0.08,
    seconds: float = 30.0,
    per_second: float = 100.0,
    seed: int = 0,
) -> tuple[Floats, Floats]:
    """Return times and the readings of a gyroscope in a decay, rad/s."""
    made = decay(tr=friction, release=release)
    time = np.arange(round(seconds * per_second) + 1) / per_second
    last = made.spline.x[-1]
    rate = np.where(time < last, made.spline(np.minimum(time, last), 1), 0.0)
    return time, rate + bias + noise * np.random.default_rng(seed).standard_normal(time.size)


def read(folder: Path, *columns: Floats, names: str = "Gyroscope z (rad/s)") -> Run:
    path = written(folder / "run.csv", *columns, names=names, form="%.8g")
    return pendmap.read_experiment(path).runs[0]


def accelerated(
    folder: Path, *columns: Floats, column: str = TANGENTIAL % 0.1, more: str = ""
) -> Run:
    return pendmap.read_experiment(experiment(folder, column, *columns, more=more)).runs[0]


def fit_model(*runs: Run) -> Identification:
    best = identify(Experiment(Path(), runs), methods=["trajectory"]).best
    assert best.method == "trajectory", best.warnings
    return best


def agrees(best: Identification, truth: dict[str, float], sigmas: float = 3.5) -> None:
    assert not any("does not fit" in warning for warning in best.warnings), best.warnings
    for name, true in truth.items():
        estimate = best.estimates[name]
        assert estimate.stderr is not None
        assert abs(estimate.value - true) < sigmas * estimate.stderr, (name, estimate)


@pytest.mark.parametrize("release", [0.3, 2.2, 2.9])
def test_a_gyroscope_gives_the_truth_at_any_amplitude(tmp_path: Path, release: float) -> None:
    """The record continues at rest, where integrated noise resembles motion."""
    best = fit_model(read(tmp_path, *rates(release=release, seconds=40)))
    agrees(best, TRUTH | {"bias": 0.01})
    assert best.misfit == pytest.approx(1, abs=0.1)
    assert "offset" not in best.estimates


@pytest.mark.parametrize(("release", "distance"), [(0.3, 0.5), (1.0, 0.1), (2.9, 0.1), (2.2, 0.5)])
def test_an_accelerometer_gives_the_truth_at_any_amplitude(
    tmp_path: Path, release: float, distance: float
) -> None:
    """Sensors are on both sides of the centre of oscillation, 0.255 m; swings may exceed 90 deg."""
    time, _, force = readings(release=release, distance=distance, bias=0.05, tilt=0.02)
    best = fit_model(accelerated(tmp_path, time, force, column=TANGENTIAL % distance))
    agrees(best, TRUTH | ({"bias": 0.05, "tilt": 0.02} if release >= 1 else {}))


def test_an_accelerometer_that_shows_no_gravity_is_fitted(tmp_path: Path) -> None:
    time, _, force = readings(distance=0.25, gravity=0.0)
    column = (TANGENTIAL % 0.25).replace("}", ", gravity_removed = true }")
    agrees(fit_model(accelerated(tmp_path, time, force, column=column)), TRUTH)


@pytest.mark.parametrize(("unit", "per"), [("rad/s2", 1.0), ("deg/s2", math.pi / 180)])
def test_an_angular_acceleration_needs_no_place(tmp_path: Path, unit: str, per: float) -> None:
    time, _, pull = readings("angular", noise=0.2, release=2.0)
    column = f'{{ name = "acc", unit = "{unit}" }}'
    best = fit_model(accelerated(tmp_path, time, pull / per, column=column))
    agrees(best, TRUTH)
    assert "tilt" not in best.estimates


def test_readings_in_g_use_the_gravity_of_the_rig(tmp_path: Path) -> None:
    time, _, force = readings(gravity=9.79)
    column = (TANGENTIAL % 0.1).replace("m/s2", "g")
    rig = "[rig]\ngravity = 9.79\n"
    agrees(fit_model(accelerated(tmp_path, time, force / 9.80665, column=column, more=rig)), TRUTH)


def test_the_sign_of_the_axis_and_the_sensor_do_not_change_the_result(tmp_path: Path) -> None:
    """Readings divided by their gain are angles for small swings, and have the same errors."""
    time, theta, force = readings()
    one, other = (
        fit_model(accelerated(tmp_path / name, time, sign * force))
        for name, sign in (("a", 1), ("b", -1))
    )
    gain = GRAVITY - 0.1 * TRUTH["w0"] ** 2
    angle = theta + 0.02 / gain * np.random.default_rng(1).standard_normal(time.size)
    by_angle = methods_of(time, angle, "trajectory")["trajectory"]
    for name in TRUTH:
        assert one[name] == pytest.approx(other[name], rel=1e-6)
        errors = [result.estimates[name].stderr or math.nan for result in (one, by_angle)]
        assert 0.5 < errors[0] / errors[1] < 2
        assert abs(one[name] - by_angle[name]) < 4 * math.hypot(*errors)


def test_errors_of_a_gyroscope_are_what_the_information_allows(tmp_path: Path) -> None:
    """For small swings an angle with noise sigma / w0 gives the same information."""
    best = fit_model(read(tmp_path, *rates(release=0.5)))
    noise = math.degrees(5e-3 / TRUTH["w0"])
    time, angle = record(decay(release=0.5), seconds=30.0, noise_deg=noise, seed=1)
    other = methods_of(time, angle, "trajectory")["trajectory"]
    for name in TRUTH:
        one, two = (result.estimates[name].stderr or math.nan for result in (best, other))
        assert 0.8 < one / two < 1.25, name


@pytest.mark.parametrize(("sensor", "least", "most"), [("gyroscope", 52, 60), ("other", 48, 60)])
def test_intervals_hold_the_truth(tmp_path: Path, sensor: str, least: int, most: int) -> None:
    """Of 60 intervals of 95 % from twenty short decays 57 +- 1.7 contain the true value."""
    inside = 0
    for seed in range(20):
        given = {"release": 0.6, "seconds": 12, "seed": seed, "bias": 0.03}
        if sensor == "gyroscope":
            run = read(tmp_path, *rates(per_second=50, **given))  # type: ignore[arg-type]
        else:
            time, _, force = readings(rate=50, **given)  # type: ignore[arg-type]
            run = accelerated(tmp_path, time, force)
        best = fit_model(run)
        for name, true in TRUTH.items():
            bounds = best.estimates[name].ci95
            assert bounds is not None, (seed, name, best.warnings)
            inside += bounds[0] <= true <= bounds[1]
    assert least <= inside <= most


def test_strong_friction_makes_the_reading_jump(tmp_path: Path) -> None:
    """The reading jumps at each turn by 2 r Tr = 0.5 m/s^2, 25 times the noise."""
    time, _, force = readings(distance=0.5, friction=0.5, c_over_m=0.1, seconds=20)
    best = fit_model(accelerated(tmp_path, time, force, column=TANGENTIAL % 0.5))
    for name, true in {"w0": 6.2, "c_over_m": 0.1, "Tr": 0.5}.items():
        assert best[name] == pytest.approx(true, rel=0.01)


@pytest.mark.parametrize("bias", [-0.3, 0.1])
def test_a_large_bias_of_a_gyroscope_is_fitted(tmp_path: Path, bias: float) -> None:
    run = read(tmp_path, *rates(release=1.0, bias=bias))
    report = identify(Experiment(Path(), (run,)), methods=["trajectory"])
    agrees(report.best, TRUTH | {"bias": bias})
    for each in (report, report.best):
        units = each.to_dataframe().unit
        assert units["w0"] == units["bias"] == each.unit("bias[0]") == "rad/s"


def test_a_gain_is_fitted_on_demand(tmp_path: Path) -> None:
    # The sensor reads three quarters of the true rate, bias included.
    time, rate = rates()
    run = read(tmp_path, time, 0.75 * rate)
    (text,) = [each.text for each in run.findings if each.what == "angle-scale"]
    assert "--effect encoder_gain fits it" in text
    there = Experiment(Path(), (run,))
    best = identify(there, methods=["trajectory"], effects=["encoder_gain"]).best
    agrees(best, {**TRUTH, "encoder_gain.e": -0.25, "bias": 0.01})
    # A drag that adds energy would compensate a part of it.
    assert identify(there, methods=["trajectory"]).with_drag is None
    best = identify(there, methods=["trajectory"], effects=["quadratic_drag"]).best
    assert any(w.startswith("quadratic_drag.q is -") for w in best.warnings)


@pytest.mark.parametrize(
    ("names", "units"),
    [
        ("Gyroscope z (deg/s)", (1.0, 180 / math.pi)),
        ("gyro_z", (1.0, 180 / math.pi)),
        ("gyro_z (rad/s)", (1e3, 1.0)),
    ],
)
def test_units_of_a_gyroscope(tmp_path: Path, names: str, units: tuple[float, float]) -> None:
    """The unit follows from the heading, or from the period if there is none."""
    time, rate = rates()
    run = read(tmp_path, time * units[0], rate * units[1], names=names)
    assert run.velocity is not None
    np.testing.assert_allclose(run.velocity, rate, atol=1e-6)
    agrees(fit_model(run), TRUTH | {"bias": 0.01})


def test_clipped_and_false_readings_are_left_out(tmp_path: Path) -> None:
    """Sensors for 500 degrees a second clip a wide swing; clipped readings are left out."""
    time, rate = rates()
    end = math.radians(500)
    rate[[700, 1500]] += 3.0
    run = read(tmp_path, time, np.clip(rate, -end, end))
    findings = {finding.what: finding.text for finding in run.findings}
    assert "8.727 rad/s" in findings["clipped"]
    assert "rad/s" in findings["outliers"]
    assert not run.trusted[[700, 1500]].any()
    agrees(fit_model(run), TRUTH | {"bias": 0.01})


def test_drift_at_rest_is_no_release(tmp_path: Path) -> None:
    """The drift of the integrated angle at rest is not taken for motion."""
    run = read(tmp_path, *rates(friction=0.5, release=1.0, seconds=40.0, seed=3))
    findings = {finding.what for finding in run.findings}
    assert "rest-tail" in findings
    assert "several-releases" not in findings
    agrees(fit_model(run), TRUTH | {"Tr": 0.5, "bias": 0.01})


def test_a_gyroscope_in_a_forced_run(tmp_path: Path) -> None:
    """The motion of the pivot does not affect a rate."""

    def slope(t: float, y: Floats) -> list[float]:
        lift = 1 + 0.3 * math.cos(11.0 * t + 0.5)
        return [y[1], -0.3 * y[1] - TRUTH["w0"] ** 2 * lift * math.sin(y[0])]

    time = np.arange(2000) / 100
    made = solve_ivp(slope, (0, time[-1]), [1.0, 0.0], "DOP853", time, rtol=1e-11, atol=1e-12)
    noise = 5e-3 * np.random.default_rng(0).standard_normal(time.size)
    written(tmp_path / "run.csv", time, made.y[1] + 0.01 + noise, names="gyro_z (rad/s)")
    drive = "drive = { p = 0.3, Omega = 11.0, phi = 0.5 }"
    text = f'[[run]]\nfile = "run.csv"\nkind = "forced"\n{drive}\n'
    (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
    runs = pendmap.read_experiment(tmp_path).runs
    fit = fit_together(runs, start=pendmap.Rig(w0=6.2, c_over_m=0.2, Tr=0.01)).fit
    assert fit.widening == 1
    for name, true in {"w0": 6.2, "c_over_m": 0.3, "Tr": 0.0, "bias": 0.01}.items():
        assert abs(fit[name] - true) < 3.5 * (fit.estimates[name].stderr or 0.0), name


def test_a_rate_in_coarse_steps(tmp_path: Path) -> None:
    """Rounding errors of steps of ten times the noise have the deviation step / sqrt(12)."""
    time, rate = rates(noise=2e-3)
    run = read(tmp_path, time, 0.02 * np.round(rate / 0.02))
    assert pendmap.noise_floor(run).sigma == pytest.approx(0.02 / math.sqrt(12), rel=0.1)
    best = fit_model(run)
    for name, true in TRUTH.items():
        assert best[name] == pytest.approx(true, rel=0.02)


def test_look_reports_the_noise_of_a_gyroscope(tmp_path: Path) -> None:
    there = Experiment(tmp_path, (read(tmp_path, *rates()),))
    assert pendmap.noise_floor(there) == pendmap.noise_floor(there.runs[0])
    two = Experiment(Path(), (there.runs[0],) * 2)
    for given, text in ((two, "got 2 runs"), ("a.csv", "got 'a.csv'")):
        with pytest.raises(InputError, match=f"must be one run, like .*{text}"):
            pendmap.noise_floor(given)  # type: ignore[arg-type]
    (run,) = summary.as_json(there)["runs"]
    assert run["noise"]["sigma"] == pytest.approx(5e-3, rel=0.05)
    assert run["noise"]["unit"] == "rad/s"
    json.dumps(run, allow_nan=False)
    text = summary.as_text(there)
    assert "rad/s (0.2" in text
    render.draw(there, tmp_path / "record.png")


def test_sensors_and_angles_are_fitted_together(tmp_path: Path) -> None:
    """Each run has its own sensor parameters: a zero of the angle, bias and tilt otherwise."""
    time, angle = record(decay(release=1.0), seconds=30.0, offset=0.01)
    _, rate = rates(release=1.0)
    names = "theta_rad,gyro_z (rad/s)"
    both = read(tmp_path, time, angle, rate, names=names)
    assert both.gyroscope is None  # an angle is preferred
    best = fit_model(both)
    agrees(best, TRUTH | {"offset": 0.01})
    assert "bias" not in best.estimates
    agrees(fit_model(read(tmp_path, *rates()), both), TRUTH | {"offset": 0.01, "bias[0]": 0.01})
    times, _, force = readings(bias=0.05)
    agrees(fit_model(accelerated(tmp_path / "a", times, force), both), {**TRUTH, "bias[0]": 0.05})


@pytest.mark.parametrize("sensor", ["gyroscope", "accelerometer"])
def test_figure_text_model_and_comparison(tmp_path: Path, sensor: str) -> None:
    """The rms residual is the noise over the gain; a model of another w0 has a larger one."""
    if sensor == "gyroscope":
        run, level, bias = read(tmp_path, *rates(release=1.0, seconds=40)), 5e-3 / 6.2, 0.01
        refused = "its angle is an integrated velocity"
    else:
        time, _, force = readings(bias=0.05)
        run = accelerated(tmp_path / "a", time, force)
        level, bias = 0.02 / (GRAVITY - 0.1 * TRUTH["w0"] ** 2), 0.05
        refused = "its angle is computed from an acceleration"
    there = Experiment(tmp_path, (run,))
    report = identify(there)
    fields = as_json(report)
    assert fields["best"] == "trajectory"
    assert fields["methods"]["trajectory"]["bias"] == pytest.approx(bias, abs=0.02)
    assert any("bias = " in line for line in as_text(report))
    assert not {"bias", "tilt"} & set(identified_model(report).notes["covariance"]["names"])
    if sensor == "accelerometer":
        render.draw(report, tmp_path / "sheet.png")
    # The other methods read the computed angle, and are less accurate.
    for name in ("energy_balance", "combined_repaired"):
        assert report.methods[name]["w0"] == pytest.approx(TRUTH["w0"], rel=0.01)
    assert compare(pendmap.Rig(**TRUTH), there).runs[0].rms == pytest.approx(level, rel=0.05)
    other = pendmap.Rig(w0=6.21, c_over_m=0.0496, Tr=0.08)
    assert compare(other, there).runs[0].rms > 3 * level
    with pytest.raises(InputError, match=refused) as fault:
        split_records(there)
    assert "\n" not in str(fault.value)
