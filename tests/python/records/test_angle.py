"""Faults of units, zero, range and readings: corrected, marked, or reported."""

from __future__ import annotations

import ast
import math
import re
from pathlib import Path

import numpy as np
import pytest

import pendmap
from pendmap.tables.findings import texts
from recorded import COUNT, clean, experiment, found, motion, noisy, read, text

TIME, THETA = clean()
SPEED = motion()[2]
ORDER = np.random.default_rng(1).permutation(TIME.size)
X, Y = 640 + 300 * np.sin(THETA), 200 + 300 * np.cos(THETA)
NAMES = "t_s,theta_rad"
DEGREE, TURN = math.pi / 180, 2 * math.pi
RUN = '[[run]]\nfile = "a.csv"\n'

# Columns as in a file, and the finding; the record that is read is the clean one
MENDED = {
    "milliseconds": ((1e3 * TIME, THETA), NAMES, "time-unit"),
    "microseconds": ((1e6 * TIME, THETA), NAMES, "time-unit"),
    "nanoseconds": ((1e9 * TIME, THETA), NAMES, "time-unit"),
    "rows in any order": ((TIME[ORDER], THETA[ORDER]), NAMES, "time-backwards"),
    "rows reversed": ((TIME[::-1], THETA[::-1]), NAMES, "time-backwards"),
    "degrees": ((TIME, THETA / DEGREE), NAMES, "angle-unit"),
    "a gauge at -90 degrees": ((TIME, THETA - TURN / 4), NAMES, "gauge-turned"),
    "a gauge at 180 degrees": ((TIME, THETA + TURN / 2), NAMES, "gauge-turned"),
    "turns slipped": ((TIME, THETA + 2 * TURN * (TIME > 12)), NAMES, "turns-slipped"),
}
# Columns that are read by their names and units, without a fault
UNITS = {
    "Time (s),Angle (rad)": (TIME, THETA),
    "t/ms,theta [deg]": (1e3 * TIME, THETA / DEGREE),
    "time_us,angle_deg": (1e6 * TIME, THETA / DEGREE),
    "t in s,phi in mrad": (TIME, 1e3 * THETA),
    "Timestamp (ms),Encoder (rev)": (1e3 * TIME, THETA / TURN),
    "time,position,velocity": (TIME, THETA, SPEED),
    "t,x,y,\u03b8 [\u00b0]": (TIME, np.sin(THETA), -np.cos(THETA), THETA / DEGREE),
    "t_s,x,y,theta_rad": (TIME, X, Y, 0 * TIME),
    "t_s,x,y,theta": (TIME, X, Y, math.nan * X),
}


@pytest.mark.parametrize("case", MENDED)
def test_a_fault_is_corrected(tmp_path: Path, case: str) -> None:
    columns, names, key = MENDED[case]
    run = read(tmp_path, text(columns, names, "%.12g"))
    assert found(run)[key].mended
    np.testing.assert_allclose(run.time - run.time[0], TIME, atol=1e-5)
    np.testing.assert_allclose(run.theta, THETA, atol=1e-5)


@pytest.mark.parametrize("names", UNITS)
def test_columns_are_read_by_names_and_units(tmp_path: Path, names: str) -> None:
    run = read(tmp_path, "mass A,,,\n" + text(UNITS[names], names, "%.9g"))
    assert "columns-guessed" in found(run)
    assert "angle-unit" not in found(run)
    np.testing.assert_allclose(run.time, TIME, atol=1e-6)
    within = 1e-2 if names.startswith("t_s,x") else 1e-5
    np.testing.assert_allclose(run.theta, THETA, atol=within)


@pytest.mark.parametrize(
    ("scale", "names", "says"),
    [
        (1.0, "Zeit [min],Winkel [Bq]", "no column of angles: .*'Bq' is not known"),
        (3e9, NAMES, "too large"),
    ],
)
def test_an_impossible_unit_is_refused(tmp_path: Path, scale: float, names: str, says: str) -> None:
    with pytest.raises(pendmap.InputError, match=says):
        read(tmp_path, text((TIME, scale * THETA), names))


