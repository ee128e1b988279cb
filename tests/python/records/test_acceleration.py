"""The acceleration channel: what it requires, its refusals, its check of an angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from accelerations import GRAVITY, SENSORS, TRUTH, column, experiment, handled, readings
from driven_decays import motion
from pendmap import InputError
from pendmap.comparison import compare
from pendmap.comparison import experiment as compared
from pendmap.identification import identify
from pendmap.identification import report as summary

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.records import Experiment, Run


PLACE = 'direction = "tangential", distance_m = %g'
CENTRE = GRAVITY / TRUTH["w0"] ** 2


def entry(place: str, unit: str = "m/s2") -> str:
    return f'{{ name = "acc", unit = "{unit}", {place} }}'


def run_of(folder: Path) -> Run:
    return pendmap.read_experiment(folder).runs[0]


def said(run: Run) -> dict[str, str]:
    return {finding.what: finding.text for finding in run.findings}


@pytest.mark.parametrize("release", [0.3, 1.4])
def test_the_reconstructed_angle_is_near_the_true_one(tmp_path: Path, release: float) -> None:
    time, theta, force = readings(release=release)
    run = run_of(experiment(tmp_path, entry(PLACE % 0.1), time, force))
    assert run.accelerometer is not None
    assert run.accelerometer.w0 == pytest.approx(TRUTH["w0"], rel=0.02)
    assert float(np.sqrt(np.mean((run.theta - theta) ** 2))) < 0.05
    assert "angle-from-acceleration" in said(run)
    assert {"outliers", "missed-counts", "readings-in-degrees"}.isdisjoint(said(run))


@pytest.mark.parametrize(
    ("place", "refused"),
    [
        ('unit = "m/s2"', "direction and distance_m missing"),
        ('direction = "tangential"', "distance_m missing"),
        ('direction = "radial", distance_m = 0.1', "cannot tell left from right"),
        (
            'direction = "up", distance_m = 0.1',
            'must be "tangential" or "radial" or "angular", got',
        ),
        (
            PLACE % -1,
            "distance_m must be 1e-06 to 100, got -1",
        ),
        (PLACE % 0.1 + ", gravity_removed = 1", "gravity_removed"),
        ('direction = "angular", unit = "m/s2"', "unit must be rad/s2 or deg/s2"),
        ('unit = "rad/s2", direction = "tangential"', "unit must be m/s2 or g"),
        (PLACE % 0.1 + ", distanse = 1", "perhaps distance_m is meant"),
    ],
)
def test_what_is_missing_or_wrong_is_named(tmp_path: Path, place: str, refused: str) -> None:
    time, _, force = readings(seconds=20)
    there = experiment(tmp_path, f'{{ name = "acc", {place} }}', time, force)
    with pytest.raises(InputError) as error:
        run_of(there)
    assert refused in str(error.value)
    assert "\n" not in str(error.value)


def test_axes_along_and_across_the_rod_are_distinguished(tmp_path: Path) -> None:
    for gravity, removed in ((GRAVITY, "false"), (0.0, "true")):
        time, _, force = readings("radial", gravity=gravity)
        place = f"{PLACE % 0.1}, gravity_removed = {removed}"
        with pytest.raises(InputError, match="along the rod: it must be the column of the axis"):
            run_of(experiment(tmp_path, entry(place), time, force))


def test_a_wrong_unit_is_detected_by_impossible_readings(tmp_path: Path) -> None:
    time, _, force = readings(release=1.4)
    with pytest.raises(InputError, match=r"reaches .* at most .* unit, distance_m, direction"):
        run_of(experiment(tmp_path, entry(PLACE % 0.1, "g"), time, force))


def test_the_centre_of_oscillation_is_refused(tmp_path: Path) -> None:
    time, _, force = readings(distance=CENTRE)
    with pytest.raises(InputError, match="only damping is measured there"):
        run_of(experiment(tmp_path, entry(PLACE % CENTRE), time, force))


@pytest.mark.parametrize("velocity", [0.0, 20.0])
def test_swings_beyond_a_quarter_turn_are_not_used(tmp_path: Path, velocity: float) -> None:
    time = np.arange(0, 40, 0.01)
    theta = motion(time, (2.5, velocity), w0=6.2, c_over_m=0.08, friction=0.1)
    force = -np.gradient(np.gradient(theta, time), time)
    run = run_of(experiment(tmp_path, '{ name = "acc", unit = "rad/s2" }', time, -force))
    assert "used from" in said(run)["acceleration-folded"]
    away = np.abs(theta - 2 * np.pi * np.round(theta[-1] / (2 * np.pi)))
    assert away[run.trusted].max() < 1.4
    assert run.trusted.mean() > 0.3
    assert np.abs(np.abs(run.theta) - away)[run.trusted].max() < 0.1


def test_forced_runs_are_refused(tmp_path: Path) -> None:
    time, _, force = readings()
    there = experiment(tmp_path, entry(PLACE % 0.1), time, force)
    with (there / "experiment.toml").open("a", encoding="utf-8") as file:
        file.write("drive = { p = 0.1, Omega = 12 }\n")
    with pytest.raises(InputError, match="forced run includes the pivot's: it must be a free"):
        run_of(there)


def test_files_of_phyphox(tmp_path: Path) -> None:
    """Files of phyphox have three axes, with gravity, or without it as "Linear Acceleration"."""
    for heading, gravity in (("Acceleration", GRAVITY), ("Linear Acceleration", 0.0)):
        time, _, across = readings(distance=0.3, gravity=gravity)
        _, _, along = readings("radial", distance=0.3, gravity=gravity, seed=1)
        other = 0.02 * np.random.default_rng(2).standard_normal(time.size)
        names = '"Time (s)",' + ",".join(f'"{heading} {axis} (m/s^2)"' for axis in "xyz")
        place = f'{{ name = "{heading} x (m/s^2)", {PLACE % 0.3} }}'
        there = experiment(tmp_path, place, time, across, along, other, names=names)
        run = run_of(there)
        assert run.accelerometer is not None
        assert run.accelerometer.gravity == gravity
        assert ("gravity removed" in said(run)["angle-from-acceleration"]) == (gravity == 0)


def test_spikes_of_the_sensor_are_left_out(tmp_path: Path) -> None:
    time, _, force = readings()
    force[[500, 1200]] += [5.0, -3.0]
    run = run_of(experiment(tmp_path, entry(PLACE % 0.1), time, force))
    assert "2 outliers" in said(run)["outliers"]
    assert not run.trusted[[500, 1200]].any()


@pytest.mark.parametrize("other", ["theta_rad", "velocity_rad_s"])
def test_an_acceleration_is_not_used_beside_an_angle_or_a_velocity(
    tmp_path: Path, other: str
) -> None:
    time, theta, force = readings(release=1.2)
    values = theta if other == "theta_rad" else np.gradient(theta, time)
    values = values + 2e-3 * np.random.default_rng(3).standard_normal(time.size)
    names = f"t_s,{other},acc"
    run = run_of(experiment(tmp_path, entry(PLACE % 0.1), time, values, force, names=names))
    assert "acceleration-unused" in said(run)
    assert run.accelerometer is None


ONCE_A_PERIOD, LATE = 1.6, 1.1
"""Part of the swings, s, that may be lost before a hand stops it, and after it lets go."""


def spans(read: Experiment) -> list[tuple[float, float]]:
    """Return the interval of each run that is used for fitting."""
    ends = [run.time[run.trusted][[0, -1]] for run in read.runs]
    return [(float(low), float(high)) for low, high in ends]


ONE, THREE = ((1.2, 30.0),), ((1.2, 12.0), (0.9, 10.0), (1.2, 14.0))


@pytest.mark.parametrize(
    ("sensor", "releases", "hold", "tremble"),
    [
        *((sensor, ONE, hold, 0.0) for sensor in SENSORS for hold in (0.4, 1.5)),
        ("near", ONE, 1.5, 0.003),
        ("near", THREE, 1.5, 0.0),
    ],
)
def test_releases_begin_after_the_hand(
    tmp_path: Path,
    sensor: str,
    releases: tuple[tuple[float, float], ...],
    hold: float,
    tremble: float,
) -> None:
    time, force, free = handled(sensor, releases, hold=hold, tremble=tremble)
    read = pendmap.read_experiment(experiment(tmp_path, column(sensor), time, force))
    used = spans(read)
    assert len(used) == len(free)
    for (low, high), (begin, end) in zip(used, free, strict=True):
        assert begin - 1e-9 <= low <= begin + LATE
        assert end - ONCE_A_PERIOD < high < end
    said = {finding.what for finding in (*read.findings, *read.runs[0].findings)}
    assert "outliers" not in said  # the jumps at the release are none


def test_the_releases_together_give_the_damping(tmp_path: Path) -> None:
    time, force, _ = handled("near", ((1.2, 12.0), (0.9, 10.0), (1.4, 14.0)))
    read = pendmap.read_experiment(experiment(tmp_path, column("near"), time, force))
    best = identify(read, methods=["trajectory"]).best
    for name, true in TRUTH.items():
        found = best.estimates[name]
        assert found.stderr is not None
        assert abs(found.value - true) < 4 * found.stderr


@pytest.mark.parametrize("sensor", ["far", "removed", "angular"])
def test_intervals_of_a_bias_are_in_order(tmp_path: Path, sensor: str) -> None:
    """The gain is negative beyond the centre of oscillation, and without gravity."""
    time, _, force = readings(**SENSORS[sensor][0], release=1.3, seconds=20)
    read = pendmap.read_experiment(experiment(tmp_path, column(sensor), time, force))
    report = identify(read, methods=["trajectory"])
    for name, estimate in report.best.estimates.items():
        assert estimate.ci95 is not None, name
        low, high = estimate.ci95
        assert low < estimate.value < high, name
    told = summary.as_json(report)["methods"]["trajectory"]["ci95"]["bias"]
    assert told[0] < told[1]


def test_a_reconstructed_angle_judges_no_model(tmp_path: Path) -> None:
    time, _, force = readings(release=1.3, seconds=20, tilt=0.03)
    read = pendmap.read_experiment(experiment(tmp_path, column("near"), time, force))
    report = identify(read)
    told = summary.as_json(report)
    assert told["table1"] == []
    assert "computed from an acceleration" in told["table1_left_out"]
    assert not summary.table1_table(report)[1]
    assert sum("no errors of periods and peaks" in line for line in summary.as_text(report)) == 1
    beside = compare(report.model, read)
    (one,) = beside.runs
    assert one.errors is None
    assert one.rms == pytest.approx(one.sigma, rel=0.1)
    run = compared.as_json(beside)["runs"][0]
    assert [row["quantity"] for row in run["quantities"]] == ["residual"]
    assert run["peak_rms_percent"] is None
    assert any("computed from an acceleration" in line for line in beside.text_parts()[1])
