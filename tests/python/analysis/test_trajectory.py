"""Trajectories: their samples, sections, events and summaries; many starts; live samples."""

from __future__ import annotations

import math
import os
import signal
import threading
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import simpson

import pendmap
from drawn import made, plain
from models import DRAG, SWING
from pendmap import Effect, InputError, Pendulum, Rig, render

if TYPE_CHECKING:
    from pathlib import Path

STICKING = Pendulum(gamma=0.1, p=0.6, omega=2.0, theta_r=0.05)


def test_sections_are_taken_once_a_period() -> None:
    run = pendmap.simulate(Pendulum(p=1.7, omega=2), 1.0, 0.5, 20 * math.pi + 1)
    assert run.section_time.values == pytest.approx(np.arange(21) * math.pi)
    assert (np.abs(run.section_theta) <= math.pi).all()
    at = np.interp(run.section_time.values, run.time.values, run.theta.values)
    assert np.cos(at) == pytest.approx(np.cos(run.section_theta.values), abs=1e-9)


def test_a_section_holds_no_end_between_two_samples() -> None:
    """The end, at 7.5 of 8 samples, is the ninth value and lies in no section."""
    pendulum = Pendulum()
    for samples, until in ((8, 7.5 / 8), (8, 1.0), (1, 1.5), (4, 2.0)):
        run = pendmap.simulate(pendulum, 1.0, 0.0, until * pendulum.period, samples=samples)
        assert run.section_time.values == pytest.approx(
            pendulum.period * np.arange(int(until) + 1), abs=1e-12
        )


@pytest.mark.parametrize(
    ("pendulum", "velocity", "until"),
    [(Pendulum(p=0, gamma=0.01), 30.0, 10.0), (Pendulum(p=0, torque=2.0), 0.0, 100.0)],
)
def test_samples_are_dense_enough_for_a_smooth_curve(
    pendulum: Pendulum, velocity: float, until: float
) -> None:
    run = pendmap.simulate(pendulum, 1.0, velocity, until)
    assert float(np.abs(np.diff(run.theta)).max()) < 0.15
    long = pendmap.simulate(Pendulum(p=0, gamma=0.5), 1.0, 1e4, 10_000.0, tol=1e-3)
    assert long.sizes["time"] <= 210_000


def test_energy_is_lost_by_damping_alone() -> None:
    # dE/dtau = -gamma v^2, integrated by Simpson's rule.
    damped = pendmap.simulate(Pendulum(gamma=0.2, p=0), 2.0, 0.3, 4 * math.pi, tol=1e-12)
    assert float(damped.energy[0]) == pytest.approx(0.3**2 / 2 + 1 - math.cos(2.0), rel=1e-15)
    lost = simpson(0.2 * damped.velocity.values**2, x=damped.time.values)
    assert float(damped.energy[0] - damped.energy[-1]) == pytest.approx(lost, abs=1e-7)
    swung = pendmap.simulate(Rig(w0=6.2, c_over_m=0.05), 1.0, 2.0, 3.0)
    bare = (swung.velocity.values / 6.2) ** 2 / 2 + 1 - np.cos(swung.theta.values)
    assert swung.energy.values == pytest.approx(bare, rel=1e-12)


def test_starts_are_advanced_as_a_trajectory_in_the_units_of_the_model() -> None:
    rig = Rig(w0=5.0, c_over_m=0.5, p=0.6, Omega=10.0, effects=(DRAG,))
    theta, velocity, turns = pendmap.advance(rig, [0.3, 9.0], [2.0, -20.0], 7, tol=1e-10)
    for k, start in enumerate(((0.3, 2.0), (9.0, -20.0))):
        run = pendmap.simulate(rig, *start, 1.4 * math.pi, tol=1e-12)
        end = float(run.theta[-1])
        assert turns[k] == round((end - start[0]) / math.tau)
        assert math.cos(end - theta[k]) == pytest.approx(1, abs=1e-12)
        assert velocity[k] == pytest.approx(float(run.velocity[-1]), abs=1e-6)


