"""Files in the formats of common tools, and experiment.toml."""

from __future__ import annotations

import datetime as dt
import hashlib
import re
import sys
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np
import openpyxl
import pandas as pd
import pytest

import pendmap
from pendmap.records import tables as reading
from pendmap.records.summary import as_text
from recorded import clean, experiment, found, motion, noisy, read, text

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap import Run


def same(run: Run, *, within: float = 1e-5, duration: float = 20.0) -> None:
    """Return whether a run equals the clean record."""
    time, theta = clean(duration=duration)
    np.testing.assert_allclose(run.time, time, atol=1e-6)
    np.testing.assert_allclose(run.theta, theta, atol=within)


def phyphox(separator: str, decimal: str) -> str:
    time, _, speed = motion(duration=40.0)
    still = np.random.default_rng(5).normal(0, 0.002, (2, time.size))
    columns = (time, still[0], speed + 0.004, still[1], np.hypot(speed, still[0]))
    names = ["Time (s)", *(f"Gyroscope {axis} (rad/s)" for axis in "xyz"), "Absolute (rad/s)"]
    rows = [
        [f"{value:.9E}".replace(".", decimal) for value in row]
        for row in zip(*columns, strict=True)
    ]
    head = separator.join(f'"{name}"' for name in names)
    return "\n".join([head, *(separator.join(row) for row in rows)]) + "\n"


@pytest.mark.parametrize(
    ("separator", "decimal"), [(",", "."), (";", ","), ("\t", "."), ("\t", ",")]
)
def test_a_file_of_phyphox_is_read(tmp_path: Path, separator: str, decimal: str) -> None:
    run = read(tmp_path, phyphox(separator, decimal))
    _, theta, speed = motion(duration=40.0)
    assert run.channels["velocity"] == "Gyroscope y (rad/s)"
    assert run.velocity is not None
    np.testing.assert_allclose(run.velocity, speed + 0.004, atol=1e-8)
    assert np.sqrt(np.mean((run.theta - theta) ** 2)) < 0.02
    assert found(run)["angle-integrated"].mended


@pytest.mark.parametrize(("separator", "decimal"), [("\t", "."), (",", "."), (";", ",")])
@pytest.mark.parametrize("upward", [True, False])
def test_a_file_of_tracker_is_read(
    tmp_path: Path, separator: str, decimal: str, *, upward: bool
) -> None:
    time, theta, _ = motion(rate=30.0, duration=20.0)
    rng = np.random.default_rng(2)
    x = 320.5 + 210 * np.sin(theta) + rng.normal(0, 0.3, theta.size)
    y = 80.25 + (-1 if upward else 1) * 210 * np.cos(theta) + rng.normal(0, 0.3, theta.size)
    rows = [[f"{v:.6E}".replace(".", decimal) for v in row] for row in zip(time, x, y, strict=True)]
    head = ["mass_A" + separator * 2, separator.join(["t", "x", "y"])]
    run = read(tmp_path, "\n".join([*head, *(separator.join(row) for row in rows)]) + "\n", "a.txt")
    assert np.sqrt(np.mean((run.theta - theta) ** 2)) < 0.004
    said = found(run)["angle-from-pixels"].text
    assert float(said.split("radius ")[1].split(",")[0]) == pytest.approx(210, rel=0.01)
    assert pendmap.noise_floor(run).sigma == pytest.approx(0.3 / 210, rel=0.1)


def test_a_file_of_a_serial_logger_is_read(tmp_path: Path) -> None:
    time, theta = clean()
    lines = [f"{1000 * t:.0f},{a:.5f}" for t, a in zip(time, theta, strict=True)]
    content = "ets Jul 29 2019\r\nrst:0x1\r\n\x00\x00,-0.\r\nREADY\r\n" + "\r\n".join(lines)
    run = read(tmp_path, content[:-3].encode(), "log.txt")
    assert {"nul-bytes", "half-line", "columns-guessed", "time-unit"} <= set(found(run))
    assert run.time[-1] == pytest.approx(19.99)
    np.testing.assert_allclose(run.theta, theta[:-1], atol=1e-5)


def test_parquet_equals_text(tmp_path: Path) -> None:
    time, theta = clean()
    pd.DataFrame({"t_s": time, "theta_rad": theta}).to_parquet(tmp_path / "a.parquet")
    (run,) = pendmap.read_experiment(tmp_path / "a.parquet").runs
    same(run, within=1e-12)
    assert run.sha256 == hashlib.sha256((tmp_path / "a.parquet").read_bytes()).hexdigest()