SMALL = motion(start=0.045, duration=30.0)
ARC = motion(start=0.08, rate=30.0)
NOISE = np.random.default_rng(2).normal(0, 0.5, (2, ARC[0].size))
BOB = ARC[0], 100 * np.sin(ARC[1]) + NOISE[0], 100 * np.cos(ARC[1]) + NOISE[1]
FINE = motion(rate=1000.0, duration=12.0)
LOST = noisy(FINE[1], 0.002, TURN / 400) + TURN / 2 * (FINE[0] > 6)
PEAKS = 0.5 * np.arange(30), np.exp(-0.015 * np.arange(30)) * (-1.0) ** np.arange(30)
ONE_SIGN = PEAKS[0], np.abs(PEAKS[1])
DEGREES = SMALL[0], noisy(SMALL[1], 1e-4, 0) / DEGREE
PUSHED = TIME, THETA, 20e3 * np.cos(12 * TIME)
HERTZ = 1.75
DRIVEN = f'kind = "forced"\ndrive = {{ p = 0.2, Omega = {math.tau * HERTZ}, phi = 0.0 }}'
SLOW, QUICK = (
    (motion(0.5, 0.0, 120.0, rate, (0.2, math.tau * HERTZ, 0.0))[:2]) for rate in (3.0, 3.6)
)
GROWING = 0.1 * np.exp(0.05 * TIME) * np.cos(6 * TIME)  # a motion that gains energy is driven
CLEAN, MILLI = (TIME, THETA), (1e3 * TIME, THETA)
FLICKER = 0.001534 * np.random.default_rng(0).integers(0, 2, TIME.size)  # no velocities
FORCED_COUNTS = DRIVEN + "\n[rig]\nencoder_counts = 4096"
PIVOT = 'pivot = { vertical = "y", unit = "mm" }'
# What is known, columns as in a file, the finding that corrects nothing, and words of it
REPORTED = {
    "a declared unit": ('[columns]\ntime.unit = "s"', MILLI, NAMES, "time-unit", "contrary"),
    "small degrees": ("", DEGREES, NAMES, "angle-unit", "degrees?"),
    "a short arc": ("", BOB, "t,x,y", "circle-uncertain", ""),
    "counts missed": ("[rig]\nencoder_counts = 400", (FINE[0], LOST), NAMES, "missed-counts", ""),
    "another w0": ("[rig]\nw0 = 3.0", CLEAN, NAMES, "period-unlike-rig", "w0 = 3 "),
    "a length in mm": ("[rig]\nlength_m = 250", CLEAN, NAMES, "period-unlike-rig", "= 250 m"),
    "the right length": ("[rig]\nlength_m = 0.25", CLEAN, NAMES, "", ""),
    "turning points": ('[columns]\npeaks = "peak_rad"', PEAKS, "t_s,peak_rad", "", ""),
    "of one sign": (
        '[columns]\npeaks = "theta_rad"',
        ONE_SIGN,
        NAMES,
        "peaks-one-sign",
        "one sign",
    ),
    "a drive unresolved": (DRIVEN, SLOW, NAMES, "drive-unresolved", "1.75 Hz is read at 3 Hz"),
    "a drive resolved": (DRIVEN, QUICK, NAMES, "", ""),
    "a count that flickers": (FORCED_COUNTS, (TIME, FLICKER), NAMES, "", ""),
    "a motion that grows": ("", (TIME, noisy(GROWING)), NAMES, "few-used", "of 2001 readings"),
    "a pivot in mm": (PIVOT, PUSHED, f"{NAMES},y", "pivot-unit", "its unit is wrong"),
}


@pytest.mark.parametrize("case", REPORTED)
def test_a_fault_is_reported(tmp_path: Path, case: str) -> None:
    known, columns, names, key, words = REPORTED[case]
    there = experiment(tmp_path, f"{RUN}{known}\n", a=text(columns, names, "%.9g"))
    (run,) = there.runs
    if key:
        assert not found(run)[key].mended
        assert words in found(run)[key].text
    else:
        assert not {"period-unlike-rig", "peaks-one-sign", "drive-unresolved"} & set(found(run))
    assert there.w0 is None
    assert math.isnan(pendmap.noise_floor(run).sigma) == run.peaks_only
    assert run.trusted.all() or not run.peaks_only


