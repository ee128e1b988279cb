"""The definition of an effect, not the name, gives the role of each parameter."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import pendmap
from pendmap import InputError
from pendmap.diagnosis.candidates import list_candidates
from pendmap.model import Effect
from pendmap.units import Units

ROLES = {"size", "width", "place", "power", "order", "time constant", "phase"}
ROLES |= {"frequency", "instant", "mode"}
SHAPES = {
    "base_sway": {"ws": "frequency"},
    "bearing_harmonic": {"n": "order"},
    "coulomb_warm_up": {"tau": "time constant"},
    "dahl_friction": {"zc": "width"},
    "eddy_brake": {"vc": "width"},
    "impulses": {"t0": "instant"},
    "inertia_ripple": {"n": "order"},
    "magnet": {"width": "width"},
    "pivot_compliance": {"wx": "mode", "z": "mode"},
    "power_law_drag": {"n": "power"},
    "rough_spot": {"th0": "place", "w": "width"},
    "stribeck_friction": {"vs": "width"},
    "viscous_warm_up": {"tau": "time constant"},
}
UNITS = {
    "width": {"rad", "rad/s"},
    "place": {"rad"},
    "power": {"1"},
    "order": {"1"},
    "time constant": {"s"},
    "frequency": {"rad/s"},
    "instant": {"s"},
    "mode": {"rad/s", "1"},
}
BARE = Units(1.0, si=False)


def test_every_parameter_has_a_role_and_every_effect_one_size() -> None:
    for effect in pendmap.effects():
        roles = {p.name: p.role for p in effect.parameters}
        assert set(roles.values()) <= ROLES, effect.name
        assert list(roles.values()).count("size") == 1, effect.name
        shapes = {n: r for n, r in roles.items() if r not in {"size", "phase"}}
        assert shapes == SHAPES.get(effect.name, shapes), effect.name
        assert all(p.unit in UNITS[p.role] for p in effect.parameters if p.name in shapes)
        turn = [p for p in effect.parameters if p.role == "phase"]
        assert all(p.unit == "rad" and p.typical[1] - p.typical[0] > 6 for p in turn), effect.name


@pytest.mark.parametrize("effect", pendmap.effects(), ids=lambda effect: effect.name)
def test_a_search_begins_where_an_effect_is_weak_and_of_a_usual_shape(
    effect: pendmap.EffectDefinition,
) -> None:
    blank = Effect.blank(effect.name, BARE)
    assert blank.sizes == [p.name for p in effect.parameters if p.role in {"size", "phase"}]
    for parameter in effect.parameters:
        value, (low, high) = blank.parameters[parameter.name], parameter.typical
        if parameter.role in {"size", "phase"}:
            assert value == low
        else:
            assert low < value < high


@pytest.mark.parametrize(
    ("term", "parameters", "roles"),
    [
        ("-k*exp(-(theta/b)^2)*v", {"k": 1, "b": 0}, ["size", "power"]),
        ("-k*exp(-(theta/b)^2)*v", {"k": 1, "b": {"power": 0, "role": "width"}}, ["size", "width"]),
        ("k*sin(2*theta - c)", {"k": 2, "c": 0}, ["size", "phase"]),
        ("-k*v*exp(-t/c)", {"k": 1, "c": -1}, ["size", "time constant"]),
        ("-k*abs(v)^c*sign(v)", {"k": "2 - c", "c": 0}, ["size", "power"]),
        ("k*sin(c*theta)", {"k": 2, "c": {"power": 0, "typical": (1, 6)}}, ["size", "order"]),
        (
            "-k*exp(-(theta-c)^2)*v",
            {"k": 1, "c": {"power": 0, "typical": (-1.0, 1.0)}},
            ["size", "place"],
        ),
    ],
)
def test_roles_in_a_formula_are_declared_or_inferred(
    term: str, parameters: dict[str, Any], roles: list[str]
) -> None:
    formula = pendmap.Formula("own_effect", term, parameters)
    assert [p.role for p in formula.definition.parameters] == roles
    again = pendmap.Formula(**formula.table)
    assert again == formula
    values = dict.fromkeys(parameters, 1.0)
    expected = [n for n, role in zip(parameters, roles, strict=True) if role in {"size", "phase"}]
    assert formula(**values).sizes == expected


ranges = st.tuples(st.floats(-3, 3), st.floats(0.01, 3)).map(lambda at: (at[0], sum(at)))
shapes = st.sampled_from(["width", "place", "power", "order", "time constant"])


@given(first=ranges, second=ranges, roles=st.tuples(shapes, shapes))
def test_a_search_scans_typical_values(
    first: tuple[float, float], second: tuple[float, float], roles: tuple[str, str]
) -> None:
    said = dict(zip("bc", zip((first, second), roles, strict=True), strict=True))
    shape = {n: {"power": 0, "role": r, "typical": typical} for n, (typical, r) in said.items()}
    formula = pendmap.Formula("own_effect", "-k*exp(-(b*theta)^2)*v/(1+c^2)", {"k": 1} | shape)
    ((*found,),) = (
        c for c in list_candidates((), driven=False, user_formulas=[formula]) if c[0].formula
    )
    assert found
    for one in found:
        for name, ((low, high), role) in said.items():
            rounded = 0.5 if role == "order" else 1e-12
            assert low - rounded <= one.shape[name] <= high + rounded
            assert role != "order" or one.shape[name] == round(one.shape[name])
    scanned = [one.shape["b"] for one in found]
    assert scanned == sorted(set(scanned))


def test_a_role_that_does_not_exist_is_refused() -> None:
    words = "parameter 'b': role must be one of width, place, power, order, time constant"
    with pytest.raises(InputError, match=words):
        pendmap.Formula("mine", "-k*b*v", {"k": 1, "b": {"power": 0, "role": "breadth"}})
