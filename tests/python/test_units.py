"""A rig in SI and a pendulum without dimensions: one conversion, two gammas, no contradictions."""

from __future__ import annotations

import dataclasses
import json
import math
import pickle
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib import rc_context
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import pendmap
from pendmap import Effect, Grid, InputError, Pendulum, Rig, figures, viewer
from pendmap.figures import style, trajectory
from pendmap.model.effects import library
from pendmap.model.units import Units
from pendmap.pictures import layers

if TYPE_CHECKING:
    from pathlib import Path

DRAG = Effect("quadratic_drag", {"q": 0.01})
HARMONIC = Effect("bearing_harmonic", {"amplitude": 1.5, "n": 4, "psi": 0.3})
SWING = Rig(w0=6.2, c_over_m=0.05, Tr=0.08, p=0.3, Omega=12.0, phi=0.4, effects=(DRAG, HARMONIC))

sizes = st.floats(1e-3, 1e3)
signed = st.floats(-1e3, 1e3)


# The numbers


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


@pytest.mark.parametrize("name", sorted(library()))
def test_every_effect_of_the_library_converts_by_what_the_library_says(name: str) -> None:
    entries = library()[name]["parameters"]
    values = {e["name"]: float(np.mean(np.clip(e["typical"], *e["range"]))) for e in entries}
    bare = Effect(name, values)
    in_si = bare.given(Units(3.0, si=True))
    for entry in entries:
        less = entry["power_of_w0_less"]
        power = entry["power_of_w0"] - (values[less] if less else 0)
        assert in_si.parameters[entry["name"]] == values[entry["name"]] * 3.0**power
    back = in_si.bare(Units(3.0, si=True))
    assert list(back.parameters.values()) == pytest.approx(list(values.values()), rel=1e-14)


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
@settings(max_examples=60, deadline=None)
def test_there_and_back_is_the_same(w0: float, q: float, **numbers: float) -> None:
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
            "c_over_m is 0.6, but 1.2 by 2 zeta w0 of zeta = 0.1: they contradict, allowed is one",
        ),
        (
            {"w0": 6.2, "p": 0.5, "stroke_mm": 20, "frequency_hz": 1.9},
            "p is 0.5, but 0.290555 by Y Omega^2/g of stroke_mm = 20, Omega = 11.9381 and",
        ),
        (
            {"w0": 6.2, "Y": 0.02, "stroke_mm": 10, "Omega": 12},
            "p is 0.293578 by Y Omega^2/g of Y = 0.02, Omega = 12 and gravity = 9.81, but 0.146789",
        ),
        ({"w0": 6.2, "Omega": 12, "frequency_hz": 12}, "Omega is 12, but 75.3982 by 2 pi f"),
        ({"w0": 6.2, "length_m": 0.3}, "w0 is 6.2, but 5.71839 by sqrt(g/l) of length_m = 0.3"),
        ({"c_over_m": 0.1}, "w0 is missing: a model in SI needs w0 in rad/s, or length_m"),
        ({"w0": 6.2, "stroke_mm": 20}, "stroke_mm has no frequency: allowed beside it is Omega"),
        ({"w0": 6.2, "p": 0.3}, "Omega is 0: allowed is a number above 0 where something"),
        ({"w0": 0}, "w0 is 0: allowed is 1e-06 to 1e+06 rad/s"),
        ({"w0": 1e200}, "w0 is 1e+200: allowed is 1e-06 to"),
        ({"length_m": -0.2}, "length_m is -0.2: allowed is a number above 0"),
        ({"length_m": 1e-20}, "allowed is 1e-06 to 1e+06 rad/s"),
        ({"w0": 6.2, "c_over_m": -1}, "c_over_m is -1: allowed is 0 or more"),
        ({"w0": 6.2, "zeta": -1}, "zeta is -1: allowed is 0 or more"),
        ({"w0": 6.2, "Tr": -1}, "Tr is -1: allowed is 0 or more"),
        ({"w0": 6.2, "gravity": 0}, "gravity is 0: allowed is a number above 0"),
        ({"w0": 6.2, "Omega": -2}, "Omega is -2: allowed is a number above 0"),
        ({"w0": 6.2, "torque": math.nan}, "torque is nan: allowed is any finite number"),
        ({"w0": "6"}, "w0 is '6': allowed is a number"),
        ({"w0": True}, "w0 is True: allowed is a number"),
        ({"w0": 6.2, "gamma": 0.1}, "gamma is not known: allowed are w0, length_m"),
    ],
)
def test_what_contradicts_or_is_none_is_refused_with_its_numbers(
    given: dict[str, Any], complaint: str
) -> None:
    with pytest.raises(InputError) as error:
        Rig.of(**given)
    assert complaint in str(error.value)
    assert "\n" not in str(error.value)


