"""Effects that a user defines by formulas and by Python functions."""

from __future__ import annotations

import json
import tomllib
from typing import TYPE_CHECKING, Any

import pytest

import pendmap
from bumpy import FILE
from pendmap import (
    Effect,
    Formula,
    InputError,
    Pendulum,
    Rig,
    load_formulas,
    load_model,
    save_model,
)

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

DRAG = Formula("own_drag", "-q*v*abs(v)", {"q": 0})
ROOT = Formula("root_drag", "-k*sqrt(abs(v))*sign(v)", {"k": 1.5})
POWER = Formula(
    "own_power",
    "-q*abs(v)^n*sign(v)",
    {"q": {"power": "2 - n"}, "n": {"power": 0, "typical": [1.1, 3], "range": [1, 4]}},
)


def test_a_formula_gives_the_map_of_the_library_s_effect() -> None:
    grid = pendmap.Grid.square(30)
    library = Pendulum(p=0.6, effects=(Effect("quadratic_drag", {"q": 0.05}),))
    own = Pendulum(p=0.6, effects=(DRAG(q=0.05),))
    a, b = (pendmap.basins(model, grid) for model in (library, own))
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
    path = save_model(rig, tmp_path / "model.toml")
    again = load_model(path)
    assert again == rig
    assert [effect.formula for effect in again.effects] == [ROOT, POWER]
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    assert content["formula"][0] == {
        "name": "root_drag",
        "term": ROOT.term,
        "parameters": {"k": {"power": 1.5}},
    }
    assert content["formula"][1]["parameters"]["q"] == {"power": "2 - n"}
    assert [formula.name for formula in load_formulas(path)] == ["root_drag", "own_power"]
    assert save_model(again, tmp_path / "again.toml").read_bytes() == path.read_bytes()


def test_a_formula_is_found_by_its_name_alone(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    text = '[pendulum]\ngamma = 0.1\n[[effect]]\nname = "root_drag"\nparameters = { k = 1.0 }\n'
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="name must be an effect of the library, got 'root_drag'"):
        load_model(path)
    path.write_text(text + FILE, encoding="utf-8")
    with pytest.raises(InputError, match=r"this file's \[\[formula\]\] are bump, lean"):
        load_model(path)
    with pytest.raises(InputError, match="name must be root_drag, got 'other'"):
        Effect("other", {"k": 1.0}, formula=ROOT)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            ("x", "-k*thetta", {"k": 2}),
            r"unknown name 'thetta' at 4: it must be one of theta, v, phase",
        ),
        (("x", "-k*v", {"k": 2}), r"units do not balance.*'k' must have power = 1"),
        (("x", "-k*v", {"k": {}}), "power is missing"),
        (
            ("x", "-k*v", {"k": {"power": 1, "typical": 3}}),
            r"typical must be \[low, high\], got 3",
        ),
        (("x", "-k*v", {"k": {"power": 1, "typical": [3, 1]}}), "the lower first"),
        (("x", "-k*v", {"k": {"power": 1, "range": [1, 2]}}), "holds the typical"),
        (("x", "-k*v", {}), "with their powers of w0"),
        (("x", 3, {"k": 1}), "term must be a text, got 3"),
        (("magnet", "-k*v", {"k": 1}), "one of the library"),
        (("c_over_m", "-k*v", {"k": 1}), "a pendulum has a parameter of that name"),
        (("x", "-v*v", {"v": 1}), "'v' must be another, it has a meaning of its own"),
        (("x", "k", {"k": 2, "q": 0}), "parameter 'q' is not in the term"),
        (
            ("x", "a*b*c*d", {"b": 2, "c": 0, "d": 0, "e": 0}),
            "must have 1 to 3 parameters, got 4",
        ),
        (("x", "k*sign(theta)", {"k": 2}), "jumps where"),
    ],
)
def test_errors_are_reported_on_one_line(given: tuple[Any, ...], said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        Formula(*given)
    assert str(caught.value).count("\n") == 0


def test_formulas_are_read_from_a_file(tmp_path: Path, pendmap_command: Run) -> None:
    path = tmp_path / "own.toml"
    path.write_text(FILE, encoding="utf-8")
    run = pendmap_command("effects", "--effects", str(path), "--json")
    assert run.returncode == 0, run.stderr
    listed = json.loads(run.stdout)["effects"]
    assert [effect["name"] for effect in listed] == ["bump", "lean"]
    assert [effect["group"] for effect in listed] == ["torque", "damping"]
    assert [effect["mappable"] for effect in listed] == ["yes", "yes"]
    shown = pendmap_command("effects", "--effects", str(path), "lean")
    assert shown.returncode == 0, shown.stderr
    # The output of the command is itself a model file.
    model = tmp_path / "model.toml"
    example = shown.stdout.partition("take by --model:")[2]
    model.write_text(f"{example}\n[pendulum]\ngamma = 0.1\np = 0.6\nomega = 2\n", encoding="utf-8")
    run = pendmap_command("basins", "--model", str(model), "--grid", "20", "--json")
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["attractors"]
    for text, said in (
        ("", "has no table [[formula]]"),
        ("[[formula]]\nname = 'x'", "term must be given, like term = "),
        (FILE + FILE, "each name must occur once, bump occurs twice"),
        ("[[formular]]\nname = 'x'", "formular is not known"),
        (FILE.replace("wrap(", "wrp("), "unknown function 'wrp' at 14"),
    ):
        path.write_text(text, encoding="utf-8")
        run = pendmap_command("effects", "--effects", str(path))
        assert run.returncode == 2, run.stdout
        assert said in run.stderr
        assert run.stderr.count("\n") == 1


def test_maps_refuse_torques_that_do_not_repeat() -> None:
    uneven = Formula("uneven", "-k*sin(theta/2)", {"k": 2})
    with pytest.raises(InputError, match="uneven can be in one trajectory, not in maps"):
        pendmap.basins(Pendulum(effects=(uneven(k=0.1),)), pendmap.Grid.square(10))
    assert pendmap.simulate(Pendulum(effects=(uneven(k=0.1),)), 1.0, 0.0, until=1.0) is not None
