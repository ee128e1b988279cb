"""Single trajectories against values of independent tools."""

from __future__ import annotations

import math
import os
import signal
import threading
from typing import Any

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.special import ellipk

import pendmap
from pendmap import InputError, Pendulum, Rig


def test_the_period_of_a_free_pendulum_is_the_elliptic_integral() -> None:
    for amplitude in (0.1, 1.0, 2.0, 3.0):
        period = 4 * ellipk(math.sin(amplitude / 2) ** 2)
        run = pendmap.simulate(Pendulum(gamma=0, p=0), amplitude, 0, period, tol=1e-12)
        assert float(run.theta[-1]) == pytest.approx(amplitude, abs=1e-10)
        assert float(run.velocity[-1]) == pytest.approx(0, abs=1e-10)


def test_sections_are_taken_once_a_period() -> None:
    run = pendmap.simulate(Pendulum(p=1.7, omega=2), 1.0, 0.5, 20 * math.pi + 1)
    assert run.sizes["period"] == 21
    assert run.section_time.values == pytest.approx(np.arange(21) * math.pi)
    assert (np.abs(run.section_theta) <= math.pi).all()
    at = np.interp(run.section_time.values, run.time.values, run.theta.values)
    assert np.cos(at) == pytest.approx(np.cos(run.section_theta.values), abs=1e-9)


@pytest.mark.parametrize(
    ("pendulum", "velocity", "until"),
    [
        (Pendulum(p=0, gamma=0.01), 30.0, 10.0),
        (Pendulum(p=0, gamma=0.1, torque=2.0), 0.0, 100.0),
        (Pendulum(p=1, omega=9.0), 9.0, 20.0),
    ],
)
def test_samples_are_dense_enough_for_a_smooth_curve(
    pendulum: Pendulum, velocity: float, until: float
) -> None:
    run = pendmap.simulate(pendulum, 1.0, velocity, until)
    assert float(np.abs(np.diff(run.theta)).max()) < 0.15
    long = pendmap.simulate(Pendulum(p=0, gamma=0.5), 1.0, 1e4, 10_000.0, tol=1e-3)
    assert long.sizes["time"] <= 210_000


def test_an_unpredictable_end_is_reported() -> None:
    run = pendmap.simulate(pendmap.PRESETS["fig2b"], 1, 0, 2000, samples=8)
    assert run["end_error"].item() > 1e-3
    assert "not predictable" in run.attrs["summary"]


def test_advance_counts_turns_as_a_trajectory_does() -> None:
    pendulum = Pendulum(p=1.0)
    theta, velocity, turns = pendmap.advance(pendulum, [-0.5, 9.0], [2.6, 0.1], 6, tol=1e-10)
    for k, start in enumerate(((-0.5, 2.6), (9.0, 0.1))):
        run = pendmap.simulate(pendulum, *start, 6 * math.pi, tol=1e-12)
        end = float(run.theta[-1])
        assert turns[k] == round((end - start[0]) / math.tau)
        assert math.cos(end - theta[k]) == pytest.approx(1, abs=1e-12)
        assert velocity[k] == pytest.approx(float(run.velocity[-1]), abs=1e-7)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ({"theta": math.nan}, "theta must be a finite number, got nan"),
        ({"velocity": math.inf}, "velocity must be a finite number, got inf"),
        ({"until": 0}, "until must be a time above 0 where t_eval is left out, got 0"),
        ({"until": math.inf}, "until must be a finite number, got inf"),
        ({"until": 1e12}, "do not fit"),
        ({"tol": 1.0}, "tol must be a number from 1e-13 to 1e-2, got 1"),
        ({"samples": 0}, "samples must be a whole number from 1 to .*, got 0"),
    ],
)
def test_bad_requests_are_refused(words: dict[str, Any], complaint: str) -> None:
    request: dict[str, Any] = {"theta": 1.0, "velocity": 0.0, "until": 10.0} | words
    with pytest.raises(InputError, match=complaint):
        pendmap.simulate(Pendulum(), **request)


