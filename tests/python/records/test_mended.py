"""Faults by a table: those that are corrected, and those that are reported."""

from __future__ import annotations

import ast
import math
import string
from pathlib import Path

import numpy as np
import pytest

import pendmap
from pendmap.records.experiment import texts
from recorded import clean, experiment, found, motion, noisy, read, text

TIME, THETA = clean()
SPEED = motion()[2]
ORDER = np.random.default_rng(1).permutation(TIME.size)
X, Y = 640 + 300 * np.sin(THETA), 200 + 300 * np.cos(THETA)
NAMES = "t_s,theta_rad"
DEGREE, TURN = math.pi / 180, 2 * math.pi

# Columns as in a file, and the finding; the record that is read is the clean one
MENDED = {
    "milliseconds": ((1e3 * TIME, THETA), NAMES, "time-unit"),
    "microseconds": ((1e6 * TIME, THETA), NAMES, "time-unit"),
    "nanoseconds": ((1e9 * TIME, THETA), NAMES, "time-unit"),
    "rows in any order": ((TIME[ORDER], THETA[ORDER]), NAMES, "time-backwards"),
    "rows reversed": ((TIME[::-1], THETA[::-1]), NAMES, "time-backwards"),
    "degrees": ((TIME, THETA / DEGREE), NAMES, "angle-unit"),
    "a gauge at -90 degrees": ((TIME, THETA - TURN / 4), NAMES, "gauge-turned"),
    "a gauge at 90 degrees": ((TIME, THETA + TURN / 4), NAMES, "gauge-turned"),
    "a gauge at 180 degrees": ((TIME, THETA + TURN / 2), NAMES, "gauge-turned"),
    "turns slipped": ((TIME, THETA + 2 * TURN * (TIME > 12)), NAMES, "turns-slipped"),
    "a velocity turned": ((TIME, THETA, -SPEED), NAMES + ",gyro_z", "sign-turned"),
    "a velocity in degrees": ((TIME, THETA, SPEED / DEGREE), NAMES + ",gyro_z", "velocity-unit"),
    "no angle beside pixels": ((TIME, X, Y, 0 * TIME), "t_s,x,y,theta", "angle-constant"),
    "a constant beside pixels": ((TIME, X, Y, 0 * TIME), "t_s,x,y,theta_rad", "angle-constant"),
    "no number beside pixels": ((TIME, X, Y, math.nan * X), "t_s,x,y,theta", "angle-constant"),
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
}


@pytest.mark.parametrize("case", MENDED)
def test_a_fault_is_corrected(tmp_path: Path, case: str) -> None:
    columns, names, key = MENDED[case]
    run = read(tmp_path, text(columns, names, "%.12g"))
    assert found(run)[key].mended
    np.testing.assert_allclose(run.time - run.time[0], TIME, atol=1e-5)
    within = 0.01 if "x" in names.split(",") else 1e-5
    np.testing.assert_allclose(run.theta, THETA, atol=within)
    if run.velocity is not None:
        np.testing.assert_allclose(run.velocity, SPEED, atol=2e-4)


@pytest.mark.parametrize("names", UNITS)
def test_columns_are_read_by_names_and_units(tmp_path: Path, names: str) -> None:
    run = read(tmp_path, "mass A,,,\n" + text(UNITS[names], names, "%.9g"))
    assert "columns-guessed" in found(run)
    assert "angle-unit" not in found(run)
    assert "pixel_x" not in run.channels
    np.testing.assert_allclose(run.time, TIME, atol=1e-6)
    np.testing.assert_allclose(run.theta, THETA, atol=1e-5)


def test_an_unknown_unit_is_refused(tmp_path: Path) -> None:
    with pytest.raises(pendmap.InputError, match="no column of angles"):
        read(tmp_path, text((TIME, THETA), "Zeit [min],Winkel [Umdr]"))


