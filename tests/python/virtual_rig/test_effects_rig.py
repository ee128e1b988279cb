"""Effects of the library against independent formulas, scipy and the virtual rig."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
from pendmap import virtual_rig
from pendmap.comparison.data import DataSplit, split_records
from pendmap.diagnosis.baseline import fit_baseline
from pendmap.diagnosis.candidates import Candidate, add_candidates
from pendmap.diagnosis.fitted_model import fit_model
from pendmap.records import read_experiment

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.diagnosis.fitted_model import Windows

GAMMA = 0.05


@pytest.mark.parametrize(("p", "theta_r", "turns", "rests"), [(0.0, 0.0, 30, 0), (1.5, 0.2, 9, 4)])
def test_a_contact_that_yields_agrees_with_scipy(
    p: float, theta_r: float, turns: int, rests: int
) -> None:
    f, zc, omega, until = 0.05, 0.1, 0.87, 100.0
    dahl = pendmap.Effect("dahl_friction", {"f": f, "zc": zc})
    model = pendmap.Pendulum(gamma=GAMMA, theta_r=theta_r, p=p, omega=omega, effects=(dahl,))
    found = pendmap.simulate(model, 1.2, 0.0, until, tol=1e-12)

    def load(tau: float, theta: float, z: float) -> float:
        return -(1 + p * math.cos(omega * tau)) * math.sin(theta) - f * z

    # The equation of the friction is integrated together with that of the motion, turn by turn.
    state, now, met = [1.2, 0.0, 0.0], 0.0, [0, 0]
    while now < until:
        pull = load(now, state[0], state[2])
        if abs(pull) <= theta_r:
            met[1] += 1

            def slips(tau: float, _: object, at: list[float] = state) -> float:
                return abs(load(tau, at[0], at[2])) - theta_r

            slips.terminal, slips.direction = True, 1  # type: ignore[attr-defined]
            held = solve_ivp(
                lambda *_: [0.0], (now, until), [0.0], events=slips, max_step=0.01, rtol=1e-12
            )
            now = float(held.t[-1])
            if now >= until:
                break
            pull = load(now, state[0], state[2])
        s = math.copysign(1.0, pull)

        def rate(tau: float, y: list[float], s: float = s) -> list[float]:
            slip = y[1] - s * y[1] * y[2]
            return [y[1], load(tau, y[0], y[2]) - GAMMA * y[1] - s * theta_r, slip / zc]

        def turned(tau: float, y: list[float], now: float = now, s: float = s) -> float:
            return y[1] if tau > now + 1e-3 else s

        turned.terminal, turned.direction = True, -s  # type: ignore[attr-defined]
        end = solve_ivp(rate, (now, until), state, "DOP853", events=turned, rtol=1e-12, atol=1e-14)
        state, now = [float(end.y[0, -1]), 0.0, float(end.y[2, -1])], float(end.t[-1])
        met[0] += 1
    assert met[0] > turns
    assert met[1] >= rests
    last = end.y[:2, -1] if now >= until and end.t[-1] >= until else [state[0], 0.0]
    assert [float(found.theta[-1]), float(found.velocity[-1])] == pytest.approx(last, abs=1e-7)


def test_a_contact_that_barely_yields_is_a_spring() -> None:
    f, zc, start = 0.3, 0.2, 1e-6
    dahl = pendmap.Effect("dahl_friction", {"f": f, "zc": zc})
    model = pendmap.Pendulum(gamma=0.0, p=0.0, effects=(dahl,))
    run = pendmap.simulate(model, start, 0.0, 20.0, tol=1e-13)
    # th'' = -th - (f/zc) (th - start), up to terms of the order start/zc.
    stiff = 1 + f / zc
    middle = start * (f / zc) / stiff
    expected = middle + (start - middle) * np.cos(math.sqrt(stiff) * run.time.values)
    assert run.theta.values == pytest.approx(expected, abs=1e-4 * start)


def clean(folder: Path, effect: str) -> tuple[DataSplit, dict[str, float]]:
    """Return evidence without noise, with a resolution of a microradian, and the truth."""
    request = virtual_rig.Request(
        "hidden", seed=5, effects=(effect,), free=2, forced=2, noise=0.0, counts=0
    )
    where = virtual_rig.places(folder / "clean", replace=True)
    virtual_rig.write(virtual_rig.make(request), where)
    found = split_records(read_experiment(where.experiment))
    exact = tuple(dataclasses.replace(run, sigma=1e-6) for run in found.fitted)
    held = tuple(dataclasses.replace(run, sigma=1e-6) for run in found.held)
    (truth,) = tomllib.loads(where.truth.read_text(encoding="utf-8"))["effect"]
    return dataclasses.replace(found, fitted=exact, held=held), truth["parameters"]


def whole(data: DataSplit) -> Windows:
    """Return one window per run, starting from rest."""
    runs = enumerate(data.fitted)
    return tuple((k, 0, len(run.time), float(run.angle[0]), 0.0) for k, run in runs)


NAMES = """added_mass asymmetric_coulomb base_sway dahl_friction drive_chirp eddy_brake
encoder_backlash encoder_drift impulses inertia_ripple pivot_compliance rig_tilt rough_spot
sensor_lag timebase"""


@pytest.mark.parametrize("name", NAMES.split())
def test_records_of_the_virtual_rig_are_fitted_exactly(name: str, tmp_path: Path) -> None:
    data, truth = clean(tmp_path, name)
    base, _ = fit_baseline(data)
    size, *_ = truth
    w0 = base.fit.model.w0
    (effect,) = (effect for effect in pendmap.effects() if effect.name == name)
    shapes = [p for p in effect.parameters if p.role not in {"size", "phase"}]
    shape = {p.name: truth[p.name] / w0**p.power_of_w0 for p in shapes}
    unit = Candidate(name, shape)
    start = base.start | {f"{name}.{size}": 0.5 * truth[size]}
    if unit.phase is not None:
        start[f"{name}.{unit.phase}"] = truth[unit.phase]
    model, free = add_candidates(base.fit.model, [unit]), [*base.free, *unit.free]
    # Parameters with units are fitted together with the size, from other starting values.
    elsewhere = {
        "eddy_brake": {"vc": 0.8},
        "pivot_compliance": {"wx": 0.95, "z": 0.5},
        "base_sway": {"ws": 1 + 1e-5},
        "impulses": {"t0": 1.01},
    }.get(name)
    if elsewhere is not None:
        free += unit.adapted
        start |= {f"{name}.{n}": part * truth[n] for n, part in elsewhere.items()}
    # The mode is at rest at the start of a run, not at that of a window within it.
    windows = whole(data) if name == "pivot_compliance" else None
    found = fit_model(data, model, free, (unit,), start=start, windows=windows).fit
    # The error of a lag is of order tau^2. Each window starts with a contact that has not yielded
    # and a sensor in the middle of its backlash.
    # An impulse of the rig is instantaneous.
    left = {"sensor_lag": 1e-5, "dahl_friction": 1e-6, "encoder_backlash": 1e-4, "impulses": 1e-4}
    assert found.rms < left.get(name, 1e-8)
    assert base.fit.rms > 10 * found.rms
    reached = found[f"{name}.{size}"]
    if unit.phase is not None:
        # A negative size is a positive one shifted by half a turn.
        reached *= math.cos(found[f"{name}.{unit.phase}"] - truth[unit.phase])
    close = {"sensor_lag": 0.02, "dahl_friction": 1e-3, "encoder_backlash": 0.005, "impulses": 0.01}
    assert reached == pytest.approx(truth[size], rel=close.get(name, 1e-4))
    for n in elsewhere or ():
        assert found[f"{name}.{n}"] == pytest.approx(truth[n], rel=close.get(name, 1e-6))


def test_the_mode_of_a_pivot_is_found_within_its_errors(tmp_path: Path) -> None:
    data, truth = clean(tmp_path, "pivot_compliance")
    draws, sigma = np.random.default_rng(1), 2e-5
    runs = tuple(
        dataclasses.replace(
            run, theta=run.theta + draws.normal(0, sigma, len(run.time)), sigma=sigma
        )
        for run in data.fitted
    )
    noisy = dataclasses.replace(data, fitted=runs)
    base, _ = fit_baseline(noisy)
    wx = truth["wx"] / base.fit.model.w0
    unit = Candidate("pivot_compliance", {"wx": wx, "z": truth["z"]})
    near = {"mu": 0.5, "wx": 0.95, "z": 0.5}
    start = {f"pivot_compliance.{n}": part * truth[n] for n, part in near.items()}
    model, free = add_candidates(base.fit.model, [unit]), [*base.free, *unit.free, *unit.adapted]
    found = fit_model(
        noisy, model, free, (unit,), start=base.start | start, windows=whole(noisy)
    ).fit
    assert found.rms == pytest.approx(sigma, rel=0.03)
    for n, value in truth.items():
        estimate = found.estimates[f"pivot_compliance.{n}"]
        assert estimate.stderr is not None
        assert abs(estimate.value - value) < 3 * estimate.stderr < 0.3 * value
