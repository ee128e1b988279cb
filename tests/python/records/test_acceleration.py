"""Accelerometers without an angle: refusals, the reconstructed angle, holds by a hand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from accelerations import GRAVITY, PLACE, SENSORS, TRUTH, column, experiment, handled, readings
from driven_decays import motion
from pendmap.comparison import compare
from pendmap.comparison import experiment as compared
from pendmap.identification import identify
from pendmap.identification import report as summary
from recorded import found

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.records import Run

CENTRE = GRAVITY / TRUTH["w0"] ** 2
DRIVE = "drive = { p = 0.1, Omega = 12 }\n"


def entry(place: str) -> str:
    return f'{{ name = "acc", {place} }}'


def run_of(folder: Path) -> Run:
    (run,) = pendmap.read_experiment(folder).runs
    return run


@pytest.mark.parametrize("release", [0.3, 1.4])
def test_the_reconstructed_angle_is_near_the_true_one(tmp_path: Path, release: float) -> None:
    time, theta, force = readings(release=release)
    force[[500, 1200]] += [5.0, -3.0]
    run = run_of(experiment(tmp_path, entry(PLACE % 0.1), time, force))
    assert run.accelerometer is not None
    assert run.accelerometer.w0 == pytest.approx(TRUTH["w0"], rel=0.02)
    assert float(np.sqrt(np.mean((run.theta - theta)[run.trusted] ** 2))) < 0.05
    assert "angle-from-acceleration" in found(run)
    assert "2 outliers" in found(run)["outliers"].text
    assert not run.trusted[[500, 1200]].any()


ALONG: dict[str, Any] = {"direction": "radial"}


@pytest.mark.parametrize(
    ("place", "given", "refused"),
    [
        ('unit = "m/s2"', {}, "direction and distance_m missing"),
        ('direction = "tangential"', {}, "distance_m missing"),
        ('direction = "radial", distance_m = 0.1', {}, "cannot tell left from right"),
        ('direction = "up", distance_m = 0.1', {}, '"tangential" or "radial" or "angular", got'),
        (PLACE % -1, {}, "distance_m must be 1e-06 to 100, got -1"),
        (PLACE % 0.1 + ", gravity_removed = 1", {}, "gravity_removed"),
        ('direction = "angular", unit = "m/s2"', {}, "unit must be rad/s2 or deg/s2"),
        ('unit = "rad/s2", direction = "tangential"', {}, "unit must be m/s2 or g"),
        (PLACE % 0.1 + ", distanse = 1", {}, "perhaps distance_m is meant"),
        (PLACE % 0.1, ALONG, "along the rod: it must be the column of the axis"),
        (PLACE % 0.1 + ", gravity_removed = true", ALONG | {"gravity": 0.0}, "along the rod"),
        (PLACE % 0.1 + ', unit = "g"', {"release": 1.4}, "unit, distance_m, direction"),
        (PLACE % CENTRE, {"distance": CENTRE}, "only damping is measured there"),
        (PLACE % 0.1, {"run": DRIVE}, "forced run includes the pivot's: it must be a free"),
    ],
)
def test_what_is_missing_or_wrong_is_named(
    tmp_path: Path, place: str, given: dict[str, Any], refused: str
) -> None:
    time, _, force = readings(**{key: given[key] for key in given if key != "run"})
    there = experiment(tmp_path, entry(place), time, force)
    with (there / "experiment.toml").open("a", encoding="utf-8") as file:
        file.write(given.get("run", ""))
    with pytest.raises(pendmap.InputError) as error:
        run_of(there)
    assert refused in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("velocity", [0.0, 20.0])
def test_swings_beyond_a_quarter_turn_are_not_used(tmp_path: Path, velocity: float) -> None:
    time = np.arange(0, 40, 0.01)
    theta = motion(time, (2.5, velocity), w0=6.2, c_over_m=0.08, friction=0.1)
    force = -np.gradient(np.gradient(theta, time), time)
    run = run_of(experiment(tmp_path, '{ name = "acc", unit = "rad/s2" }', time, -force))
    assert "used from" in found(run)["acceleration-folded"].text
    away = np.abs(theta - 2 * np.pi * np.round(theta[-1] / (2 * np.pi)))
    assert away[run.trusted].max() < 1.4
    assert run.trusted.mean() > 0.3
    assert np.abs(np.abs(run.theta) - away)[run.trusted].max() < 0.1


@pytest.mark.parametrize(
    ("heading", "gravity"), [("Acceleration", GRAVITY), ("Linear Acceleration", 0.0)]
)
def test_files_of_phyphox(tmp_path: Path, heading: str, gravity: float) -> None:
    time, _, across = readings(distance=0.3, gravity=gravity)
    _, _, along = readings("radial", distance=0.3, gravity=gravity, seed=1)
    names = '"Time (s)",' + ",".join(f'"{heading} {axis} (m/s^2)"' for axis in "xy")
    place = f'{{ name = "{heading} x (m/s^2)", {PLACE % 0.3} }}'
    run = run_of(experiment(tmp_path, place, time, across, along, names=names))
    assert run.accelerometer is not None
    assert run.accelerometer.gravity == gravity


def test_an_acceleration_is_not_used_beside_an_angle(tmp_path: Path) -> None:
    time, theta, force = readings(release=1.2)
    there = experiment(tmp_path, entry(PLACE % 0.1), time, theta, force, names="t_s,theta_rad,acc")
    assert "acceleration-unused" in found(run_of(there))
    assert run_of(there).accelerometer is None


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("hold", [0.4, 1.5])
def test_a_release_begins_after_the_hand(tmp_path: Path, sensor: str, hold: float) -> None:
    time, force, ((begin, end),) = handled(sensor, ((1.2, 30.0),), hold)
    run = run_of(experiment(tmp_path, column(sensor), time, force))
    low, high = run.time[run.trusted][[0, -1]]
    assert begin - 1e-9 <= low <= begin + 0.3
    assert end - 0.02 < high < end
    assert "outliers" not in found(run)  # the jumps at the release are none


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("releases", [((1.2, 12.0), (0.9, 10.0)), ((0.3, 10.0), (1.3, 12.0))])
def test_several_releases_are_refused(
    tmp_path: Path, sensor: str, releases: tuple[tuple[float, float], ...]
) -> None:
    time, force, free = handled(sensor, releases)
    there = experiment(tmp_path, column(sensor), time, force)
    with pytest.raises(pendmap.InputError, match="must be of one release, got 2, ") as error:
        run_of(there)
    assert "\n" not in str(error.value)
    with (there / "experiment.toml").open("a", encoding="utf-8") as file:
        file.write(f"from_s = {free[1][0]}\n")
    assert run_of(there).trusted.mean() > 0.9


@pytest.mark.parametrize("sensor", ["far", "removed", "angular"])
def test_intervals_of_a_bias_are_in_order(tmp_path: Path, sensor: str) -> None:
    # The gain is negative beyond the centre of oscillation, and without gravity.
    time, _, force = readings(**SENSORS[sensor][0], release=1.3, seconds=20)
    read = pendmap.read_experiment(experiment(tmp_path, column(sensor), time, force))
    report = identify(read, methods=["trajectory"])
    for name, estimate in report.best.estimates.items():
        assert estimate.ci95 is not None, name
        low, high = estimate.ci95
        assert low < estimate.value < high, name
    low, high = summary.as_json(report)["methods"]["trajectory"]["ci95"]["bias"]
    assert low < high


def test_a_reconstructed_angle_judges_no_model(tmp_path: Path) -> None:
    time, _, force = readings(release=1.3, seconds=20, tilt=0.03)
    read = pendmap.read_experiment(experiment(tmp_path, column("near"), time, force))
    report = identify(read)
    result = summary.as_json(report)
    assert result["table1"] == []
    assert "computed from an acceleration" in result["table1_left_out"]
    assert sum("no errors of periods and peaks" in line for line in summary.as_text(report)) == 1
    beside = compare(report.model, read)
    (one,) = beside.runs
    assert one.errors is None
    assert one.rms == pytest.approx(one.sigma, rel=0.1)
    run = compared.as_json(beside)["runs"][0]
    assert [row["quantity"] for row in run["quantities"]] == ["residual"]
    assert run["peak_rms_percent"] is None
    assert any("computed from an acceleration" in line for line in beside.text_parts()[1])
