"""A rig in SI and a dimensionless pendulum: one conversion, two gammas, no contradictions."""

from __future__ import annotations

import dataclasses
import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pendmap
from models import DRAG, SWING
from pendmap import Effect, InputError, Pendulum, Rig

sizes = st.floats(1e-3, 1e3)
signed = st.floats(-1e3, 1e3)


# Numbers


def test_the_paper_s_quantities_by_hand() -> None:
    # w0 = sqrt(9.81 / 0.2725) = 6; f = 3 / pi Hz is Omega = 6; Y = 50 mm gives 0.05 * 36 / 9.81.
    rig = Rig.of(length_m=0.2725, c_over_m=0.6, Tr=0.72, stroke_mm=50, frequency_hz=3 / math.pi)
    assert rig.w0 == pytest.approx(6, rel=1e-15)
    assert rig.length_m == pytest.approx(0.2725, rel=1e-15)
    assert rig.stroke_m == pytest.approx(0.05, rel=1e-15)
    assert rig.period == pytest.approx(math.pi / 3, rel=1e-15)
    pendulum = rig.pendulum
    assert pendulum.gamma == pytest.approx(0.1, rel=1e-15)
    assert pendulum.theta_r == pytest.approx(0.02, rel=1e-15)
    assert pendulum.omega == pytest.approx(1, rel=1e-15)
    assert pendulum.p == pytest.approx(1.8 / 9.81, rel=1e-15)


def test_times_torques_and_effects_have_their_powers_of_w0() -> None:
    effects = (Effect("bearing_harmonic", {"amplitude": 8.0, "n": 3.0, "psi": 0.5}), DRAG)
    pendulum = Rig(w0=2.0, torque=2.0, lab_time_s=50.0, phi=0.25, effects=effects).pendulum
    assert (pendulum.torque, pendulum.lab_time, pendulum.phase) == (0.5, 100.0, 0.25)
    harmonic, drag = pendulum.effects
    assert harmonic.parameters == {"amplitude": 2.0, "n": 3.0, "psi": 0.5}
    assert drag.parameters == DRAG.parameters


@given(
    w0=st.floats(0.1, 100),
    gamma=st.floats(0, 10),
    p=signed,
    omega=sizes,
    phase=signed,
    torque=signed,
    theta_r=st.floats(0, 10),
    lab_time=signed,
    q=signed,
)
@settings(max_examples=60)
def test_conversion_and_its_inverse_give_the_number_back(
    w0: float, q: float, **numbers: float
) -> None:
    effect = Effect("quadratic_drag", {"q": q}, ci95={"q": (q - 1, q + 1)})
    pendulum = Pendulum(**numbers, effects=(effect,))
    rig = Rig.from_pendulum(pendulum, w0)
    back = rig.pendulum
    for name in Pendulum.numbers():
        assert getattr(back, name) == pytest.approx(getattr(pendulum, name), rel=1e-15, abs=1e-300)
    assert back.effects == pendulum.effects
    assert rig.period * w0 == pytest.approx(pendulum.period, rel=1e-15)


def test_conversion_keeps_the_provenance_and_drops_a_covariance_of_other_numbers() -> None:
    notes = {"provenance": {"command": "identify"}, "covariance": {"w0": [1.0]}}
    rig = dataclasses.replace(SWING, notes=notes)
    assert rig.pendulum.notes == {"provenance": {"command": "identify"}}
    assert rig == SWING


# Two gammas


def test_zeta_is_half_of_gamma() -> None:
    rig = Rig.of(w0=6.0, zeta=0.05)
    assert rig.c_over_m == pytest.approx(0.6, rel=1e-15)
    assert rig.zeta == pytest.approx(0.05, rel=1e-15)
    assert rig.pendulum.gamma == pytest.approx(0.1, rel=1e-15)
    assert rig.pendulum.zeta == pytest.approx(0.05, rel=1e-15)
    assert Rig.of(w0=6.0, zeta=0.05, c_over_m=0.6).c_over_m == 0.6
    # sqrt(1 - zeta^2) and exp(-zeta pi / sqrt(1 - zeta^2)) of eqs. 2.2 to 2.6, small swings
    run = pendmap.simulate(rig, 1e-4, 0.0, math.pi / (6 * math.sqrt(1 - 0.05**2)), tol=1e-12)
    delta = 0.05 / math.sqrt(1 - 0.05**2)
    assert float(run.theta[-1]) == pytest.approx(-1e-4 * math.exp(-delta * math.pi), rel=1e-8)
    assert float(run.velocity[-1]) == pytest.approx(0, abs=1e-11)


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        (
            {"w0": 6, "zeta": 0.1, "c_over_m": 0.6},
            "c_over_m is 0.6, but 1.2 by 2 zeta w0 of zeta = 0.1: they contradict, one of them",
        ),
        (
            {"w0": 6.2, "p": 0.5, "stroke_mm": 20, "frequency_hz": 1.9},
            "p is 0.5, but 0.290555 by Y Omega^2/g of stroke_mm = 20, Omega = 11.9381 and",
        ),
        ({"w0": 6.2, "Omega": 12, "frequency_hz": 12}, "Omega is 12, but 75.3982 by 2 pi f"),
        ({"w0": 6.2, "length_m": 0.3}, "w0 is 6.2, but 5.71839 by sqrt(g/l) of length_m = 0.3"),
        ({"c_over_m": 0.1}, "w0 is missing: a model in SI needs w0 in rad/s, or length_m"),
        ({"w0": 6.2, "stroke_mm": 20}, "stroke_mm needs a frequency: Omega or frequency_hz must"),
        ({"w0": 6.2, "p": 0.3}, "Omega must be a number above 0 where something is driven, got 0"),
        ({"w0": 0}, "w0 must be a number from 1e-06 to 1e+06 rad/s, got 0"),
        ({"length_m": -0.2}, "length_m must be a number above 0, got -0.2"),
        ({"w0": 6.2, "c_over_m": -1}, "c_over_m must be 0 or more, got -1"),
        ({"w0": 6.2, "gravity": 0}, "gravity must be a number above 0, got 0"),
        ({"w0": 6.2, "Omega": -2}, "Omega must be a number above 0, got -2"),
        ({"w0": 6.2, "torque": math.nan}, "torque must be a finite number, got nan"),
        ({"w0": "6"}, "w0 must be a number, got '6'"),
        ({"w0": 6.2, "gamma": 0.1}, "gamma is not known: it must be one of w0, length_m"),
    ],
)
def test_contradictory_values_are_refused_with_their_numbers(
    given: dict[str, Any], complaint: str
) -> None:
    with pytest.raises(InputError) as error:
        Rig.of(**given)
    assert complaint in str(error.value)
    assert "\n" not in str(error.value)


