"""Files of common tools, folders, experiment.toml, rates, unused columns; what `look` says."""

from __future__ import annotations

import datetime as dt
import hashlib
import json
import os
import re
import sys
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import openpyxl
import pandas as pd
import pytest

import pendmap
from pendmap.records.summary import as_json, as_text, doubts
from recorded import clean, experiment, found, motion, noisy, read, text

if TYPE_CHECKING:
    from conftest import Run as Command

TIME, THETA = clean()
SLOW = motion(duration=60.0, rate=12.0)
FIELDS = {"channels", "rate_hz", "noise", "segments", "findings"}


def same(run: pendmap.Run, *, within: float = 1e-5) -> None:
    """Check that a run equals the clean record."""
    np.testing.assert_allclose(run.time - run.time[0], TIME, atol=1e-6)
    np.testing.assert_allclose(run.theta, THETA, atol=within)


def rows(columns: Any, separator: str, decimal: str) -> str:  # noqa: ANN401 (arrays)
    """Return the text of columns with any separator and decimal sign."""
    whole = text(columns, "", "%.9E").replace(",", "&").replace(".", decimal)
    return whole.replace("&", separator)


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), ("\t", ",")])
def test_a_file_of_phyphox_is_read(tmp_path: Path, separator: str, decimal: str) -> None:
    time, theta, speed = motion(duration=40.0)
    still = np.random.default_rng(5).normal(0, 0.002, (2, time.size))
    columns = (time, still[0], speed + 0.004, still[1], np.hypot(speed, still[0]))
    names = ["Time (s)", *(f"Gyroscope {axis} (rad/s)" for axis in "xyz"), "Absolute (rad/s)"]
    head = separator.join(f'"{name}"' for name in names)
    run = read(tmp_path, head + "\n" + rows(columns, separator, decimal))
    assert run.channels["velocity"] == "Gyroscope y (rad/s)"
    assert run.velocity is not None
    np.testing.assert_allclose(run.velocity, speed + 0.004, atol=1e-8)
    assert np.sqrt(np.mean((run.theta - theta) ** 2)) < 0.02
    assert found(run)["angle-integrated"].mended


@pytest.mark.parametrize(
    ("separator", "decimal", "sign"), [("\t", ".", -1), (",", ".", 1), (";", ",", -1)]
)
def test_a_file_of_tracker_is_read(tmp_path: Path, separator: str, decimal: str, sign: int) -> None:
    time, theta, _ = motion(rate=30.0)
    noise = np.random.default_rng(2).normal(0, 0.3, (2, theta.size))
    x, y = 320.5 + 210 * np.sin(theta) + noise[0], 80.25 + sign * 210 * np.cos(theta) + noise[1]
    head = "mass_A" + separator * 2 + "\n" + separator.join(["t", "x", "y"]) + "\n"
    run = read(tmp_path, head + rows((time, x, y), separator, decimal), "a.txt")
    assert np.sqrt(np.mean((run.theta - theta) ** 2)) < 0.004
    said = found(run)["angle-from-pixels"].text
    assert float(said.split("radius ")[1].split(" ")[0]) == pytest.approx(210, rel=0.01)
    assert pendmap.noise_floor(run).sigma == pytest.approx(0.3 / 210, rel=0.1)


def test_a_file_of_a_serial_logger_is_read(tmp_path: Path) -> None:
    lines = [f"{1000 * t:.0f},{a:.5f}" for t, a in zip(TIME, THETA, strict=True)]
    content = "ets Jul 29 2019\r\nrst:0x1\r\n\x00\x00,-0.\r\nREADY\r\n" + "\r\n".join(lines)
    run = read(tmp_path, content[:-3].encode(), "log.txt")
    assert {"nul-bytes", "columns-guessed", "time-unit"} <= set(found(run))
    np.testing.assert_allclose(run.theta[:-1], THETA[:-1], atol=1e-5)


@pytest.mark.parametrize("form", ["parquet", "t_s", "time", "categories"])
def test_parquet_and_data_frames_are_read_as_text(tmp_path: Path, form: str) -> None:
    frame = pd.DataFrame({"t_s": TIME, "theta_rad": THETA})
    if form == "t_s":
        frame = frame.set_index("t_s")
    elif form == "time":
        dates = pd.Timestamp("2026-05-01") + pd.to_timedelta(TIME, unit="s")
        frame = frame.drop(columns="t_s").set_axis(dates)
    elif form == "categories":
        frame["theta_rad"] = frame["theta_rad"].astype(str).astype("category")
    if form == "parquet":
        frame.to_parquet(tmp_path / "a.parquet")
        (run,) = pendmap.read_experiment(tmp_path / "a.parquet").runs
        assert run.sha256 == hashlib.sha256((tmp_path / "a.parquet").read_bytes()).hexdigest()
    else:
        whole = frame.copy()
        (run,) = pendmap.read_experiment(frame).runs
        pd.testing.assert_frame_equal(frame, whole)
    same(run, within=1e-12)