def test_friction_opposes_the_motion_in_all_units() -> None:
    rubbing = pendmap.simulate(Pendulum(theta_r=0.05), 0, 7, 5, tol=1e-12)
    pushed = pendmap.simulate(Pendulum(torque=-0.05), 0, 7, 5, tol=1e-12)
    assert (rubbing.velocity.values > 0).all()
    assert rubbing.theta.values == pytest.approx(pushed.theta.values, abs=1e-12)
    rig = Rig(w0=6.2, c_over_m=0.05, Tr=8.0, p=1.5, Omega=12.0)
    si = pendmap.simulate(rig, 2.0, 3.0, 5.0)
    bare = pendmap.simulate(rig.pendulum, 2.0, 3.0 / 6.2, 5.0 * 6.2)
    assert si.event_kind.values.tolist() == bare.event_kind.values.tolist()
    assert {"turn", "stick", "release"} <= {*si.event_kind.values.tolist()}
    assert 6.2 * si.event_time.values == pytest.approx(bare.event_time.values)


def test_what_a_summary_says_of_the_motion() -> None:
    chaos = pendmap.simulate(pendmap.PRESETS["fig2b"], 1, 0, 2000, samples=8)
    assert chaos["end_error"].item() > 1e-3
    assert "not predictable" in chaos.attrs["summary"]
    held = pendmap.simulate(
        Pendulum(p=1.5, omega=0.87, theta_r=0.2), 1.0, 0.0, 100.0, lyapunov=True
    )
    assert held["stuck"].item()
    assert "exponent" not in held
    assert "permanently" in held.attrs["summary"]


@pytest.mark.parametrize(("velocity", "turns"), [(0.0, ""), (-9.0, "full turns backward)")])
def test_turns_since_the_start_are_described_in_words(velocity: float, turns: str) -> None:
    run = pendmap.simulate(Pendulum(gamma=0.01, p=0), 0.5, velocity, 20.0)
    line = run.attrs["summary"].splitlines()[0]
    full = math.trunc((0.5 - float(run.theta[-1])) / math.tau)
    assert (f"({full} {turns}" in line) if turns else "full turn" not in line
    # From 2 to -1.85 rad, which is half a turn, the motion never passes the top.
    assert pendmap.simulate(Pendulum(gamma=0.0, p=0.0), 2.0, 0.0, 3.6)["turns"].item() == 0


@pytest.mark.parametrize(("theta", "said"), [(1e5, False), (1e9, True), (1e16, True)])
def test_angles_beyond_the_resolution_of_a_double_are_reported(theta: float, said: bool) -> None:  # noqa: FBT001
    """A double has 53 bits: its resolution of an angle exceeds the tolerance 1e-9 from 8e6 on."""
    summary = pendmap.simulate(Pendulum(), theta, 0.0, 1.0).attrs["summary"]
    assert ("ANGLES ARE ROUNDED" in summary) == said


def test_axes_are_named_in_the_units_of_the_result() -> None:
    for model, clock, speed in ((SWING, "t (s)", "dθ/dt (rad/s)"), (SWING.pendulum, "τ", "dθ/dτ")):
        _, energy, phase, _ = made(pendmap.simulate(model, 1.0, 3.0, 5.0)).axes
        assert plain(energy.get_xlabel()) == clock
        assert plain(phase.get_ylabel()) == speed


# Many starts, and times


@pytest.mark.parametrize("model", [STICKING, Pendulum(p=1.7), Rig(w0=6.2, Tr=1.0, p=0.3, Omega=9)])
def test_states_at_chosen_times_are_those_of_trajectories_that_end_there(
    model: Pendulum | Rig,
) -> None:
    times = np.geomspace(0.1, 20.0, 12) / model.units.w0
    run = pendmap.simulate(model, 1.0, 0.0, until=30.0, t_eval=times, tol=1e-12)
    assert np.array_equal(run.time, times)
    for time, theta, velocity in zip(times, run.theta.values, run.velocity.values, strict=True):
        end = pendmap.simulate(model, 1.0, 0.0, float(time), tol=1e-12)
        assert theta == pytest.approx(float(end.theta[-1]), abs=1e-11)
        assert velocity == pytest.approx(float(end.velocity[-1]), abs=1e-11 * model.units.w0)
    whole = pendmap.simulate(model, 1.0, 0.0, float(times[-1]), tol=1e-12)
    for name in ("section_theta", "section_velocity", "section_time", "event_time"):
        assert run[name].values == pytest.approx(whole[name].values, abs=1e-9)


