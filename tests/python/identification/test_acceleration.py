"""Damping from an accelerometer alone, against decays integrated with scipy."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from accelerations import GRAVITY, TRUTH, experiment, readings
from decays import decay, record
from pendmap import InputError, render
from pendmap.comparison import compare
from pendmap.comparison.data import split_records
from pendmap.identification import identified_model, identify
from pendmap.identification.methods.registry import identify_record
from pendmap.identification.report import as_json, as_text
from pendmap.records import Experiment

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.identification import IdentificationReport

TANGENTIAL = '{ name = "acc", unit = "m/s2", direction = "tangential", distance_m = %g }'


def identified(folder: Path) -> IdentificationReport:
    return identify(pendmap.read_experiment(folder), methods=["trajectory"])


def agrees(report: IdentificationReport, truth: dict[str, float], sigmas: float = 3.5) -> None:
    best = report.best
    assert best.method == "trajectory", best.warnings
    assert not any("does not fit" in warning for warning in best.warnings)
    for name, true in truth.items():
        found = best.estimates[name]
        assert found.stderr is not None
        assert abs(found.value - true) < sigmas * found.stderr, (name, found)


@pytest.mark.parametrize("release", [0.3, 1.0, 2.2, 2.9])
@pytest.mark.parametrize("distance", [0.1, 0.5])
def test_the_truth_is_found_at_any_amplitude(
    tmp_path: Path, release: float, distance: float
) -> None:
    """Sensors are on both sides of the centre of oscillation, 0.255 m; swings may exceed 90 deg."""
    time, _, force = readings(release=release, distance=distance, bias=0.05, tilt=0.02)
    report = identified(experiment(tmp_path, TANGENTIAL % distance, time, force))
    agrees(report, TRUTH | ({"bias": 0.05, "tilt": 0.02} if release >= 1 else {}))


def test_an_accelerometer_that_shows_no_gravity_is_fitted(tmp_path: Path) -> None:
    time, _, force = readings(distance=0.25, gravity=0.0)
    column = (TANGENTIAL % 0.25).replace("}", ", gravity_removed = true }")
    agrees(identified(experiment(tmp_path, column, time, force)), TRUTH)


@pytest.mark.parametrize(("unit", "per"), [("rad/s2", 1.0), ("deg/s2", math.pi / 180)])
def test_an_angular_acceleration_needs_no_place(tmp_path: Path, unit: str, per: float) -> None:
    time, _, pull = readings("angular", noise=0.2, release=2.0)
    column = f'{{ name = "acc", unit = "{unit}" }}'
    report = identified(experiment(tmp_path, column, time, pull / per))
    agrees(report, TRUTH)
    assert "tilt" not in report.best.estimates


def test_readings_in_g_use_the_gravity_of_the_rig(tmp_path: Path) -> None:
    time, _, force = readings(gravity=9.79)
    column = (TANGENTIAL % 0.1).replace("m/s2", "g")
    there = experiment(tmp_path, column, time, force / 9.80665, more="[rig]\ngravity = 9.79\n")
    agrees(identified(there), TRUTH)


def test_the_sign_of_the_axis_alone_does_not_change_the_result(tmp_path: Path) -> None:
    time, _, force = readings()
    one = identified(experiment(tmp_path / "a", TANGENTIAL % 0.1, time, force)).best
    other = identified(experiment(tmp_path / "b", TANGENTIAL % 0.1, time, -force)).best
    for name in TRUTH:
        assert one[name] == pytest.approx(other[name], rel=1e-6)


def test_errors_equal_those_of_an_angle_of_the_same_relative_noise(tmp_path: Path) -> None:
    """Readings divided by their gain are angles for small swings, and have the same errors."""
    time, theta, force = readings()
    gain = GRAVITY - 0.1 * TRUTH["w0"] ** 2
    angle = theta + 0.02 / gain * np.random.default_rng(1).standard_normal(time.size)
    best = identified(experiment(tmp_path, TANGENTIAL % 0.1, time, force)).best
    other = identify_record(time, angle, methods=["trajectory"])["trajectory"]
    for name in TRUTH:
        one, two = best.estimates[name].stderr, other.estimates[name].stderr
        assert one is not None
        assert two is not None
        assert 0.5 < one / two < 2
        assert abs(best[name] - other[name]) < 4 * math.hypot(one, two)


def test_intervals_hold_the_truth(tmp_path: Path) -> None:
    """Of 90 intervals of 95 % from thirty short decays 85.5 +- 2.1 contain the true value."""
    held = count = 0
    for seed in range(30):
        time, _, force = readings(release=0.6, seconds=12, rate=50, seed=seed, bias=0.03)
        best = identified(experiment(tmp_path, TANGENTIAL % 0.1, time, force)).best
        for name, true in TRUTH.items():
            bounds = best.estimates[name].ci95
            assert bounds is not None, (seed, name, best.warnings)
            held += bounds[0] <= true <= bounds[1]
            count += 1
    assert count == 90
    assert held >= 79


def test_strong_friction_makes_the_reading_jump(tmp_path: Path) -> None:
    """The reading jumps at each turn by 2 r Tr = 0.5 m/s^2, 25 times the noise."""
    time, _, force = readings(distance=0.5, friction=0.5, c_over_m=0.1, seconds=20)
    report = identified(experiment(tmp_path, TANGENTIAL % 0.5, time, force))
    for name, true in {"w0": 6.2, "c_over_m": 0.1, "Tr": 0.5}.items():
        assert report.best[name] == pytest.approx(true, rel=0.01)


def test_figure_text_and_model_of_an_accelerometer(tmp_path: Path) -> None:
    time, _, force = readings(bias=0.05)
    report = identify(
        pendmap.read_experiment(experiment(tmp_path / "a", TANGENTIAL % 0.1, time, force))
    )
    fields = as_json(report)
    assert fields["methods"]["trajectory"]["bias"] == pytest.approx(0.05, abs=0.02)
    assert any(
        "tangential acceleration 0.1 m from the pivot" in text for text in fields["findings"]
    )
    assert any("bias = " in line for line in as_text(report))
    model = identified_model(report)
    assert not {"bias", "tilt"} & set(model.notes["covariance"]["names"])
    render.draw(report, tmp_path / "sheet.png")
    # The other methods read the reconstructed angle, and are less accurate.
    for name in ("energy_balance", "combined_repaired"):
        assert report.methods[name]["w0"] == pytest.approx(TRUTH["w0"], rel=0.01)


def test_a_model_is_compared_with_an_accelerometer(tmp_path: Path) -> None:
    """The rms residual is the noise over the gain; a model of another w0 has a larger one."""
    time, _, force = readings()
    there = pendmap.read_experiment(experiment(tmp_path, TANGENTIAL % 0.1, time, force))
    rig = pendmap.Rig(**TRUTH)
    noise = 0.02 / (GRAVITY - 0.1 * TRUTH["w0"] ** 2)
    assert compare(rig, there).runs[0].rms == pytest.approx(noise, rel=0.05)
    other = pendmap.Rig(w0=6.21, c_over_m=0.0496, Tr=0.08)
    assert compare(other, there).runs[0].rms > 3 * noise


def test_diagnose_requires_an_angle(tmp_path: Path) -> None:
    time, _, force = readings()
    there = pendmap.read_experiment(experiment(tmp_path, TANGENTIAL % 0.1, time, force))
    with pytest.raises(InputError, match="its angle is computed from an acceleration"):
        split_records(there)


def test_an_angle_and_an_accelerometer_are_fitted_together(tmp_path: Path) -> None:
    """Each run has its own sensor parameters: a zero of the angle, bias and tilt otherwise."""
    time, _, force = readings(bias=0.05)
    folder = experiment(tmp_path, TANGENTIAL % 0.1, time, force)
    one = pendmap.read_experiment(folder).runs[0]
    seconds, angle = record(decay(release=1.0), seconds=30, offset=0.01)
    np.savetxt(
        tmp_path / "angle.csv",
        np.stack([seconds, angle], axis=1),
        delimiter=",",
        header="t_s,theta_rad",
        comments="",
    )
    other = pendmap.read_experiment(tmp_path / "angle.csv").runs[0]
    both = identify(Experiment(folder, (one, other)), methods=["trajectory"])
    agrees(both, TRUTH | {"offset": 0.01, "bias[0]": 0.05})
