"""``pendmap diagnose`` on the command line: JSON, model file, refusals."""

from __future__ import annotations

import json
import math
import re
import sys
import tomllib
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap.diagnosis
from bumpy import FILE
from hidden import once
from pendmap import cli
from recorded import clean
from recorded import text as csv

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

FIELDS = (
    "verdict",
    "effects",
    "equivalent",
    "model",
    "gap",
    "where",
    "next_experiment",
    "detection_limits",
)
GAP = ("noise_floor", "before", "after", "held_out_before", "held_out_after")


@pytest.fixture
def hidden(pendmap_command: Run) -> str:
    """Return the folder of an experiment with a hidden drag."""
    made = pendmap_command(
        *("rig", "hidden", "--effect", "quadratic_drag", "--seed", "3", "--out", "hidden")
    )
    assert made.returncode == 0, made.stderr
    return "hidden"


def test_json_and_a_model_that_every_command_takes(
    tmp_path: Path, hidden: str, pendmap_command: Run
) -> None:
    run = pendmap_command("diagnose", hidden, "--json")
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    assert all(field in found for field in FIELDS)
    assert all(field in found["gap"] for field in GAP)
    assert found["verdict"] == "named"
    (effect,) = found["effects"]
    assert effect["name"] == "quadratic_drag"
    low, high = effect["ci95"]["q"]
    assert low < effect["parameters"]["q"] < high
    assert found["detection_limits"]["bearing_harmonic"] > 0
    # The model file named in it exists; --json alone writes no other file.
    made = {path.name for path in tmp_path.iterdir()} - {"hidden", "hidden.truth.toml"}
    assert made == {found["model"]} == {"diagnose.toml"}
    path = tmp_path / found["model"]
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    assert content["effect"][0]["probability"] == effect["probability"]
    names = content["covariance"]["names"]
    assert "quadratic_drag.q" in names
    assert len(content["covariance"]["matrix"]) == len(names)
    place = names.index("quadratic_drag.q")
    deviation = math.sqrt(content["covariance"]["matrix"][place][place])
    assert high - low == pytest.approx(2 * 1.96 * deviation, rel=1e-4)
    assert found["parameters"]["quadratic_drag.q"]["stderr"] == pytest.approx(deviation, rel=1e-9)
    assert content["provenance"]["verdict"] == "named"
    assert content["provenance"]["records"][0]["sha256"]
    assert pendmap.load_model(path).effects[0].name == "quadratic_drag"
    moved = pendmap_command("simulate", "--model", found["model"], "--until", "5", "--json")
    assert moved.returncode == 0, moved.stderr
    # A diagnosis of the same records with the new model names nothing.
    more = pendmap_command(
        *("diagnose", hidden, "--model", found["model"], "--json"),
        *("--out", "b.toml", "--out", "b.nc"),
    )
    again = pendmap.load(tmp_path / "b.nc")
    assert json.loads(more.stdout)["verdict"] == again.verdict == "none"
    assert again.model.effects == pendmap.load_model(tmp_path / "b.toml").effects


@pytest.mark.thorough
def test_a_viscous_model_lacks_coulomb_friction(tmp_path: Path, pendmap_command: Run) -> None:
    made = pendmap_command("rig", "hidden", "--effect", "none", "--seed", "5", "--out", "plain")
    assert made.returncode == 0, made.stderr
    (tmp_path / "viscous.toml").write_text(
        "[pendulum]\nw0 = 6.2\nc_over_m = 0.1\n", encoding="utf-8"
    )
    run = pendmap_command("diagnose", "plain", "--model", "viscous.toml", "--json")
    found = json.loads(run.stdout)
    assert [effect["name"] for effect in found["effects"]] == ["coulomb_friction"]
    assert found["verdict"] == "named"
    model = pendmap.load_model(tmp_path / found["model"])
    assert model.effects[0].parameters["theta_r"] == found["effects"][0]["parameters"]["theta_r"]


