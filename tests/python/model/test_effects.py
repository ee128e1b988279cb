"""Effects of the library and formulas of a user, in Python, in files and on the command line."""

from __future__ import annotations

import json
import math
import tomllib
from typing import TYPE_CHECKING, Any

import pytest

import pendmap
from bumpy import FILE
from pendmap import Effect, Formula, Grid, InputError, Pendulum, Rig, load_formulas, load_model

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

LIBRARY = {effect.name: effect for effect in pendmap.effects()}
TORQUES = [e.name for e in LIBRARY.values() if e.group != "reading" and e.mappable != "no"]

DRAG = Formula("own_drag", "-q*v*abs(v)", {"q": 0})
ROOT = Formula("root_drag", "-k*sqrt(abs(v))*sign(v)", {"k": 1.5})
POWER = Formula(
    "own_power",
    "-q*abs(v)^n*sign(v)",
    {"q": {"power": "2 - n"}, "n": {"power": 0, "typical": [1.1, 3], "range": [1, 4]}},
)
UNEVEN = Formula("uneven", "-k*sin(theta/2)", {"k": 2})


def middle(name: str) -> Effect:
    """Return the effect with values from the middle of the typical ranges."""
    values = {p.name: sum(p.typical) / 2 for p in LIBRARY[name].parameters}
    values |= {p.name: 3.0 for p in LIBRARY[name].parameters if p.role == "order"}
    return Effect(name, values)


# The library


def test_json_and_text_hold_the_whole_library(pendmap_command: Run) -> None:
    run = pendmap_command("effects", "--json")
    assert run.returncode == 0, run.stderr
    listed = json.loads(run.stdout, parse_constant=pytest.fail)["effects"]
    assert [entry["name"] for entry in listed] == [*LIBRARY]
    assert len(listed) >= 22
    keys = {"name", "group", "family", "formula", "parameters", "mappable", "revealed_by"}
    assert all(set(entry) == keys for entry in listed)
    (drag,) = (entry for entry in listed if entry["name"] == "power_law_drag")
    assert drag["parameters"][0]["power_of_w0_less"] == "n"
    assert drag["parameters"][0]["range"] == [None, None]
    assert drag["parameters"][1]["range"] == [0.5, 4.0]
    text = " ".join(pendmap_command("effects", "--verbose").stdout.split())
    for effect in LIBRARY.values():
        assert f" {effect.name} {effect.formula} " in text
        assert all(f" {p.name}, {p.role}: {p.meaning} (" in text for p in effect.parameters)


def test_a_named_effect_is_shown_as_a_table_of_a_model_file(
    pendmap_command: Run, tmp_path: Path
) -> None:
    path = tmp_path / "model.toml"
    path.write_text(FILE, encoding="utf-8")
    for words in (("power_law_drag", "magnet"), ("--effects", "model.toml", "lean")):
        text = pendmap_command("effects", *words).stdout
        unit = "in SI times w0^(2-n), rad^(1-n) s^(n-2))"
        assert words[0] == "--effects" or unit in " ".join(text.split())
        tables = text.partition("take by --model:")[2]
        path.write_text(f"{tables}\n[pendulum]\n", encoding="utf-8")
        assert [effect.name for effect in load_model(path).effects][-1] == words[-1]
        path.write_text(FILE, encoding="utf-8")


@pytest.mark.parametrize("name", TORQUES)
def test_maps_and_trajectories_agree(name: str) -> None:
    model = Pendulum(gamma=0.0, p=0.6, effects=(middle(name),), lab_time=100.0)
    run = pendmap.simulate(model, 1.0, 0.3, model.period, tol=1e-10)
    theta, velocity, _ = pendmap.advance(model, [1.0], [0.3], periods=1, tol=1e-7)
    # A drift proceeds in a trajectory and is constant in a map.
    tolerance = 1e-3 if LIBRARY[name].mappable == "frozen" else 1e-6
    difference = float(run.theta[-1]) - theta[0]
    assert math.remainder(difference, math.tau) == pytest.approx(0, abs=tolerance)
    assert float(run.velocity[-1]) == pytest.approx(velocity[0], abs=tolerance)


