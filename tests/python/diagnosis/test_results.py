"""Tables, residuals, forecasts, periods and peaks, and files of a diagnosis."""

from __future__ import annotations

import dataclasses
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from hidden import once
from pendmap import Effect, InputError, Rig, Run, _core, render, viewer
from pendmap.comparison import compare
from pendmap.comparison.forecast import compare_forecasts
from pendmap.diagnosis import Discrepancy, diagnosed_model
from pendmap.diagnosis.result import as_text
from pendmap.diagnosis.summary import as_json
from pendmap.formatting import json_text

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.identification.runs import FitRun

TRUE = Rig(w0=6.2, c_over_m=0.05, Tr=0.08, effects=(Effect("quadratic_drag", {"q": 0.02}),))


def made(name: str, release: float, **drive: float) -> Run:
    """Return a record with noise, of a forced run with a drive."""
    time = np.arange(0.0, 20.0, 0.02)
    rig = dataclasses.replace(TRUE, **drive)
    theta = pendmap.simulate(rig, release, 0.0, t_eval=time).theta.values
    noise = np.random.default_rng(round(10 * release)).normal(0.0, 1e-3, time.size)
    kind = "forced" if drive else "free"
    every = np.ones(time.size, bool)
    return Run(name, f"{name}.csv", kind, time, theta + noise, every, drive=drive or None)


@pytest.fixture(scope="module")
def result() -> Discrepancy:
    runs = [made("a", 2.5), made("b", 1.0), made("c", 1.2, p=0.2, Omega=11.0, phi=0.3)]
    return pendmap.diagnose(runs)


def test_parameters_are_those_of_the_model_file(result: Discrepancy) -> None:
    assert result.verdict == "named"
    table, model = result.to_dataframe(), diagnosed_model(result)
    (effect,) = result.effects
    row = table.loc["quadratic_drag.q"]
    assert (row.value, row.low, row.high) == (effect.parameters["q"], *effect.ci95["q"])
    assert row.unit == "1/rad"
    assert table.value["w0"] == model.w0
    for name, true in {"w0": 6.2, "c_over_m": 0.05, "Tr": 0.08, "quadratic_drag.q": 0.02}.items():
        assert abs(table.value[name] - true) < 5 * table.stderr[name]
    covariance = model.notes["covariance"]
    assert list(result.correlation) == covariance["names"]
    sizes = np.sqrt(np.diag(covariance["matrix"]))
    expected = np.array(covariance["matrix"]) / np.outer(sizes, sizes)
    assert result.correlation.to_numpy() == pytest.approx(expected, rel=1e-9)
    assert result.ranking.score.is_monotonic_decreasing
    assert "quadratic_drag" in result.ranking.index[:6]


def test_shapes_of_candidates_are_in_si(result: Discrepancy) -> None:
    w0 = result.base.fitted.fit.model.w0
    for k in result.scores.best():
        candidate = result.scores.scores[k].candidate
        for name, value in result.ranking["shape"][candidate.name].items():
            entry = candidate.definition[name]
            assert value == pytest.approx(candidate.shape[name] * w0**entry.power_of_w0)


def test_an_effect_that_is_named_with_the_other_sign_has_its_correlations(
    result: Discrepancy,
) -> None:
    (effect,) = result.effects
    turned = dataclasses.replace(effect, parameters={"q": -effect.parameters["q"]})
    other = dataclasses.replace(result, effects=(turned,)).correlation
    sign = -1 if effect.parameters["q"] * result.best.fitted.fit["quadratic_drag.q"] > 0 else 1
    assert other.loc["w0", "c_over_m"] == result.correlation.loc["w0", "c_over_m"]
    usual = result.correlation.loc["w0", "quadratic_drag.q"]
    assert other.loc["w0", "quadratic_drag.q"] == sign * usual