def test_energy_is_kept_without_drive_and_damping_and_lost_by_damping() -> None:
    free = pendmap.simulate(Pendulum(gamma=0, p=0), 2.0, 0.3, 200.0, tol=1e-12)
    assert float(np.ptp(free.energy.values)) < 1e-10
    assert float(free.energy[0]) == pytest.approx(0.3**2 / 2 + 1 - math.cos(2.0), rel=1e-15)
    # dE/dtau = -gamma v^2, integrated by Simpson's rule.
    damped = pendmap.simulate(Pendulum(gamma=0.2, p=0), 2.0, 0.3, 4 * math.pi, tol=1e-12)
    lost = simpson(0.2 * damped.velocity.values**2, x=damped.time.values)
    assert float(damped.energy[0] - damped.energy[-1]) == pytest.approx(lost, abs=1e-7)
    rig = Rig(w0=6.2, c_over_m=0.05)
    swung = pendmap.simulate(rig, 1.0, 2.0, 3.0)
    bare = (swung.velocity.values / 6.2) ** 2 / 2 + 1 - np.cos(swung.theta.values)
    assert swung.energy.values == pytest.approx(bare, rel=1e-12)


def test_a_section_holds_no_end_between_two_samples() -> None:
    """The end, at 7.5 of 8 samples, is the ninth value and lies in no section."""
    pendulum = Pendulum()
    for samples, until in ((8, 7.5 / 8), (8, 1.0), (1, 1.5), (4, 2.0)):
        run = pendmap.simulate(pendulum, 1.0, 0.0, until * pendulum.period, samples=samples)
        assert run.section_time.values == pytest.approx(
            pendulum.period * np.arange(int(until) + 1), abs=1e-12
        )


def watched(pendulum: Pendulum | Rig, until: float, **words: Any) -> tuple[Any, np.ndarray]:  # noqa: ANN401
    """Return a trajectory, and the samples passed to the callback meanwhile, shape (3, N)."""
    parts: list[np.ndarray] = []
    run = pendmap.simulate(
        pendulum, 1.0, 0.5, until, live=lambda *part: parts.append(np.stack(part)), **words
    )
    return run, np.concatenate(parts, axis=1)


@pytest.mark.parametrize(
    "pendulum",
    [
        Pendulum(p=1.5, omega=0.87, theta_r=0.2, phase=0.4),
        Pendulum(p=0.9, effects=(pendmap.Effect("drive_chirp", {"r": 1e-4}),), lab_time=3.0),
        Rig(w0=6.2, c_over_m=0.3, Tr=0.5, p=1.2, Omega=7.0),
    ],
)
@pytest.mark.parametrize("lyapunov", [False, True])
def test_live_samples_equal_the_trajectory_bit_for_bit(
    pendulum: Pendulum | Rig,
    lyapunov: bool,  # noqa: FBT001 (a parameter of the test)
) -> None:
    run, shown = watched(pendulum, 40.3, lyapunov=lyapunov)
    alone = pendmap.simulate(pendulum, 1.0, 0.5, 40.3, lyapunov=lyapunov)
    for name, values in zip(("time", "theta", "velocity"), shown, strict=True):
        assert np.array_equal(values, alone[name].values)
        assert np.array_equal(values, run[name].values)
    assert np.array_equal(run.event_time.values, alone.event_time.values)
    assert "interrupted" not in run.attrs


def test_live_samples_of_large_angles_are_exact() -> None:
    parts: list[np.ndarray] = []
    run = pendmap.simulate(Pendulum(), 1e6, 0.0, 9.0, live=lambda *p: parts.append(np.stack(p)))
    assert np.array_equal(np.concatenate(parts, axis=1)[1], run.theta.values)


def test_an_interrupt_leaves_what_was_computed() -> None:
    """The stored part equals that of the whole trajectory."""
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


def test_an_error_of_the_live_callback_ends_the_simulation() -> None:
    def show(*_: np.ndarray) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        pendmap.simulate(Pendulum(), 1.0, 0.0, 1e6, live=show)
    with pytest.raises(InputError, match="live"):
        pendmap.simulate(Pendulum(), 1.0, 0.0, 10.0, live=3)  # type: ignore[arg-type]


def test_half_a_turn_is_no_turn() -> None:
    # The motion swings from 2 to -1.85 rad and never passes the top.
    swing = pendmap.simulate(Pendulum(gamma=0.0, p=0.0), 2.0, 0.0, 3.6)
    assert swing["turns"].item() == 0
    assert "full turn" not in swing.attrs["summary"]


def test_a_drive_that_needs_too_many_steps_is_refused() -> None:
    assert pendmap.simulate(pendmap.Pendulum(p=1e4), 1.0, 0.0, 1.0).theta.size > 1
    for p in (-2e6, 1e14):
        with pytest.raises(InputError, match="times gravity"):
            pendmap.simulate(pendmap.Pendulum(p=p), 1.0, 0.0, 1.0)
