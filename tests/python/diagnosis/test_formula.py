"""``diagnose`` with candidates defined by the user."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from bumpy import BUMP, FILE, experiment
from pendmap import Formula, InputError, Rig, load_model
from pendmap.diagnosis import diagnose
from pendmap.records import read_experiment

if TYPE_CHECKING:
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
