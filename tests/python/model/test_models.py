"""Models in SI and without dimensions, and their files: conversion, round trips, refusals."""

from __future__ import annotations

import dataclasses
import datetime as dt
import json
import math
import pickle
import tomllib
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from models import DRAG, EXAMPLE, SWING, written
from pendmap import Effect, Formula, InputError, Pendulum, Rig, load_model, save_model

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


def test_the_paper_s_quantities_by_hand() -> None:
    # w0 = sqrt(9.81 / 0.2725) = 6; f = 3 / pi Hz is Omega = 6; Y = 50 mm gives 0.05 * 36 / 9.81.
    rig = Rig.of(length_m=0.2725, c_over_m=0.6, Tr=0.72, stroke_mm=50, frequency_hz=3 / math.pi)
    assert rig.w0 == pytest.approx(6, rel=1e-15)
    assert rig.length_m == pytest.approx(0.2725, rel=1e-15)
    assert rig.period == pytest.approx(math.pi / 3, rel=1e-15)
    pendulum = rig.pendulum
    assert pendulum.gamma == pytest.approx(0.1, rel=1e-15)
    assert pendulum.theta_r == pytest.approx(0.02, rel=1e-15)
    assert pendulum.omega == pytest.approx(1, rel=1e-15)
    assert pendulum.p == pytest.approx(1.8 / 9.81, rel=1e-15)


def test_times_torques_and_effects_have_their_powers_of_w0() -> None:
    effects = (Effect("bearing_harmonic", {"amplitude": 8.0, "n": 3.0, "psi": 0.5}), DRAG)
    notes = {"provenance": {"command": "identify"}, "covariance": {"w0": [1.0]}}
    rig = Rig(w0=2.0, torque=2.0, lab_time_s=50.0, phi=0.25, effects=effects, notes=notes)
    pendulum = rig.pendulum
    assert (pendulum.torque, pendulum.lab_time, pendulum.phase) == (0.5, 100.0, 0.25)
    harmonic, drag = pendulum.effects
    assert harmonic.parameters == {"amplitude": 2.0, "n": 3.0, "psi": 0.5}
    assert drag.parameters == DRAG.parameters
    assert pendulum.notes == {"provenance": {"command": "identify"}}
    assert Rig.from_pendulum(pendulum, 2.0) == dataclasses.replace(rig, Omega=2.0)


def test_zeta_is_half_of_gamma() -> None:
    rig = Rig.of(w0=6.0, zeta=0.05)
    assert rig.c_over_m == pytest.approx(0.6, rel=1e-15)
    assert rig.pendulum.gamma == pytest.approx(0.1, rel=1e-15)
    assert rig.zeta == pytest.approx(rig.pendulum.zeta, rel=1e-15)
    assert Rig.of(w0=6.0, zeta=0.05, c_over_m=0.6).c_over_m == 0.6
    # sqrt(1 - zeta^2) and exp(-zeta pi / sqrt(1 - zeta^2)) of eqs. 2.2 to 2.6, small swings
    run = pendmap.simulate(rig, 1e-4, 0.0, math.pi / (6 * math.sqrt(1 - 0.05**2)), tol=1e-12)
    delta = 0.05 / math.sqrt(1 - 0.05**2)
    assert float(run.theta[-1]) == pytest.approx(-1e-4 * math.exp(-delta * math.pi), rel=1e-8)
    assert float(run.velocity[-1]) == pytest.approx(0, abs=1e-11)


@pytest.mark.parametrize(
    ("name", "values", "si"),
    [
        ("viscous_damping", {"gamma": 0.1}, "c_over_m"),
        ("coulomb_friction", {"theta_r": 0.1}, "Tr"),
        ("bias_torque", {"torque": 0.1}, "torque"),
    ],
)
def test_two_names_of_one_term_are_refused(name: str, values: dict[str, float], si: str) -> None:
    effect, (field,) = Effect(name, values), values
    with pytest.raises(InputError, match=rf"{field} is 0\.2, the same term as the effect {name}"):
        Pendulum(**({"gamma": 0} | {field: 0.2}), effects=(effect,))
    with pytest.raises(InputError, match=rf"{si} is 0\.2, the same term as the effect {name}"):
        Rig(w0=6, **{si: 0.2}, effects=(effect,))
    either = Pendulum(**({"gamma": 0} | values)), Pendulum(gamma=0, effects=(effect,))
    ends = [pendmap.simulate(x, 2.0, 0.0, 5.0).theta.values for x in either]
    assert np.array_equal(*ends)