@pytest.mark.parametrize("indexed", ["t_s", "time", None])
def test_a_data_frame_is_read_as_its_file(tmp_path: Path, indexed: str | None) -> None:
    time, theta = clean()
    frame = pd.DataFrame({"t_s": time, "theta_rad": theta})
    frame.loc[100, "theta_rad"] = np.inf
    frame.loc[200, "theta_rad"] += 3.0
    frame.to_csv(tmp_path / "a.csv", index=False)
    (written,) = pendmap.read_experiment(tmp_path / "a.csv").runs
    if indexed == "t_s":
        frame = frame.set_index("t_s")
    elif indexed == "time":
        dates = pd.Timestamp("2026-05-01") + pd.to_timedelta(time, unit="s")
        frame = frame.drop(columns="t_s").set_axis(dates)
    whole = frame.copy()
    (run,) = pendmap.read_experiment(frame).runs
    pd.testing.assert_frame_equal(frame, whole)
    np.testing.assert_allclose(run.time, written.time, atol=1e-8)
    np.testing.assert_array_equal(run.theta, written.theta)
    np.testing.assert_array_equal(run.trusted, written.trusted)
    assert {"outliers"} <= found(run).keys() == found(written).keys()


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
    time, theta = clean()
    dates = (pd.Timestamp("2026-02-28 23:59:50") + pd.to_timedelta(time, unit="s")).strftime(form)
    rows = [
        f"{d}{separator}{repr(x).replace('.', decimal)}"
        for d, x in zip(dates, theta.tolist(), strict=True)
    ]
    first = [] if head is None else [f"{head}{separator}theta_rad"]
    (tmp_path / "a.csv").write_text("\n".join([*first, *rows]) + "\n", encoding="utf-8")
    (run,) = pendmap.read_experiment(tmp_path / "a.csv").runs
    same(run, within=1e-12)


def test_a_data_frame_without_times_has_a_rate() -> None:
    time, theta = clean()
    frame = pd.DataFrame({"theta_deg": np.degrees(theta)})
    (run,) = pendmap.read_experiment(frame, rate_hz=1 / (time[1] - time[0])).runs
    same(run)


@pytest.mark.parametrize(
    ("records", "says"),
    [
        (pd.DataFrame(), "DataFrame: must have rows of numbers, it is empty"),
        (pd.DataFrame({"t_s": [0.0, 0.1]}), "DataFrame: no column of angles"),
        (np.zeros((9, 2)), "path must be a path or a DataFrame, got array"),
    ],
)
def test_a_data_frame_that_is_no_record_is_refused(records: Any, says: str) -> None:  # noqa: ANN401
    with pytest.raises(pendmap.InputError, match=re.escape(says)):
        pendmap.read_experiment(records)


def test_every_key_of_a_description(tmp_path: Path) -> None:
    time, theta = clean()
    volts = 2.5 + theta / 1.2566
    content = "made by hand\nin spring\nTime;volts\n" + text((1000 * time, volts), "", "%.7f")
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
    read_in = experiment(tmp_path, description, a=semicolons)
    first, second = read_in.runs
    assert (first.name, second.name) == ("a (1)", "a (2)")
    assert (first.time[0], first.time[-1]) == (1.2, 8.0)
    assert (second.lab_time_s, second.hold_out, second.time[0]) == (150.0, True, 8.0)
    np.testing.assert_allclose(first.theta, theta[120:801], atol=1e-6)
    assert read_in.known == {"gravity": 9.81, "length_m": 0.2552, "w0": 6.2}
    assert read_in.sha256["a.csv"] == hashlib.sha256(semicolons.encode()).hexdigest()


def test_drives_and_pivots_are_read(tmp_path: Path) -> None:
    time, theta, _ = motion(drive=(0.3, 12.0, 0.4))
    push = -0.3 * 9.81 * np.cos(12 * time + 0.4)
    description = """
    rig = { gravity = 9.81, w0 = 6.2 }
    [[run]]
    file = "a.csv"
    drive = { p = 0.3, Omega = 12.0 }
    [[run]]
    file = "a.csv"
    kind = "forced"
    pivot = { vertical = "acc_y", unit = "m/s2" }
    """
    content = text((time, noisy(theta), push), "t_s,theta_rad,acc_y")
    first, second = experiment(tmp_path, description, a=content).runs
    assert first.kind == second.kind == "forced"
    assert first.drive == {"p": 0.3, "Omega": 12.0, "phi": None}
    assert second.pivot is not None
    np.testing.assert_allclose(second.pivot["vertical"], push, atol=1e-6)
    assert second.pivot_unit == "m/s2"


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("seconds", [20.0, 84.02])
def test_every_second_row_may_be_of_another_sensor(
    tmp_path: Path, first: int, seconds: float
) -> None:
    time, theta = clean(duration=seconds)
    theta[first::2] = np.nan
    run = read(tmp_path, text((time, theta)))
    assert run.time.size == np.isfinite(theta).sum()
    assert found(run)["angle-missing"].mended