SMALL = motion(start=0.045, duration=30.0)
ARC = motion(start=0.08, rate=30.0)
NOISE = np.random.default_rng(2).normal(0, 0.5, (2, ARC[0].size))
FINE = motion(rate=1000.0, duration=12.0)
LOST = noisy(FINE[1], 0.002, TURN / 400) + TURN / 2 * (FINE[0] > 6)
PEAKS = 0.5 * np.arange(30), np.exp(-0.015 * np.arange(30)) * (-1.0) ** np.arange(30)
# What is known, columns as in a file, the finding that corrects nothing, and words of it
REPORTED = {
    "a declared unit": (
        '[columns]\ntime = { unit = "s" }',
        (1e3 * TIME, THETA),
        NAMES,
        "time-unit",
        "contrary",
    ),
    "small degrees": (
        "",
        (SMALL[0], noisy(SMALL[1], 1e-4, 0) / DEGREE),
        NAMES,
        "angle-unit",
        "degrees?",
    ),
    "a short arc": (
        "",
        (ARC[0], 100 * np.sin(ARC[1]) + NOISE[0], 100 * np.cos(ARC[1]) + NOISE[1]),
        "t,x,y",
        "circle-uncertain",
        "",
    ),
    "counts missed": ("[rig]\nencoder_counts = 400", (FINE[0], LOST), NAMES, "missed-counts", ""),
    "another w0": ("[rig]\nw0 = 3.0", (TIME, THETA), NAMES, "period-unlike-rig", "w0 = 3 "),
    "w0 in 1/1000": ("[rig]\nw0 = 6200", (TIME, THETA), NAMES, "period-unlike-rig", "w0 = 6200"),
    "a length in mm": (
        "[rig]\nlength_m = 250",
        (TIME, THETA),
        NAMES,
        "period-unlike-rig",
        "length_m = 250 m",
    ),
    "the right length": ("[rig]\nlength_m = 0.25", (TIME, THETA), NAMES, "", ""),
    "turning points": ('[columns]\npeaks = "peak_rad"', PEAKS, "t_s,peak_rad", "", ""),
    "turning points of one sign": (
        '[columns]\npeaks = "theta_rad"',
        (PEAKS[0], np.abs(PEAKS[1])),
        NAMES,
        "peaks-one-sign",
        "one sign",
    ),
}


@pytest.mark.parametrize("case", REPORTED)
def test_a_fault_is_reported(tmp_path: Path, case: str) -> None:
    known, columns, names, key, words = REPORTED[case]
    described = f'{known}\n[[run]]\nfile = "a.csv"\n'
    there = experiment(tmp_path, described, a=text(columns, names, "%.9g"))
    (run,) = there.runs
    if key:
        assert not found(run)[key].mended
        assert words in found(run)[key].text
    else:
        assert not {"period-unlike-rig", "peaks-one-sign", "peaks-undeclared"} & set(found(run))
    assert there.w0 is None
    if run.peaks_only:
        assert run.trusted.all()
        assert math.isnan(pendmap.noise_floor(run).sigma)


PACKAGE = Path(pendmap.__file__).parent / "records"
GIVEN = {
    "note": set(),
    "finding": set(),
    "finding_of": set(),
    "leave_out": {"number"},
    "distrust": {"number"},
}


def test_each_finding_of_the_table_is_used_with_the_values_of_its_text() -> None:
    used = set()
    for path in PACKAGE.glob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        used |= {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant)} & set(texts())
        for call in (n for n in ast.walk(tree) if isinstance(n, ast.Call)):
            name = getattr(call.func, "attr", getattr(call.func, "id", ""))
            places = call.args[:2] if name in {"leave_out", "distrust"} else call.args[:1]
            keys = [n.value for n in places if isinstance(n, ast.Constant)]
            if name not in GIVEN or not keys or None in {k.arg for k in call.keywords}:
                continue
            text, _ = texts()[keys[-1]]
            wanted = {field for _, field, _, _ in string.Formatter().parse(text) if field}
            assert not wanted & {"at", "span", "where"}, keys[-1]
            assert wanted <= {k.arg for k in call.keywords} | GIVEN[name], keys[-1]
    assert used == set(texts())