@pytest.mark.parametrize(
    ("effect", "reason"),
    [
        (Effect("bearing_harmonic", {"amplitude": 0.1, "n": 2.5, "psi": 0.0}), "repeat every turn"),
        (UNEVEN(k=0.1), "not in maps"),
        (middle("dahl_friction"), "not in maps: it depends on where the motion last turned"),
        (middle("pivot_compliance"), "not in maps: its sideways mode has a motion of its own"),
    ],
)
def test_torques_that_do_not_repeat_are_simulated_and_not_mapped(
    effect: Effect, reason: str
) -> None:
    model = Pendulum(p=0.6, effects=(effect,))
    assert pendmap.simulate(model, 1.0, 0.0, 10.0).theta.size > 1
    with pytest.raises(InputError, match=f"{effect.name} can be in one trajectory, .*{reason}"):
        pendmap.basins(model, Grid.square(4))
    if reason == "repeat every turn":
        # An elastic torque bounds the angle, which is not wrapped.
        spring = Pendulum(p=0.6, effects=(effect, middle("elastic_restoring")))
        assert pendmap.basins(spring, Grid.square(4)).sizes["attractor"] > 0


# Formulas


def test_a_formula_gives_the_map_of_the_library_s_effect() -> None:
    effects = Effect("quadratic_drag", {"q": 0.05}), DRAG(q=0.05)
    models = (Pendulum(p=0.6, effects=(effect,)) for effect in effects)
    a, b = (pendmap.basins(model, Grid.square(30)) for model in models)
    assert (a.label.values == b.label.values).all()
    assert list(a.attractor.values) == list(b.attractor.values)
    assert tomllib.loads(b.attrs["model"])["formula"][0]["term"] == "-q*v*abs(v)"


@pytest.mark.parametrize(("formula", "values"), [(ROOT, {"k": 0.3}), (POWER, {"q": 0.1, "n": 1.7})])
def test_a_formula_converts_between_si_and_no_dimensions(
    formula: Formula, values: dict[str, float]
) -> None:
    rig = Rig(w0=6.2, c_over_m=0.1, effects=(formula(**values),))
    slow = pendmap.simulate(rig, 1.5, 0.0, until=4.0)
    bare = pendmap.simulate(rig.pendulum, 1.5, 0.0, until=4.0 * 6.2)
    assert float(slow.theta[-1]) == pytest.approx(float(bare.theta[-1]), abs=1e-9)
    # Against a power law of the library with equal numbers.
    q, n = (values["k"], 0.5) if "k" in values else (values["q"], values["n"])
    other = Rig(w0=6.2, c_over_m=0.1, effects=(Effect("power_law_drag", {"q": q, "n": n}),))
    known = pendmap.simulate(other, 1.5, 0.0, until=4.0)
    assert float(slow.theta[-1]) == pytest.approx(float(known.theta[-1]), abs=1e-9)


def test_a_model_file_carries_its_formulas(tmp_path: Path) -> None:
    rig = Rig(w0=6.2, effects=(ROOT(k=0.3), POWER(q=0.1, n=1.7)))
    path = pendmap.save_model(rig, tmp_path / "model.toml")
    again = load_model(path)
    assert again == rig
    assert [effect.formula for effect in again.effects] == [ROOT, POWER]
    tables = tomllib.loads(path.read_text(encoding="utf-8"))["formula"]
    root = {"name": "root_drag", "term": ROOT.term, "parameters": {"k": {"power": 1.5}}}
    assert tables[0] == root
    assert tables[1]["parameters"]["q"] == {"power": "2 - n"}
    assert [formula.name for formula in load_formulas(path)] == ["root_drag", "own_power"]
    text = '[pendulum]\n[[effect]]\nname = "root_drag"\nparameters = { k = 1.0 }\n'
    for formulas, complaint in (("", "got 'root_drag'"), (FILE, r"\[\[formula\]\] are bump, lean")):
        path.write_text(text + formulas, encoding="utf-8")
        with pytest.raises(InputError, match=f"name must be an effect of the library.*{complaint}"):
            load_model(path)