def test_the_verdict_comes_first(
    tmp_path: Path, hidden: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # Other tests use the diagnosis of these records too.
    found = once("quadratic_drag", seed=3)
    monkeypatch.setattr(pendmap.diagnosis, "diagnose", lambda *_given, **_named: found)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["pendmap", "diagnose", hidden, "--out", "found.toml"])
    with pytest.raises(SystemExit) as end:
        cli.run()
    said = capsys.readouterr().out
    joined = re.sub(r"\n {4}", " ", said)
    assert not end.value.code
    assert said.startswith("Verdict: named")
    assert "Written: found.toml" in said
    # Numbers have the units stated in the report.
    assert re.search(
        r"^  quadratic_drag: q = \S+ 1/rad \[\S+, \S+\]; closes \d+ % of .*; probability 0\.\d+",
        joined,
        re.MULTILINE,
    )
    ranked = said.partition("candidate")[2].splitlines()
    shapes = [line for line in ranked if " w = " in line]
    assert shapes
    assert all(re.search(r"th0 = \S+ rad, w = \S+ rad\b", line) for line in shapes)
    assert re.search(r"^Share of the squared gap closed: \d+ %$", said, re.MULTILINE)


@pytest.mark.parametrize(
    "given",
    [
        ("absent",),
        ("hidden", "--without", "friction"),
        ("hidden", "--max-effects", "-1"),
        ("hidden", "--model", "absent.toml"),
        ("hidden", "--out", "model.png"),
    ],
)
def test_bad_input_is_refused_on_one_line(
    given: tuple[str, ...], tmp_path: Path, pendmap_command: Run
) -> None:
    (tmp_path / "hidden").mkdir()
    run = pendmap_command("diagnose", *given)
    assert run.returncode == 2
    assert "Traceback" not in run.stderr
    assert not list(tmp_path.glob("*.toml"))


def test_help_says_which_files_json_alone_writes(pendmap_command: Run) -> None:
    said = " ".join(pendmap_command("diagnose", "--help").stdout.split())
    assert "One JSON object on stdout; alone, no file but the model." in said


