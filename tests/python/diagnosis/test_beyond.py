"""Diagnoses of which a supplementary part cannot be computed."""

from __future__ import annotations

import dataclasses
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap.diagnosis
from hidden import once
from pendmap import InputError, _core, render, viewer
from pendmap.diagnosis import Discrepancy, diagnosed_model, result, summary
from pendmap.formatting import json_text

if TYPE_CHECKING:
    from pathlib import Path

ENTRIES = ("fit_runs", "fit_rows", "simulate")
"""Functions of the core that integrate a model."""
LOST = "the motion leaves the range of numbers: it begins too fast"


def anew() -> Discrepancy:
    """Return a diagnosis without the parts that are computed on demand."""
    return dataclasses.replace(once("quadratic_drag"), reasons={})


def lose(monkeypatch: pytest.MonkeyPatch, share: float, seed: int = 0) -> None:
    """Make each call into the core diverge with a given probability."""
    draw = np.random.default_rng(seed)
    for name in ENTRIES:
        true = getattr(_core, name)

        def call(*given: Any, true: Any = true) -> Any:  # noqa: ANN401 (the signature of the core)
            if draw.random() < share:
                raise _core.Diverged(LOST)
            return true(*given)

        monkeypatch.setattr(_core, name, call)


@pytest.mark.parametrize(("share", "seed"), [(1.0, 0), (0.3, 2)])
def test_a_part_that_cannot_be_computed_is_null_with_its_reason(
    share: float, seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = json.loads(json_text(summary.as_json(once("quadratic_drag"))))
    assert whole["not_computed"] == {}
    found = anew()
    lose(monkeypatch, share, seed)
    told = json.loads(json_text(summary.as_json(found)))
    assert told.keys() == whole.keys()
    for name in ("verdict", "effects", "gap", "where", "ranking", "left"):
        assert told[name] == whole[name], name
    # Each part has a value or a reason.
    unknown = told["not_computed"]
    for part in {name.partition(".")[0] for name in unknown}:
        assert told[part] is None or told[part] != whole[part], part
    for part in ("forecast", "cycles"):
        if told[part] != whole[part]:
            assert any(name.partition(".")[0] == part for name in unknown), part
    assert told["next_experiment"] == whole["next_experiment"]
    assert all("range of numbers" in reason for reason in unknown.values())
    if share == 1.0:
        assert {name.partition(".")[0] for name in unknown} >= {"forecast", "cycles"}
    text = "\n".join(result.as_text(found))
    assert "Verdict: named" in text
    for name in unknown:
        assert f"Not computed: {name}: " in text
    render.draw(found, tmp_path / "a.png")
    render.write_report(found, tmp_path / "a.html")
    viewer.record(found, tmp_path / "a.rrd")
    report = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert all(name in report for name in unknown)


@pytest.mark.thorough
def test_the_torque_of_a_spring_is_named_elastic_with_reserve(tmp_path: Path) -> None:
    # An oscillator whose period does not grow with amplitude equals a pendulum with a spring.
    t = np.arange(0, 30, 0.02)
    record = tmp_path / "spring.csv"
    rows = np.c_[t, 3.1 * np.exp(-0.5 * t) * np.cos(6 * t)]
    np.savetxt(record, rows, "%.6f", ",", header="t_s,theta_rad", comments="")
    found = pendmap.diagnosis.diagnose(pendmap.read_experiment(record))
    (effect,) = found.effects
    assert effect.name == "elastic_restoring"
    assert effect.approximate
    assert effect.parameters["k"] == pytest.approx(36.25, rel=1e-3)
    assert found.best.fitted.fit.model.w0 < 0.1


def test_a_model_that_loses_the_motion_is_refused_with_the_records(tmp_path: Path) -> None:
    record = tmp_path / "run.csv"
    rows = "".join(f"{k / 100},{np.exp(-k / 2000) * np.cos(k / 20):.4f}\n" for k in range(1500))
    record.write_text(rows)
    model = pendmap.Rig.of(w0=5.0, torque=1e9)
    with pytest.raises(InputError, match=r"run\.csv: no model can be fitted to these records: "):
        pendmap.diagnosis.diagnose(pendmap.read_experiment(record), model=model)


@pytest.mark.thorough
def test_a_parameter_that_differs_between_runs_is_reported_and_has_a_wider_interval(
    tmp_path: Path,
) -> None:
    time, noise = np.arange(0, 40, 0.04), np.random.default_rng(1)
    w0 = np.array([6.200, 6.209, 6.201, 6.207])
    for k, own in enumerate(w0):
        motion = pendmap.simulate(pendmap.Rig(w0=own, c_over_m=0.06, Tr=0.08), 1.5, 0, 40.1)
        theta = np.interp(time, motion["time"], motion["theta"]) + 1e-3 * noise.normal(
            size=time.size
        )
        rows = np.c_[time, theta]
        np.savetxt(tmp_path / f"{k}.csv", rows, "%.5f", ",", header="t_s,theta_rad", comments="")
    found = pendmap.diagnosis.diagnose(pendmap.read_experiment(tmp_path))
    assert found.verdict in {"unknown", "partial"}
    assert found.runs.between("w0") == pytest.approx(w0.std(ddof=1), rel=0.2)
    assert any(line.startswith("w0 differs from run to run by ") for line in result.as_text(found))
    between = diagnosed_model(found).notes["covariance"]["between_runs"]
    assert between["w0"] == found.runs.between("w0")