def test_held_released_and_at_rest(tmp_path: Path) -> None:
    _, theta, _ = motion(start=0.6, duration=75.0)
    readings = noisy(np.concatenate([np.full(150, theta[0]), theta]))
    time = np.arange(readings.size) / 100
    run = read(tmp_path, text((time, readings)))
    assert [segment.what for segment in run.segments] == ["held", "motion", "rest"]
    held, _, rest = run.segments
    assert held.to_s == pytest.approx(1.5, abs=0.1)
    speed = np.gradient(theta, 0.01)
    stops = 1.5 + np.flatnonzero(np.abs(speed) > 0.01)[-1] / 100
    assert stops - 4 < rest.from_s < stops + 1
    used = time[run.trusted]
    assert held.to_s < used[0] < 1.7
    assert used[-1] < rest.from_s


def test_a_few_swings_do_not_determine_the_zero_and_a_rest_does(tmp_path: Path) -> None:
    for duration in (0.4, 1.0, 3.0):
        time, theta = clean(start=2.4, duration=duration)
        run = read(tmp_path, text((time, theta)))
        np.testing.assert_allclose(run.theta, theta, atol=1e-6)
        assert not any(f.mended for f in run.findings if f.what.startswith(("zero", "gauge")))
    time, theta = clean(start=0.1, duration=20.0)
    run = read(tmp_path, text((time, theta + 0.5)))
    assert found(run)["zero-offset"].mended
    np.testing.assert_allclose(run.theta, theta, atol=0.01)


def test_the_zero_of_a_forced_run_is_left_alone(tmp_path: Path) -> None:
    described = f'{RUN}kind = "forced"\ndrive = {{ p = 0.3, Omega = 9.0 }}\n'
    (run,) = experiment(tmp_path, described, a=text((TIME, THETA + math.pi / 2))).runs
    np.testing.assert_allclose(run.theta, THETA + math.pi / 2, atol=1e-6)
    assert not {f.what for f in run.findings} & {"zero-uncertain", "zero-offset", "gauge-turned"}


@pytest.mark.parametrize("known", ["", "[rig]\nencoder_counts = 4096\n"])
def test_steps_are_those_of_the_angle_in_radians(tmp_path: Path, known: str) -> None:
    (run,) = experiment(tmp_path, RUN + known, a=text((TIME, np.degrees(THETA)))).runs
    assert run.count_rad == pytest.approx(COUNT, rel=1e-3)
    assert "counts-differ" not in found(run)
    assert known or "4096" in found(run)["counts-seen"].text


def test_swings_after_turns_are_counted(tmp_path: Path) -> None:
    time, theta = clean(start=0.0, velocity=30.0, duration=80.0)
    assert theta[-1] > 30
    run = read(tmp_path, text((time, theta)))
    assert "no-swing" not in found(run)
    np.testing.assert_allclose(run.theta, theta, atol=1e-5)
    assert run.trusted.mean() > 0.7


def test_only_ends_of_a_sensor_are_clipped(tmp_path: Path) -> None:
    time, theta = clean(start=3.0, duration=12.0)
    for limit in (0.3, 1.0, 2.0):
        said = found(read(tmp_path, text((time, np.minimum(theta, limit)))))["clipped"].text
        assert said.startswith(f"the sensor's range ends at {limit:.4g} rad: ")
    dense = np.linspace(0.0, 12.0, 24001)
    drawn = np.interp(dense, time, noisy(motion(start=3.0, duration=12.0)[1], 0.0))
    assert "clipped" not in found(read(tmp_path, text((dense, drawn), form="%.4f")))


