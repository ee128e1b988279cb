"""Schema of each kind of result, from which attributes and JSON follow; numerical choices."""

from __future__ import annotations

from typing import Any

import pytest

from pendmap import InputError, Pendulum
from pendmap.analysis.numerics import Numerics

DRIVEN = Pendulum(gamma=0.1, p=0.6, omega=2.0)


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
