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
import pytest

import pendmap
from conftest import COMMAND
from decays import decay, record
from fits import written
from pendmap.identification.report import as_json

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

FIELDS = ("w0", "c_over_m", "zeta", "Tr", "theta_r", "stderr", "ci95", "warnings")
TRUTH = {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.08}


@pytest.fixture
def decay_file(tmp_path: Path) -> Path:
    """Return the file of a free decay, of two columns."""
    time, angle = record(decay(), seconds=60, rate=50, seed=3)
    return written(tmp_path / "decay.csv", time, angle)


def test_from_a_record_to_its_basins(
    tmp_path: Path, decay_file: Path, pendmap_command: Run
) -> None:
    before = decay_file.read_bytes()
    run = pendmap_command("identify", decay_file, "--out", "model.toml")
    assert run.returncode == 0, run.stderr
    assert "trajectory" in run.stdout
    assert "Written: model.toml" in run.stdout
    assert decay_file.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["decay.csv", "model.toml"]
    content = tomllib.loads((tmp_path / "model.toml").read_text(encoding="utf-8"))
    for name, true in TRUTH.items():
        low, high = content["covariance"]["ci95"][name]
        assert low < content["pendulum"][name] < high
        assert abs(content["pendulum"][name] - true) < (high - low)
    assert content["covariance"]["names"][:3] == list(TRUTH)
    (used,) = content["provenance"]["records"]
    assert used["file"].endswith("decay.csv")
    assert len(used["sha256"]) == 64
    assert "identify" in content["provenance"]["command"]
    mapped = pendmap_command(
        *("basins", "--model", "model.toml", "--stroke-mm", 60, "--frequency-hz", 1.9),
        *("--grid", 20, "--json"),
    )
    assert mapped.returncode == 0, mapped.stderr
    assert json.loads(mapped.stdout)["cells"] == 400
    compared = pendmap_command("compare", "model.toml", decay_file, "--json")
    assert compared.returncode == 0, compared.stderr
    (one,) = json.loads(compared.stdout)["runs"]
    assert one["rms"] == pytest.approx(one["noise"], rel=0.05)
    assert one["period_rms_percent"] < 1
    assert {"residual", "periods, rms"} < {row["quantity"] for row in one["quantities"]}


def test_the_whole_result_is_written_and_drawn(
    tmp_path: Path, decay_file: Path, pendmap_command: Run
) -> None:
    written = pendmap_command("identify", decay_file, "--out", "all.nc", "--out", "model.toml")
    assert written.stdout.rstrip().endswith("Written: model.toml, all.nc"), written.stderr
    report = pendmap.load(tmp_path / "all.nc")
    kept = pendmap.load_model(tmp_path / "model.toml")
    assert (report.model.w0, report.model.Tr) == (kept.w0, kept.Tr)
    words = ("plot", "all.nc", "--layer", "peaks", "--width", 86, "--out", "peaks.png")
    drawn = pendmap_command(*words)
    assert drawn.returncode == 0, drawn.stderr
    assert (tmp_path / "peaks.png").stat().st_size > 5000


def test_corrections_of_a_record_are_said(tmp_path: Path, pendmap_command: Run) -> None:
    time, angle = record(decay(), seconds=30, rate=50, seed=3)
    written(tmp_path / "a.csv", 1000 * time, angle)
    words = ("identify", "a.csv", "--method", "energy_balance")
    run = pendmap_command(*words, "--json", "--verbose")
    said = pendmap_command(*words, "--out", "a.toml").stdout
    assert "a: mended: " in said
    assert said.count("mended: ") == sum(
        "milliseconds" in f for f in json.loads(run.stdout)["findings"]
    )


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


def test_the_command_says_the_parameters_first(decay_file: Path, pendmap_command: Run) -> None:
    short = pendmap_command("identify", decay_file, "--out", "a.toml")
    first, second, *_ = short.stdout.splitlines()
    pattern = r"w0 = 6\.\d+\(\d+\) rad/s, c/m = 0\.\d+\(\d+\) 1/s, Tr = .* rad/s\^2"
    assert re.fullmatch(pattern, first)
    assert second.startswith("trajectory: ")
    assert "log_decrement" not in short.stdout
    long = pendmap_command("identify", decay_file, "--out", "b.toml", "--verbose")
    assert long.stdout.startswith(f"{first}\n")
    assert "log_decrement" in long.stdout
    assert max(map(len, long.stdout.splitlines())) <= 80


def test_methods_and_an_effect_can_be_chosen(decay_file: Path, pendmap_command: Run) -> None:
    words = ("--method", "trajectory", "--method", "log_decrement", "--effect", "quadratic_drag")
    run = pendmap_command("identify", decay_file, *words, "--json")
    assert run.returncode == 0, run.stderr
    methods = json.loads(run.stdout)["methods"]
    assert list(methods) == ["trajectory", "log_decrement"]
    low, high = methods["trajectory"]["ci95"]["quadratic_drag.q"]
    assert low - (high - low) < 0 < high + (high - low)


