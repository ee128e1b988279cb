"""Files without a description: folders, records without times, unused columns."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from pendmap.records.summary import as_json, as_text, doubts
from recorded import clean, experiment, found, motion, read, text

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run


def test_files_of_a_plain_folder_are_runs_in_the_order_of_names(tmp_path: Path) -> None:
    for name, start in (("b.csv", 0.9), ("a.txt", 0.6), ("c.dat", 1.2)):
        (tmp_path / name).write_text(text(clean(start=start)), encoding="utf-8")
    (tmp_path / "notes.txt").write_text("clamped at noon\n", encoding="utf-8")
    (tmp_path / "picture.png").write_bytes(b"\x89PNG")
    shown = pendmap.read_experiment(tmp_path)
    assert [run.name for run in shown.runs] == ["a", "b", "c"]
    assert [round(float(run.theta[0]), 1) for run in shown.runs] == [0.6, 0.9, 1.2]
    assert {run.kind for run in shown.runs} == {"free"}
    said = {finding.what: finding.text for finding in shown.findings}
    assert "no experiment.toml" in said["no-description"]
    assert "notes.txt" in said["file-left-out"]
    assert set(shown.sha256) == {"a.txt", "b.csv", "c.dat"}


def test_a_folder_without_a_record_is_refused_in_one_line(
    pendmap_command: Run, tmp_path: Path
) -> None:
    folder = tmp_path / "lab"
    folder.mkdir()
    for wrong in (None, "clamped at noon\n"):
        if wrong:
            (folder / "notes.txt").write_text(wrong, encoding="utf-8")
        run = pendmap_command("identify", folder)
        assert run.returncode == 2
        assert run.stderr.count("\n") == 1
        assert "has no experiment.toml" in run.stderr
    assert "got 1 file, the first refused: " in run.stderr
    assert "notes.txt" in run.stderr


def test_a_file_of_a_plain_folder_is_never_written_over(
    pendmap_command: Run, tmp_path: Path
) -> None:
    folder = tmp_path / "lab"
    folder.mkdir()
    (folder / "a.csv").write_text(text(clean()), encoding="utf-8")
    (tmp_path / "a.png").symlink_to(folder / "a.csv")
    run = pendmap_command("look", folder, "--plot", "a.png")
    assert run.returncode == 2
    assert "is an input" in run.stderr


HEADS = {
    "nothing above": "",
    "a name": "theta_rad\n",
    "names and values of settings": "start_deg, sample_rate, duration\n90, 100, 20 \n",
}


@pytest.mark.parametrize("head", HEADS.values(), ids=HEADS)
@pytest.mark.parametrize("decimal", [".", ","])
def test_a_column_alone_is_an_angle_at_a_rate(tmp_path: Path, head: str, decimal: str) -> None:
    time, theta = clean()
    lines = [f"{value:.6f}".replace(".", decimal) for value in theta]
    path = tmp_path / "alone.txt"
    path.write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    (run,) = pendmap.read_experiment(path, rate_hz=100).runs
    np.testing.assert_allclose(run.time, time, atol=1e-9)
    np.testing.assert_allclose(run.theta, theta, atol=2e-6)
    assert run.rate_hz == pytest.approx(100)


def test_an_unreadable_line_keeps_its_sampling_instant(tmp_path: Path) -> None:
    time, theta = clean()
    lines = [f"{value:.6f}" for value in theta]
    lines[700] = "overrun"
    path = tmp_path / "alone.txt"
    path.write_text("\n\n".join(lines), encoding="utf-8")
    (run,) = pendmap.read_experiment(path, rate_hz=100).runs
    np.testing.assert_allclose(run.time, np.delete(time, 700), atol=1e-9)


def test_a_rate_in_a_description_gives_the_times_and_an_option_overrides_it(tmp_path: Path) -> None:
    time, theta = clean()
    described = '[columns]\nangle = "w"\nrate_hz = 100\n[[run]]\nfile = "run.csv"\n'
    content = text((theta, theta), "w,copy")
    (run,) = experiment(tmp_path, described, run=content).runs
    np.testing.assert_allclose(run.time, time, atol=1e-9)
    (run,) = pendmap.read_experiment(tmp_path, rate_hz=50).runs
    np.testing.assert_allclose(run.time, 2 * time, atol=1e-9)


def test_a_column_of_times_overrides_a_rate(tmp_path: Path) -> None:
    time, theta = clean()
    path = tmp_path / "timed.csv"
    path.write_text(text((time, theta)), encoding="utf-8")
    (run,) = pendmap.read_experiment(path, rate_hz=1000).runs
    np.testing.assert_allclose(run.time, time, atol=1e-6)
    assert "'t_s' has the times" in found(run)["rate-unused"].text


@pytest.mark.parametrize("columns", [1, 2])
def test_without_times_and_rate_both_ways_are_named(
    pendmap_command: Run, tmp_path: Path, columns: int
) -> None:
    path = tmp_path / "alone.txt"
    path.write_text(text((clean()[1],) * columns, ""), encoding="utf-8")
    run = pendmap_command("identify", path)
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert "--rate 1000" in run.stderr
    assert "rate_hz = 1000" in run.stderr


@pytest.mark.parametrize("rate", ["0", "-5", "1e12", "quick"])
def test_an_invalid_rate_is_refused(pendmap_command: Run, tmp_path: Path, rate: str) -> None:
    path = tmp_path / "alone.txt"
    path.write_text(text((clean()[1],), ""), encoding="utf-8")
    run = pendmap_command("look", path, f"--rate={rate}")
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1


def test_the_rate_reaches_each_command(pendmap_command: Run, tmp_path: Path) -> None:
    path = tmp_path / "alone.txt"
    path.write_text(text((clean()[1],), ""), encoding="utf-8")
    run = pendmap_command("identify", path, "--rate", "100", "--out", "model.toml", "--json")
    assert run.returncode == 0, run.stderr
    low, high = json.loads(run.stdout)["methods"]["trajectory"]["ci95"]["w0"]
    assert low - 0.001 < 6.2 < high + 0.001
    run = pendmap_command("compare", "model.toml", path, "--rate", "100", "--json")
    assert run.returncode == 0, run.stderr
    assert "--rate" in pendmap_command("diagnose", "--help").stdout


def test_unused_columns_are_named(tmp_path: Path) -> None:
    time, theta = clean()
    names = "t_s,theta_rad,cart_pos_m,motor torque [Nm],still,spare"
    columns = (time, theta, 0.1 * np.sin(time), np.cos(time), 0 * time, time**2)
    run = read(tmp_path, text(columns, names))
    shown = pendmap.read_experiment(tmp_path / "record.csv")
    assert run.unused == tuple(names.split(",")[2:])
    assert as_json(shown)["unused"] == list(run.unused)
    assert "not used: 'cart_pos_m', 'motor torque [Nm]', 'still', 'spare'" in as_text(shown)
    said = found(run)
    assert 'horizontal = "cart_pos_m", unit = "m"' in said["pivot-column"].text
    assert "no free decay" in said["motor-column"].text
    assert any("no free decay" in line for line in doubts(shown, run))


def test_used_or_constant_columns_are_not_reported(tmp_path: Path) -> None:
    time, theta = clean()
    content = text((time, theta, 0 * time, np.cos(time)), "t_s,theta_rad,torque,cart_acc")
    run = read(tmp_path, content)
    assert "motor-column" not in found(run)
    described = '[[run]]\nfile = "run.csv"\npivot = { horizontal = "cart_acc", unit = "m/s2" }\n'
    (run,) = experiment(tmp_path, described, run=content).runs
    assert run.unused == ("torque",)
    assert not {"pivot-column", "motor-column"} & set(found(run))


def test_a_position_of_something_else_is_no_angle(tmp_path: Path) -> None:
    time, _, speed = motion()
    run = read(tmp_path, text((time, np.sin(0.7 * time), speed), "time,position,velocity"))
    assert "angle" not in run.channels
    assert "may be the angle itself" in found(run)["angle-column"].text
