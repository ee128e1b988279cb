"""Results that are computed, stored and drawn in SI."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from matplotlib import rc_context
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import pendmap
from drawn import plain
from models import DRAG, SWING
from pendmap import Effect, Grid, Pendulum, Rig
from pendmap.charts import basins, names, registry
from pendmap.files import facts
from pendmap.render import drawing, style


def term(rig: Rig, t: float, theta: float, velocity: float) -> float:
    """Return the acceleration of a rig with quadratic drag and a bearing's harmonic, in SI."""
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
    """Return the last state, integrated from turn to turn in SI; held if the load is too small."""
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
    assert run["stuck"].item() == 1
    assert "Friction holds it since t = " in run.attrs["summary"]
    assert run.event_time.attrs["units"] == "s"


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


def test_axes_are_named_in_the_units_of_the_result() -> None:
    run = pendmap.simulate(SWING, 1.0, 3.0, 5.0)
    parameters = names.parameters(facts(run))
    assert parameters == (
        "w0 = 6.2 rad/s,  c/m = 0.05 1/s,  p = 0.3,  Ω = 12 rad/s,  φ = 0.4 rad,  "
        "Tr = 0.08 rad/s²;   quadratic drag (q = 0.01 1/rad),  "
        "bearing harmonic (amplitude = 1.5 rad/s^2, n = 4, psi = 0.3 rad)"
    )
    for model, clock, speed in ((SWING, "t (s)", "dθ/dt (rad/s)"), (SWING.pendulum, "τ", "dθ/dτ")):
        run = pendmap.simulate(model, 1.0, 3.0, 5.0)
        with rc_context(style.RC):
            sheet = drawing.draw(registry.build(run), dpi=50.0)
            sheet.canvas.draw()
        _, energy, phase, _ = sheet.axes
        assert plain(energy.get_xlabel()) == clock
        assert plain(phase.get_ylabel()) == speed
        for text in sheet.texts:
            assert text.get_window_extent().x1 <= sheet.bbox.x1, text.get_text()


def test_titles_leave_out_what_is_zero() -> None:
    assert Pendulum(p=0).title == "γ = 0.1, p = 0"
    assert Rig(w0=6.2).title == "w0 = 6.2 rad/s, c/m = 0 1/s, p = 0"
    assert "lab time = 30 s" in Rig(w0=6.2, lab_time_s=30).title


def test_effects_are_named_with_units() -> None:
    effects = (
        Effect("stribeck_friction", {"a": 0.5, "vs": 2.0}),
        Effect("power_law_drag", {"q": 0.01, "n": 1.5}),
        Effect("encoder_offset", {"d": -0.01}),
    )
    title = Rig(w0=2.0, effects=effects).title
    for said in ("a = 0.5 rad/s^2, vs = 2 rad/s", "n = 1.5)", "(d = -0.01 rad)"):
        assert said in title
    bare = Rig(w0=2.0, effects=effects).pendulum.title  # over w0^2, over w0; an angle is unchanged
    assert "stribeck_friction (a = 0.125, vs = 1)" in bare
    assert "encoder_offset (d = -0.01 rad)" in bare


@pytest.mark.parametrize(
    ("model", "own"), [(Rig(w0=6.2, c_over_m=0.5), "2π/w0"), (Pendulum(p=0), "2π")]
)
def test_periods_without_drive_are_given_in_the_units_of_the_map(
    model: Rig | Pendulum, own: str
) -> None:
    result = pendmap.basins(model, Grid.square(8))
    unit = basins.text_of(result, basins.LAYERS["settle"].unit)
    assert unit == f"periods of {own} to settle"
    assert "forcing" not in result.settle_periods.attrs["long_name"]


@pytest.mark.parametrize(
    ("velocity", "said"), [(0.0, "rad, velocity"), (-9.0, "full turns backward)")]
)
def test_turns_since_the_start_are_described_in_words(velocity: float, said: str) -> None:
    run = pendmap.simulate(Pendulum(gamma=0.01, p=0), 0.5, velocity, 20.0)
    line = run.attrs["summary"].splitlines()[0]
    assert said in line
    full = (0.5 - float(run.theta[-1])) / math.tau
    assert f"({math.trunc(full)} full" in line or velocity == 0


@pytest.mark.parametrize(("theta", "said"), [(1.0, False), (1e5, False), (1e9, True), (1e16, True)])
def test_angles_beyond_the_resolution_of_a_double_are_reported(theta: float, said: bool) -> None:  # noqa: FBT001
    """A double has 53 bits: its resolution of an angle exceeds the tolerance 1e-9 from 8e6 on."""
    summary = pendmap.simulate(Pendulum(), theta, 0.0, 1.0).attrs["summary"]
    assert ("ANGLES ARE ROUNDED" in summary) == said