def test_models_are_values() -> None:
    for model in (SWING, SWING.pendulum):
        again = pickle.loads(pickle.dumps(model))  # noqa: S301 (written here)
        assert again == model
        assert hash(again) == hash(model)
    assert Pendulum(effects=[DRAG]).effects == (DRAG,)  # type: ignore[arg-type]
    assert dataclasses.replace(SWING, w0=5.0).effects == SWING.effects


def of(**given: Any) -> Rig:  # noqa: ANN401 (any quantity)
    return Rig.of(**{"w0": 6.2, **given})


def drag(**given: Any) -> Effect:  # noqa: ANN401 (any argument)
    return Effect(**{"name": "quadratic_drag", "parameters": {"q": 0.1}, **given})


FAR = Effect("bearing_harmonic", {"amplitude": 1, "n": 2000, "psi": 0})


@pytest.mark.parametrize(
    ("model", "words", "complaint"),
    [
        (
            *(of, {"w0": 6, "zeta": 0.1, "c_over_m": 0.6}),
            "c_over_m is 0.6, but 1.2 by 2 zeta w0 of zeta = 0.1: they contradict, one of them",
        ),
        (
            *(of, {"p": 0.5, "stroke_mm": 20, "frequency_hz": 1.9}),
            "p is 0.5, but 0.290555 by Y Omega^2/g of stroke_mm = 20, Omega = 11.9381 and",
        ),
        (of, {"Omega": 12, "frequency_hz": 12}, "Omega is 12, but 75.3982 by 2 pi f"),
        (of, {"length_m": 0.3}, "w0 is 6.2, but 5.71839 by sqrt(g/l) of length_m = 0.3"),
        (Rig.of, {"c_over_m": 0.1}, "w0 is missing: a model in SI needs w0 in rad/s, or length_m"),
        (of, {"stroke_mm": 20}, "stroke_mm needs a frequency: Omega or frequency_hz must"),
        (of, {"p": 0.3}, "Omega must be a number above 0 where something is driven, got 0"),
        (of, {"w0": 0}, "w0 must be a number from 1e-06 to 1e+06 rad/s, got 0"),
        (of, {"length_m": -0.2}, "length_m must be a number above 0, got -0.2"),
        (of, {"Omega": -2}, "Omega must be 0 or more, got -2"),
        (of, {"torque": math.nan}, "torque must be a finite number, got nan"),
        (of, {"gamma": 0.1}, "gamma is not known: it must be one of w0, length_m"),
        (of, {"effects": (FAR,)}, "to 1000, got 2000 (without dimensions, w0 is 6.2)"),
        (drag, {"name": "drag"}, "name must be an effect of the library, got 'drag'"),
        (drag, {"parameters": {}}, "quadratic_drag: q is missing: it needs q (1/rad)"),
        (drag, {"parameters": {"q": 1, "r": 2}}, "quadratic_drag: parameters: r is not known"),
        (drag, {"ci95": {"q": [2, 1]}}, "must be [low, high], the lower first, got [2, 1]"),
        (drag, {"probability": 2}, "quadratic_drag: probability must be a number from 0 to 1"),
        (drag, {"approximate": "yes"}, "approximate must be True or False, got 'yes'"),
        (Pendulum, {"effects": (DRAG, DRAG)}, "quadratic_drag and quadratic_drag are the same"),
        (Pendulum, {"effects": DRAG}, "effects must be a tuple of Effect, got Effect("),
    ],
)
def test_bad_numbers_are_refused_on_one_line(
    model: Callable[..., object], words: dict[str, Any], complaint: str
) -> None:
    with pytest.raises(InputError) as error:
        model(**words)
    assert complaint in str(error.value)
    assert "\n" not in str(error.value)


