"""Schema of each kind of result, from which attributes and JSON follow; numerical choices."""

from __future__ import annotations

import importlib
from typing import Any

import pytest

import pendmap
from pendmap import InputError, Pendulum
from pendmap.analysis.numerics import Numerics
from pendmap.files import facts

DRIVEN = Pendulum(gamma=0.1, p=0.6, omega=2.0)
RESULTS = {
    "basins": lambda: pendmap.basins(DRIVEN, 10),
    "basin_sweep": lambda: pendmap.sweep(DRIVEN, {"p": (0.5, 0.7, 2)}, grid=10),
    "bifurcation": lambda: pendmap.bifurcation(DRIVEN, {"p": (0.5, 0.7, 2)}, starts=2),
    "lifetime": lambda: pendmap.lifetime(DRIVEN, starts=100),
    "melnikov": lambda: pendmap.melnikov(DRIVEN, [1.0, 2.0]),
    "orbits": lambda: pendmap.orbit(DRIVEN, 1, 0, pendmap.Grid.square(20)),
    "parameter_map": lambda: pendmap.parameter_map(
        DRIVEN, {"p": (0.5, 0.7, 2), "omega": (1.8, 2.0, 2)}, starts=2
    ),
    "tongues": lambda: pendmap.tongues(DRIVEN, [1.9, 2.0]),
    "trajectory": lambda: pendmap.simulate(DRIVEN, 1.0, 0.0, 10.0),
}

OF_ALL = ("Conventions", "comment", "history", "source", "references")


@pytest.mark.parametrize("kind", pendmap.ANALYSES)
def test_attributes_and_json_follow_from_the_schema(kind: str) -> None:
    schema = importlib.import_module(f"pendmap.analysis.{kind}").SCHEMA
    names = [field.name for field in schema.fields]
    assert len(set(names)) == len(names)
    assert all(field.meaning for field in schema.fields)
    alone = pendmap.ANALYSES[kind][1][0]  # a function that needs only a model
    result = RESULTS.get(kind, lambda: getattr(pendmap, alone)(DRIVEN))()
    own = set(facts(result)) - set(DRIVEN.attributes) - {"kind", "title", *OF_ALL}
    assert own <= {field.place for field in schema.fields}
    json = schema.json(result)
    assert list(json) == [f.name for f in schema.fields if f.json and f.name in json]
    assert not {f.name for f in schema.fields if not f.json} & set(json)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"tol": float("nan")}, "tol must be a finite number, got nan"),
        ({"max_periods": 0}, "max_periods must be a whole number from 1 to"),
        ({"threads": 0}, "threads must be a whole number from 1 to 256, got 0"),
        ({"seed": -1}, "seed must be a whole number from 0 to"),
        ({"progress": 3}, "progress must be a function of two numbers"),
    ],
)
def test_numerical_choices_are_checked_as_they_are_made(given: Any, message: str) -> None:  # noqa: ANN401
    with pytest.raises(InputError, match=message):
        Numerics(**given)


def test_numerical_choices_are_passed_to_the_core_and_stored_in_a_result() -> None:
    numerics = Numerics(1e-5, None, 2, 7)
    assert numerics.core == {"tol": 1e-5, "max_periods": None, "threads": 2, "seed": 7}
    said = numerics.provenance()
    assert (said["tol"], said["threads"], said["seed"]) == (1e-5, 2, 7)
    assert Numerics().workers == 0
    assert Numerics().provenance()["threads"] >= 1
