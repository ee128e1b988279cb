"""Features of SINDy in the benchmark, along a motion by scipy: wrong ones would be unfair."""

from __future__ import annotations

import functools
import importlib
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pendmap.identification.runs import FitRun
from pendmap.virtual_rig.equation import Parameters

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    Floats = np.ndarray

W0, DAMPING, DRAG = 6.0, 0.05, 0.02
AMPLITUDE, OMEGA, PHASE = 0.3, 11.0, 0.7
INTERVAL = 0.002
TIME = np.arange(0.0, 8.0, INTERVAL)


@pytest.fixture(scope="module")
def sindy() -> ModuleType:
    """Return the module ``benchmarks/blind/sindy_features.py``."""
    sys.path.insert(0, str(Path(__file__).parents[3]))
    return importlib.import_module("benchmarks.blind.sindy_features")


@functools.cache
def path(drag: float = 0.0) -> tuple[Floats, Floats, Floats]:
    """Return angle, velocity and acceleration of the driven pendulum."""

    def rates(time: Floats | float, y: Floats) -> list[Floats]:
        pull = W0**2 * (1 + AMPLITUDE * np.cos(OMEGA * time + PHASE)) * np.sin(y[0])
        return [y[1], -pull - DAMPING * y[1] - drag * y[1] * np.abs(y[1])]

    solved = solve_ivp(rates, (0.0, 8.0), [1.5, 0.0], t_eval=TIME, rtol=1e-12, atol=1e-12)
    return *solved.y, rates(TIME, solved.y)[1]


def run(theta: Floats) -> FitRun:
    drive = {"p": AMPLITUDE, "Omega": OMEGA, "phi": PHASE}
    return FitRun(TIME, theta, 1e-5, drive=drive)


def offered(sindy: ModuleType, states: object, effect: str, **shape: float) -> Floats:
    """Return the column of one feature along a motion."""
    rig = Parameters(W0, DAMPING, 0.01)
    pool = [
        (candidate, feature)
        for candidate, feature in sindy.features([states], rig)
        if feature.effect == effect
        and math.isclose(feature.phase, 0.0)
        and all(math.isclose(dict(feature.shape)[n], v) for n, v in shape.items())
    ]
    assert len(pool) == 1, [feature for _, feature in pool]
    return np.asarray(sindy.columns(states, rig, pool)[:, 0])


@pytest.mark.parametrize(
    ("effect", "shape", "torque"),
    [
        ("quadratic_drag", {}, lambda _, v, __: -v * abs(v)),
        ("magnet", {"width": 0.3}, lambda th, *_: -th / 0.3 * np.exp(-((th / 0.3) ** 2) / 2)),
        ("rig_tilt", {}, lambda th, *_: -(W0**2) * np.cos(th)),
        ("inertia_ripple", {"n": 2.0}, lambda th, v, a: np.sin(2 * th) * v**2 - np.cos(2 * th) * a),
    ],
)
def test_torques_are_those_of_their_formulas(
    sindy: ModuleType, effect: str, shape: dict[str, float], torque: Callable[..., Floats]
) -> None:
    states = sindy.States(run(path()[0]), INTERVAL, 5, *path())
    expected, column = torque(*path()), offered(sindy, states, effect, **shape)
    moving = np.abs(path()[1]) > 1e-3
    # To first order in the size; a ripple's acceleration includes the rig's friction too.
    assert np.max(np.abs(column - expected)[moving]) < 2e-4 * np.max(np.abs(expected))


def test_a_drag_is_found_in_a_record_of_it(sindy: ModuleType) -> None:
    record = run(path(DRAG)[0] + np.random.default_rng(1).normal(0, 1e-4, TIME.shape))
    (states,), rig = sindy.smoothed([record], 2.0)
    assert rig.w0 == pytest.approx(W0, rel=0.01)
    column = offered(sindy, states, "quadratic_drag")
    every = np.column_stack([states.base, column])[50:-50]
    fitted = np.linalg.lstsq(every, states.acceleration[50:-50])[0]
    assert math.sqrt(fitted[0]) == pytest.approx(W0, rel=1e-3)
    assert fitted[3] == pytest.approx(DRAG, rel=0.1)