def test_a_pivot_without_unit_and_an_absent_drive_are_reported(tmp_path: Path) -> None:
    time, theta = clean()
    content = text((time, theta, np.cos(time)), "t_s,theta_rad,acc_y")
    described = '[[run]]\nfile = "run.csv"\nkind = "forced"\n'
    (run,) = experiment(tmp_path, described, run=content).runs
    assert "neither drive nor pivot" in found(run)["drive-missing"].text
    described += 'pivot = { vertical = "acc_y" }\n'
    shown = experiment(tmp_path, described, run=content)
    keys = found(shown.runs[0])
    assert "m/s2" in keys["pivot-unit"].text
    assert "drive-missing" not in keys
    assert "pivot     vertical -1 to 1 m/s2" in as_text(shown)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (
            "hold_ot = true",
            "hold_ot is not known, perhaps hold_out is meant: it must be one of file",
        ),
        ('pivot = "pivot_m"', "must be a table like pivot = { vertical"),
        ("from_s = 19.999", "must be times within .*, they leave 1 sample"),
    ],
)
def test_a_refused_description_names_its_fault(tmp_path: Path, line: str, says: str) -> None:
    with pytest.raises(pendmap.InputError, match=says):
        experiment(tmp_path, f'[[run]]\nfile = "run.csv"\n{line}\n', run=text(clean()))


def workbook(folder: Path, sheets: dict[str, list[list[Any]]]) -> Path:
    """Write a workbook."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(folder / "book.xlsx")
    return folder / "book.xlsx"


def test_a_workbook_without_its_reader_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = workbook(tmp_path, {"data": [[1.0, 2.0]]})
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(pendmap.InputError, match=r"with openpyxl: pip install pendmap\[excel\]"):
        pendmap.read_experiment(path)


@pytest.mark.parametrize("clock", ["s", "date"])
def test_a_workbook_is_read_as_its_text_would_be(tmp_path: Path, clock: str) -> None:
    time, theta = clean()
    begin = dt.datetime(2024, 3, 31, 1, 59, 50)  # noqa: DTZ001 (workbooks have no time zone)
    stamps = [begin + dt.timedelta(seconds=t) for t in time] if clock == "date" else time
    rows: list[list[Any]] = [["Pendulum of Monday"], [], ["Time", None, "Angle (deg)"]]
    rows += [[t, None, a] for t, a in zip(stamps, np.degrees(theta), strict=True)]
    path = workbook(tmp_path, {"notes": [["a", 1.0]], "data": rows})
    (run,) = pendmap.read_experiment(path).runs
    np.testing.assert_allclose(run.time - run.time[0], time, atol=2e-3 if clock == "date" else 1e-9)
    np.testing.assert_allclose(run.theta, theta, atol=1e-12)
    assert "'data' is read" in found(run)["sheet-chosen"].text


@pytest.mark.parametrize(
    ("sheet", "says"),
    [
        ('<row r="1048576"><c r="XFD1048576"><v>1</v></c></row>', "no column of times"),
        ('<row r="2000000000"><c r="A2000000000"><v>1</v></c></row>', "rows of numbers"),
        ('<row><c r="ALM1"><v>1</v></c></row>' * 6000, "at most 5000000 cells"),
    ],
)
def test_a_small_workbook_does_not_unpack_to_gigabytes(
    tmp_path: Path, sheet: str, says: str
) -> None:
    plain, path = workbook(tmp_path, {"data": [[1.0]]}), tmp_path / "bomb.xlsx"
    with zipfile.ZipFile(plain) as packed, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as bomb:
        for part in packed.namelist():
            text = packed.read(part)
            if part.startswith("xl/worksheets"):
                rows = f"<sheetData>{sheet}</sheetData>".encode()
                text = re.sub(rb"<sheetData>.*</sheetData>", rows, text)
            bomb.writestr(part, text)
    with pytest.raises(pendmap.InputError, match=says):
        pendmap.read_experiment(path)


def test_a_workbook_that_unpacks_to_too_much_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reading, "MOST_BYTES", 1000)
    with zipfile.ZipFile(tmp_path / "book.xlsx", "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("xl/workbook.xml", bytes(10_000))
    with pytest.raises(pendmap.InputError, match="unpacks to"):
        pendmap.read_experiment(tmp_path / "book.xlsx")