def test_rounded_digits_do_not_contradict_and_the_rig_s_own_name_counts() -> None:
    rig = Rig.of(w0=6.2, p=0.2906, stroke_mm=20, frequency_hz=1.9)
    assert rig.p == 0.2906


# Effects


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ({"name": "drag", "parameters": {}}, "name is 'drag': allowed is an effect of the library"),
        ({"name": "quadratic_darg", "parameters": {}}, "the nearest is quadratic_drag"),
        ({"name": 3, "parameters": {}}, "name is 3"),
        ({"name": ["a"], "parameters": {}}, "name is ['a']"),
        ({"parameters": {}}, "quadratic_drag: q is missing: it needs q (1/rad)"),
        ({"parameters": {"q": 1, "r": 2}}, "quadratic_drag: parameters: 'r' is not known"),
        ({"parameters": [1.0]}, "quadratic_drag: parameters is [1.0]: allowed is a mapping of q"),
        ({"parameters": {"q": "1"}}, "quadratic_drag: q is '1': allowed is a number"),
        ({"parameters": {"q": math.inf}}, "quadratic_drag: q is inf: allowed is any finite number"),
        ({"ci95": {"q": 1.0}}, "ci95 of q is 1.0: allowed is [low, high]"),
        ({"ci95": {"q": [2, 1]}}, "ci95 of q is [2, 1]: allowed is [low, high], the lower first"),
        ({"ci95": {"r": [1, 2]}}, "quadratic_drag: ci95: 'r' is not known"),
        ({"probability": 2}, "quadratic_drag: probability is 2: allowed is 0 to 1"),
        ({"approximate": "yes"}, "quadratic_drag: approximate is 'yes': allowed is True or False"),
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
def test_one_thing_is_written_one_way(
    name: str, values: dict[str, float], field: str, si: str
) -> None:
    effect = Effect(name, values)
    with pytest.raises(
        InputError, match=rf"{field} is 0\.2 beside the effect {name}: they are the"
    ):
        Pendulum(**({"gamma": 0} | {field: 0.2}), effects=(effect,))
    with pytest.raises(InputError, match=rf"{si} is 0\.2 beside the effect {name}: they are the"):
        Rig(w0=6, **{si: 0.2}, effects=(effect,))
    either = Pendulum(**({"gamma": 0} | values)), Pendulum(gamma=0, effects=(effect,))
    ends = [pendmap.simulate(x, 2.0, 0.0, 5.0).theta.values for x in either]
    assert np.array_equal(*ends)


def test_effects_twice_or_outside_their_range_are_refused() -> None:
    with pytest.raises(InputError, match="quadratic_drag"):
        Pendulum(effects=(DRAG, DRAG))
    far = Effect("bearing_harmonic", {"amplitude": 1, "n": 2000, "psi": 0})
    with pytest.raises(InputError, match="n is 2000: allowed is 0 to 1000"):
        Pendulum(effects=(far,))
    with pytest.raises(InputError, match=r"n is 2000: .* \(without dimensions, w0 is 6\)"):
        Rig(w0=6, effects=(far,))
    for wrong in (DRAG, "quadratic_drag", ["quadratic_drag"], 3):
        with pytest.raises(InputError, match=r"effects is .*: allowed is"):
            Pendulum(effects=wrong)  # type: ignore[arg-type]


