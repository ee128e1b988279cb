"""The library of effects, in Python and on the command line."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING

import pytest

import pendmap
from pendmap import InputError, _core

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

NAMES = [effect.name for effect in pendmap.effects()]
DRIFTING = {effect.name for effect in pendmap.effects() if effect.mappable == "frozen"}
TORQUES = [e.name for e in pendmap.effects() if e.group != "reading" and e.mappable != "no"]
OWN = {"viscous_damping": "gamma", "coulomb_friction": "theta_r", "bias_torque": "torque"}


def middle(name: str) -> pendmap.Effect:
    """Return the effect with values from the middle of the typical ranges."""
    (effect,) = (e for e in pendmap.effects() if e.name == name)
    values = {p.name: sum(p.typical) / 2 for p in effect.parameters}
    values |= {p.name: 3.0 for p in effect.parameters if p.role == "order"}
    return pendmap.Effect(name, values)


def pendulum(name: str) -> pendmap.Pendulum:
    effect = middle(name)
    if name in OWN:
        return pendmap.Pendulum(p=0.6, **{OWN[name]: effect.values[0]})
    return pendmap.Pendulum(p=0.6, effects=(effect,), lab_time=100.0)


def test_the_library_is_that_of_the_kernel() -> None:
    assert [entry["name"] for entry in _core.effects()] == NAMES
    assert len(set(NAMES)) == len(NAMES) >= 22
    for effect in pendmap.effects():
        assert effect.group in {"damping", "torque", "drive", "reading"}
        families = {"damping", "dry friction", "position torque", "drive", "reading"}
        assert effect.family in families
        assert effect.mappable in {"yes", "frozen", "no"}
        for parameter in effect.parameters:
            assert parameter.name in effect.formula
            assert parameter.range[0] <= parameter.typical[0] < parameter.typical[1]
            assert parameter.typical[1] <= parameter.range[1]
            assert parameter.unit
            assert parameter.meaning


def test_json_holds_the_whole_library(pendmap_command: Run) -> None:
    run = pendmap_command("effects", "--json")
    assert run.returncode == 0, run.stderr
    effects = json.loads(run.stdout, parse_constant=pytest.fail)["effects"]
    assert [e["name"] for e in effects] == NAMES
    keys = {"name", "group", "family", "formula", "parameters", "mappable", "revealed_by"}
    assert all(set(e) == keys for e in effects)
    (drag,) = (e for e in effects if e["name"] == "power_law_drag")
    assert drag["parameters"][0]["power_of_w0_less"] == "n"
    assert drag["parameters"][0]["range"] == [None, None]
    assert drag["parameters"][1]["range"] == [0.5, 4.0]


def test_the_text_names_every_effect_and_parameter(pendmap_command: Run) -> None:
    short, long = (
        " ".join(pendmap_command("effects", *words).stdout.split())
        for words in ((), ("--verbose",))
    )
    for effect in pendmap.effects():
        assert f" {effect.name} {effect.formula} " in short
        assert f" {effect.name} {effect.formula} " in long
        assert all(f" {p.name}, {p.role}: {p.meaning} (" in long for p in effect.parameters)
    one = pendmap_command("effects", "magnet", "--json")
    assert [e["name"] for e in json.loads(one.stdout)["effects"]] == ["magnet"]


def test_a_named_effect_is_shown_as_a_table_of_a_model_file(
    pendmap_command: Run, tmp_path: Path
) -> None:
    names = ("power_law_drag", "magnet", "encoder_gain")
    said = pendmap_command("effects", *names).stdout
    assert "in SI times w0^(2-n), rad^(1-n) s^(n-2))" in " ".join(said.split())
    text = "[pendulum]\n" + said[said.index("[[effect]]") :]
    (tmp_path / "model.toml").write_text(text, encoding="utf-8")
    model = pendmap.load_model(tmp_path / "model.toml")
    assert [effect.name for effect in model.effects] == list(names)
    assert model.effects[1].parameters == {"amplitude": 0.005, "width": 0.1}


@pytest.mark.parametrize("name", TORQUES)
def test_maps_and_trajectories_agree(name: str) -> None:
    model = pendulum(name)
    # A drift proceeds in a trajectory and is constant in a map: over one period the effect is
    # small.
    run = pendmap.simulate(model, 1.0, 0.3, model.period, tol=1e-10)
    theta, velocity, _ = pendmap.advance(model, [1.0], [0.3], periods=1, tol=1e-7)
    tolerance = 1e-3 if name in DRIFTING else 1e-6
    difference = float(run.theta[-1]) - theta[0]
    assert math.remainder(difference, math.tau) == pytest.approx(0, abs=tolerance)
    assert float(run.velocity[-1]) == pytest.approx(velocity[0], abs=tolerance)


def test_torques_that_do_not_repeat_are_simulated_and_not_mapped() -> None:
    uneven = pendmap.Effect("bearing_harmonic", {"amplitude": 0.1, "n": 2.5, "psi": 0.0})
    model = pendmap.Pendulum(p=0.6, effects=(uneven,))
    assert pendmap.simulate(model, 1.0, 0.0, 10.0).theta.size > 1
    for ask in (
        lambda: pendmap.basins(model, pendmap.Grid.square(4)),
        lambda: pendmap.advance(model, [1.0], [0.0], periods=1),
    ):
        with pytest.raises(InputError, match="not in maps: it does not repeat every turn"):
            ask()
    # A start does not determine the last turning point of a contact.
    yielding = pendmap.Pendulum(p=0.6, effects=(middle("dahl_friction"),))
    assert pendmap.simulate(yielding, 1.0, 0.0, 10.0).theta.size > 1
    with pytest.raises(InputError, match="not in maps: it depends on where the motion last turned"):
        pendmap.basins(yielding, pendmap.Grid.square(4))
    # An elastic torque bounds the angle, which is not wrapped.
    spring = pendmap.Pendulum(p=0.6, effects=(uneven, middle("elastic_restoring")))
    assert pendmap.basins(spring, pendmap.Grid.square(4)).sizes["attractor"] > 0
