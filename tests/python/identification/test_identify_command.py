"""``pendmap identify`` and ``compare``: from a record to a model that every command takes."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import tomllib
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat

import pendmap
from conftest import COMMAND
from decays import decay, record
from fits import TRUTH, written
from pendmap.identification.report import as_json

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

FIELDS = ("w0", "c_over_m", "zeta", "Tr", "theta_r", "stderr", "ci95", "warnings")


@pytest.fixture
def decay_file(tmp_path: Path) -> Path:
    """Return the file of a free decay, of two columns."""
    time, angle = record(decay(), seconds=60, rate=50, seed=3)
    return written(tmp_path / "decay.csv", time, angle)


def test_from_a_record_to_its_basins(
    tmp_path: Path, decay_file: Path, pendmap_command: Run
) -> None:
    before = decay_file.read_bytes()
    run = pendmap_command("identify", decay_file, "--out", "all.nc", "--out", "model.toml")
    assert run.returncode == 0, run.stderr
    assert run.stdout.rstrip().endswith("Written: model.toml, all.nc")
    first, second, third, fourth, *others = re.sub(r"\n +", " ", run.stdout).splitlines()
    pattern = r"w0 = 6\.\d+\(\d+\) rad/s, c/m = 0\.\d+\(\d+\) 1/s, Tr = .* rad/s\^2"
    assert re.fullmatch(pattern, first)
    assert re.fullmatch(r"f = 0\.98\d+\(\d+\) Hz, period 1\.0\d+\(\d+\) s", second)
    assert third.startswith("viscous: zeta = ")
    assert re.match(r"Q = \S+ at 1\.\d+ rad, of all losses, dead band 0\.0\d+\(\d+\) rad", fourth)
    assert any(line.startswith("trajectory: ") for line in others)
    assert "log_decrement" not in run.stdout
    assert decay_file.read_bytes() == before
    files = sorted(path.name for path in tmp_path.iterdir())
    assert files == ["all.nc", "decay.csv", "model.toml"]
    content = tomllib.loads((tmp_path / "model.toml").read_text(encoding="utf-8"))
    for name, true in TRUTH.items():
        low, high = content["covariance"]["ci95"][name]
        assert low < content["pendulum"][name] < high
        assert abs(content["pendulum"][name] - true) < (high - low)
    assert content["covariance"]["names"] == [*TRUTH, "encoder_offset.d"]
    (used,) = content["provenance"]["records"]
    assert used["file"].endswith("decay.csv")
    assert len(used["sha256"]) == 64
    assert "identify" in content["provenance"]["command"]
    report, model = pendmap.load(tmp_path / "all.nc"), pendmap.load_model(tmp_path / "model.toml")
    assert (report.model.w0, report.model.Tr) == (model.w0, model.Tr)
    assert model.notes["covariance"]["matrix"] == report.best.covariance[1].tolist()
    drawn = pendmap_command("plot", "all.nc", "--layer", "peaks", "--out", "peaks.png")
    assert drawn.returncode == 0, drawn.stderr
    drive = ("--stroke-mm", 60, "--frequency-hz", 1.9)
    mapped = pendmap_command("basins", "--model", "model.toml", *drive, "--grid", 20, "--json")
    assert json.loads(mapped.stdout)["cells"] == 400
    compared = pendmap_command("compare", "model.toml", decay_file, "--json")
    (one,) = json.loads(compared.stdout)["runs"]
    assert one["rms"] == pytest.approx(one["noise"], rel=0.05)
    assert one["period_rms_percent"] < 1
    assert {"residual", "periods, rms"} < {row["quantity"] for row in one["quantities"]}


def test_a_long_text_has_corrections_and_every_method(tmp_path: Path, pendmap_command: Run) -> None:
    time, angle = record(decay(), seconds=30, rate=50, seed=3)
    written(tmp_path / "a.csv", 1000 * time, angle)
    run = pendmap_command("identify", "a.csv", "--out", "a.toml", "--verbose")
    assert run.stdout.startswith("w0 = ")
    assert run.stdout.count("a: mended: ") == run.stdout.count("mended: ") == 1
    assert "milliseconds" in run.stdout
    assert "log_decrement" in run.stdout
    assert max(map(len, run.stdout.splitlines())) <= 80


def test_json_has_every_method(decay_file: Path, pendmap_command: Run, tmp_path: Path) -> None:
    run = pendmap_command("identify", decay_file, "--json")
    assert run.returncode == 0, run.stderr
    result: dict[str, Any] = json.loads(run.stdout)
    assert result["best"] == "trajectory"
    assert result["model"] is None
    assert result["with_drag"] is None
    for name in ("combined", "log_decrement", "de_paula", "trajectory", "energy_balance"):
        assert set(FIELDS) <= set(result["methods"][name]), name
    best = result["methods"]["trajectory"]
    assert best["zeta"] == pytest.approx(best["c_over_m"] / (2 * best["w0"]), rel=1e-12)
    assert best["theta_r"] == pytest.approx(best["Tr"] / best["w0"] ** 2, rel=1e-12)
    assert result["methods"]["log_decrement"]["Tr"] is None
    assert result["methods"]["log_decrement"]["theta_r"] is None
    assert [path.name for path in tmp_path.iterdir()] == ["decay.csv"]
    same = as_json(pendmap.identify(decay_file))["methods"]
    assert result["methods"] == json.loads(json.dumps(same))


def test_readings_fit_and_residual_are_written_for_other_tools(
    tmp_path: Path, decay_file: Path, pendmap_command: Run
) -> None:
    outs = [word for end in ("csv", "xlsx", "mat") for word in ("--out", f"fit.{end}")]
    run = pendmap_command("identify", decay_file, "--method", "trajectory", *outs)
    assert run.returncode == 0, run.stderr
    tables = [
        pd.read_csv(tmp_path / "fit.csv"),
        pd.read_excel(tmp_path / "fit.xlsx", engine="openpyxl"),
    ]
    content = loadmat(tmp_path / "fit.mat")
    names = ["time_s", "reading_rad", "fit_rad", "residual_rad"]
    for table in tables:
        assert list(table) == [*names, "run"]
        assert set(table["run"]) == {"decay"}
        for name in names:
            assert table[name].to_numpy() == pytest.approx(content[name].ravel(), abs=1e-12)
    record, table = pd.read_csv(decay_file), tables[0]
    assert table["reading_rad"].to_numpy() == pytest.approx(record["theta_rad"].to_numpy())
    assert np.std(table["residual_rad"]) == pytest.approx(np.radians(0.1), rel=0.05)
    assert (table["reading_rad"] - table["fit_rad"] - table["residual_rad"]).abs().max() < 1e-12


def test_drag_is_tried_where_the_residual_exceeds_the_noise(
    tmp_path: Path, pendmap_command: Run
) -> None:
    rig = ("rig", "free_decay", "--effect", "quadratic_drag", "--size", 3, "--out", "dragged")
    assert pendmap_command(*rig).returncode == 0
    truth = tomllib.loads((tmp_path / "dragged.truth.toml").read_text(encoding="utf-8"))
    q = truth["effect"][0]["parameters"]["q"]
    words = ("identify", "dragged", "--method", "trajectory", "--method", "log_decrement")
    found = json.loads(pendmap_command(*words, "--json").stdout)
    assert list(found["methods"]) == ["trajectory", "log_decrement"]
    assert found["with_drag"]["parameters"]["quadratic_drag.q"] == pytest.approx(q, rel=0.01)
    assert found["with_drag"]["rms"] < 0.5 * found["rms"]
    assert "\nWith quadratic_drag (q = 0.0" in pendmap_command(*words).stdout
    given = json.loads(pendmap_command(*words, "--effect", "quadratic_drag", "--json").stdout)
    low, high = given["methods"]["trajectory"]["ci95"]["quadratic_drag.q"]
    assert low - (high - low) < q < high + (high - low)


def test_no_model_is_written_where_the_search_did_not_converge(
    tmp_path: Path, pendmap_command: Run
) -> None:
    time = np.arange(0, 20, 0.02)
    chirp = 0.6 * np.cos(3 * time + 0.2 * time**2)
    noise = np.random.default_rng(0).normal(0, 1e-3, time.size)
    written(tmp_path / "a.csv", time, chirp + noise)
    for words in ((), ("--effect", "quadratic_drag")):
        run = pendmap_command("identify", "a.csv", *words, "--out", "a.toml")
        assert run.returncode == 2
        assert run.stderr.count("\n") == 1
        assert "trajectory did not converge" in run.stderr
        assert not (tmp_path / "a.toml").exists()


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("identify absent.csv", "absent.csv: No such file"),
        ("identify decay.csv --effect quadratic", "perhaps quadratic_drag"),
        ("identify decay.csv --effect drive_phase", "acts on the drive: it must be"),
        ("identify decay.csv --out model.txt", "suffix must be .toml or .nc or .csv or .xlsx or"),
        ("identify decay.csv --method best", "must be one of trajectory"),
        ("identify forced --method trajectory", "no run is free"),
        ("identify decay.toml --out a.nc --out decay.toml", "'--out': 'decay.toml': is an input"),
        ("identify forced --out forced/experiment.toml", "is an input, which would"),
        ("compare absent.toml decay.csv", "absent.toml: No such file"),
        ("compare bare.toml decay.csv", "bare.toml: has no dimensions, it must be a model in SI"),
        ("compare model.toml forced", "decay: neither its drive nor its pivot is given"),
        ("compare model.png decay.csv --plot model.png", "'model.png': is an input"),
    ],
)
def test_bad_arguments_are_refused_on_one_line(
    tmp_path: Path, decay_file: Path, pendmap_command: Run, words: str, complaint: str
) -> None:
    forced = '[[run]]\nfile = "../decay.csv"\nkind = "forced"\n'
    model = "[pendulum]\nw0 = 6.2\n"
    texts = {"model.toml": model, "model.png": model, "bare.toml": "[pendulum]\ngamma = 0.1\n"}
    texts |= {"decay.toml": decay_file.read_text(), "forced/experiment.toml": forced}
    (tmp_path / "forced").mkdir()
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    run = pendmap_command(*words.split())
    assert run.returncode == 2
    assert complaint in run.stderr
    assert run.stderr.count("\n") == 1
    assert all((tmp_path / name).read_text() == text for name, text in texts.items())
    assert len([*tmp_path.rglob("*")]) == len(texts) + 2


def test_a_wrong_unit_is_reported_first(tmp_path: Path, pendmap_command: Run) -> None:
    time, angle = record(decay(), seconds=10, seed=3)
    (tmp_path / "lab").mkdir()
    written(tmp_path / "lab" / "run.csv", time, np.degrees(angle), names="theta")
    text = '[columns]\nangle = { name = "theta", unit = "rad" }\n[[run]]\nfile = "run.csv"\n'
    (tmp_path / "lab" / "experiment.toml").write_text(text, encoding="utf-8")
    (tmp_path / "model.toml").write_text("[pendulum]\nw0 = 6.2\n", encoding="utf-8")
    for words in ("identify lab --method energy_balance", "compare model.toml lab"):
        text = " ".join(pendmap_command(*words.split()).stdout.split())
        assert re.match("Warning: run: [^:]*: the unit or the scale is wrong", text)
        assert text.count("the unit or the scale is wrong") == 1
    # Nothing is searched where no pendulum swings like this.
    run = pendmap_command("identify", "lab")
    assert run.returncode == 2
    assert re.search("run: swings of 154.2 rad .*: the unit or the scale is wrong", run.stderr)


def test_a_closed_pipe_is_no_failure(decay_file: Path, tmp_path: Path) -> None:
    """The exit code is 128 plus the number of the signal, the convention of shells."""
    words = [COMMAND, "identify", decay_file, "--method", "energy_balance", "--out", "model.toml"]
    read, write = os.pipe()
    os.close(read)
    made = subprocess.run(words, cwd=tmp_path, stdout=write, stderr=subprocess.PIPE, check=False)
    os.close(write)
    assert (made.returncode, made.stderr) == (128 + signal.SIGPIPE, b"")
    assert (tmp_path / "model.toml").is_file()
