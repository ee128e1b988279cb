"""Numbers of the trade: against a simulation, and their errors against repeated records."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import pendmap
from fits import joint_fit
from pendmap import Effect, Rig, Run
from pendmap.identification import identify
from pendmap.records import Experiment
from pendmap.residuals.noise import estimate_noise
from pendmap.residuals.torque import OVER, residual_torque

DRAG = (Effect("quadratic_drag", {"q": 0.05}),)
KNOWN = {"mass": 0.2, "length": 0.3}


def report(rig: Rig, seed: int = 0, **known: float) -> pendmap.identification.IdentificationReport:
    time = np.arange(0.0, 12.0, 0.05)
    theta = pendmap.simulate(rig, 2.0, 0.0, t_eval=time).theta.values
    theta += np.random.default_rng(seed).normal(0, 2e-3, time.size)
    run = Run("a", "a.csv", "free", time, theta, np.ones(time.size, bool))
    names = [effect.name for effect in rig.effects]
    records = Experiment(Path("a"), (run,), known)
    return identify(records, methods=["trajectory"], effects=names)


def test_q_is_the_energy_over_what_a_swing_loses() -> None:
    rig = Rig(w0=5.0, c_over_m=0.05, Tr=0.1, effects=DRAG)
    found = report(rig)
    half = found.largest_swing / 2
    assert half == pytest.approx(1.0, rel=0.01)
    # A swing that begins above the amplitude and ends below it by as much.
    swing = pendmap.simulate(rig, half + 0.095, 0.0, 2.0, samples=2000)
    theta, velocity = swing.theta.values, swing.velocity.values
    end = np.flatnonzero((velocity[:-1] > 0) & (velocity[1:] <= 0))[0]
    energy = rig.w0**2 * (1 - np.cos(theta)) + velocity**2 / 2
    middle = 0.5 * (energy[0] + energy[end])
    q = math.tau * middle / (energy[0] - energy[end])
    reached = math.acos(1 - middle / rig.w0**2)
    assert reached == pytest.approx(half, abs=0.02)
    assert found.quantities["Q"].value == pytest.approx(q, rel=0.02)


def test_quantities_have_the_errors_of_repeated_records() -> None:
    rig = Rig(w0=5.0, c_over_m=0.05, Tr=0.1)
    every = [report(rig, seed, **KNOWN).quantities for seed in range(24)]
    true = {
        "frequency_hz": 5 / math.tau,
        "time_constant_s": 40.0,
        "dead_band_deg": math.degrees(math.asin(0.004)),
        "friction_n_m": 0.2 * 9.81 * 0.3 / 25 * 0.1,
        "viscous_n_m_s": 0.2 * 9.81 * 0.3 / 25 * 0.05,
    }
    for name, value in true.items():
        away = np.array([(one[name].value - value) / (one[name].stderr or 0) for one in every])
        assert 0.6 < np.sqrt(np.mean(away**2)) < 1.5, name
    spread = np.std([one["Q"].value for one in every])
    assert np.median([one["Q"].stderr for one in every]) == pytest.approx(spread, rel=0.5)


def test_what_is_not_known_is_left_out() -> None:
    found = report(Rig(w0=5.0, c_over_m=0.05, Tr=0.0))
    assert "friction_n_m" not in found.quantities
    given = report(Rig(w0=5.0, c_over_m=0.05, Tr=0.1), inertia=0.04).quantities
    assert given["friction_n_m"].value == pytest.approx(0.004, rel=0.1)
    # Q is not that of a damping which it leaves out.
    cubic = Rig(w0=5.0, c_over_m=0.05, Tr=0.1, effects=(Effect("cubic_damping", {"k3": 0.01}),))
    assert "Q" not in report(cubic).quantities


def test_the_missing_torque_has_nothing_of_the_models_own_terms() -> None:
    rig = Rig(w0=5.0, c_over_m=0.05, Tr=0.1, effects=DRAG)
    time = np.arange(0.0, 20.0, 0.02)
    theta = pendmap.simulate(rig, 2.0, 0.0, t_eval=time).theta.values
    theta += np.random.default_rng(0).normal(0, 2e-3, time.size)
    joint = joint_fit(time, theta)
    noise = estimate_noise(joint.fit, joint.given, len(joint.fit.names), [0.0])
    rows = residual_torque(joint.given, joint.fit, noise).rows
    torque = {name: np.array([row["torque"] for row in rows[name]]) for name in OVER if rows[name]}
    # Coulomb friction is a constant along the motion.
    assert torque["amplitude"].mean() == pytest.approx(0, abs=1e-9)
    assert torque["lab_time"].mean() == pytest.approx(0, abs=1e-9)
    # Over the velocity nothing is left along the friction and the damping.
    middle = np.array([(row["from"] + row["to"]) / 2 for row in rows["velocity"]])
    assert abs(torque["velocity"] @ np.sign(middle)) < 0.2 * np.abs(torque["velocity"]).sum()