def test_each_start_moves_as_alone(tmp_path: Path) -> None:
    starts, given = np.array([1.0, 0.5, 0.01]), {"samples": 64, "lyapunov": True}
    every = pendmap.simulate(STICKING, starts, 0.0, 20.0, **given)
    assert every.theta.dims == ("start", "time")
    assert every.theta0.values == pytest.approx(starts)
    assert every.stuck.values.tolist() == [0, 0, 1]
    assert every.attrs["summary"].startswith("3 starts up to tau = 20; friction holds 1 of them")
    for k, start in enumerate(starts):
        one, alone = every.isel(start=k), pendmap.simulate(STICKING, start, 0.0, 20.0, **given)
        for name in ("theta", "velocity", "energy", "section_theta", "end_error", "turns"):
            assert np.array_equal(one[name], alone[name])
        assert "exponent" not in alone or one.exponent.item() == alone.exponent.item()
        events = alone.sizes["event"]
        assert one.event_kind.values.tolist()[:events] == alone.event_kind.values.tolist()
        assert set(one.event_kind.values.tolist()[events:]) <= {""}
    assert render.draw(every.isel(start=1), tmp_path / "one.png").exists()
    with pytest.raises(InputError, match=r"3 trajectories at once: .* dataset.isel\(start=0\)"):
        pendmap.view(every, tmp_path / "every.rrd")
    with pytest.raises(InputError, match="cannot draw 3 trajectories at once"):
        render.draw(every, tmp_path / "every.png")


# Live samples


@pytest.mark.parametrize(
    ("pendulum", "theta", "lyapunov"),
    [
        (Pendulum(p=1.5, omega=0.87, theta_r=0.2, phase=0.4), 1.0, True),
        (Pendulum(p=0.9, effects=(Effect("drive_chirp", {"r": 1e-4}),), lab_time=3.0), 1e6, False),
        (Rig(w0=6.2, c_over_m=0.3, Tr=0.5, p=1.2, Omega=7.0), 1.0, False),
    ],
)
def test_live_samples_equal_the_trajectory_bit_for_bit(
    pendulum: Pendulum | Rig, theta: float, *, lyapunov: bool
) -> None:
    parts: list[np.ndarray] = []
    start, show = (theta, 0.5, 40.3), lambda *part: parts.append(np.stack(part))
    run = pendmap.simulate(pendulum, *start, live=show, lyapunov=lyapunov)
    alone = pendmap.simulate(pendulum, *start, lyapunov=lyapunov)
    shown = np.concatenate(parts, axis=1)
    for name, values in zip(("time", "theta", "velocity"), shown, strict=True):
        assert np.array_equal(values, alone[name].values)
        assert np.array_equal(values, run[name].values)
    assert np.array_equal(run.event_time.values, alone.event_time.values)
    assert "interrupted" not in run.attrs


def test_an_interrupt_leaves_what_was_computed() -> None:
    pendulum, seen = Pendulum(p=1.0), 0

    def show(time: np.ndarray, *_: np.ndarray) -> None:
        nonlocal seen
        if not seen:
            threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)).start()
        seen += time.size

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may ignore it
    try:
        run = pendmap.simulate(pendulum, 1.0, 0.0, 1e6, live=show, samples=16)
    finally:
        signal.signal(signal.SIGINT, before)
    assert run.attrs["interrupted"] == 1
    assert run.attrs["until_asked"] == 1e6
    assert run.attrs["until"] == float(run.time[-1]) < 1e6
    assert seen == run.sizes["time"] > 1
    assert "INTERRUPTED before tau = 1e+06" in run.attrs["summary"]
    whole = pendmap.simulate(pendulum, 1.0, 0.0, 200.0, samples=16)
    same = min(run.sizes["time"], 1000)
    assert np.array_equal(run.theta.values[:same], whole.theta.values[:same])
    assert (run.event_time.values <= float(run.time[-1])).all()