@pytest.mark.parametrize(
    ("form", "separator", "decimal", "head"),
    [
        ("%Y-%m-%d %H:%M:%S.%f", ",", ".", "when"),
        ("%Y-%m-%dT%H:%M:%S.%fZ", ";", ".", ""),
        ("%Y-%m-%d %H:%M:%S,%f", ";", ",", "Datum"),
        ("%Y-%m-%dT%H:%M:%S.%f+02:00", "\t", ".", None),
    ],
)
def test_times_may_be_dates(
    tmp_path: Path, form: str, separator: str, decimal: str, head: str | None
) -> None:
    dates = (pd.Timestamp("2026-02-28 23:59:50") + pd.to_timedelta(TIME, unit="s")).strftime(form)
    angles = [repr(angle).replace(".", decimal) for angle in THETA.tolist()]
    lines = [separator.join(pair) for pair in zip(dates, angles, strict=True)]
    first = [] if head is None else [f"{head}{separator}theta_rad"]
    same(read(tmp_path, "\n".join([*first, *lines]) + "\n"), within=1e-12)


@pytest.mark.parametrize(
    ("records", "says"),
    [
        (pd.DataFrame(), "DataFrame: must have rows of numbers, it is empty"),
        (pd.DataFrame({"t_s": [0.0, 0.1]}), "DataFrame: no column of angles"),
        (pd.DataFrame({"t": SLOW[0], "x": 6 * SLOW[0], "y": SLOW[1]}), "circle, they lie on none"),
        (np.zeros((9, 2)), "path must be a path, a table"),
    ],
)
def test_a_data_frame_that_is_no_record_is_refused(records: Any, says: str) -> None:  # noqa: ANN401
    with pytest.raises(pendmap.InputError, match=re.escape(says)):
        pendmap.read_experiment(records)


def test_every_key_of_a_description(tmp_path: Path) -> None:
    volts = 2.5 + THETA / 1.2566
    content = "made by hand\nin spring\nTime;volts\n" + text((1000 * TIME, volts), "", "%.7f")
    description = """
    [rig]
    gravity = 9.81
    length_m = 0.2552
    w0 = 6.2
    [columns]
    time = { name = "Time", unit = "ms" }
    angle = { name = "volts", unit = "V", scale = 1.2566, zero = 2.5 }
    [reader]
    delimiter = ";"
    decimal = ","
    skip_rows = 2
    [[run]]
    file = "a.csv"
    from_s = 1.2
    to_s = 8.0
    [[run]]
    file = "a.csv"
    kind = "free"
    lab_time_s = 150.0
    from_s = 8.0
    hold_out = true
    """
    semicolons = content.replace(",", ";").replace(".", ",")
    there = experiment(tmp_path, description, a=semicolons)
    first, second = there.runs
    assert (first.name, second.name) == ("a (1)", "a (2)")
    assert (first.time[0], first.time[-1]) == (1.2, 8.0)
    assert (second.lab_time_s, second.hold_out, second.time[0]) == (150.0, True, 8.0)
    np.testing.assert_allclose(first.theta, THETA[120:801], atol=1e-6)
    assert there.known == {"gravity": 9.81, "length_m": 0.2552, "w0": 6.2}
    assert there.sha256["a.csv"] == hashlib.sha256(semicolons.encode()).hexdigest()


def test_drives_and_pivots_are_read(tmp_path: Path) -> None:
    time, theta, _ = motion(drive=(0.3, 12.0, 0.4))
    push = -0.3 * 9.81 * np.cos(12 * time + 0.4)
    run = '[[run]]\nfile = "a.csv"\n'
    description = (
        f"{run}drive = {{ p = 0.3, Omega = 12.0 }}\n"
        f'{run}pivot = {{ vertical = "acc_y" }}\n{run}kind = "forced"\n'
    )
    content = text((time, noisy(theta), push), "t_s,theta_rad,acc_y")
    there = experiment(tmp_path, description, a=content)
    first, second, third = there.runs
    assert first.kind == second.kind == "forced"
    assert first.drive == {"p": 0.3, "Omega": 12.0, "phi": None}
    assert second.pivot is not None
    np.testing.assert_allclose(second.pivot["vertical"], push, atol=1e-6)
    assert "m/s2" in found(second)["pivot-unit"].text
    assert "pivot     vertical -2.943 to 2.943 m/s2" in as_text(there)
    assert "neither drive nor pivot" in found(third)["drive-missing"].text


