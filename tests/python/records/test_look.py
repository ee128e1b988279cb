"""``pendmap look`` from the point of view of a user, and its figure."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib import rc_context

import pendmap
from pendmap import render
from pendmap.charts import record
from pendmap.render import drawing, style
from recorded import clean, text

if TYPE_CHECKING:
    from conftest import Run

RECORDS = os.environ.get("PENDMAP_RECORDS")
FIELDS = {"channels", "rate_hz", "noise", "segments", "findings"}


def odd(folder: Path) -> Path:
    """Write a record with many findings."""
    time, theta = clean(duration=30.0)
    rng = np.random.default_rng(1)
    readings = np.concatenate([np.full(200, theta[0]), theta])
    time = np.arange(readings.size) / 100 + rng.normal(0, 4e-4, readings.size)
    readings[rng.choice(3000, 12)] += 0.6
    kept = np.r_[0:1500, 1570 : readings.size]
    path = folder / "odd.csv"
    path.write_text(text((time[kept], readings[kept] + 0.02)), encoding="utf-8")
    return path


def folder_of(tmp_path: Path, runs: int) -> Path:
    folder = tmp_path / "lab"
    folder.mkdir()
    entries = []
    for k in range(runs):
        (folder / f"run_{k:02d}.csv").write_text(text(clean(start=0.5 + 0.1 * k)), encoding="utf-8")
        entries.append(f'[[run]]\nfile = "run_{k:02d}.csv"\nlab_time_s = {60 * k}\n')
    (folder / "experiment.toml").write_text(
        "[rig]\nw0 = 6.2\n" + "".join(entries), encoding="utf-8"
    )
    return folder


def test_json_keeps_the_contract(pendmap_command: Run, tmp_path: Path) -> None:
    run = pendmap_command("look", odd(tmp_path), "--json")
    assert run.returncode == 0, run.stderr
    result = json.loads(run.stdout, parse_constant=pytest.fail)
    assert set(result) >= FIELDS
    assert result["channels"] == {"time": "t_s", "angle": "theta_rad"}
    assert result["rate_hz"] == pytest.approx(100, rel=0.01)
    assert 0 < result["noise"]["sigma"] < 0.01
    assert [segment["what"] for segment in result["segments"]] == ["held", "motion"]
    keys = {finding["what"] for finding in result["findings"]}
    assert {"time-gap", "time-jitter", "outliers", "held-start", "zero-offset"} <= keys
    assert [path.name for path in tmp_path.iterdir()] == ["odd.csv"]


def test_a_folder_lists_each_run(pendmap_command: Run, tmp_path: Path) -> None:
    folder = folder_of(tmp_path, 3)
    result = json.loads(pendmap_command("look", folder, "--json").stdout)
    assert set(result) >= FIELDS
    assert [run["name"] for run in result["runs"]] == ["run_00", "run_01", "run_02"]
    for run in result["runs"]:
        assert set(run) >= FIELDS
    said = pendmap_command("look", folder).stdout
    assert "run_02 (free)" in said
    assert "w0 6.2" in said


def test_a_figure_is_written(pendmap_command: Run, tmp_path: Path) -> None:
    path = odd(tmp_path)
    run = pendmap_command("look", path, "--plot", "a.png", "--quiet")
    assert run.returncode == 0, run.stderr
    assert run.stdout == ""
    for suffix in (".svg", ".pdf"):
        render.draw(pendmap.read_experiment(path), tmp_path / f"a{suffix}")
    for suffix in (".png", ".svg", ".pdf"):
        assert (tmp_path / f"a{suffix}").stat().st_size > 5000


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("nothing.csv", None, "No such file"),
        ("words.csv", b"a,b\nc,d\n", "no rows of numbers"),
        (".", None, "experiment.toml"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(
    pendmap_command: Run, tmp_path: Path, name: str, content: bytes | None, says: str
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    run = pendmap_command("look", name, "--plot", "a.png")
    assert run.returncode == 2
    assert says in run.stderr
    assert run.stderr.count("\n") == 1
    assert not (tmp_path / "a.png").exists()


def drawn(experiment: pendmap.Experiment, **given: Any) -> Any:  # noqa: ANN401
    with rc_context(style.RC):
        figure = drawing.draw(record.sheet(experiment), dpi=100.0, **given)
        figure.canvas.draw()
    return figure


def several(tmp_path: Path) -> dict[str, pendmap.Experiment]:
    peaks = tmp_path / "peaks.csv"
    place = 0.5 * np.arange(30)
    peaks.write_text(text((place, np.exp(-0.03 * place) * (-1.0) ** np.arange(30)), "t_s,peak_rad"))
    plain = tmp_path / "plain.csv"
    plain.write_text(text(clean()))
    few = tmp_path / "few.csv"
    few.write_text(text(tuple(part[:7] for part in clean())))
    paths = (odd(tmp_path), plain, peaks, few, folder_of(tmp_path, 4))
    return {path.stem: pendmap.read_experiment(path) for path in paths}


def test_a_figure_may_be_small(tmp_path: Path) -> None:
    for experiment in several(tmp_path).values():
        assert drawn(experiment, size=(2.0, 2.0)).get_size_inches() == pytest.approx([2.0, 2.0])


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


def test_a_forced_record_that_flickers_by_a_count_at_rest_is_looked_at(
    pendmap_command: Run, tmp_path: Path
) -> None:
    """The record has noise, but no velocities from which to estimate jitter."""
    readings = 0.001534 * np.random.default_rng(0).integers(0, 2, 2000)
    (tmp_path / "run_00.csv").write_text(text((np.arange(2000) / 100, readings)), encoding="utf-8")
    (tmp_path / "experiment.toml").write_text(
        '[rig]\nencoder_counts = 4096\n[[run]]\nfile = "run_00.csv"\nkind = "forced"\n'
        "drive = { p = 0.5, Omega = 12.0, phi = 0.0 }\n",
        encoding="utf-8",
    )
    run = pendmap_command("look", tmp_path)
    assert run.returncode == 0, run.stderr
    assert "noise" in run.stdout
