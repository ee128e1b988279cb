"""``pendmap diagnose`` on the command line: JSON, model file, candidates of the user, refusals."""

from __future__ import annotations

import json
import math
import re
import tomllib
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from bumpy import BUMP, FILE, experiment
from hidden import once, recorded
from pendmap import Formula, InputError
from recorded import clean
from recorded import text as csv

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

FIELDS = "verdict effects equivalent model gap where next_experiment detection_limits"
GAP = "noise_floor before after held_out_before held_out_after"


@pytest.fixture
def hidden(pendmap_command: Run) -> str:
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
    fields = json.loads(run.stdout)
    assert set(FIELDS.split()) <= set(fields)
    assert set(GAP.split()) <= set(fields["gap"])
    assert fields["verdict"] == "named"
    (effect,) = fields["effects"]
    assert effect["name"] == "quadratic_drag"
    low, high = effect["ci95"]["q"]
    assert low < effect["parameters"]["q"] < high
    assert fields["detection_limits"]["bearing_harmonic"] > 0
    # The model file named in it exists; --json alone writes no other file.
    made = {path.name for path in tmp_path.iterdir()} - {"hidden", "hidden.truth.toml"}
    assert made == {fields["model"]} == {"diagnose.toml"}
    path = tmp_path / fields["model"]
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    assert content["effect"][0]["probability"] == effect["probability"]
    place = content["covariance"]["names"].index("quadratic_drag.q")
    deviation = math.sqrt(content["covariance"]["matrix"][place][place])
    assert high - low == pytest.approx(2 * 1.96 * deviation, rel=1e-4)
    assert fields["parameters"]["quadratic_drag.q"]["stderr"] == pytest.approx(deviation, rel=1e-9)
    assert content["provenance"]["verdict"] == "named"
    assert content["provenance"]["records"][0]["sha256"]
    moved = pendmap_command("simulate", "--model", fields["model"], "--until", "5", "--json")
    assert moved.returncode == 0, moved.stderr
    # A diagnosis of the same records with the new model names nothing.
    words = ("--model", fields["model"], "--json", "--out", "b.toml", "--out", "b.nc")
    more = pendmap_command("diagnose", hidden, *words)
    again = pendmap.load(tmp_path / "b.nc")
    assert json.loads(more.stdout)["verdict"] == again.verdict == "none"
    assert again.model.effects == pendmap.load_model(tmp_path / "b.toml").effects


@pytest.mark.thorough
def test_a_viscous_model_lacks_coulomb_friction() -> None:
    records, _ = recorded(seed=5)
    result = pendmap.diagnose(records, model=pendmap.Rig(w0=6.2, c_over_m=0.1))
    assert [effect.name for effect in result.effects] == ["coulomb_friction"]
    assert result.verdict == "named"
    assert result.model.effects[0].parameters == result.effects[0].parameters


def test_the_verdict_comes_first() -> None:
    text = str(once("quadratic_drag", seed=3))
    # Numbers have the units stated in the report; the table has what each effect closes.
    assert re.search(
        r"^Model: w0 = \S+ rad/s, c/m = \S+ 1/s, Tr = \S+ rad/s\^2$", text, re.MULTILINE
    )
    assert re.search(r"^  quadratic_drag: q = \S+ 1/rad \[\S+, \S+\]$", text, re.MULTILINE)
    row = r"^quadratic_drag +\d+ % +\d+ % +\d+ +\[0\.\d+, 0\.\d+\] 1/rad +0\.\d\d$"
    assert re.search(row, text, re.MULTILINE)
    assert re.search(r"^Share of the squared gap closed: \d+ %$", text, re.MULTILINE)
    shapes = [line for line in text.splitlines() if " w = " in line]
    assert shapes
    assert all(re.search(r"th0 = \S+ rad, w = \S+ rad\b", line) for line in shapes)


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ("absent", "absent"),
        ("record.csv --without friction", "friction"),
        ("record.csv --max-effects -1", "-1"),
        ("record.csv --model absent.toml", "absent.toml"),
        ("record.csv --out model.xyz", "model.xyz"),
        ("record.csv --model bare.toml", "bare.toml: has no dimensions, it must be a model in SI"),
    ],
)
def test_bad_input_is_refused_on_one_line(
    given: str, text: str, tmp_path: Path, pendmap_command: Run
) -> None:
    (tmp_path / "bare.toml").write_text("[pendulum]\ngamma = 0.1\n", encoding="utf-8")
    (tmp_path / "record.csv").write_text(csv(clean(duration=2.0)), encoding="utf-8")
    run = pendmap_command("diagnose", *given.split())
    assert run.returncode == 2
    assert text in run.stderr
    assert run.stderr.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == {"bare.toml", "record.csv"}


