"""No coefficient of a model adds energy; drag of a power that is fitted."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
from driven_decays import motion
from hidden import diagnosed
from pendmap.comparison.data import DataSplit, split_records
from pendmap.diagnosis import diagnosed_model
from pendmap.diagnosis.candidates import Candidate
from pendmap.diagnosis.fitted_model import FittedModel, fit_model, impose_physics
from pendmap.diagnosis.result import as_text
from pendmap.diagnosis.summary import as_json
from pendmap.identification.fit import fit_runs
from pendmap.identification.runs import FitRun
from pendmap.model import Effect, Rig, save_model
from pendmap.records import Experiment, Run

if TYPE_CHECKING:
    from pendmap.identification.fit import TrajectoryFit
    from pendmap.model.effects import EffectDefinition

W0, TR, Q = 6.2, 0.05, 0.02
BASE = ("w0", "c_over_m", "Tr")
TIME = np.arange(2000) * 0.02
SWING = 2 * np.pi / W0
SIZE, POWER = "power_law_drag.q", "power_law_drag.n"


def record(theta: np.ndarray, seed: int = 1) -> Experiment:
    noisy = theta + np.random.default_rng(seed).normal(0, 1e-3, TIME.shape)
    run = Run("a", "a.csv", "free", TIME, noisy, np.ones(TIME.size, bool))
    return Experiment(Path("there"), (run,))


def decay(c_over_m: float = 0.0, drag: float = Q, seed: int = 1) -> Experiment:
    theta = motion(TIME, (2.4, 0.0), w0=W0, c_over_m=c_over_m, friction=TR, drag=drag)
    return record(theta, seed)


def with_effect(data: DataSplit, effect: str, steps: int = 40, **parameters: float) -> FittedModel:
    """Fit an effect, or only estimate the errors of given parameters."""
    shape = dict(list(parameters.items())[1:])
    model = Rig(W0, c_over_m=0.05, Tr=TR, effects=(Effect(effect, parameters),))
    free = [*BASE, *(f"{effect}.{name}" for name in parameters)]
    return fit_model(data, model, free, [Candidate(effect, shape)], steps=steps)


def test_negative_damping_is_fixed_at_0_and_the_others_fitted_again() -> None:
    # The true damping is 0; with this noise its estimate is negative.
    data = split_records(decay(seed=4))
    free = with_effect(data, "quadratic_drag", q=0.01)
    assert free.fit["c_over_m"] < -1e-4
    held = impose_physics(data, free)
    assert held is not None
    assert held.zeroed == ("c_over_m",)
    assert held.fit.model.c_over_m == 0
    assert "c_over_m" not in held.fit.estimates
    # With the coefficient at 0 and the others unchanged the model fits worse.
    start = {n: v for n, v in free.start.items() if n != "c_over_m"}
    unchanged = fit_model(data, held.fit.model, held.free, held.chosen, start=start, steps=0)
    assert free.chi2 < held.chi2 < unchanged.chi2
    for name, true in (("w0", W0), ("Tr", TR), ("quadratic_drag.q", Q)):
        estimate = held.fit.estimates[name]
        assert abs(estimate.value - true) < 4 * estimate.stderr


RIG = {"viscous_damping", "coulomb_friction"}  # parameters of a rig
OPPOSING = [e for e in pendmap.effects() if e.opposing and e.name not in RIG]


@pytest.mark.parametrize("effect", OPPOSING, ids=lambda effect: effect.name)
def test_what_opposes_the_motion_is_never_below_0(effect: EffectDefinition) -> None:
    # The damping falls with velocity. Sizes just below 0 are far within their errors.
    experiment = decay(c_over_m=0.15, drag=-0.01)
    data, size = split_records(experiment), effect.parameters[0].name
    begin = Effect.blank(effect.name, Rig(W0).units).parameters
    fitted = with_effect(data, effect.name, steps=0, **{**begin, size: -1e-9})
    key = f"{effect.name}.{size}"
    assert fitted.fit[key] < 0
    held = impose_physics(data, fitted)
    assert held is not None
    assert held.chosen == () == held.fit.model.effects
    given = impose_physics(data, dataclasses.replace(fitted, chosen=()))
    assert given is not None
    assert key in given.zeroed
    assert given.fit.model.effects[0].parameters[size] == 0
    result = pendmap.identify(experiment, effects=[effect.name], methods=["trajectory"])
    assert all(result.parameters[n].value >= 0 for n in (key, "c_over_m", "Tr"))
    assert result.joint is not None
    assert not result.joint.fit.negative


@pytest.mark.parametrize(
    ("tau", "possible"),
    [(0.5 * SWING, False), (2 * SWING, True), (0.5 * TIME[-1], True), (2 * TIME[-1], False)],
)
def test_a_time_constant_is_between_a_swing_and_the_length_of_the_record(
    tau: float, *, possible: bool
) -> None:
    data = split_records(decay(c_over_m=0.05))
    fitted = with_effect(data, "viscous_warm_up", steps=0, b=0.01, tau=tau)
    assert (impose_physics(data, fitted) is not None) is possible


def test_the_printed_model_equals_the_written_one(tmp_path: Path) -> None:
    # The damping is cubic, and no effect may be added: negative friction fits best.
    result, _ = diagnosed("cubic_damping", seed=5, size=3.0, free=3, forced=0, max_effects=0)
    fields = as_json(result)
    assert fields["set_to_zero"] == ["Tr"]
    assert fields["model_file"]["rms"] == result.best.fitted.fit.rms
    assert "Tr" not in fields["parameters"]
    (line,) = (line for line in as_text(result) if line.startswith("Tr is fixed at 0"))
    assert "unphysical" in line
    path = save_model(diagnosed_model(result), tmp_path / "model.toml")
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    assert content["pendulum"].get("Tr", 0.0) == 0
    assert content["pendulum"]["w0"] == fields["parameters"]["w0"]["value"]
    assert content["provenance"]["set_to_zero"] == ["Tr"]


@pytest.mark.parametrize(("part", "possible"), [(2.0, False), (1.05, False), (0.5, True)])
def test_a_drift_takes_no_friction_below_0(part: float, *, possible: bool) -> None:
    # A record by scipy whose friction decreases by a fraction.
    def rhs(t: float, state: list[float]) -> list[float]:
        friction = TR * (1 - part * t / TIME[-1]) * np.tanh(state[1] / 1e-3)
        return [state[1], -0.05 * state[1] - W0**2 * np.sin(state[0]) - friction]

    path = solve_ivp(rhs, (0, TIME[-1]), (2.4, 0.0), "LSODA", TIME, rtol=1e-9, atol=1e-10)
    data = split_records(record(path.y[0]))
    fitted = with_effect(data, "coulomb_drift", r=-0.1 * TR / TIME[-1])
    assert fitted.fit["coulomb_drift.r"] == pytest.approx(-part * TR / TIME[-1], rel=0.1)
    assert (impose_physics(data, fitted) is not None) is possible


def law(q: float, n: float) -> Rig:
    effect = Effect("power_law_drag", {"q": q, "n": n})
    return Rig(w0=6.2, c_over_m=0.05, Tr=0.09, effects=(effect,))


def dragged(sigma: float) -> FitRun:
    """Return a decay with quadratic drag, a power law of 2, made by scipy."""
    time = TIME[:1500]
    theta = motion(time, (2.0, 0.0), w0=6.2, c_over_m=0.05, friction=0.09, drag=0.02)
    return FitRun(time, theta + np.random.default_rng(2).normal(0, sigma, time.shape), sigma)


def correlation(fit: TrajectoryFit) -> float:
    places = [fit.names.index(SIZE), fit.names.index(POWER)]
    (a, ab), (_, b) = fit.covariance[np.ix_(places, places)]
    return float(ab / math.sqrt(a * b))


@pytest.mark.parametrize("n", [1.1, 3.0])
def test_every_power_leads_to_the_same_fit(n: float) -> None:
    """The size of a start is in the unit of the start's power."""
    size = 0.02 * 4.0 ** (2 - n)  # equal drag at 4 rad/s
    fit = fit_runs(
        [dragged(1e-3)], law(1.0, 1.7), [*BASE, SIZE, POWER], start={SIZE: size, POWER: n}
    )
    assert fit.converged
    for name, truth in ((SIZE, 0.02), (POWER, 2.0)):
        estimate = fit.estimates[name]
        assert abs(estimate.value - truth) < 3 * estimate.stderr
        assert estimate.ci95[0] < truth < estimate.ci95[1]
    # The records determine the drag at their velocities: size and power are correlated.
    assert correlation(fit) < -0.8


def test_the_ends_of_the_size_s_interval_are_those_of_its_profile() -> None:
    run = dragged(8e-3)
    fit = fit_runs([run], law(0.02, 2.0), [*BASE, SIZE, POWER], profiled=[SIZE])
    size = fit.estimates[SIZE]
    assert size.stderr > 0.2 * size.value
    r, width = correlation(fit), fit.estimates[POWER].stderr
    for end in size.ci95:
        # All others fitted at powers near the best one there, at the minimum of a parabola.
        middle = fit[POWER] + r * width * size.value / size.stderr * math.log(end / size.value)
        offsets = width * math.sqrt(1 - r**2) * np.linspace(-3, 3, 5)
        fits = [fit_runs([run], law(end, middle + d), BASE, profiled=()) for d in offsets]
        bend, slope, least = np.polyfit(offsets, [held.chi2 - fit.chi2 for held in fits], 2)
        assert least - slope**2 / (4 * bend) == pytest.approx(3.84, rel=0.15)