@pytest.mark.parametrize(
    ("term", "parameters", "roles"),
    [
        ("-k*exp(-(theta/b)^2)*v", {"k": 1, "b": {"power": 0, "role": "width"}}, ["size", "width"]),
        ("k*sin(2*theta - c)", {"k": 2, "c": 0}, ["size", "phase"]),
        ("-k*v*exp(-t/c)", {"k": 1, "c": -1}, ["size", "time constant"]),
        ("-k*abs(v)^c*sign(v)", {"k": "2 - c", "c": 0}, ["size", "power"]),
        ("k*sin(c*theta)", {"k": 2, "c": {"power": 0, "typical": (1, 6)}}, ["size", "order"]),
        (
            *("-k*exp(-(theta-c)^2)*v", {"k": 1, "c": {"power": 0, "typical": (-1.0, 1.0)}}),
            ["size", "place"],
        ),
    ],
)
def test_roles_in_a_formula_are_declared_or_inferred(
    term: str, parameters: dict[str, Any], roles: list[str]
) -> None:
    formula = Formula("own_effect", term, parameters)
    assert [p.role for p in formula.definition.parameters] == roles
    assert Formula(**formula.table) == formula
    expected = [n for n, role in zip(parameters, roles, strict=True) if role in {"size", "phase"}]
    assert formula(**dict.fromkeys(parameters, 1.0)).sizes == expected


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        (
            ("x", "-k*thetta", {"k": 2}),
            "unknown name 'thetta' at 4: it must be one of theta, v, ph",
        ),
        (("x", "-k*v", {"k": 2}), r"units do not balance.*'k' must have power = 1"),
        (("x", "-k*v", {"k": {}}), "power is missing"),
        (("x", "-k*v", {"k": {"power": 1, "typical": 3}}), r"typical must be \[low, high\], got 3"),
        (("x", "-k*v", {"k": {"power": 1, "typical": [3, 1]}}), "the lower first"),
        (("x", "-k*v", {"k": {"power": 1, "range": [1, 2]}}), "holds the typical"),
        (
            ("x", "-k*b*v", {"k": 1, "b": {"power": 0, "role": "breadth"}}),
            "parameter 'b': role must be one of width, place, power, order, time constant",
        ),
        (("x", "-k*v", {}), "with their powers of w0"),
        (("x", 3, {"k": 1}), "term must be a text, got 3"),
        (("magnet", "-k*v", {"k": 1}), "one of the library"),
        (("c_over_m", "-k*v", {"k": 1}), "a pendulum has a parameter of that name"),
        (("x", "-v*v", {"v": 1}), "'v' must be another, it has a meaning of its own"),
        (("x", "k", {"k": 2, "q": 0}), "parameter 'q' is not in the term"),
        (("x", "a*b*c*d", {"b": 2, "c": 0, "d": 0, "e": 0}), "must have 1 to 3 parameters, got 4"),
        (("x", "k*sign(theta)", {"k": 2}), "jumps where"),
    ],
)
def test_errors_are_reported_on_one_line(given: tuple[Any, ...], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint) as caught:
        Formula(*given)
    assert str(caught.value).count("\n") == 0


def test_formulas_are_read_from_a_file(tmp_path: Path, pendmap_command: Run) -> None:
    path = tmp_path / "own.toml"
    path.write_text(FILE, encoding="utf-8")
    run = pendmap_command("effects", "--effects", "own.toml", "--json")
    assert run.returncode == 0, run.stderr
    shown = [(e["name"], e["group"], e["mappable"]) for e in json.loads(run.stdout)["effects"]]
    assert shown == [("bump", "torque", "yes"), ("lean", "damping", "yes")]
    for text, complaint in (
        ("", "has no table [[formula]]"),
        ("[[formula]]\nname = 'x'", "term must be given, like term = "),
        (FILE + FILE, "each name must occur once, bump occurs twice"),
        ("[[formular]]\nname = 'x'", "formular is not known"),
        (FILE.replace("wrap(", "wrp("), "unknown function 'wrp' at 14"),
    ):
        path.write_text(text, encoding="utf-8")
        run = pendmap_command("effects", "--effects", "own.toml")
        assert (run.returncode, run.stderr.count("\n")) == (2, 1), run.stdout
        assert complaint in run.stderr