def test_models_are_values() -> None:
    for model in (SWING, SWING.pendulum):
        again = pickle.loads(pickle.dumps(model))  # noqa: S301 (what was just written)
        assert again == model
        assert hash(again) == hash(model)
        assert dataclasses.asdict(model)["effects"][0]["name"] == "quadratic_drag"
    assert Pendulum(effects=[DRAG]).effects == (DRAG,)  # type: ignore[arg-type]
    assert dataclasses.replace(SWING, w0=5.0).effects == SWING.effects


# What is computed


def term(rig: Rig, t: float, theta: float, velocity: float) -> float:
    """The acceleration of a rig with quadratic drag and a bearing's harmonic, in SI."""
    drag, harmonic = (e.parameters for e in rig.effects)
    pull = rig.w0**2 * (1 + rig.p * math.cos(rig.Omega * t + rig.phi))
    bump = harmonic["amplitude"] * math.sin(harmonic["n"] * theta + harmonic["psi"])
    drags = rig.c_over_m * velocity + drag["q"] * velocity * abs(velocity)
    return rig.torque + bump - drags - pull * math.sin(theta)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rubs", [False, True], ids=["smooth", "with friction"])
def test_simulate_in_si_against_scipy_in_si(seed: int, *, rubs: bool) -> None:
    draw = np.random.default_rng(seed)
    rig = Rig(
        w0=draw.uniform(4, 8),
        c_over_m=draw.uniform(0.05, 0.3),
        Tr=draw.uniform(0.5, 2.0) if rubs else 0.0,
        torque=draw.uniform(-1, 1),
        p=draw.uniform(0.2, 0.6),
        Omega=draw.uniform(8, 14),
        phi=draw.uniform(-3, 3),
        effects=(
            Effect("quadratic_drag", {"q": draw.uniform(0.01, 0.05)}),
            Effect("bearing_harmonic", {"amplitude": draw.uniform(0.5, 2), "n": 3, "psi": 0.7}),
        ),
    )
    start, until = (draw.uniform(-2, 2), draw.uniform(1, 5)), 3.0
    run = pendmap.simulate(rig, *start, until, tol=1e-12)
    theta, velocity = by_scipy(rig, start, until)
    assert float(run.time[-1]) == pytest.approx(until, rel=1e-14)
    assert float(run.theta[-1]) == pytest.approx(theta, abs=1e-8)
    assert float(run.velocity[-1]) == pytest.approx(velocity, abs=1e-7)


def by_scipy(rig: Rig, start: tuple[float, float], until: float) -> tuple[float, float]:
    """The last state, integrated from turn to turn in SI; held wherever the load is too small."""
    t, (theta, velocity) = 0.0, start

    def load(time: float) -> float:
        return term(rig, time, theta, 0.0)

    def turn(_: float, y: Any) -> float:  # noqa: ANN401
        return float(y[1])

    turn.terminal = True  # type: ignore[attr-defined]
    while t < until:
        if velocity == 0 and abs(load(t)) < rig.Tr:
            times = np.linspace(t, until, 2001)
            free = np.flatnonzero([abs(load(x)) > rig.Tr for x in times])
            if not free.size:
                return theta, 0.0
            t = brentq(
                lambda x: abs(load(x)) - rig.Tr, *times[free[0] - 1 : free[0] + 1], xtol=1e-14
            )
        sense = math.copysign(1.0, velocity or load(t))
        turn.direction = -sense  # type: ignore[attr-defined]

        def slope(time: float, y: Any, rubs: float = sense * rig.Tr) -> list[float]:  # noqa: ANN401
            return [y[1], term(rig, time, y[0], y[1]) - rubs]

        piece = solve_ivp(
            slope,
            (t, until),
            (theta, velocity),
            method="DOP853",
            rtol=1e-13,
            atol=1e-13,
            events=turn,
        )
        t, (theta, velocity) = float(piece.t[-1]), map(float, piece.y[:, -1])
        velocity = velocity if t == until else 0.0
    return theta, velocity