# Effects


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ({"name": "drag", "parameters": {}}, "name must be an effect of the library, got 'drag'"),
        ({"parameters": {}}, "quadratic_drag: q is missing: it needs q (1/rad)"),
        ({"parameters": {"q": 1, "r": 2}}, "quadratic_drag: parameters: r is not known"),
        ({"parameters": [1.0]}, "quadratic_drag: parameters must be a mapping of q, got [1.0]"),
        ({"parameters": {"q": "1"}}, "quadratic_drag: q must be a number, got '1'"),
        ({"ci95": {"q": 1.0}}, "ci95 of q must be [low, high], got 1.0"),
        ({"ci95": {"q": [2, 1]}}, "ci95 of q must be [low, high], the lower first, got [2, 1]"),
        ({"probability": 2}, "quadratic_drag: probability must be a number from 0 to 1, got 2"),
        ({"approximate": "yes"}, "quadratic_drag: approximate must be True or False, got 'yes'"),
    ],
)
def test_effects_are_checked_against_the_library(words: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InputError) as error:
        Effect(**({"name": "quadratic_drag", "parameters": {"q": 0.1}} | words))
    assert complaint in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "values", "field", "si"),
    [
        ("viscous_damping", {"gamma": 0.1}, "gamma", "c_over_m"),
        ("coulomb_friction", {"theta_r": 0.1}, "theta_r", "Tr"),
        ("bias_torque", {"torque": 0.1}, "torque", "torque"),
    ],
)
def test_two_names_of_one_term_are_refused(
    name: str, values: dict[str, float], field: str, si: str
) -> None:
    effect = Effect(name, values)
    with pytest.raises(InputError, match=rf"{field} is 0\.2, the same term as the effect {name}"):
        Pendulum(**({"gamma": 0} | {field: 0.2}), effects=(effect,))
    with pytest.raises(InputError, match=rf"{si} is 0\.2, the same term as the effect {name}"):
        Rig(w0=6, **{si: 0.2}, effects=(effect,))
    either = Pendulum(**({"gamma": 0} | values)), Pendulum(gamma=0, effects=(effect,))
    ends = [pendmap.simulate(x, 2.0, 0.0, 5.0).theta.values for x in either]
    assert np.array_equal(*ends)


def test_effects_twice_or_outside_their_range_are_refused() -> None:
    with pytest.raises(InputError, match="quadratic_drag"):
        Pendulum(effects=(DRAG, DRAG))
    far = Effect("bearing_harmonic", {"amplitude": 1, "n": 2000, "psi": 0})
    with pytest.raises(InputError, match="n must be a finite number from 0 to 1000, got 2000"):
        Pendulum(effects=(far,))
    with pytest.raises(InputError, match=r"n must be .*, got 2000 \(without dimensions, w0 is 6\)"):
        Rig(w0=6, effects=(far,))
    for wrong in (DRAG, "quadratic_drag", ["quadratic_drag"], 3):
        with pytest.raises(InputError, match=r"effects must be .*, got "):
            Pendulum(effects=wrong)  # type: ignore[arg-type]


def test_models_are_values() -> None:
    for model in (SWING, SWING.pendulum):
        again = pickle.loads(pickle.dumps(model))  # noqa: S301 (written here)
        assert again == model
        assert hash(again) == hash(model)
        assert dataclasses.asdict(model)["effects"][0]["name"] == "quadratic_drag"
    assert Pendulum(effects=[DRAG]).effects == (DRAG,)  # type: ignore[arg-type]
    assert dataclasses.replace(SWING, w0=5.0).effects == SWING.effects