def test_residuals_and_predictions_are_those_of_the_best_model(result: Discrepancy) -> None:
    fit, fitted, runs = result.followed()
    for given, run, curve in zip(fitted, runs, fit.curves, strict=True):
        residual = result.residual[run.name]
        inside = np.isfinite(curve[0])
        predicted = result.predict(residual.time.values, run.name)
        assert predicted[inside] == pytest.approx(curve[0][inside], abs=1e-7)
        known = np.isfinite(residual.values) & inside
        model = given.theta[known] - residual.values[known]
        assert model == pytest.approx(predicted[known], abs=0.01)
        assert 0.5e-3 < np.nanstd(residual) < 2e-3
    forced = next(run for run in runs if run.kind == "forced")
    exact = pendmap.simulate(
        dataclasses.replace(TRUE, **forced.drive), 1.2, 0.0, t_eval=[0.5, 1.0, 2.0]
    ).theta.values
    assert result.predict([0.5, 1.0, 2.0], forced.name) == pytest.approx(exact, abs=2e-3)


def test_what_is_loaded_has_the_same_numbers(result: Discrepancy, tmp_path: Path) -> None:
    fields = json.dumps(as_json(result))
    again = pendmap.load(pendmap.save(result, tmp_path / "a.nc"))
    assert json.dumps(as_json(again)) == fields
    assert again.adds == result.adds
    assert again.to_dataframe().equals(result.to_dataframe())
    assert again.ranking.equals(result.ranking)
    assert diagnosed_model(again).notes["covariance"] == result.model.notes["covariance"]
    name = result.data.runs[0].name
    assert again.residual[name].identical(result.residual[name])
    assert np.array_equal(again.predict([1.0, 2.0], name), result.predict([1.0, 2.0], name))
    assert pendmap.view(again, tmp_path / "a.rrd").exists()


def test_view_says_what_it_takes(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"result must be a dataset, .*, got 3"):
        pendmap.view(3, tmp_path / "a.rrd")
    with pytest.raises(InputError, match="path must be left out where a recording is opened"):
        pendmap.view("a.rrd", tmp_path / "a.rrd")