def test_every_second_row_may_be_of_another_sensor(tmp_path: Path) -> None:
    time, theta = clean(duration=84.02)
    theta[1::2] = np.nan
    run = read(tmp_path, text((time, theta)))
    assert run.time.size == np.isfinite(theta).sum()
    assert found(run)["angle-missing"].mended


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ('pivot = "pivot_m"', "must be a table like pivot = { vertical"),
        ('pivot = { vertical = "y", sign = 2 }', "sign must be 1 or -1, got 2"),
        ('pivot = { vertical = "y", scale = 0 }', "scale must be .*, got 0"),
        ("from_s = 19.999", "must be times within .*, they leave 1 sample"),
    ],
)
def test_a_refused_description_names_its_fault(tmp_path: Path, line: str, says: str) -> None:
    with pytest.raises(pendmap.InputError, match=says):
        experiment(tmp_path, f'[[run]]\nfile = "run.csv"\n{line}\n', run=text((TIME, THETA)))


def workbook(folder: Path, sheets: dict[str, list[list[Any]]]) -> Path:
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, cells in sheets.items():
        sheet = book.create_sheet(name)
        for row in cells:
            sheet.append(row)
    book.save(folder / "book.xlsx")
    return folder / "book.xlsx"


@pytest.mark.parametrize("clock", ["s", "date", "duration"])
def test_a_workbook_is_read_as_its_text_would_be(tmp_path: Path, clock: str) -> None:
    stamps = [dt.timedelta(seconds=t) for t in TIME.tolist()]
    if clock == "date":
        begin = dt.datetime(2024, 3, 31, 1, 59, 50)  # noqa: DTZ001 (workbooks have no time zone)
        stamps = [begin + stamp for stamp in stamps]
    cells: list[list[Any]] = [["Pendulum of Monday"], [], ["Time", None, "Angle (deg)"]]
    times = TIME if clock == "s" else stamps
    cells += [[t, None, a] for t, a in zip(times, np.degrees(THETA), strict=True)]
    cells[100][2] = "#N/A"
    path = workbook(tmp_path, {"notes": [["a", 1.0]], "data": cells})
    (run,) = pendmap.read_experiment(path).runs
    rest = np.delete(np.arange(TIME.size), 97)
    within = 1e-9 if clock == "s" else 2e-3
    np.testing.assert_allclose(run.time - run.time[0], TIME[rest], atol=within)
    np.testing.assert_allclose(run.theta, THETA[rest], atol=1e-12)
    assert "'data' is read" in found(run)["sheet-chosen"].text


def test_a_workbook_without_its_reader_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = workbook(tmp_path, {"data": [[1.0, 2.0]]})
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(pendmap.InputError, match=r"with openpyxl: pip install pendmap\[excel\]"):
        pendmap.read_experiment(path)


@pytest.mark.parametrize(
    ("sheet", "says"),
    [
        ('<row r="1048576"><c r="XFD1048576"><v>1</v></c></row>', "no column of times"),
        ('<row r="2000000000"><c r="A2000000000"><v>1</v></c></row>', "rows of numbers"),
        ('<row><c r="ALM1"><v>1</v></c></row>' * 1300, "at most 1200000 cells"),
        ("<row/>" * 200_000, "unpacks to"),
    ],
)
def test_a_small_workbook_does_not_unpack_to_gigabytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sheet: str, says: str
) -> None:
    monkeypatch.setattr("pendmap.tables.programs.MOST_CELLS", 1_200_000)
    monkeypatch.setattr("pendmap.tables.table.MOST_BYTES", 1_000_000)
    plain, path = workbook(tmp_path, {"data": [[1.0]]}), tmp_path / "bomb.xlsx"
    with zipfile.ZipFile(plain) as packed, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as bomb:
        for part in packed.namelist():
            content = packed.read(part)
            if part.startswith("xl/worksheets"):
                inner = f"<sheetData>{sheet}</sheetData>".encode()
                content = re.sub(rb"<sheetData>.*</sheetData>", inner, content)
            bomb.writestr(part, content)
    with pytest.raises(pendmap.InputError, match=says):
        pendmap.read_experiment(path)


