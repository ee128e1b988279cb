"""Effects of the library against the virtual rig, which is written independently."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from pendmap import Effect, Pendulum, Rig
from pendmap.virtual_rig import EFFECTS, Experiment, Request, RunPlan, make, places, write

if TYPE_CHECKING:
    from pathlib import Path

W0, LAB, SECONDS = 6.2, 50.0, 10.0
FREE, DRIVEN = (0.0, 1.0), (0.9, 5.4)
STICKS = {"turn", "stick", "release"}
MODE, YIELDING = {"mu": 0.05, "wx": 40.0, "z": 0.02}, {"f": 0.6, "zc": 0.1}
CASES = {
    "whirling": (MODE | {"wx": 60.0}, (0.5, 21.0), 0.0, FREE, set()),
    "rubbing to a rest": (MODE, (2.5, 0.0), 3.5, FREE, {"turn", "stick"}),
    "driven, with sticks": (MODE | {"mu": 0.1}, (1.2, 0.0), 4.0, DRIVEN, STICKS),
    "released by the mode": ({"mu": 0.3, "wx": 20.0, "z": 0.01}, (0.3, 8.0), 3.0, FREE, STICKS),
    "a mode that creeps back": (MODE | {"z": 1.6}, (2.0, 5.0), 3.5, FREE, {"turn", "stick"}),
    "a contact that yields and sticks": (YIELDING, (1.2, 0.0), 4.0, DRIVEN, STICKS),
}
"""Parameters of an effect with a state of its own, start, friction, drive, and what is met."""


def experiment(
    name: str, values: dict[str, float], plan: RunPlan, parameters: tuple[float, float, float]
) -> Experiment:
    """Return a run of the virtual rig with an effect, read without noise and counts."""
    typed = ",".join([name, *(f"{key}={value!r}" for key, value in values.items())])
    given = dict(zip(("w0", "c_over_m", "friction"), parameters, strict=True))
    return make(Request("hidden", 0, (typed,), noise=0.0, counts=0, plans=(plan,), **given))


def compare(  # noqa: PLR0913 (parts of a motion)
    name: str,
    values: dict[str, float],
    start: tuple[float, float],
    friction: float,
    drive: tuple[float, float],
    *,
    c_over_m: float = 0.05,
) -> set[str]:
    """Compare the motion by the library with that of the rig; return what the rig met."""
    effects = (Effect(name, values),)
    model = Rig(W0, c_over_m, friction, 0.0, *drive, lab_time_s=LAB, effects=effects)
    run = pendmap.simulate(model, *start, SECONDS, tol=1e-12)
    # The library's inertia is the whole one, that of the rig lacks the added mass.
    inertia = 1 + values["e"] if name == "added_mass" else 1.0
    plan = RunPlan("forced", *start, SECONDS, *drive, lab_time=LAB)
    parameters = W0 * math.sqrt(inertia), c_over_m * inertia, friction * inertia
    path = experiment(name, values, plan, parameters).runs[0].path
    # An impulse of the rig takes no time.
    bound = 1e-3 if name == "impulses" else 1e-8
    assert run.theta.values == pytest.approx(path.angle(run.time.values), abs=bound)
    assert run.velocity.values[-1:] == pytest.approx(path.velocity(np.array([SECONDS])), abs=bound)
    return {event.what for event in path.events}


@pytest.mark.parametrize("case", CASES)
def test_effects_with_a_state_of_their_own_agree(case: str) -> None:
    values, start, friction, drive, events = CASES[case]
    name = "dahl_friction" if values is YIELDING else "pivot_compliance"
    assert compare(name, values, start, friction, drive) >= events


SHARED = [
    e.name for e in pendmap.effects() if e.name in EFFECTS and EFFECTS[e.name].group != "reading"
]


@pytest.mark.parametrize("name", SHARED)
def test_every_other_effect_agrees(name: str) -> None:
    drawn = EFFECTS[name].draw(np.random.default_rng(5), 10.0, {})
    values = dataclasses.asdict(drawn) | ({"t0": LAB + 1.2} if name == "impulses" else {})
    c_over_m = 0.0 if name == "viscous_damping" else 0.1
    friction = 0.0 if name == "coulomb_friction" else 0.5
    for start, drive in (((1.8, 0.0), FREE), ((0.5, 12.0), (0.3, 12.0))):
        compare(name, values, start, friction, drive, c_over_m=c_over_m)


READINGS = ["encoder_offset", "encoder_drift", "encoder_gain", "encoder_eccentricity"]


@pytest.mark.parametrize("name", [*READINGS, "encoder_backlash"])
def test_readings_agree(name: str, tmp_path: Path) -> None:
    values = dataclasses.asdict(EFFECTS[name].draw(np.random.default_rng(5), 10.0, {}))
    plan = RunPlan("free", 2.0, 0.0, SECONDS)
    where = places(tmp_path / "lab", replace=False)
    write(experiment(name, values, plan, (W0, 0.1, 0.1)), where)
    record = pendmap.read_experiment(where.experiment)
    with_it, without = (
        pendmap.compare(Rig(W0, 0.1, 0.1, effects=effects), record).runs[0].rms
        for effects in ((Effect(name, values),), ())
    )
    # A play of the library is centred where the record starts.
    assert with_it < (1e-3 if name == "encoder_backlash" else 1e-11)
    assert without > 1e-4 > 10 * with_it or name == "encoder_backlash"


def test_a_contact_that_barely_yields_is_a_spring() -> None:
    f, zc, start = 0.3, 0.2, 1e-6
    model = Pendulum(gamma=0.0, p=0.0, effects=(Effect("dahl_friction", {"f": f, "zc": zc}),))
    run = pendmap.simulate(model, start, 0.0, 20.0, tol=1e-13)
    # th'' = -th - (f/zc) (th - start), up to terms of the order start/zc.
    stiff = 1 + f / zc
    middle = start * (f / zc) / stiff
    expected = middle + (start - middle) * np.cos(math.sqrt(stiff) * run.time.values)
    assert run.theta.values == pytest.approx(expected, abs=1e-4 * start)
