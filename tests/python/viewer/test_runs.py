"""Recordings of identifications and diagnoses, read back: records, models, residuals, texts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import decays
from hidden import once
from pendmap import viewer
from pendmap.charts.diagnosis import forecast
from pendmap.charts.palette import look
from pendmap.diagnosis.result import as_text
from pendmap.identification import identify, report
from pendmap.records import Experiment, Run
from pendmap.viewer import runs
from recordings import ReadBack

if TYPE_CHECKING:
    from pathlib import Path

    import numpy.typing as npt

    from pendmap.diagnosis import Discrepancy
    from pendmap.identification import IdentificationReport

    Floats = npt.NDArray[np.float64]

pytestmark = pytest.mark.usefixtures("strict_recordings")

OFFSET = 0.05
"""Zero of the sensor, rad: large enough to show if a model's reading lacked it."""


def scalars(back: ReadBack, entity: str) -> Floats:
    return back.rows(entity, "Scalars:scalars")


def assert_hangs(back: ReadBack, path: str, pivot: float, angle: Floats) -> None:
    """Assert that a pendulum with an arm of length 1 hangs at this angle."""
    at = back.rows(f"/run_1/pendulum/data/{path}/bob", "Points2D:positions") - (pivot, 0.0)
    assert np.allclose(at, np.stack([np.sin(angle), -np.cos(angle)], axis=1), atol=1e-5)


def swings(seed: int = 0, seconds: float = 24.0) -> tuple[Floats, Floats]:
    made = decays.decay(release=2.0)
    return decays.record(made, seconds=seconds, rate=50.0, offset=OFFSET, seed=seed)


@pytest.fixture(scope="module")
def one() -> IdentificationReport:
    return identify(*swings())


@pytest.fixture(scope="module")
def of_one(one: IdentificationReport, tmp_path_factory: pytest.TempPathFactory) -> ReadBack:
    return ReadBack(viewer.record(one, tmp_path_factory.mktemp("recording") / "a.rrd"))


def test_record_model_and_residual(of_one: ReadBack, one: IdentificationReport) -> None:
    time, theta = one.run.time, one.run.theta
    record, model = scalars(of_one, "/run_1/angle/record"), scalars(of_one, "/run_1/angle/model")
    assert np.allclose(of_one.seconds("/run_1/angle/record"), time, atol=1e-5)
    assert np.allclose(record, theta)
    read = decays.decay(release=2.0).angle(time) + OFFSET
    assert np.allclose(model, read, atol=1e-3), "what the sensor would have read without noise"
    residual = scalars(of_one, "/run_1/residual/residual")
    assert np.allclose(residual, 1e3 * (theta - model), atol=1e-9)
    assert one.joint is not None
    sigma = one.joint.readings[0].sigma
    assert np.allclose(scalars(of_one, "/run_1/residual/above"), 2e3 * sigma)
    assert np.allclose(scalars(of_one, "/run_1/residual/below"), -2e3 * sigma)
    assert np.mean(np.abs(residual) < 2e3 * sigma) == pytest.approx(0.954, abs=0.03)
    assert_hangs(of_one, "record", 0.0, record)
    assert_hangs(of_one, "model", runs.APART, model)
    assert_hangs(of_one, "model/record", runs.APART, record)


def test_the_estimates_are_in_the_text(of_one: ReadBack, one: IdentificationReport) -> None:
    page = of_one.one("/summary", "TextDocument:text")
    assert page.split("\n\n") == [line.strip() for line in report.as_text(one)]
    table = of_one.one("/part_5/table", "TextDocument:text")
    for name, method in one.methods.items():
        if method.applicable:
            assert f"| {look(name).label} |" in table