# Files


def test_a_file_in_si_with_every_key_is_read_and_written_unchanged(tmp_path: Path) -> None:
    rig = load_model(written(tmp_path, EXAMPLE))
    assert isinstance(rig, Rig)
    assert (rig.w0, rig.c_over_m, rig.Tr, rig.phi, rig.lab_time_s) == (6.2, 0.05, 0.08, 0.3, 150)
    assert rig.Omega == pytest.approx(2 * math.pi * 1.9, rel=1e-15)
    assert rig.p == pytest.approx(0.02 * rig.Omega**2 / 9.81, rel=1e-15)
    quadratic, harmonic = rig.effects
    assert quadratic == drag(
        parameters={"q": 0.012}, ci95={"q": (0.011, 0.013)}, probability=0.97, approximate=False
    )
    assert (harmonic.values, harmonic.ci95) == ([0.6, 4.0, 0.1], {})
    path = save_model(rig, tmp_path / "again.toml")
    before, after = (tomllib.loads(text) for text in (EXAMPLE, path.read_text(encoding="utf-8")))
    for table in ("covariance", "provenance"):
        assert after[table] == before[table]
    assert after["provenance"]["made"] == dt.datetime(2024, 5, 1, 12, tzinfo=dt.UTC)
    assert after["effect"][0] == before["effect"][0]
    assert after["format_version"] == 1
    assert load_model(path) == rig
    assert save_model(load_model(path), tmp_path / "third.toml").read_bytes() == path.read_bytes()
    bare = load_model(save_model(rig.pendulum, tmp_path / "bare.toml"))
    assert bare == rig.pendulum
    assert bare.effects[1].values == pytest.approx([0.6 / 6.2**2, 4, 0.1], rel=1e-15)
    assert "covariance" not in bare.notes
    notes = {"provenance": {'\n"\x7f\\': "\x7f\u2028"}}
    extreme = Pendulum(gamma=1e300, p=-1 / 3, omega=5e-324, notes=notes)
    back = load_model(save_model(extreme, tmp_path / "extreme.toml"))
    assert (back, back.notes) == (extreme, notes)


@pytest.mark.parametrize("in_si", [True, False])
def test_models_become_dicts_and_come_back(tmp_path: Path, in_si: bool) -> None:  # noqa: FBT001
    bend = Formula("bend", "-k*sqrt(abs(v))*sign(v) - b*sin(theta)", {"k": 1.5, "b": 2})
    rig = load_model(written(tmp_path, EXAMPLE))
    notes = {"covariance": rig.notes["covariance"]}
    rig = dataclasses.replace(rig, effects=(*rig.effects, bend(k=0.1, b=0.2)), notes=notes)
    model = rig if in_si else rig.pendulum
    again = type(model).from_dict(json.loads(json.dumps(model.to_dict())))
    assert again == model
    assert again.notes == model.notes
    other = Pendulum if in_si else Rig
    with pytest.raises(InputError, match=r"content must be a model .*, got one of the other kind"):
        other.from_dict(model.to_dict())
    for wrong in ([], {"pendulum": {"w1": 3}}, {}):
        with pytest.raises(InputError):
            type(model).from_dict(wrong)  # type: ignore[arg-type]


def test_a_rig_is_driven_by_stroke_and_frequency() -> None:
    rig = Rig(w0=6.2, c_over_m=0.05, phi=0.4, effects=(DRAG,))
    shaken = rig.driven(stroke_mm=20, frequency_hz=1.9)
    assert shaken == dataclasses.replace(rig, p=shaken.p, Omega=2 * math.pi * 1.9)
    assert shaken.p == pytest.approx(0.02 * shaken.Omega**2 / 9.81, rel=1e-15)
    faster = shaken.driven(frequency_hz=3.8)
    assert faster.p == pytest.approx(4 * shaken.p, rel=1e-15)  # the stroke stays
    assert shaken.driven(p=0.3, phi=0.0) == dataclasses.replace(shaken, p=0.3, phi=0.0)
    for wrong in ({"w0": 3.0}, {"stroke_mm": 20.0}, {"p": 0.2, "stroke_mm": 20, "Omega": 9.0}):
        with pytest.raises(InputError, match=r"w0 is not known|needs a frequency|contradict"):
            rig.driven(**wrong)