def test_the_free_decay_with_friction_in_si(truths: dict[str, Any]) -> None:
    case = truths["free_decay"]["nonlinear"][0]
    rig = Rig(**{name: float(case[name]) for name in ("w0", "c_over_m", "Tr")})
    run = pendmap.simulate(rig, float(case["theta0"]), 0.0, 90.0, tol=1e-12)
    turns = run.event_kind.values == "turn"
    count = 30
    times = [float(x) for x in case["times"][1 : count + 1]]
    peaks = [float(x) for x in case["thetas"][1 : count + 1]]
    assert run.event_time.values[turns][:count] == pytest.approx(times, abs=1e-9)
    assert run.event_theta.values[turns][:count] == pytest.approx(peaks, abs=1e-9)
    assert run.attrs["stuck"] == 1
    assert "Friction holds it since t = " in run.attrs["summary"]
    assert run.event_time.attrs["units"] == "s"


def test_simulate_is_the_same_in_both_units() -> None:
    rig = SWING
    there = pendmap.simulate(rig, 1.0, 3.1, 20.0, lyapunov=True)
    bare = pendmap.simulate(rig.pendulum, 1.0, 0.5, 124.0, lyapunov=True)
    assert there.theta.values == pytest.approx(bare.theta.values, abs=1e-9)
    for name, factor in (
        ("velocity", 6.2),
        ("section_velocity", 6.2),
        ("time", 1 / 6.2),
        ("section_time", 1 / 6.2),
        ("event_time", 1 / 6.2),
    ):
        assert there[name].values == pytest.approx(factor * bare[name].values, abs=1e-7), name
    for name, factor in (("exponent", 6.2), ("exponent_stderr", 6.2), ("exponent_from", 1 / 6.2)):
        assert there.attrs[name] == pytest.approx(factor * bare.attrs[name], rel=1e-6), name
    units = {name: there[name].attrs["units"] for name in ("time", "velocity", "theta")}
    assert units == {"time": "s", "velocity": "rad/s", "theta": "rad"}
    assert "per second" in there.attrs["summary"]
    assert "per unit of tau" in bare.attrs["summary"]
    assert " rad/s" in there.attrs["summary"].split("\n")[0]


def test_maps_are_the_same_in_both_units() -> None:
    rig = Rig(w0=5.0, c_over_m=0.5, p=0.6, Omega=10.0, effects=(DRAG,))
    there = pendmap.basins(rig, Grid.square(24, rig.w0))
    bare = pendmap.basins(rig.pendulum, Grid.square(24))
    assert np.array_equal(there.label.values, bare.label.values)
    for name in ("velocity", "velocity_point", "point_velocity", "exponent"):
        assert there[name].values == pytest.approx(5 * bare[name].values, abs=1e-8), name
    assert there.period.values == pytest.approx(bare.period.values / 5)
    assert there.velocity.attrs["units"] == there.point_velocity.attrs["units"] == "rad/s"
    assert (there.velocity.attrs["low"], there.velocity.attrs["high"]) == (-15.0, 15.0)
    assert there.exponent.attrs["units"] == "1/s"
    assert there.period.attrs["units"] == "s"
    starts = [0.1, 1.0, 2.5], [3.0, -10.0, 12.0]
    lists = pendmap.basins_of(rig, *starts)
    other = pendmap.basins_of(rig.pendulum, starts[0], [v / 5 for v in starts[1]])
    assert np.array_equal(lists.label.values, other.label.values)
    assert list(lists.start_velocity.values) == starts[1]


def test_without_a_grid_a_rig_has_the_same_window() -> None:
    assert Grid.square(10, 5.0).velocity.as_tuple == (-15.0, 15.0, 10)
    assert Grid.square(10).velocity.as_tuple == (-3.0, 3.0, 10)


def test_finite_time_exponents_are_per_second() -> None:
    rig = Rig(w0=5.0)
    there = pendmap.basins(rig, Grid.square(12, rig.w0), layer_periods=20)
    bare = pendmap.basins(rig.pendulum, Grid.square(12), layer_periods=20)
    values = there.finite_time_exponent.values
    assert values == pytest.approx(5 * bare.finite_time_exponent.values, rel=1e-5)
    assert there.finite_time_exponent.attrs["units"] == "1/s"