def test_runs_have_separate_views_and_nothing_is_drawn_across_a_gap(tmp_path: Path) -> None:
    every = []
    for number, seconds in ((1, 14.0), (2, 6.0)):
        time, theta = swings(number, seconds)
        there = (time < 8.0) | (time > 10.1)
        trusted = np.ones(np.count_nonzero(there), bool)
        every.append(Run(f"{number}", "a.csv", "free", time[there], theta[there], trusted))
    both = identify(Experiment(tmp_path, tuple(every)), methods=["trajectory"])
    back = ReadBack(viewer.record(both, tmp_path / "a.rrd"))
    assert np.allclose(scalars(back, "/run_2/angle/record"), every[1].theta)
    assert {"/run_1/residual", "/run_2/residual"} <= set(back.views)
    (cut,) = (motion.time[np.isnan(motion.record)] for motion in runs.of_identification(both)[:1])
    assert len(cut) == 1
    assert 8.0 < cut < 10.1
    bob = back.rows("/run_1/pendulum/data/record/bob", "Points2D:positions")
    assert np.isfinite(bob).all()


def test_where_no_trajectory_is_fitted_the_charts_are_recorded(tmp_path: Path) -> None:
    peaks = np.array([0.0, 0.5, 1.0]), np.array([2.0, -1.9, 1.8]), np.ones(3, bool)
    few = identify(Experiment(tmp_path, (Run("a", "a.csv", "free", *peaks, peaks_only=True),)))
    back = ReadBack(viewer.record(few, tmp_path / "a.rrd"))
    assert not [view for view in back.views if view.startswith("/run_1")]
    texts = [str(rows.get("TextDocument:text")) for rows in back.columns.values()]
    assert any("No method can be applied" in text for text in texts)


@pytest.fixture(scope="module")
def found() -> Discrepancy:
    return once("quadratic_drag")


@pytest.fixture(scope="module")
def back(found: Discrepancy, tmp_path_factory: pytest.TempPathFactory) -> ReadBack:
    return ReadBack(viewer.record(found, tmp_path_factory.mktemp("recording") / "a.rrd"))


def test_a_diagnosis_shows_all_runs_and_both_models(found: Discrepancy, back: ReadBack) -> None:
    """Residuals are those of the gap; held-out runs come last."""
    for number, row in enumerate(found.gap.by_run, 1):
        root = f"/run_{number}/residual"
        for name, rms in (("before", row.before), ("after", row.after)):
            left = scalars(back, f"{root}/{name}")
            assert np.sqrt(np.nanmean(left**2)) == pytest.approx(1e3 * rms, rel=1e-6)
        assert scalars(back, f"{root}/above") == pytest.approx(2e3 * row.noise_floor)
        assert {f"/run_{number}/{view}" for view in ("pendulum", "angle")} <= set(back.views)
    assert f"/run_{len(found.gap.by_run) + 1}/angle/record" not in back.columns
    run = found.data.fitted[0]
    record = scalars(back, "/run_1/angle/record")
    np.testing.assert_allclose(back.seconds("/run_1/angle/record"), run.time, atol=2e-9)
    np.testing.assert_allclose(record, run.theta)
    for place, name in enumerate(("before", "after"), 1):
        model = scalars(back, f"/run_1/angle/{name}")
        left = scalars(back, f"/run_1/residual/{name}") / 1e3
        assert record - model == pytest.approx(left, abs=1e-9)
        assert_hangs(back, name, runs.APART * place, model)
    for origin in back.views:
        assert any(entity.startswith(origin) for entity in back.columns), origin
    text = back.one("/summary", "TextDocument:text")
    assert text.split("\n\n") == [line.strip() for line in as_text(found)]


def test_torque_and_forecasts_have_their_coordinates(found: Discrepancy, back: ReadBack) -> None:
    for over in ("angle", "velocity"):
        for name, torque in (("before", found.torque_before), ("after", found.torque_after)):
            line = np.array(back.one(f"/torque/{over}/data/{name}", "LineStrips2D:strips"))
            rows = torque.rows[over]
            expected = [(row[end], row["torque"]) for row in rows for end in ("from", "to")]
            np.testing.assert_allclose(line.reshape(-1, 2), expected, rtol=1e-6, atol=1e-7)
    shown = max(found.forecasts, key=lambda one: one.starts)
    line = np.array(back.one(f"/forecast/{shown.kind}/data/after", "LineStrips2D:strips"))
    up = line.reshape(-1, 2)[:, 1]
    logarithmic = forecast(found, shown).y.scale == "log"
    np.testing.assert_allclose(10.0**up if logarithmic else up, 1e3 * shown.after, rtol=1e-5)