@pytest.mark.parametrize(
    "text",
    [
        "[pendulum]\ngamma = 0.2\n",
        "[pendulum]\nzeta = 0.1\n",
        "[pendulum]\nzeta = 0.1\ngamma = 0.2\n",
        b"\xef\xbb\xbf[pendulum]\ngamma = 0.2\n",
        b"[pendulum]\r\ngamma = 0.2\r\n",
        "pendulum = { gamma = 0.2 }",
        "[pendulum]\ngamma = 0.2\n[provenance]\n",
    ],
)
def test_unusual_valid_files_are_read(tmp_path: Path, text: str | bytes) -> None:
    assert load_model(written(tmp_path, text)) == Pendulum(gamma=0.2, p=0, omega=1)


KNOWN = (
    "it must be one of gamma, p, omega, phase, torque, theta_r, lab_time, zeta, or in SI w0, length"
)
EFFECT = '[pendulum]\n[[effect]]\nname = "quadratic_drag"\n'


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "has no table [pendulum]"),
        (b"x = " + b"[" * 100_000, "not a TOML file: "),
        ("[pendulum]\n[rig]\nw0 = 6\n", "[rig] is not known: it must be one of [pendulum]"),
        ("gamma = 1\n[pendulum]\n", "gamma is not known: it must be one of [pendulum], [[formula]"),
        ("format_version = 2\n[pendulum]\n", "must be a whole number from 1 to 1, got 2"),
        # keys
        ("[pendulum]\nlength_cm = 25\n", "length_cm is not known, perhaps length_m is meant"),
        ("[pendulum]\ngama = 1\n", f"gama is not known, perhaps gamma is meant: {KNOWN}"),
        ('[pendulum]\n"a\\nb" = 1\n', r"'a\nb' is not known"),
        (
            "[pendulum]\nw0 = 6\ngamma = 0.1\n",
            "gamma has no dimensions and w0 is in SI: both must be of one kind; gamma is c_over_m",
        ),
        # numbers
        ("[pendulum]\ngamma = nan\n", "gamma must be a finite number, got nan"),
        ("[pendulum]\np = 1\n", "p without omega: a drive needs a frequency above 0"),
        ("[pendulum]\ngamma = 0.1\nzeta = 0.1\n", "gamma is 0.1, but 0.2 by 2 zeta of zeta = 0.1"),
        # effects
        ("[pendulum]\n[effect]\n", "effect must be [[effect]], one table each, got {}"),
        ("effect = [1]\n[pendulum]\n", "[[effect]] 1: must be a table, got 1"),
        (EFFECT, "[[effect]] 1: parameters must be given, like parameters = { q = 0.01 }"),
    ],
)
def test_errors_of_a_file_are_reported_on_one_line(
    tmp_path: Path, text: str | bytes, complaint: str
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputError) as error:
        load_model(path)
    assert str(error.value).startswith(f"{path}: ")
    assert complaint in str(error.value)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 400


@pytest.mark.parametrize(
    ("model", "complaint"),
    [
        (Pendulum(notes={"covariance": [1]}), r"must be a table \[covariance\], got"),
        (Pendulum(notes={"covariance": {"a": None}}), "NoneType"),
        (Pendulum(notes=[1]), r"notes must be a mapping, got \[1\]"),  # type: ignore[arg-type]
        (3, r"model must be a Pendulum, like Pendulum\(p=0\.6\), got 3"),
    ],
)
def test_what_is_no_model_is_not_written(
    tmp_path: Path,
    model: Any,  # noqa: ANN401
    complaint: str,
) -> None:
    with pytest.raises(InputError, match=complaint):
        save_model(model, tmp_path / "a.toml")
    assert not list(tmp_path.iterdir())