@pytest.mark.parametrize(
    ("gain", "gyroscope"), [(0.75, True), (1.33, True), (0.75, False), (1.5, False)]
)
def test_a_gain_that_the_period_disproves_is_reported_with_its_error(
    tmp_path: Path, gain: float, *, gyroscope: bool
) -> None:
    time, theta, speed = motion(start=1.4, duration=60.0)
    noise = np.random.default_rng(1).standard_normal((3, time.size))
    content = text((time, gain * theta + 1e-3 * noise[0]))
    if gyroscope:
        columns = (time, 0.01 * noise[0], gain * speed + 0.01 * noise[1], 0.01 * noise[2])
        head = [f'"{name}"' for name in ("Time (s)", *(f"Gyroscope {k} (rad/s)" for k in "xyz"))]
        content = text(columns, ",".join(head)).replace(",", "\t")
    words = found(read(tmp_path, content))["angle-scale"].text
    factor, error = re.search(r"angle is (\S+) \+- (\S+) times", words).groups()  # type: ignore[union-attr]
    assert abs(float(factor) - 1 / gain) < 3 * float(error)
    assert float(words.split("gain is ")[1].split()[0]) == pytest.approx(gain, rel=0.01)
    assert float(error) < 0.01
    channel = "velocity" if gyroscope else "angle"
    described = f"{RUN}[columns]\n{channel} = {{ scale = {factor} }}\n"
    (run,) = experiment(tmp_path, described, a=content).runs
    assert "angle-scale" not in found(run)


def test_outliers_of_the_virtual_rig_do_not_spoil_its_noise(tmp_path: Path) -> None:
    time, theta, _ = motion(duration=40.0)
    rng = np.random.default_rng(8)
    readings = noisy(theta, 0.002)
    false = rng.random(time.size) < 0.01
    readings[false] += rng.uniform(0.2, math.pi, int(false.sum()))
    run = read(tmp_path, text((time, readings)))
    assert np.mean(run.trusted[~false]) > 0.995
    assert np.mean(~run.trusted[false]) > 0.95
    assert pendmap.noise_floor(run).sigma == pytest.approx(0.00205, rel=0.06)


ADJACENT = [([500, 500 + k, 500 + 2 * k], [0.5, 2.1, -0.9], 0.001) for k in (2, 6, 11)]
ENDS = [([k], [size], 0.005) for k, size in ((0, 0.25), (3, -2.0), (9, 0.25), (1998, 0.25))]


@pytest.mark.parametrize(("at", "sizes", "noise"), [*ADJACENT, *ENDS, ([2000], [-2.0], 0.005)])
def test_adjacent_outliers_and_those_at_the_ends_are_no_jumps(
    tmp_path: Path, at: list[int], sizes: list[float], noise: float
) -> None:
    time, theta, _ = motion()
    readings = noisy(theta, noise)
    readings[at] += sizes
    run = read(tmp_path, text((time, readings)))
    assert np.flatnonzero(~run.trusted).tolist() == at
    assert "missed-counts" not in found(run)


def test_two_percent_of_outliers_with_gaps_are_found(tmp_path: Path) -> None:
    time, theta, _ = motion(duration=40.0)
    rng = np.random.default_rng(5)
    readings = noisy(theta, 0.004)
    false = rng.random(time.size) < 0.02
    readings[false] += rng.choice([-1, 1], false.sum()) * rng.uniform(0.3, math.pi, false.sum())
    kept = np.ones(time.size, bool)
    for begin in rng.choice(time.size - 40, 8, replace=False):
        kept[begin : begin + rng.integers(1, 20)] = False
    run = read(tmp_path, text((time[kept], readings[kept])))
    assert not np.any(run.trusted & false[kept])
    assert np.mean(run.trusted[~false[kept]]) > 0.985


@pytest.mark.parametrize(("start", "rate"), [(2.9, 25.0), (0.1, 25.0), (2.9, 1000.0)])
def test_a_record_without_outliers_has_no_finding(
    tmp_path: Path, start: float, rate: float
) -> None:
    time, theta, _ = motion(start=start, rate=rate)
    run = read(tmp_path, text((time, noisy(theta, 0.003))))
    assert not {"outliers", "missed-counts"} & found(run).keys()


def test_each_text_of_a_finding_is_used() -> None:
    used = set()
    root = Path(pendmap.__file__).parent
    for path in root.rglob("*.py"):
        nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        used |= {node.value for node in nodes if isinstance(node, ast.Constant)} & set(texts())
    assert used == set(texts())
