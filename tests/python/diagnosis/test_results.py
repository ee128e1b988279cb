"""Tables, residuals, predictions and files of a diagnosis."""

from __future__ import annotations

import dataclasses
import json
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from pendmap import Effect, InputError, Rig, Run
from pendmap.comparison import Comparison
from pendmap.diagnosis import Discrepancy, diagnosed_model
from pendmap.diagnosis.summary import as_json
from recordings import ReadBack

if TYPE_CHECKING:
    from pathlib import Path

DRAG = Effect("quadratic_drag", {"q": 0.02})
TRUE = Rig(w0=6.2, c_over_m=0.05, Tr=0.08, effects=(DRAG,))


def made(name: str, release: float, model: Rig = TRUE, **drive: float) -> Run:
    """Return a record with noise, of a forced run with a drive."""
    time = np.arange(0.0, 20.0, 0.02)
    rig = Rig(w0=6.2, c_over_m=0.05, Tr=0.08, effects=model.effects, **drive)
    theta = pendmap.simulate(rig, release, 0.0, t_eval=time).theta.values
    noise = np.random.default_rng(round(10 * release)).normal(0.0, 1e-3, time.size)
    kind = "forced" if drive else "free"
    every = np.ones(time.size, bool)
    return Run(name, f"{name}.csv", kind, time, theta + noise, every, drive=drive or None)


@pytest.fixture(scope="module")
def found() -> Discrepancy:
    runs = [made("a", 2.5), made("b", 1.0), made("c", 1.2, p=0.2, Omega=11.0, phi=0.3)]
    return pendmap.diagnose(runs)


def test_parameters_are_those_of_the_model_file(found: Discrepancy) -> None:
    assert found.verdict == "named"
    table, model = found.to_dataframe(), diagnosed_model(found)
    (effect,) = found.effects
    row = table.loc["quadratic_drag.q"]
    assert (row.value, row.low, row.high) == (effect.parameters["q"], *effect.ci95["q"])
    assert row.unit == "1/rad"
    assert table.value["w0"] == model.w0
    for name, true in {"w0": 6.2, "c_over_m": 0.05, "Tr": 0.08, "quadratic_drag.q": 0.02}.items():
        assert abs(table.value[name] - true) < 5 * table.stderr[name]
    covariance = model.notes["covariance"]
    assert list(found.correlation) == covariance["names"]
    sizes = np.sqrt(np.diag(covariance["matrix"]))
    expected = np.array(covariance["matrix"]) / np.outer(sizes, sizes)
    assert found.correlation.to_numpy() == pytest.approx(expected, rel=1e-9)
    assert found.model == model
    assert found.model.notes["covariance"] == covariance
    ranking = found.ranking
    assert ranking.score.is_monotonic_decreasing
    assert "quadratic_drag" in ranking.index[:6]


def test_shapes_of_candidates_are_in_si(found: Discrepancy) -> None:
    w0 = found.base.fitted.fit.model.w0
    for k in found.scores.best():
        candidate = found.scores.scores[k].candidate
        for name, value in found.ranking["shape"][candidate.name].items():
            entry = candidate.definition[name]
            assert value == pytest.approx(candidate.shape[name] * w0**entry.power_of_w0)
    ((_, rows),), _ = found.text_parts()
    shaped = [row for row in rows if row[1]]
    assert shaped
    for name, text, *_ in shaped:
        values = found.ranking["shape"][name].values()
        assert [f"{value:.3g}" for value in values] == re.findall(r"= (\S+)", text)


def test_an_effect_that_is_named_with_the_other_sign_has_its_correlations(
    found: Discrepancy,
) -> None:
    (effect,) = found.effects
    turned = dataclasses.replace(effect, parameters={"q": -effect.parameters["q"]})
    other = dataclasses.replace(found, effects=(turned,)).correlation
    sign = -1 if effect.parameters["q"] * found.best.fitted.fit["quadratic_drag.q"] > 0 else 1
    assert other.loc["w0", "c_over_m"] == found.correlation.loc["w0", "c_over_m"]
    own = found.correlation.loc["w0", "quadratic_drag.q"]
    assert other.loc["w0", "quadratic_drag.q"] == sign * own


def test_residuals_and_predictions_are_those_of_the_best_model(found: Discrepancy) -> None:
    _, fitted, runs = found.followed()
    curves = found.best.fitted.fit.curves
    for given, run, curve in zip(fitted, runs, curves, strict=True):
        residual = found.residual[run.name]
        inside = np.isfinite(curve[0])
        times = residual.time.values[inside]
        assert found.predict(times, run.name) == pytest.approx(curve[0][inside], abs=1e-7)
        known = np.isfinite(residual.values) & inside
        model = given.theta[known] - residual.values[known]
        assert model == pytest.approx(
            found.predict(residual.time.values[known], run.name), abs=0.01
        )
        assert 0.5e-3 < np.nanstd(residual) < 2e-3
    forced = next(run for run in runs if run.kind == "forced")
    rig = Rig(**{**{n: getattr(TRUE, n) for n in TRUE.numbers()}, **forced.drive}, effects=(DRAG,))
    exact = pendmap.simulate(rig, 1.2, 0.0, t_eval=[0.5, 1.0, 2.0]).theta.values
    assert found.predict([0.5, 1.0, 2.0], forced.name) == pytest.approx(exact, abs=2e-3)


def test_what_is_loaded_has_the_same_numbers(found: Discrepancy, tmp_path: Path) -> None:
    before = pendmap.load(pendmap.save(found, tmp_path / "before.nc"))
    said = json.dumps(as_json(found))
    after = pendmap.load(pendmap.save(found, tmp_path / "after.nc"))
    for again in (before, after):
        assert json.dumps(as_json(again)) == said
        assert again.adds == found.adds
        assert again.to_dataframe().equals(found.to_dataframe())
        assert again.ranking.equals(found.ranking)
        assert diagnosed_model(again).notes["covariance"] == found.model.notes["covariance"]
        name = found.data.runs[0].name
        assert again.residual[name].identical(found.residual[name])
        assert np.array_equal(again.predict([1.0, 2.0], name), found.predict([1.0, 2.0], name))
    assert "<th>95 % interval</th>" in after._repr_html_()
    assert pendmap.view(after, tmp_path / "after.rrd").exists()


def test_view_says_what_it_takes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"result must be a dataset, .*, got 3"):
        pendmap.view(3, tmp_path / "a.rrd")
    with pytest.raises(InputError, match="path must be left out where a recording is opened"):
        pendmap.view("a.rrd", tmp_path / "a.rrd")
    opened: list[object] = []
    monkeypatch.setattr("pendmap.viewer.open_viewer", opened.append)
    made = pendmap.view(pendmap.simulate(TRUE, 1.0, 0.0, 5.0))
    assert opened == [made]
    assert made.stat().st_size > 1000
    pendmap.view(made)
    assert opened == [made, made]


def test_a_comparison_and_its_records_have_recordings(tmp_path: Path) -> None:
    experiment = made("a", 1.0)
    compared = pendmap.compare(TRUE, experiment)
    assert isinstance(compared, Comparison)
    back = ReadBack(pendmap.view(compared, tmp_path / "a.rrd"))
    panels = {f"/part_1/{name}" for name in ("record", "residual", "errors")}
    assert panels | {"/legend", "/summary"} <= set(back.views)
    assert "- model: blue" in back.one("/legend", "TextDocument:text")
    assert pendmap.view(experiment, tmp_path / "b.rrd").exists()
