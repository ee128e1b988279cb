"""``diagnose`` with candidates defined by the user."""

from __future__ import annotations

import importlib
import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bumpy import BUMP, FILE, experiment, torque
from pendmap import Formula, InputError, Rig, load_formulas, load_model
from pendmap.diagnosis import TorqueFunction, diagnose
from pendmap.diagnosis.functions import check_functions
from pendmap.diagnosis.result import as_text
from pendmap.records import read_experiment

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from conftest import Run


def test_a_formula_that_alone_explains_the_records_is_named(
    tmp_path: Path, pendmap_command: Run
) -> None:
    records = experiment(tmp_path / "records")
    own = tmp_path / "own.toml"
    own.write_text(FILE, encoding="utf-8")
    out = tmp_path / "found.toml"
    run = pendmap_command(
        "diagnose", str(records), "--effects", str(own), "--out", str(out), "--json"
    )
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    assert found["verdict"] == "named"
    (bump,) = found["effects"]
    assert bump["name"] == "bump"
    for name, true in BUMP.items():
        low, high = bump["ci95"][name]
        assert low - (high - low) < true < high + (high - low), name
    assert found["gap"]["held_out_after"] < 1.1 * found["gap"]["noise_floor"]
    # The new model needs no other file.
    model = load_model(out)
    assert isinstance(model, Rig)
    assert model.effects[-1].formula is not None
    drive = ("--p", "0.6", "--omega", "2", "--gamma", "0.2")
    run = pendmap_command("basins", "--model", str(out), *drive, "--grid", "10", "--json")
    assert run.returncode == 0, run.stderr


# ruff: noqa: ARG001 (a function takes all arguments of a torque)
def _table(theta: Any, v: Any, t: Any, phase: Any, parameters: Any) -> Any:  # noqa: ANN401
    grid = np.linspace(-math.pi, math.pi, 2001)
    return np.interp(np.angle(np.exp(1j * theta)), grid, [torque(x) for x in grid])


def _slope(theta: Any, v: Any, t: Any, phase: Any, parameters: Any) -> Any:  # noqa: ANN401
    return parameters["size"] * np.sin(5 * theta)


@pytest.mark.thorough
def test_functions_are_scored_beside_effects(tmp_path: Path) -> None:
    records = read_experiment(experiment(tmp_path / "records"))
    functions = [TorqueFunction("table", _table), TorqueFunction("slope", _slope, {"size": 0.1})]
    # Without a formula no effect of the library is named for the bump.
    found = diagnose(records, effects=functions)
    assert found.verdict not in {"none", "named"}
    shares = [line for line in as_text(found) if line.startswith("Share")]
    assert len(shares) == bool(found.nearest.fitted.names)
    nearest = [line for line in shares if "closed by the nearest effects: " in line]
    assert nearest == (shares if found.verdict == "unknown" else [])
    table, slope = found.functions
    assert (table.name, slope.name) == ("table", "slope")
    assert table.size == pytest.approx(1.0, abs=0.3)
    level = found.base.fitted.noise.level
    best = max(score.gain for score in found.scores.scores) / level
    assert table.gain > best
    assert table.gain > 2 * slope.gain
    # Beside the true formula the functions gain nothing.
    (tmp_path / "own.toml").write_text(FILE, encoding="utf-8")
    found = diagnose(records, effects=[*load_formulas(tmp_path / "own.toml"), *functions])
    assert [effect.name for effect in found.effects] == ["bump"]
    assert all(score.left < 12 for score in found.functions)
    assert any(line.startswith("Function table") for line in as_text(found))


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda *_: np.zeros(3), "raised ValueError"),
        (lambda th, *_: th / 0.0, "must return finite numbers"),
        (lambda th: th, "raised TypeError"),
        (lambda th, _v, _t, _phase, own: own["sise"] * th, "raised KeyError"),
        (lambda th, *_: 1.0 if th > 0 else 0.0, "raised ValueError"),
    ],
)
def test_an_error_of_a_function_is_reported_on_one_line(
    function: Callable[..., Any], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    records = read_experiment(experiment(tmp_path / "records"))
    # Functions are called before any fit.
    module = importlib.import_module("pendmap.diagnosis.diagnose")
    monkeypatch.setattr(module, "fit_baseline", pytest.fail)
    with (
        np.errstate(divide="ignore", invalid="ignore"),
        pytest.raises(InputError, match=said) as caught,
    ):
        diagnose(records, max_effects=0, effects=[TorqueFunction("mine", function)])
    assert str(caught.value).count("\n") == 0


def test_a_function_may_be_undefined_at_readings_of_0(tmp_path: Path) -> None:
    records = read_experiment(experiment(tmp_path / "records"))
    # Readings in counts repeat, so that angles and velocities of exactly 0 occur.
    function = TorqueFunction("mine", lambda th, v, *_: v / np.abs(v) + np.sin(th) / th)
    check_functions(records.runs, [function])


def test_an_invalid_candidate_is_refused(tmp_path: Path) -> None:
    records = read_experiment(experiment(tmp_path / "records"))
    lopsided = Formula("two", "-k*v - c*v^3", {"k": 1, "c": -1})
    with pytest.raises(InputError, match="is not proportional to its first parameter k"):
        diagnose(records, effects=[lopsided])
    with pytest.raises(InputError, match="has one twice"):
        diagnose(records, effects=[Formula("one", "-k*v^3", {"k": -1})] * 2)
    with pytest.raises(InputError, match="must be a list of Formula"):
        diagnose(records, effects=3)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="must be a Formula, like"):
        diagnose(records, effects=["bump"])  # type: ignore[list-item]
