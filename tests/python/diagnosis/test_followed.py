"""Rates, rotations, runs that no model follows, and the physical core in coloured residuals."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

import pendmap
from driven_decays import motion
from pendmap.comparison.data import split_records
from pendmap.diagnosis import baseline
from pendmap.diagnosis.baseline import fit_baseline, lost_runs
from pendmap.diagnosis.fitted_model import fit_model
from pendmap.diagnosis.state import State
from pendmap.diagnosis.thresholds import Thresholds
from pendmap.records import Experiment, Run
from pendmap.records.experiment import Gyroscope
from pendmap.residuals.torque import residual_torque

TIME = np.arange(1000) * 0.02


def decay(start: float, speed: float = 0.0, w0: float = 6.2, drag: float = 0.0) -> np.ndarray:
    return motion(TIME, (start, speed), w0=w0, c_over_m=0.05, friction=0.05, drag=drag)


def run_of(theta: np.ndarray, name: str = "a", noise: float = 1e-3, seed: int = 1) -> Run:
    noisy = theta + noise * np.random.default_rng(seed).standard_normal(theta.size)
    return Run(name, f"{name}.csv", "free", TIME, noisy, np.ones(theta.size, bool))


def of_rate(theta: np.ndarray, seed: int = 1) -> Run:
    """Return the run of a gyroscope with a bias."""
    noise = 5e-3 * np.random.default_rng(seed).standard_normal(theta.size)
    rate = CubicSpline(TIME, theta)(TIME, 1) + 0.02 + noise
    sensor = Gyroscope(6.2)
    return dataclasses.replace(run_of(theta), velocity=rate, gyroscope=sensor)


def experiment(*runs: Run) -> Experiment:
    return Experiment(Path("there"), runs)


def test_drag_is_named_from_a_gyroscope() -> None:
    result = pendmap.diagnose(of_rate(decay(2.2, drag=0.03)), max_effects=1)
    assert (result.verdict, [e.name for e in result.effects]) == ("named", ["quadratic_drag"])
    low, high = result.effects[0].ci95["q"]
    assert low < 0.03 < high
    assert result.best.fitted.fit["bias"] == pytest.approx(0.02, abs=1e-3)
    assert result.gap.after == pytest.approx(5e-3 / 6.2, rel=0.1)
    (forecast,) = result.forecasts
    assert np.nanmax(forecast.after) < 1.3 * forecast.noise_floor


def test_the_torque_that_rates_show_is_that_of_angles() -> None:
    ends = []
    for run in (run_of(decay(2.2, drag=0.1)), of_rate(decay(2.2, drag=0.1))):
        data = split_records(experiment(run))
        base, _ = fit_baseline(data, without=("quadratic_drag",))
        rows = residual_torque(data.fitted, base.fit, base.noise).rows["velocity"]
        ends.append([rows[k]["torque"] for k in (0, -1)])
    assert abs(ends[0][0]) > 0.3
    np.testing.assert_allclose(ends[1], ends[0], rtol=0.3)


@pytest.mark.parametrize(("start", "speed", "w0"), [(0.3, 40.0, 6.2), (-2.0, -18.0, 4.0)])
def test_a_rotation_gives_the_natural_frequency(start: float, speed: float, w0: float) -> None:
    run = run_of(decay(start, speed, w0)[:300], noise=3e-3)
    run = dataclasses.replace(run, time=TIME[:300])
    report = pendmap.identify(run, methods=["trajectory"])
    w0_found = report.parameters["w0"]
    assert abs(w0_found.value - w0) < 4 * (w0_found.stderr or 0)
    assert w0_found.stderr < 0.01 * w0
    assert pendmap.diagnose(run, max_effects=0).verdict == "none"


def test_a_lost_run_is_fitted_in_windows_or_set_aside() -> None:
    starts = {"0": 1.5, "1": 0.9, "other": 1.4}
    runs = [run_of(decay(a, w0=4.4 if k == "other" else 6.2), k) for k, a in starts.items()]
    data = split_records(experiment(*runs))
    windows = [(k, 0, TIME.size, a, 0.0) for k, a in enumerate(starts.values())]
    fitted = fit_model(data, pendmap.Rig(6.2, 0.05, 0.05), ["w0"], windows=windows, steps=0)
    assert [*lost_runs(data.fitted, fitted.fit)] == [2]
    shorter = baseline.in_windows(data, [2])
    assert [run.longest_s for run in shorter.fitted] == [None, None, pytest.approx(TIME[-1] / 4)]
    left = baseline.set_aside(data, [2])
    assert left is not None
    assert [left.runs[k].name for k in left.fitted_of] == ["0", "1"]
    assert {left.runs[k].name for k in left.held_of} == {"0", "1"}
    assert left.runs[2].findings[-1].what == "run-lost"
    assert baseline.set_aside(split_records(experiment(runs[0])), [0]) is None


def test_what_opposes_the_motion_is_no_start_below_0() -> None:
    data = split_records(experiment(run_of(decay(2.2, drag=-0.004))))
    base, _ = fit_baseline(data, without=("quadratic_drag",))
    state = State(data, base, Thresholds(), 1, ())
    scores = state.scores(base).scores
    drives = [
        s
        for s in scores
        if s.candidate.definition.opposing and s.start.get(s.candidate.free[0], 0) < 0
    ]
    assert {"quadratic_drag", "cubic_damping"} <= {s.candidate.name for s in drives}
    assert not any(s.gain for s in drives)


def test_the_core_that_closes_half_of_the_gap_is_not_unknown() -> None:
    """Disturbances as slow as the swings leave few independent readings."""
    rng, runs = np.random.default_rng(2), []
    for k, start in enumerate((1.0, 0.7, 0.85)):
        slow = lfilter([1.0], [1.0, -1.9549, 0.9702], rng.standard_normal(700))[500:]
        theta = decay(start, drag=0.12)[:200] + 0.01 * slow / np.std(slow)
        run = run_of(theta, str(k), seed=k)
        runs.append(dataclasses.replace(run, time=TIME[:200]))
    result = pendmap.diagnose(runs, max_effects=1)
    assert not any(attempt.accepted for attempt in result.attempts)
    assert result.verdict == "partial"
    assert [effect.name for effect in result.effects] == ["quadratic_drag"]
    assert result.effects[0].approximate


def test_a_run_of_another_rig_is_set_aside_and_said() -> None:
    starts = {"0": 1.5, "1": 0.9, "other": 1.4}
    runs = [run_of(decay(a, w0=4.4 if k == "other" else 6.2), k) for k, a in starts.items()]
    result = pendmap.diagnose(runs, max_effects=0)
    assert [result.data.runs[k].name for k in result.data.fitted_of] == ["0", "1"]
    assert result.verdict == "none"
    assert any("no model follows it" in line for line in result.text_parts()[1])


def test_far_above_the_noise_damping_effects_are_fitted_outright() -> None:
    cubic = pendmap.Effect("cubic_damping", {"k3": 0.02})
    rig = pendmap.Rig(6.2, 0.05, 0.05, effects=(cubic,))
    theta = pendmap.simulate(rig, theta=2.2, velocity=0.0, t_eval=TIME).theta.values
    run = run_of(theta, noise=5e-5)
    _, core = fit_baseline(split_records(experiment(run)))
    assert core is not None
    assert core.names == ("power_law_drag",)
    result = pendmap.diagnose(run, max_effects=1)
    assert (result.verdict, [e.name for e in result.effects]) == ("named", ["cubic_damping"])


def test_the_worst_run_is_set_aside_alone() -> None:
    """A run that is lost spoils the fit to the others, which are followed without it."""
    runs = [run_of(decay(a, drag=0.03), str(k), seed=k) for k, a in enumerate((1.5, 0.9, 1.3))]
    runs[0] = dataclasses.replace(runs[0], theta=runs[0].theta + 0.03 * TIME)
    data, base, core = baseline.fit_followed(split_records(experiment(*runs)))
    assert [run.name for run in data.fitted] == ["1", "2"]
    assert [run.name for run in data.runs if run.findings] == ["0"]
    assert core is not None
    assert core.fit["quadratic_drag.q"] == pytest.approx(0.03, rel=0.05)
    assert core.chi2 < base.chi2


def test_a_run_held_out_that_no_model_follows_is_set_aside() -> None:
    runs = [run_of(decay(a, drag=0.03), str(k), seed=k) for k, a in enumerate((1.5, 0.9, 1.3))]
    drifting = dataclasses.replace(runs[1], theta=runs[1].theta + 0.05 * TIME, hold_out=True)
    data, _, _ = baseline.fit_followed(split_records(experiment(runs[0], drifting, runs[2])))
    assert {data.runs[k].name for k in (*data.fitted_of, *data.held_of)} == {"0", "2"}
    assert data.inside
    assert [run.name for run in data.runs if run.findings] == ["1"]


def test_no_other_start_is_tried_where_noise_explains_the_residuals(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    starts, fit = [], baseline.fit_with_candidates

    def counted(*given: Any, short: bool, **more: Any) -> Any:  # noqa: ANN401 (passed on)
        starts.append(short)
        return fit(*given, short=short, **more)

    monkeypatch.setattr(baseline, "fit_with_candidates", counted)
    theta, wave = decay(1.5, drag=0.03), 0.01 * np.sin(TIME)
    for more, asked in ((0.0, [False]), (wave, [False, True])):
        starts.clear()
        fit_baseline(split_records(experiment(run_of(theta + more))))
        assert starts == asked
