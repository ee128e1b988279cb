"""Damping from a gyroscope alone, against decays integrated with scipy."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
from decays import decay, record
from fits import TRUTH, agrees, methods_of, written
from pendmap import render
from pendmap.comparison import compare
from pendmap.identification import identified_model, identify
from pendmap.identification.methods.trajectory import fit_trusted
from pendmap.identification.report import as_text
from pendmap.records import Experiment, Run, summary

if TYPE_CHECKING:
    from decays import Floats
    from pendmap.identification import Identification

GYRO = "Gyroscope z (rad/s)"
DEGREE = math.pi / 180


def rates(  # noqa: PLR0913 (the release and the sensor)
    *,
    release: float = 2.2,
    noise: float = 5e-3,
    bias: float = 0.01,
    friction: float = 0.08,
    seconds: float = 30.0,
    rate: float = 100.0,
    seed: int = 0,
) -> tuple[Floats, Floats]:
    """Return times and the readings of a gyroscope in a decay, rad/s."""
    made = decay(tr=friction, release=release)
    time = np.arange(round(seconds * rate) + 1) / rate
    last = made.spline.x[-1]
    speed = np.where(time < last, made.spline(np.minimum(time, last), 1), 0.0)
    return time, speed + bias + noise * np.random.default_rng(seed).standard_normal(time.size)


def read(folder: Path, *columns: Floats, names: str = GYRO) -> Run:
    path = written(folder / "run.csv", *columns, names=names, form="%.8g")
    return pendmap.read_experiment(path).runs[0]


def fit_model(*runs: Run, effects: tuple[str, ...] = ()) -> Identification:
    best = identify(Experiment(Path(), runs), methods=["trajectory"], effects=effects).best
    assert best.method == "trajectory", best.warnings
    return best


# Heading, readings, their unit in rad/s, unit of time in s, further parameters
GYROSCOPES: dict[str, tuple[str, dict[str, float], float, float]] = {
    "small": (GYRO, {"release": 0.3, "seconds": 40}, 1.0, 1.0),
    "wide": (GYRO, {"release": 2.9, "seconds": 40}, 1.0, 1.0),
    "a large bias": (GYRO, {"release": 1.0, "bias": -0.3}, 1.0, 1.0),
    "a short swing": (GYRO, {"release": 1.0, "friction": 0.5, "seconds": 40, "seed": 3}, 1.0, 1.0),
    "degrees": ("Gyroscope z (deg/s)", {}, DEGREE, 1.0),
    "no unit": ("gyro_z", {}, DEGREE, 1.0),
    "milliseconds": ("gyro_z (rad/s)", {}, 1.0, 1e-3),
}


@pytest.mark.parametrize("case", GYROSCOPES)
def test_a_gyroscope_gives_the_truth(tmp_path: Path, case: str) -> None:
    names, given, unit, second = GYROSCOPES[case]
    time, rate = rates(**given)  # type: ignore[arg-type]
    run = read(tmp_path, time / second, rate / unit, names=names)
    np.testing.assert_allclose(run.velocity, rate, atol=1e-6)
    # The drift of the integrated angle at rest is not taken for motion.
    findings = {finding.what for finding in run.findings}
    assert "several-releases" not in findings
    assert case != "a short swing" or "rest-tail" in findings
    best, bias = fit_model(run), given.get("bias", 0.01)
    agrees(best, TRUTH | {"Tr": given.get("friction", 0.08), "bias": bias}, 3.5)
    assert best.misfit == pytest.approx(1, abs=0.1)
    assert "offset" not in best.estimates
    (entry,) = summary.as_json(Experiment(tmp_path, (run,)))["runs"]
    assert entry["noise"]["sigma"] == pytest.approx(5e-3, rel=0.05)
    assert entry["noise"]["unit"] == "rad/s"
    units = best.to_dataframe().unit
    assert units["w0"] == units["bias"] == best.unit("bias[0]") == "rad/s"


def test_errors_are_what_the_information_allows(tmp_path: Path) -> None:
    """For small swings an angle with the noise over the gain gives the same information."""
    sigma = 5e-3 / TRUTH["w0"]
    angle = record(decay(release=0.5), seconds=30, noise_deg=math.degrees(sigma), seed=1)
    one, other = fit_model(read(tmp_path, *rates(release=0.5))), methods_of(*angle, "trajectory")
    agrees(one, TRUTH)
    for name in TRUTH:
        errors = [fit.estimates[name].stderr or math.nan for fit in (one, other["trajectory"])]
        assert 1 / 1.25 < errors[0] / errors[1] < 1.25, name


def test_intervals_hold_the_truth(tmp_path: Path) -> None:
    """Of 60 intervals of 95 % from twenty short decays 57 +- 1.7 contain the true value."""
    inside = 0
    for seed in range(20):
        run = read(tmp_path, *rates(release=0.6, seconds=12, seed=seed, bias=0.03, rate=50))
        best = fit_model(run)
        for name, true in TRUTH.items():
            low, high = best.estimates[name].ci95 or (math.nan, math.nan)
            inside += low <= true <= high
    assert 52 <= inside <= 60


def test_a_gain_is_fitted_on_demand(tmp_path: Path) -> None:
    # The sensor reads three quarters of the true rate, bias included.
    time, rate = rates()
    run = read(tmp_path, time, 0.75 * rate)
    (text,) = [finding.text for finding in run.findings if finding.what == "angle-scale"]
    assert "--effect encoder_gain fits it" in text
    best = fit_model(run, effects=("encoder_gain",))
    agrees(best, {**TRUTH, "encoder_gain.e": -0.25, "bias": 0.01}, 3.5)
    # The period disproves a gain of 1: it is fitted without being asked for.
    freed = identify(Experiment(Path(), (run,)), methods=["trajectory"]).best
    agrees(freed, {**TRUTH, "encoder_gain.e": -0.25, "bias": 0.01}, 3.5)
    warnings = fit_model(run, effects=("quadratic_drag",)).warnings
    assert any(warning.startswith("quadratic_drag.q is -") for warning in warnings)


def test_clipped_and_false_readings_are_left_out(tmp_path: Path) -> None:
    """Sensors for 500 degrees a second clip a wide swing; clipped readings are left out."""
    time, rate = rates()
    end = 500 * DEGREE
    rate[[700, 1500]] += 3.0
    run = read(tmp_path, time, np.clip(rate, -end, end))
    findings = {finding.what: finding.text for finding in run.findings}
    assert "8.727 rad/s" in findings["clipped"]
    assert "rad/s" in findings["outliers"]
    assert not run.trusted[[700, 1500]].any()
    agrees(fit_model(run), TRUTH | {"bias": 0.01}, 3.5)


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
    fit = fit_trusted(runs, pendmap.Rig(w0=6.2, c_over_m=0.2, Tr=0.01), ()).fit
    assert fit.widening == 1
    agrees(fit, {"w0": 6.2, "c_over_m": 0.3, "Tr": 0.0, "bias": 0.01}, 3.5)


def test_sensors_and_angles_are_fitted_together(tmp_path: Path) -> None:
    """Each run has its own sensor parameters: a zero of the angle or a bias."""
    time, angle = record(decay(release=1.0), seconds=30.0, offset=0.01)
    _, rate = rates(release=1.0)
    both = read(tmp_path, time, angle, rate, names="theta_rad,gyro_z (rad/s)")
    assert both.gyroscope is None  # an angle is preferred
    agrees(fit_model(read(tmp_path, *rates()), both), TRUTH | {"offset": 0.01, "bias[0]": 0.01})


def test_reports_and_comparisons_are_in_radians(tmp_path: Path) -> None:
    """The rms residual is the noise over the gain; a model of another w0 has a larger one."""
    run, level = read(tmp_path, *rates(release=1.0, seconds=40)), 5e-3 / TRUTH["w0"]
    report = identify(run)
    assert any("bias = " in line for line in as_text(report))
    assert "bias" not in identified_model(report).notes["covariance"]["names"]
    # The other methods read the computed angle, and are less accurate.
    for name in ("energy_balance", "combined_repaired"):
        assert report.methods[name]["w0"] == pytest.approx(TRUTH["w0"], rel=0.01)
    render.draw(report, tmp_path / "sheet.png")
    for w0, low, high in ((6.2, 0.95, 1.05), (6.21, 3.0, math.inf)):
        other = pendmap.Rig(**TRUTH | {"w0": w0})
        assert low * level < compare(other, run).runs[0].rms < high * level
