"""Features of SINDy in the benchmark, against formulas and motions written here.

Wrong features would make the benchmark's comparison unfair.
"""

from __future__ import annotations

import importlib
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pendmap.identification.runs import FitRun
from pendmap.virtual_rig.equation import Parameters

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

W0, DAMPING = 6.0, 0.05
AMPLITUDE, OMEGA, PHASE = 0.3, 11.0, 0.7
INTERVAL = 0.002
TIME = np.arange(0.0, 8.0, INTERVAL)

FAINT = 1e-5
"""Size of a hidden effect, small enough for its square to be negligible."""


@pytest.fixture(scope="module")
def sindy() -> ModuleType:
    """Return the module ``benchmarks/blind/sindy_features.py``."""
    sys.path.insert(0, str(Path(__file__).parents[3]))
    return importlib.import_module("benchmarks.blind.sindy_features")


class Motion(NamedTuple):
    """A motion with its time derivatives: rad, rad/s, rad/s^2."""

    theta: Floats
    v: Floats
    a: Floats


def rates(time: Floats, theta: Floats, v: Floats, drag: float = 0.0) -> Floats:
    """Return ``th''`` of the driven pendulum."""
    lift = AMPLITUDE * np.cos(OMEGA * time + PHASE)
    return -(W0**2) * (1 + lift) * np.sin(theta) - DAMPING * v - drag * v * np.abs(v)


def motion(time: Floats = TIME, drag: float = 0.0) -> Motion:
    """Return the motion at ``time``, without noise."""
    solved = solve_ivp(
        lambda t, y: [y[1], rates(t, y[0], y[1], drag)],
        (TIME[0] - 0.1, TIME[-1]),
        [1.5, 0.0],
        dense_output=True,
        rtol=1e-12,
        atol=1e-12,
    )
    theta, v = solved.sol(time)
    return Motion(theta, v, rates(time, theta, v, drag))


def run(theta: Floats) -> FitRun:
    """Return the record of a driven motion."""
    drive = {"p": AMPLITUDE, "Omega": OMEGA, "phi": PHASE}
    return FitRun(TIME, theta, 1e-5, drive=drive)


def offered(
    sindy: ModuleType, seen: Motion, effect: str, phase: float = 0.0, **shape: float
) -> Floats:
    """Return the column of one feature along a motion."""
    states = sindy.States(run(seen.theta), INTERVAL, 5, *seen)
    rig = Parameters(W0, DAMPING, 0.01)
    pool = [
        (candidate, feature)
        for candidate, feature in sindy.features([states], rig)
        if feature.effect == effect
        and math.isclose(feature.phase, phase)
        and all(math.isclose(dict(feature.shape)[n], v) for n, v in shape.items())
    ]
    assert len(pool) == 1, [feature for _, feature in pool]
    return np.asarray(sindy.columns(states, rig, pool)[:, 0])


@pytest.mark.parametrize(
    ("effect", "shape", "torque"),
    [
        ("quadratic_drag", {}, lambda m: -m.v * abs(m.v)),
        ("cubic_damping", {}, lambda m: -(m.v**3)),
        ("asymmetric_coulomb", {}, lambda m: -np.ones_like(m.v)),
        ("bias_torque", {}, lambda m: np.ones_like(m.v)),
        ("bearing_harmonic", {"n": 3.0}, lambda m: np.sin(3 * m.theta)),
        ("magnet", {"width": 0.3}, lambda m: -m.theta / 0.3 * np.exp(-((m.theta / 0.3) ** 2) / 2)),
        ("rig_tilt", {}, lambda m: -(W0**2) * np.cos(m.theta)),
        (
            "inertia_ripple",
            {"n": 2.0},
            lambda m: np.sin(2 * m.theta) * m.v**2 - np.cos(2 * m.theta) * m.a,
        ),
    ],
)
def test_torques_are_those_of_their_formulas(
    sindy: ModuleType, effect: str, shape: dict[str, float], torque: Callable[[Motion], Floats]
) -> None:
    seen = motion()
    expected, found = torque(seen), offered(sindy, seen, effect, **shape)
    moving = np.abs(seen.v) > 1e-3
    # To first order in the size; a ripple's acceleration includes the rig's friction too.
    assert np.max(np.abs(found - expected)[moving]) < 2e-4 * np.max(np.abs(expected))