def test_drag_is_tried_where_the_residual_exceeds_the_noise(
    tmp_path: Path, pendmap_command: Run
) -> None:
    rig = ("rig", "free_decay", "--effect", "quadratic_drag", "--size", 3, "--out", "dragged")
    assert pendmap_command(*rig).returncode == 0
    truth = tomllib.loads((tmp_path / "dragged.truth.toml").read_text(encoding="utf-8"))
    q = truth["effect"][0]["parameters"]["q"]
    words = ("identify", "dragged", "--method", "trajectory")
    found = json.loads(pendmap_command(*words, "--json").stdout)
    assert found["with_drag"]["parameters"]["quadratic_drag.q"] == pytest.approx(q, rel=0.01)
    assert found["with_drag"]["rms"] < 0.5 * found["rms"]
    assert "\nWith quadratic_drag (q = 0.0" in pendmap_command(*words).stdout


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
        (("identify", "absent.csv"), "absent.csv: No such file"),
        (("identify", "empty.csv"), "empty.csv"),
        (("identify", "vacant"), "has no experiment.toml"),
        (("identify", "decay.csv", "--method", "best"), "must be one of trajectory"),
        (("identify", "decay.csv", "--effect", "quadratic"), "perhaps quadratic_drag"),
        (("identify", "decay.csv", "--effect", "drive_phase"), "acts on the drive: it must be"),
        (("identify", "decay.csv", "--out", "model.csv"), "suffix must be .toml or .nc or"),
        (("identify", "decay.toml", "--out", "decay.toml", "--out", "decay.nc"), "is an input"),
        (("identify", "forced"), "no run is free"),
        (("compare", "absent.toml", "decay.csv"), "absent.toml: No such file"),
        (
            ("compare", "bare.toml", "decay.csv"),
            "bare.toml: has no dimensions, it must be a model in SI",
        ),
        (("compare", "model.toml", "idle"), "run_00: neither its drive nor its pivot is given"),
        (("compare", "model.png", "decay.csv", "--plot", "model.png"), "'model.png': is an input"),
        (("identify", "forced", "--out", "forced/experiment.toml"), "is an input, which would"),
        (("identify", "decay.toml", "--out", "decay.toml"), "'--out': 'decay.toml': is an input"),
        (("look", "decay.png", "--plot", "./decay.png"), "'--plot': 'decay.png': is an input"),
    ],
)
def test_bad_arguments_are_refused_on_one_line(
    tmp_path: Path,
    decay_file: Path,
    pendmap_command: Run,
    words: tuple[str, ...],
    complaint: str,
) -> None:
    (tmp_path / "vacant").mkdir()
    (tmp_path / "empty.csv").write_text("", encoding="utf-8")
    (tmp_path / "bare.toml").write_text("[pendulum]\ngamma = 0.1\n", encoding="utf-8")
    (tmp_path / "model.toml").write_text("[pendulum]\nw0 = 6.2\n", encoding="utf-8")
    (tmp_path / "model.png").write_text("[pendulum]\nw0 = 6.2\n", encoding="utf-8")
    for name in ("decay.toml", "decay.png"):
        (tmp_path / name).write_bytes(decay_file.read_bytes())
    for name, drive in (("forced", "drive = { p = 0.2, Omega = 12.0 }\n"), ("idle", "")):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "run_00.csv").write_bytes(decay_file.read_bytes())
        (folder / "experiment.toml").write_text(
            f'[[run]]\nfile = "run_00.csv"\nkind = "forced"\n{drive}', encoding="utf-8"
        )
    before = {path: path.is_file() and path.read_bytes() for path in tmp_path.rglob("*")}
    run = pendmap_command(*words)
    assert run.returncode == 2
    assert complaint in run.stderr
    assert run.stderr.count("\n") == 1
    after = {path: path.is_file() and path.read_bytes() for path in tmp_path.rglob("*")}
    assert after == before


@pytest.mark.parametrize(
    "words", [("identify", "lab", "--method", "energy_balance"), ("compare", "model.toml", "lab")]
)
def test_a_wrong_unit_is_reported_first(
    words: tuple[str, ...], tmp_path: Path, pendmap_command: Run
) -> None:
    time, angle = record(decay(), seconds=20, seed=3)
    lab = tmp_path / "lab"
    lab.mkdir()
    written(lab / "run.csv", time, np.degrees(angle), names="theta")
    (lab / "experiment.toml").write_text(
        '[columns]\nangle = { name = "theta", unit = "rad" }\n[[run]]\nfile = "run.csv"\n',
        encoding="utf-8",
    )
    (tmp_path / "model.toml").write_text("[pendulum]\nw0 = 6.2\n", encoding="utf-8")
    run = pendmap_command(*words)
    said = " ".join(run.stdout.split())
    assert re.match("Warning: run: [^:]*: the unit or the scale is wrong", said)
    assert said.count("the unit or the scale is wrong") == 1


def test_a_closed_pipe_is_no_failure(decay_file: Path, tmp_path: Path) -> None:
    """The exit code is 128 plus the number of the signal, the convention of shells."""
    words = ["identify", decay_file, "--method", "energy_balance", "--out", "model.toml"]
    read, write = os.pipe()
    os.close(read)
    made = subprocess.run(
        [str(COMMAND), *map(str, words)],
        cwd=tmp_path,
        stdout=write,
        stderr=subprocess.PIPE,
        check=False,
        text=True,
    )
    os.close(write)
    assert (made.returncode, made.stderr) == (128 + signal.SIGPIPE, "")
    assert (tmp_path / "model.toml").is_file()
