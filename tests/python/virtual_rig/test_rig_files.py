"""`pendmap rig`: files, refusals, interrupts."""

from __future__ import annotations

import json
import math
import signal
import subprocess
import time
from typing import TYPE_CHECKING

import numpy as np
import pytest

from conftest import COMMAND
from interrupted import any_file, started
from pendmap.virtual_rig import EFFECTS, PRESETS, Request, make
from rigs import read_toml, record

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run


def test_an_experiment_is_a_folder_and_a_separate_file_of_its_truth(
    pendmap_command: Run, tmp_path: Path
) -> None:
    run = pendmap_command("rig", "hidden", "--seed", 1, "--out", "lab", "--json")
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout) == {"experiment": "lab", "truth": "lab.truth.toml"}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["lab", "lab.truth.toml"]
    description = read_toml(tmp_path / "lab" / "experiment.toml")
    files = {entry["file"] for entry in description["run"]}
    assert {path.name for path in (tmp_path / "lab").iterdir()} == {*files, "experiment.toml"}
    kinds = [entry["kind"] for entry in description["run"]]
    assert (kinds.count("free"), kinds.count("forced")) == (5, 4)
    assert description["rig"]["encoder_counts"] == 4096
    begins = [entry["lab_time_s"] for entry in description["run"]]
    for entry, begin, later in zip(
        description["run"], begins, [*begins[1:], math.inf], strict=True
    ):
        rows = record(tmp_path / "lab" / entry["file"])
        assert 15 <= rows[-1, 0] <= 30
        assert np.diff(rows[:, 0]) == pytest.approx(0.01, abs=1e-9)
        assert begin + rows[-1, 0] < later
        assert ("drive" in entry) == (entry["kind"] == "forced")
        if "drive" in entry:
            assert set(entry["drive"]) == {"p", "Omega", "phi"}
    truth = read_toml(tmp_path / "lab.truth.toml")
    (effect,) = truth["effect"]
    hidden = (tmp_path / "lab" / "experiment.toml").read_text(encoding="utf-8")
    assert effect["name"] not in hidden + run.stdout + run.stderr
    assert effect["name"] in {name.split(":")[0] for name in EFFECTS}
    assert 0.05 <= truth["sensor"]["noise_deg"] <= 0.5
    assert {"w0", "c_over_m", "Tr"} <= set(truth["pendulum"])


def test_the_same_seed_gives_the_same_bytes(rig: Run, tmp_path: Path) -> None:
    for seed, out in ((3, "a"), (3, "b"), (4, "c")):
        run = rig("hidden", "--seed", seed, "--duration", 3, "--out", out)
        assert run.returncode == 0, run.stderr
    one, same, other = (
        [p.read_bytes() for p in sorted((tmp_path / name).iterdir())] for name in "abc"
    )
    assert one == same
    assert one != other
    truths = [(tmp_path / f"{name}.truth.toml").read_bytes() for name in "abc"]
    assert truths[0] == truths[1] != truths[2]


def test_a_record_keeps_full_precision(rig: Run, tmp_path: Path) -> None:
    words = ("--duration", 2, "--seed", 5, "--effect", "none", "--free", 1, "--forced", 0)
    for counts in (0, 4096):
        rig("hidden", *words, "--counts", counts, "--out", f"lab{counts}")
        (run,) = make(
            Request("hidden", 5, ("none",), free=1, forced=0, duration=2.0, counts=counts)
        ).runs
        rows = record(tmp_path / f"lab{counts}" / "run_00.csv")
        assert rows[:, 0] == pytest.approx(run.time, abs=1e-6)
        assert rows[:, 1] == pytest.approx(run.angle, rel=1e-11)


def test_the_list_names_every_effect(rig: Run) -> None:
    text = rig("--list").stdout
    listed = json.loads(rig("--list", "--json").stdout)["effects"]
    assert [effect["name"] for effect in listed] == list(EFFECTS)
    for effect in listed:
        assert effect["name"] in text
        assert effect["formula"] in text
    for preset in PRESETS:
        assert preset in rig("--help").stdout


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("rig", "NAME"),
        ("rig hidden", "--out"),
        ("rig hiden --out x", "hiden"),
        ("rig hidden --out x --effect quadratic_drga", "quadratic_drag"),
        ("rig hidden --out x --effect magnet,A=1", "amplitude, width"),
        ("rig hidden --out x --effect magnet,amplitude=nan", "finite"),
        ("rig hidden --out x --effect pivot_compliance,mu=2", "0 to 0.3"),
        ("rig hidden --out x --effect magnet --effect magnet:dipole", "twice"),
        ("rig free_decay --out x --effect drive_phase", "forced"),
        ("rig hidden --out x --effect load_dependent_friction --size 100", "Tr"),
        ("rig hidden --out x --size 0", "0"),
        ("rig forced --out x --size 1e6", "must be 1 where no size of an effect is drawn, got"),
        ("rig hidden --out x --effect impulses,J=0.02 --size 2", "no size of an effect is drawn"),
        ("rig hidden --out x --noise 0 --correlation 0.5", "without noise"),
        ("rig hidden --out x --free 0 --forced 0", "1 to 99"),
        ("rig hidden --out x --w0 0", "0.1 to 100"),
        ("rig hidden --out x --rate 1e5 --duration 3600", "up to"),
        ("rig hidden --out x --tr=-1", "-1"),
        ("rig hidden --out no/such/x", "no/such"),
    ],
)
def test_bad_input_gets_one_line_and_leaves_nothing(
    rig: Run, tmp_path: Path, words: str, complaint: str
) -> None:
    run = rig(*words.split()[1:])
    assert run.returncode == 2
    assert run.stdout == ""
    assert len(run.stderr.strip().splitlines()) == 1, run.stderr
    assert complaint in run.stderr
    assert list(tmp_path.iterdir()) == []