def test_files_of_a_plain_folder_are_runs_in_the_order_of_names(
    pendmap_command: Command, tmp_path: Path
) -> None:
    folder = tmp_path / "lab"
    folder.mkdir()
    for name, start in (("b.csv", 0.9), ("a.txt", 0.6), ("c.dat", 1.2)):
        (folder / name).write_text(text(clean(start=start)), encoding="utf-8")
    (folder / "notes.txt").write_text("clamped at noon\n", encoding="utf-8")
    (folder / "picture.png").write_bytes(b"\x89PNG")
    shown = pendmap.read_experiment(folder)
    assert [run.name for run in shown.runs] == ["a", "b", "c"]
    assert [round(float(run.theta[0]), 1) for run in shown.runs] == [0.6, 0.9, 1.2]
    assert {run.kind for run in shown.runs} == {"free"}
    said = {finding.what: finding.text for finding in shown.findings}
    assert "no experiment.toml" in said["no-description"]
    assert "notes.txt" in said["file-left-out"]
    assert set(shown.sha256) == {"a.txt", "b.csv", "c.dat"}
    result = json.loads(pendmap_command("look", "lab", "--json").stdout)
    assert [run["name"] for run in result["runs"]] == ["a", "b", "c"]
    for run in (result, *result["runs"]):
        assert set(run) >= FIELDS
    # A file of the folder is an input: it is not written over.
    (tmp_path / "a.png").symlink_to(folder / "b.csv")
    run = pendmap_command("look", folder, "--plot", "a.png")
    assert run.returncode == 2
    assert "is an input" in run.stderr


def test_a_folder_without_a_record_is_refused_in_one_line(tmp_path: Path) -> None:
    for notes in ("", "clamped at noon\n"):
        if notes:
            (tmp_path / "notes.txt").write_text(notes, encoding="utf-8")
        with pytest.raises(pendmap.InputError) as error:
            pendmap.read_experiment(tmp_path)
        assert "has no experiment.toml" in str(error.value)
        assert "\n" not in str(error.value)
        assert not notes or "got 1 file, the first refused: " in str(error.value)


@pytest.mark.parametrize(
    ("head", "decimal"),
    [
        ("", "."),
        ("theta_rad\n", ","),
        ("start_deg, sample_rate, duration\n90, 100, 20 \n", "."),
        ("", ","),
    ],
)
def test_a_column_alone_is_an_angle_at_a_rate(tmp_path: Path, head: str, decimal: str) -> None:
    lines = [f"{value:.6f}".replace(".", decimal) for value in THETA]
    lines[700] = "overrun"  # an unreadable line keeps its sampling instant
    path = tmp_path / "alone.txt"
    path.write_text(head + "\n\n".join(lines) + "\n", encoding="utf-8")
    (run,) = pendmap.read_experiment(path, rate_hz=100).runs
    np.testing.assert_allclose(run.time, np.delete(TIME, 700), atol=1e-9)
    np.testing.assert_allclose(run.theta, np.delete(THETA, 700), atol=2e-6)


def test_a_rate_gives_the_times_unless_a_column_has_them(tmp_path: Path) -> None:
    described = '[columns]\nangle = "w"\nrate_hz = 100\n[[run]]\nfile = "run.csv"\n'
    (run,) = experiment(tmp_path, described, run=text((THETA, THETA), "w,copy")).runs
    np.testing.assert_allclose(run.time, TIME, atol=1e-9)
    (run,) = pendmap.read_experiment(tmp_path, rate_hz=50).runs
    np.testing.assert_allclose(run.time, 2 * TIME, atol=1e-9)
    frame = pd.DataFrame({"theta_deg": np.degrees(THETA)})
    same(pendmap.read_experiment(frame, rate_hz=100).runs[0])
    (tmp_path / "run.csv").write_text(text((TIME, THETA)), encoding="utf-8")
    (run,) = pendmap.read_experiment(tmp_path / "run.csv", rate_hz=1000).runs
    same(run)
    assert "'t_s' has the times" in found(run)["rate-unused"].text


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "must be given, got 1, 2: pendmap look alone.txt --rate 100 --angle 1"),
        *((["--rate", rate], "rate") for rate in ("0", "-5", "1e12", "quick")),
    ],
)
def test_a_rate_that_is_missing_or_invalid_is_named(
    pendmap_command: Command, tmp_path: Path, words: list[str], says: str
) -> None:
    (tmp_path / "alone.txt").write_text(text((THETA, THETA), ""), encoding="utf-8")
    for command in ("identify", "compare", "diagnose"):
        assert "--rate" in pendmap_command(command, "--help").stdout
    run = pendmap_command("look", "alone.txt", *words)
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert says in run.stderr