@pytest.mark.parametrize(
    ("words", "option"),
    [
        ("lab --out lab/experiment.toml", "--out"),
        ("lab --out lab/../link.toml", "--out"),
        ("lab --model base.toml --out base.toml", "--out"),
        ("lab --effects own.toml --out ./own.toml", "--out"),
        ("lab --report lab/run.md", "--report"),
        ("record.png --plot record.png", "--plot"),
        ("record.rrd --rerun record.rrd", "--rerun"),
    ],
)
def test_an_input_is_not_replaced(
    words: str, option: str, tmp_path: Path, pendmap_command: Run
) -> None:
    (tmp_path / "lab").mkdir()
    described = '[[run]]\nfile = "run.md"\n'
    record = csv(clean(duration=2.0))
    inputs = {"record.png": record, "record.rrd": record, "lab/run.md": record}
    inputs |= {"lab/experiment.toml": described, "own.toml": FILE}
    inputs |= {"base.toml": "[pendulum]\nw0 = 6.2\n"}
    for name, text in inputs.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "link.toml").symlink_to(tmp_path / "lab" / "experiment.toml")
    run = pendmap_command("diagnose", *words.split())
    assert run.returncode == 2
    assert f"Invalid value for '{option}'" in run.stderr
    assert "is an input, which would be lost: it must be another file" in run.stderr
    files = [path for path in tmp_path.rglob("*") if path.is_file() and not path.is_symlink()]
    assert len(files) == len(inputs)
    assert all((tmp_path / name).read_text(encoding="utf-8") == inputs[name] for name in inputs)


def test_a_wrong_unit_is_reported_before_the_verdict(tmp_path: Path, pendmap_command: Run) -> None:
    time, theta = clean(duration=10.0)
    (tmp_path / "run.csv").write_text(csv((time, np.degrees(theta))), encoding="utf-8")
    columns = '[columns]\nangle = { name = "theta_rad", unit = "rad" }\n'
    (tmp_path / "experiment.toml").write_text(columns + '[[run]]\nfile = "run.csv"\n')
    run = pendmap_command("diagnose", ".", "--out", "new.toml", "--max-effects", "0")
    assert run.stdout.startswith("Warning: run: swings of ")
    first, _, others = " ".join(run.stdout.split()).partition(" Verdict: ")
    assert first.endswith("the unit or the scale is wrong")
    assert "the unit or the scale is wrong" not in others


@pytest.mark.thorough
def test_a_driven_record_taken_for_a_free_one_gets_no_name(
    hidden: str, tmp_path: Path, pendmap_command: Run
) -> None:
    (tmp_path / "forced.csv").write_bytes((tmp_path / hidden / "run_01.csv").read_bytes())
    run = pendmap_command("diagnose", "forced.csv", "--json", "--out", "c.toml")
    assert run.returncode == 0, run.stderr
    fields = json.loads(run.stdout)
    assert fields["verdict"] == "unknown"
    assert fields["effects"] == []
    # The residual is many times the noise, and the releases in the record are reported.
    assert fields["gap"]["after"] > 5 * fields["gap"]["noise_floor"]
    assert any("releases" in text for text in fields["findings"])


def test_a_formula_that_alone_explains_the_records_is_named(
    tmp_path: Path, pendmap_command: Run
) -> None:
    experiment(tmp_path / "records")
    (tmp_path / "own.toml").write_text(FILE, encoding="utf-8")
    words = ("records", "--effects", "own.toml", "--out", "new.toml", "--json")
    run = pendmap_command("diagnose", *words)
    assert run.returncode == 0, run.stderr
    fields = json.loads(run.stdout)
    assert fields["verdict"] == "named"
    (bump,) = fields["effects"]
    assert bump["name"] == "bump"
    for name, true in BUMP.items():
        low, high = bump["ci95"][name]
        assert low - (high - low) < true < high + (high - low), name
    assert fields["gap"]["held_out_after"] < 1.1 * fields["gap"]["noise_floor"]
    # The new model needs no other file.
    model = pendmap.load_model(tmp_path / "new.toml")
    assert isinstance(model, pendmap.Rig)
    assert model.effects[-1].formula is not None


@pytest.mark.parametrize(
    ("effects", "text"),
    [
        ([Formula("two", "-k*v - c*v^3", {"k": 1, "c": -1})], "is not proportional to its first"),
        ([Formula("one", "-k*v^3", {"k": -1})] * 2, "has one twice"),
        (3, "must be a list of Formula"),
        (["bump"], "must be a Formula, like"),
    ],
)
def test_an_invalid_candidate_is_refused(effects: Any, text: str) -> None:  # noqa: ANN401
    time = np.arange(500) * 0.02
    run = pendmap.Run("a", "a.csv", "free", time, np.cos(6 * time), np.ones(500, bool))
    with pytest.raises(InputError, match=text):
        pendmap.diagnose(run, effects=effects)