def test_an_experiment_is_replaced_only_on_request(rig: Run, tmp_path: Path) -> None:
    words = ("hidden", "--duration", 1, "--out", "lab")
    (tmp_path / "lab").mkdir()
    assert rig(*words).returncode == 0  # an empty folder is free
    before = {p: p.read_bytes() for p in (tmp_path / "lab").iterdir()}
    refused = rig(*words, "--seed", 2)
    assert refused.returncode == 2
    assert "--overwrite" in refused.stderr
    assert len(refused.stderr.strip().splitlines()) == 1
    assert {p: p.read_bytes() for p in (tmp_path / "lab").iterdir()} == before
    assert rig(*words, "--seed", 2, "--overwrite").returncode == 0
    assert {p: p.read_bytes() for p in (tmp_path / "lab").iterdir()} != before
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "thesis.txt").write_text("text", encoding="utf-8")
    kept = rig("hidden", "--out", "home", "--overwrite")
    assert kept.returncode == 2
    assert "not an experiment" in kept.stderr
    assert (tmp_path / "home" / "thesis.txt").exists()
    (tmp_path / "file").write_text("text", encoding="utf-8")
    assert rig("hidden", "--out", "file").returncode == 2


@pytest.mark.parametrize("moment", ["computing", "writing"])
def test_an_interrupt_leaves_no_partial_file(tmp_path: Path, moment: str) -> None:
    runs = ["--free", "60", "--duration", "200"] if moment == "computing" else ["--rate", "2000"]
    words = [str(COMMAND), "rig", "hidden", *runs, "--out", "lab"]
    with started(words, cwd=tmp_path, stderr=subprocess.PIPE) as process:
        if moment == "computing":
            time.sleep(1.2)
        while (
            moment == "writing"
            and process.poll() is None
            and not any_file(tmp_path, ".pendmap-*/new/*")
        ):
            time.sleep(0.001)
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "Traceback" not in stderr
    if moment == "computing":
        assert "nothing was written" in stderr
        assert list(tmp_path.iterdir()) == []
    else:
        assert "lab, lab.truth.toml written" in stderr
        assert sorted(p.name for p in tmp_path.iterdir()) == ["lab", "lab.truth.toml"]
        assert len(list((tmp_path / "lab").iterdir())) == 10


def test_one_run_is_held_out_of_each_kind_with_three(rig: Run, tmp_path: Path) -> None:
    counts = {(5, 4): (1, 1), (3, 2): (1, 0), (2, 2): (0, 0), (0, 3): (0, 1)}
    for (free, forced), held in counts.items():
        words = ("--free", free, "--forced", forced, "--duration", 1, "--overwrite")
        assert rig("hidden", "--effect", "none", *words, "--out", "lab").returncode == 0
        runs = read_toml(tmp_path / "lab" / "experiment.toml")["run"]
        out = [run["kind"] for run in runs if run.get("hold_out", False)]
        assert (out.count("free"), out.count("forced")) == held


def test_records_are_drawn(rig: Run, tmp_path: Path) -> None:
    words = ("hidden", "--duration", 2, "--dropouts", 0.1, "--seed", 1, "--out", "lab")
    run = rig(*words, "--plot", "runs.svg", "--json")
    assert run.returncode == 0, run.stderr
    written = {"experiment": "lab", "truth": "lab.truth.toml", "plot": "runs.svg"}
    assert json.loads(run.stdout) == written
    assert (tmp_path / "runs.svg").read_bytes().startswith(b"<?xml")
    assert "runs.png" in rig(*words, "--overwrite", "--plot", "runs.png").stdout
    for name in ("runs.jpg", "no/runs.png"):
        refused = rig(*words[:-1], "other", "--plot", name)
        assert refused.returncode == 2
        assert name in refused.stderr
    assert not (tmp_path / "other").exists()
