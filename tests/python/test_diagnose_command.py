"""``pendmap diagnose`` on the command line: JSON, model file, refusals."""

from __future__ import annotations

import json
import math
import tomllib
from typing import TYPE_CHECKING

import pytest

from pendmap import Rig

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
    """The folder of an experiment with a drag hidden in it."""
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
    assert Rig.from_toml(path).effects[0].name == "quadratic_drag"
    again = pendmap_command("simulate", "--model", found["model"], "--until", "5", "--json")
    assert again.returncode == 0, again.stderr
    # With what was found in the model there is nothing left to find.
    more = pendmap_command(
        "diagnose", hidden, "--model", found["model"], "--json", "--out", "b.toml"
    )
    assert json.loads(more.stdout)["verdict"] == "none"


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
    model = Rig.from_toml(tmp_path / found["model"])
    assert model.effects[0].parameters["theta_r"] == found["effects"][0]["parameters"]["theta_r"]


def test_the_verdict_comes_first(hidden: str, pendmap_command: Run) -> None:
    run = pendmap_command("diagnose", hidden, "--out", "found.toml", "--max-effects", "1")
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("Verdict: named")
    assert "Written: found.toml" in run.stdout


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