def read_by(*g: Callable[[Floats], Floats]) -> Callable[[Motion], Motion]:
    """Return the reading ``y = th + e g(th)`` of a motion, from g and its two derivatives."""

    def reading(m: Motion) -> Motion:
        error, slope, bend = (FAINT * part(m.theta) for part in g)
        return Motion(m.theta + error, (1 + slope) * m.v, (1 + slope) * m.a + bend * m.v**2)

    return reading


def read_at(rate: float) -> Callable[[Motion], Motion]:
    """Return the motion as read on a clock of that rate."""
    return lambda m: Motion(m.theta, rate * m.v, rate**2 * m.a)


@pytest.mark.parametrize(
    ("effect", "phase", "reading", "when"),
    [
        ("encoder_offset", 0.0, read_by(np.ones_like, np.zeros_like, np.zeros_like), TIME),
        ("encoder_gain", 0.0, read_by(np.array, np.ones_like, np.zeros_like), TIME),
        ("encoder_eccentricity", 0.0, read_by(np.sin, np.cos, lambda th: -np.sin(th)), TIME),
        (
            "encoder_eccentricity",
            math.pi / 2,
            read_by(np.cos, lambda th: -np.sin(th), lambda th: -np.cos(th)),
            TIME,
        ),
        ("sensor_lag", 0.0, read_at(1.0), TIME - FAINT),
        ("timebase", 0.0, read_at(1 / (1 + FAINT)), TIME / (1 + FAINT)),
    ],
)
def test_reading_features_are_those_of_distorted_readings(
    sindy: ModuleType,
    effect: str,
    phase: float,
    reading: Callable[[Motion], Motion],
    when: Floats,
) -> None:
    read = reading(motion(when))
    error = (read.a - rates(TIME, read.theta, read.v)) / FAINT
    seen = motion()
    found = offered(sindy, seen, effect, phase=phase)
    lift = AMPLITUDE * np.cos(OMEGA * TIME + PHASE)
    base = np.column_stack([(1 + lift) * np.sin(seen.theta), seen.v])

    def left(column: Floats) -> Floats:
        """Remove the part that gravity and damping, in every model, explain."""
        return np.asarray(column - base @ np.linalg.lstsq(base, column)[0])

    assert np.max(np.abs(left(error))) > 0.01 * np.max(np.abs(error))
    assert np.max(np.abs(left(found) - left(error))) < 0.002 * np.max(np.abs(left(error)))


def test_the_filter_preserves_the_motion(sindy: ModuleType) -> None:
    seen = motion()
    states = sindy.states_of(run(seen.theta), 15)
    inner = slice(15, -15)
    found = (states.theta, states.velocity, states.acceleration)
    for own, true in zip(found, seen, strict=True):
        assert np.max(np.abs(own - true)[inner]) < 1e-3 * np.max(np.abs(true))


def test_a_drag_is_found_in_a_record_of_it(sindy: ModuleType) -> None:
    drag = 0.02
    theta = motion(drag=drag).theta
    record = run(theta + np.random.default_rng(1).normal(0, 1e-4, theta.shape))
    (states,), rig = sindy.smoothed([record], 2.0)
    assert rig.w0 == pytest.approx(W0, rel=0.01)
    column = offered(
        sindy, Motion(states.theta, states.velocity, states.acceleration), "quadratic_drag"
    )
    every = np.column_stack([states.base, column])[50:-50]
    fitted = np.linalg.lstsq(every, states.acceleration[50:-50])[0]
    assert math.sqrt(fitted[0]) == pytest.approx(W0, rel=1e-3)
    assert fitted[3] == pytest.approx(drag, rel=0.1)