def test_starts_are_advanced_in_rad_per_second() -> None:
    rig = Rig(w0=5.0, c_over_m=0.5, p=0.6, Omega=10.0, effects=(DRAG,))
    theta, velocity, turns = pendmap.advance(rig, [0.3, 1.0], [2.0, -20.0], 7, tol=1e-9)
    other = pendmap.advance(rig.pendulum, [0.3, 1.0], [0.4, -4.0], 7, tol=1e-9)
    assert theta == pytest.approx(other[0])
    assert velocity == pytest.approx(5 * other[1])
    assert list(turns) == list(other[2])


def test_an_effect_changes_the_motion() -> None:
    for run in (pendmap.simulate, lambda *a: pendmap.advance(a[0], [a[1]], [a[2]], 3)[0]):
        ends = [run(Pendulum(effects=e), 2.0, 0.0, 20.0) for e in ((), (DRAG,))]
        thetas = [getattr(end, "theta", end)[-1] for end in ends]
        assert abs(float(thetas[0]) - float(thetas[1])) > 1e-4


# Files and pictures


@pytest.mark.parametrize("suffix", [".nc", ".zarr"])
def test_results_in_si_are_stored_and_drawn(tmp_path: Path, suffix: str) -> None:
    results = {
        "run": pendmap.simulate(SWING, 1.0, 3.0, 5.0),
        "map": pendmap.basins(SWING, Grid.square(8, 6.2)),
    }
    for name, result in results.items():
        back = pendmap.load(pendmap.save(result, tmp_path / f"{name}{suffix}"))
        assert back.identical(result) or suffix == ".zarr"
        assert back.attrs == result.attrs
        assert back.attrs["units"] == "SI"
        assert (back.attrs["w0"], back.attrs["Omega"]) == (6.2, 12.0)
        assert back.attrs["gamma"] == pytest.approx(0.05 / 6.2)
        effects = json.loads(back.attrs["effects"])
        assert effects[0] == {"name": "quadratic_drag", "parameters": {"q": 0.01}}
        assert "quadratic_drag (q = 0.01), bearing_harmonic" in back.attrs["title"]
        assert "w0 = 6.2 rad/s" in back.attrs["title"]
        assert figures.draw(back, tmp_path / f"{name}.svg").stat().st_size > 1000
        assert viewer.record(back, tmp_path / f"{name}.rrd").stat().st_size > 1000


def test_axes_are_named_in_the_units_of_the_result() -> None:
    run = pendmap.simulate(SWING, 1.0, 3.0, 5.0)
    parameters = layers.parameters(run.attrs)
    assert parameters == (
        "w0 = 6.2 rad/s,  c/m = 0.05 1/s,  p = 0.3,  Ω = 12 rad/s,  phase = 0.4,  "
        "Tr = 0.08 rad/s²,  quadratic drag,  bearing harmonic"
    )
    for model, clock, speed in ((SWING, "t (s)", "dθ/dt (rad/s)"), (SWING.pendulum, "τ", "dθ/dτ")):
        run = pendmap.simulate(model, 1.0, 3.0, 5.0)
        with rc_context(style.RC):
            sheet = trajectory.figure(run, layer=None, size=None, dpi=50.0, colormap=None)
            sheet.canvas.draw()
        history, phase, _ = sheet.axes
        assert history.get_xlabel() == clock
        assert phase.get_ylabel() == speed
        for text in sheet.texts:
            assert text.get_window_extent().x1 <= sheet.bbox.x1, text.get_text()


def test_titles_leave_out_what_is_zero() -> None:
    assert Pendulum(p=0).title == "γ = 0.1, p = 0"
    assert Rig(w0=6.2).title == "w0 = 6.2 rad/s, c/m = 0 1/s, p = 0"
    assert "lab time = 30 s" in Rig(w0=6.2, lab_time_s=30).title