@pytest.mark.parametrize(
    ("words", "option"),
    [
        (("lab", "--out", "lab/experiment.toml"), "--out"),
        (("lab", "--out", "lab/../link.toml"), "--out"),
        (("lab", "--model", "base.toml", "--out", "base.toml"), "--out"),
        (("lab", "--model", "link.toml", "--out", "lab/experiment.toml"), "--out"),
        (("lab", "--effects", "own.toml", "--out", "./own.toml"), "--out"),
        (("record.toml", "--out", "record.toml"), "--out"),
        (("lab", "--report", "lab/run.md"), "--report"),
        (("folder/report.html", "--report", "folder/report.html"), "--report"),
        (("record.png", "--plot", "record.png"), "--plot"),
        (("record.rrd", "--rerun", "record.rrd"), "--rerun"),
    ],
)
def test_an_input_is_not_replaced(
    words: tuple[str, ...], option: str, tmp_path: Path, pendmap_command: Run
) -> None:
    for name in ("lab", "folder"):
        (tmp_path / name).mkdir()
    record = csv(clean(duration=2.0))
    for name in ("record.toml", "record.png", "record.rrd", "lab/run.md", "folder/report.html"):
        (tmp_path / name).write_text(record, encoding="utf-8")
    described = '[[run]]\nfile = "run.md"\n'
    (tmp_path / "lab" / "experiment.toml").write_text(described, encoding="utf-8")
    (tmp_path / "link.toml").symlink_to(tmp_path / "lab" / "experiment.toml")
    (tmp_path / "base.toml").write_text("[pendulum]\nw0 = 6.2\n", encoding="utf-8")
    (tmp_path / "own.toml").write_text(FILE, encoding="utf-8")

    def content() -> dict[Path, bytes]:
        return {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    before = content()
    run = pendmap_command("diagnose", *words)
    assert run.returncode == 2
    assert f"Invalid value for '{option}'" in run.stderr
    assert "is an input, which would be lost: it must be another file" in run.stderr
    assert run.stderr.count("\n") == 1
    assert content() == before


def test_a_model_without_dimensions_is_refused_with_the_remedy(
    tmp_path: Path, pendmap_command: Run
) -> None:
    (tmp_path / "bare.toml").write_text("[pendulum]\ngamma = 0.1\n", encoding="utf-8")
    (tmp_path / "record.csv").write_text(csv(clean(duration=2.0)), encoding="utf-8")
    run = pendmap_command("diagnose", "record.csv", "--model", "bare.toml")
    assert run.returncode == 2
    assert "bare.toml: has no dimensions, it must be a model in SI: in [pendulum] w0" in run.stderr
    assert "from_toml" not in run.stderr
    assert run.stderr.count("\n") == 1


def test_a_wrong_unit_is_reported_before_the_verdict(tmp_path: Path, pendmap_command: Run) -> None:
    lab = tmp_path / "lab"
    lab.mkdir()
    time, theta = clean(duration=10.0)
    (lab / "run.csv").write_text(csv((time, np.degrees(theta))), encoding="utf-8")
    described = (
        '[columns]\nangle = { name = "theta_rad", unit = "rad" }\n[[run]]\nfile = "run.csv"\n'
    )
    (lab / "experiment.toml").write_text(described, encoding="utf-8")
    run = pendmap_command("diagnose", "lab", "--out", "found.toml", "--max-effects", "0")
    assert run.stdout.startswith("Warning: run: swings of ")
    assert run.stdout.index("Verdict: ") < run.stdout.index("\nResidual, rms: ")
    first, _, others = " ".join(run.stdout.split()).partition(" Verdict: ")
    assert first.endswith("the unit or the scale is wrong")
    assert "the unit or the scale is wrong" not in others


@pytest.mark.thorough
def test_small_degrees_are_doubted_and_no_effect_is_firm(
    tmp_path: Path, pendmap_command: Run
) -> None:
    time = np.arange(3000) * 0.02
    theta = 0.05 * np.exp(-0.03 * time) * np.cos(6.0 * time)
    theta += 1e-4 * np.random.default_rng(2).standard_normal(time.size)
    (tmp_path / "small.csv").write_text(csv((time, np.degrees(theta))), encoding="utf-8")
    run = pendmap_command("diagnose", "small.csv", "--json")
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    # An amplitude of 2.9 rad under the wrong unit: no effect is firm.
    assert "degrees?" in found["doubts"][0]
    assert all(effect["approximate"] for effect in found["effects"])


@pytest.mark.thorough
def test_effects_left_out_are_reported(hidden: str, pendmap_command: Run) -> None:
    none = pendmap_command("diagnose", hidden, "--max-effects", "0", "--out", "a.toml")
    assert "at most 0 effects were allowed" in none.stdout
    drags = ("quadratic_drag", "power_law_drag")
    words = [word for name in drags for word in ("--without", name)]
    less = pendmap_command("diagnose", hidden, *words, "--out", "b.toml")
    assert "excluded from the candidates: quadratic_drag, power_law_drag" in less.stdout


@pytest.mark.thorough
def test_a_driven_record_taken_for_a_free_one_gets_no_name(
    hidden: str, tmp_path: Path, pendmap_command: Run
) -> None:
    (tmp_path / "forced.csv").write_bytes((tmp_path / hidden / "run_01.csv").read_bytes())
    run = pendmap_command("diagnose", "forced.csv", "--json", "--out", "c.toml")
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    assert found["verdict"] == "unknown"
    assert found["effects"] == []
    # The residual is many times the noise, and the releases in the record are reported.
    assert found["gap"]["after"] > 5 * found["gap"]["noise_floor"]
    assert any("releases" in text for text in found["findings"])