@pytest.mark.parametrize(("share", "seed"), [(1.0, 0), (0.3, 2)])
def test_a_part_that_cannot_be_computed_is_null_with_its_reason(
    share: float, seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = json.loads(json_text(as_json(once("quadratic_drag"))))
    assert whole["not_computed"] == {}
    result = dataclasses.replace(once("quadratic_drag"), reasons={})
    draw = np.random.default_rng(seed)
    for name in ("fit_runs", "fit_rows", "simulate"):
        true = getattr(_core, name)

        def call(*given: Any, true: Any = true) -> Any:  # noqa: ANN401 (the signature of the core)
            if draw.random() < share:
                raise _core.Diverged("the motion leaves the range of numbers: it begins too fast")
            return true(*given)

        monkeypatch.setattr(_core, name, call)
    fields = json.loads(json_text(as_json(result)))
    assert fields.keys() == whole.keys()
    for name in ("verdict", "effects", "gap", "where", "ranking", "left", "next_experiment"):
        assert fields[name] == whole[name], name
    unknown = fields["not_computed"]
    assert set(unknown) == {n for n in ("forecast", "cycles") if fields[n] != whole[n]}
    assert share < 1 or set(unknown) == {"forecast", "cycles"}
    assert all("range of numbers" in reason for reason in unknown.values())
    lines = "\n".join(as_text(result))
    assert "Verdict: named" in lines
    render.draw(result, tmp_path / "a.png")
    render.write_report(result, tmp_path / "a.html")
    viewer.record(result, tmp_path / "a.rrd")
    report = (tmp_path / "a.html").read_text(encoding="utf-8")
    for name in unknown:
        assert f"Not computed: {name}: " in lines
        assert name in report


def test_a_model_that_loses_the_motion_is_refused_with_the_records(tmp_path: Path) -> None:
    record = tmp_path / "run.csv"
    rows = "".join(f"{k / 100},{np.exp(-k / 2000) * np.cos(k / 20):.4f}\n" for k in range(1500))
    record.write_text(rows)
    model = pendmap.Rig.of(w0=5.0, torque=1e9)
    with pytest.raises(InputError, match=r"run\.csv: no model can be fitted to these records: "):
        pendmap.diagnose(record, model=model)


@pytest.mark.thorough
def test_a_parameter_that_differs_between_runs_is_reported_and_has_a_wider_interval() -> None:
    time, noise = np.arange(0, 40, 0.04), np.random.default_rng(1)
    frequencies, runs = np.array([6.200, 6.209, 6.201, 6.207]), []
    for w0 in frequencies:
        path = pendmap.simulate(Rig(w0=w0, c_over_m=0.06, Tr=0.08), 1.5, 0, t_eval=time)
        theta = path.theta.values + 1e-3 * noise.normal(size=time.size)
        runs.append(Run(f"{w0}", "a.csv", "free", time, theta, np.ones(time.size, bool)))
    result = pendmap.diagnose(runs)
    assert result.verdict in {"unknown", "partial"}
    assert result.runs.between("w0") == pytest.approx(frequencies.std(ddof=1), rel=0.2)
    assert any(line.startswith("w0 differs from run to run by ") for line in as_text(result))
    between = diagnosed_model(result).notes["covariance"]["between_runs"]
    assert between["w0"] == result.runs.between("w0")


def test_errors_grow_from_the_noise_and_those_of_the_new_model_less() -> None:
    forecasts = once("quadratic_drag").forecasts
    assert {forecast.kind for forecast in forecasts} == {"free", "forced"}
    for forecast in forecasts:
        floor = forecast.noise_floor
        assert forecast.horizon[0] < 0.2
        assert forecast.after[0] == pytest.approx(floor, rel=0.08)
        assert forecast.before[0] == pytest.approx(floor, rel=0.1)
        assert np.all(np.diff(forecast.horizon) > 0)
        far = forecast.horizon > 0.5 * forecast.horizon[-1]
        before, after = np.mean(forecast.before[far]), np.mean(forecast.after[far])
        # The new model's only error is that of the initial state, fitted to one swing of readings.
        assert floor * 0.9 < after < 1.4 * floor
        assert before > 1.2 * after


def test_periods_and_peaks_are_those_of_a_simulation() -> None:
    """The turning points of a simulation give the periods and peaks of ``compare``."""
    result = once("quadratic_drag")
    model = dataclasses.replace(diagnosed_model(result), notes={})
    compared = compare(model, result.data.experiment).runs
    simulated = {one.run.name: one.errors for one in compared}
    assert result.cycles[0].held_out
    assert {one.name for one in result.cycles} == set(simulated)
    for one in result.cycles:
        ours, other = one.errors["after"], simulated[one.name]
        assert other is not None
        np.testing.assert_allclose(ours.period_error, other.period_error, atol=1e-3)
        np.testing.assert_allclose(ours.peak_error, other.peak_error, atol=1e-3)
    before, after = (
        np.mean([one.errors[name].peak_rms for one in result.cycles])
        for name in ("before", "after")
    )
    assert after < 0.5 * before


def test_forecasts_do_not_depend_on_where_clocks_begin() -> None:
    result = once("quadratic_drag")
    for begin in np.random.default_rng(1).uniform(0.0, 1000.0, 3):
        held = tuple(_later(run, float(begin)) for run in result.data.held)
        data = dataclasses.replace(result.data, held=held)
        moved = compare_forecasts(data, result.base.fits, result.best.fits)
        for forecast, usual in zip(moved, result.forecasts, strict=True):
            np.testing.assert_allclose(forecast.after, usual.after, rtol=0.1)


def _later(run: FitRun, begin: float) -> FitRun:
    """Return a run on a clock that began earlier; the phase of the drive refers to its zero."""
    drive = run.drive
    if drive is not None:
        drive = {**drive, "phi": float(drive["phi"] or 0) - float(drive["Omega"] or 0) * begin}
    return dataclasses.replace(run, time=run.time + begin, drive=drive)