def test_unused_columns_are_named(tmp_path: Path) -> None:
    names = "t_s,theta_rad,cart_pos_m,motor torque [Nm],still,spare"
    columns = (TIME, THETA, 0.1 * np.sin(TIME), np.cos(TIME), 0 * TIME, TIME**2)
    run = read(tmp_path, text(columns, names))
    shown = pendmap.read_experiment(tmp_path / "record.csv")
    assert run.unused == tuple(names.split(",")[2:])
    assert as_json(shown)["unused"] == list(run.unused)
    assert "not used: 'cart_pos_m', 'motor torque [Nm]', 'still', 'spare'" in as_text(shown)
    assert 'horizontal = "cart_pos_m", unit = "m"' in found(run)["pivot-column"].text
    assert any("no free decay" in line for line in doubts(shown, run))
    described = '[[run]]\nfile = "a.csv"\npivot = { horizontal = "cart_acc", unit = "m/s2" }\n'
    content = text((TIME, THETA, 0 * TIME, np.cos(TIME)), "t_s,theta_rad,torque,cart_acc")
    (run,) = experiment(tmp_path, described, a=content).runs
    assert run.unused == ("torque",)
    assert not {"pivot-column", "motor-column"} & set(found(run))


def test_a_position_of_something_else_is_no_angle(tmp_path: Path) -> None:
    columns = (TIME, np.sin(0.7 * TIME), motion()[2])
    run = read(tmp_path, text(columns, "time,position,velocity"))
    assert "angle" not in run.channels
    assert "may be the angle itself" in found(run)["angle-column"].text


def test_json_keeps_the_contract(pendmap_command: Command, tmp_path: Path) -> None:
    time, theta = clean(duration=30.0)
    rng = np.random.default_rng(1)
    readings = np.concatenate([np.full(200, theta[0]), theta])
    time = np.arange(readings.size) / 100
    even, time = time, time + rng.normal(0, 4e-4, readings.size)
    readings = np.interp(time, even, readings)
    readings[rng.choice(3000, 12)] += 0.6
    kept = np.r_[0:1500, 1570 : readings.size]
    (tmp_path / "odd.csv").write_text(text((time[kept], readings[kept] + 0.02)), encoding="utf-8")
    run = pendmap_command("look", "odd.csv", "--json", "--plot", "a.svg")
    assert run.returncode == 0, run.stderr
    result = json.loads(run.stdout, parse_constant=pytest.fail)
    assert set(result) >= FIELDS
    assert result["channels"] == {"time": "t_s", "angle": "theta_rad"}
    assert result["rate_hz"] == pytest.approx(100, rel=0.01)
    assert 0 < result["noise"]["sigma"] < 0.01
    assert [segment["what"] for segment in result["segments"]] == ["held", "motion"]
    keys = {finding["what"] for finding in result["findings"]}
    assert {"time-gap", "time-jitter", "outliers", "held-start"} <= keys
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.svg", "odd.csv"]


RECORDS = os.environ.get("PENDMAP_RECORDS")


@pytest.mark.skipif(not RECORDS, reason="PENDMAP_RECORDS names no folder of measured records")
@pytest.mark.parametrize(
    ("name", "rate", "count", "noise"),
    [
        ("multiarm_single_free_large.csv", 1000, 0.0, 6e-5),
        ("cartpend_free_long.csv", 50, 2 * np.pi / 4000, 1.7e-3),
        # The residual of a pendulum fitted from 3 to 25 s is 1.04e-3; that part's noise is 1.07e-3.
        ("cartpend_forced_cart_pulse.csv", 50, 2 * np.pi / 4000, 0.85e-3),
    ],
)
def test_measured_records(name: str, rate: float, count: float, noise: float) -> None:
    (run,) = pendmap.read_experiment(Path(RECORDS or "") / name).runs
    assert run.rate_hz == pytest.approx(rate)
    assert run.count_rad == pytest.approx(count, rel=1e-3)
    assert 0.5 < pendmap.noise_floor(run).sigma / noise < 1.5
    assert run.trusted.mean() > 0.9
