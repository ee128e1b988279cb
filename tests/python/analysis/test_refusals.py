"""What each analysis refuses, in one line that says what a value must be."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import pendmap
from pendmap import Effect, InputError, Pendulum, Rig

DRIVEN = Pendulum(gamma=0.1, p=1.0, omega=2.0)
RIG = Rig(w0=6.2, c_over_m=1.0, p=0.9, Omega=12.4)
PLANE = {"p": (0, 1, 3), "omega": (1, 2, 3)}


def over(*axes: object) -> dict[str, Any]:
    """Return ranges over p, and omega if it is given."""
    return dict(zip(("p", "omega"), axes, strict=False))


RANGES = [
    ([1, 2], "ranges must be a mapping"),
    (over((0, 1, 3)), "ranges must be a mapping"),
    ({**PLANE, "gamma": (0, 1, 2)}, "got p, omega, gam"),
    ({"p": (0, 1, 3), "Omega": (1, 2, 3)}, "'Omega' is no parameter of this model"),
    ({"p": (0, 1, 3), "viscous_damping.gamma": (0, 1, 3)}, "is no parameter of this model"),
    ({"p": (0, 1, 3), "gamma": (-1, 2, 3)}, "gamma = -1: gamma must be 0 or more, got -1"),
    (over((0, 1, 3), (0, 2, 3)), "omega must be a number above 0, got 0"),
    (over((1, 1, 3), (1, 2, 3)), "two finite values a finite distance apart"),
    (over((0, math.nan, 3), (1, 2, 3)), "p must be .*, got nan"),
    (over((0, 1, 0), (1, 2, 3)), "how many must be .*, got 0"),
    (over((0, 1), (1, 2, 3)), "first, last, how many"),
    (over((0, 1, 1), (1, 2, 2)), "p is 0 to 1: one value has one bound"),
    (over([], [1.0]), r"p must be an array \(N,\) of finite numbers"),
    (over([0.4, 0.2, 0.3], [1.0]), "p must be ascending or descending values"),
]
CURVES = [
    (over([0.1, 0.2], [2.0]), "omega must have as many values as p, 2, got 1"),
    (over([0.1, 0.3, 0.2], [1, 2, 3]), "p must be ascending"),
    (over([0.1, 0.2], [1, -2]), "p = 0.2: omega must be a number above 0, got -2"),
    ({"c": over([1, 2], np.zeros((2, 2)))}, r"omega must be an array \(N,\)"),
]
OF_RIGS = [
    ({"stroke_mm": (-1, 20, 2), "c_over_m": (1, 2, 2)}, "stroke_mm must be 0 or more, got -1"),
    ({"stroke_mm": (1, 2, 2), "p": (0.1, 0.2, 2)}, "stroke_mm and p must be two parameters"),
    (
        {"p": (0.1, 0.2, 2), "Tr": (-1, 1, 2)},
        r"Tr = -1: theta_r must be 0 or more, got -0.026.* \(without dimensions, w0 is 6.2\)",
    ),
]


LINE = {"ranges": {"p": (0.5, 0.6, 2)}}
ONE_START = {"theta": 1.0, "velocity": 0.0}
TO_10 = {**ONE_START, "until": 10.0}
RUBBING = (Effect("coulomb_friction", {"theta_r": 0.05}),)
SIDEWAYS = (Effect("lateral_drive", {"e": 0.1, "phase": 0.0}),)
FED = (Effect("quadratic_drag", {"q": -1.0}),)
CALLS = [
    ("basins", {"threads": 0}, "threads must be a whole number from 1 to 256, got 0"),
    ("basins", {"threads": 1.5}, "threads must be a whole number from 1 to 256, got 1.5"),
    ("basins", {"seed": -1}, "seed must be a whole number from 0 to .*, got -1"),
    ("basins", {"progress": 3}, "progress must be a function of two numbers"),
    ("sweep", {**LINE, "grid": 0}, "grid must be a whole number"),
    ("sweep", {**LINE, "check": 2}, "check must be"),
    ("parameter_map", {"ranges": PLANE, "starts": 0}, "starts must be .*, got 0"),
    ("parameter_map", {"ranges": PLANE, "box": 3}, "box"),
    ("orbit", {"n": 65}, "n must be a whole number from 1 to 64, got 65"),
    ("orbit", {"n": 1.5}, "n must be .*, got 1.5"),
    ("orbit", {"w": math.nan}, "w must be .*, got nan"),
    ("orbit", {"grid": 3}, "Grid"),
    ("lyapunov", {"precision": 0.0}, "precision must be a number above 0, up to 0.5, got 0"),
    ("lyapunov", {"precision": math.nan}, "precision must be .*, got nan"),
    ("lyapunov", {"theta": math.inf}, "theta must be .*, got inf"),
    ("lifetime", {"starts": 10}, "starts must be a whole number from 100 .*, got 10"),
    ("lifetime", {"from_period": -1}, "from_period must be .*, got -1"),
    ("tongues", {"omega": [2.0, 1.0]}, "ascending"),
    ("tongues", {"omega": 0.0}, "above 0"),
    ("tongues", {"p_max": 0.0}, "p_max must be .*, got 0"),
    ("tongues", {"p_max": 2.1e5, "omega": 2.0}, "up to 50000 times the square of the lowest"),
    ("melnikov", {"omega": [2.0, 1.0]}, "ascending"),
    ("simulate", {**TO_10, "velocity": math.inf}, "velocity must be a finite number, got inf"),
    ("simulate", {**TO_10, "until": 0}, "until must be a time above 0 .*, got 0"),
    ("simulate", ONE_START, "until must be a time above 0 where t_eval is left out, got None"),
    ("simulate", {**ONE_START, "t_eval": [2, 1]}, r"t_eval must be ascending values, got \[2, 1\]"),
    ("simulate", {**ONE_START, "t_eval": [-1, 1]}, "t_eval must be times from 0"),
    ("simulate", {**TO_10, "t_eval": [20.0]}, "t_eval must end by until = 10, got 20"),
    ("simulate", {**TO_10, "t_eval": [2.0], "samples": 4}, "samples must be left out with t_eval"),
    ("simulate", {**TO_10, "t_eval": [2], "lyapunov": True}, "lyapunov must be left out with t_ev"),
    ("simulate", {**TO_10, "theta": [0, 1], "live": print}, "live must be left out with several"),
    ("simulate", {**TO_10, "live": 3}, "live"),
    ("simulate", {**TO_10, "theta": [0, 1], "velocity": [1]}, "they must be as many"),
    ("simulate", {**TO_10, "theta": []}, "theta must have one start or more, got none"),
]
MODELS = [
    ("tongues", {"theta_r": 0.05}, "friction holds it whatever the drive"),
    ("tongues", {"effects": RUBBING}, "friction holds"),
    ("tongues", {"effects": SIDEWAYS}, "a sideways drive or an effect moves it"),
    ("melnikov", {"torque": 1.0}, "torque must be above -1 and below 1"),
    ("melnikov", {"torque": -1.3}, "torque must be above -1 and below 1"),
    ("melnikov", {"effects": (Effect("elastic_restoring", {"k": 0.05}),)}, "counts turns"),
    ("simulate", {"p": -2e6}, "times gravity"),
    ("simulate", {"p": 1e14}, "times gravity"),
    ("simulate", {"effects": FED}, "leaves the range of numbers"),
    ("basins", {"effects": FED}, "leaves the range of numbers"),
]


MORE = {
    "simulate": {"theta": 1.0, "velocity": 2.0, "until": 30.0},
    "basins": {"grid": 20},
    "tongues": {"omega": 2.0},
}
REFUSED = [
    *(("parameter_map", DRIVEN, {"ranges": ranges}, text) for ranges, text in RANGES),
    *(("bifurcation", DRIVEN, {"ranges": ranges}, text) for ranges, text in CURVES),
    *(("parameter_map", RIG, {"ranges": ranges}, text) for ranges, text in OF_RIGS),
    *((name, DRIVEN, given, text) for name, given, text in CALLS),
    *((name, Pendulum(**model), MORE.get(name, {}), text) for name, model, text in MODELS),
]


@pytest.mark.parametrize(("name", "model", "given", "text"), REFUSED)
def test_bad_input(name: str, model: Pendulum | Rig, given: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        getattr(pendmap, name)(model, **given)


@pytest.mark.parametrize("labels", [np.zeros(5, int), np.ones((3, 3)), np.zeros((0, 3), int)])
def test_labels_of_no_plane(labels: object) -> None:
    for measure in (pendmap.basin_entropy, pendmap.uncertainty_exponent):
        with pytest.raises(InputError, match="labels"):
            measure(labels)


def test_what_is_no_result_has_no_model() -> None:
    with pytest.raises(InputError, match="dataset must be a result of pendmap"):
        pendmap.pendulum_of(3)  # type: ignore[arg-type]
