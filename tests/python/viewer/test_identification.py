"""Recordings of identifications, read back: record, model, residual, both pendulums, tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import decays
import pendmap
from pendmap import viewer
from pendmap.charts.palette import drawn, look
from pendmap.identification import identify
from pendmap.identification.report import as_text
from pendmap.viewer import runs
from recordings import ReadBack, hanging, scalars

if TYPE_CHECKING:
    from pathlib import Path

    import numpy.typing as npt

    from pendmap.identification import IdentificationReport

    Floats = npt.NDArray[np.float64]

pytestmark = pytest.mark.usefixtures("strict_recordings")

OFFSET = 0.05
"""Zero of the sensor, rad: large enough to show if a model's reading lacked it."""


def write(file: Path, time: Floats, theta: Floats, name: str = "theta_rad") -> Path:
    rows = (f"{t:.6f},{x:.9f}" for t, x in zip(time, theta, strict=True))
    file.write_text("\n".join([f"t_s,{name}", *rows]) + "\n")
    return file


def swings(seed: int = 0, seconds: float = 24.0) -> tuple[Floats, Floats]:
    made = decays.decay(release=2.0)
    return decays.record(made, seconds=seconds, rate=50.0, offset=OFFSET, seed=seed)


def identified(file: Path, *methods: str) -> IdentificationReport:
    return identify(pendmap.read_experiment(file), methods=methods or None)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> IdentificationReport:
    return identified(write(tmp_path_factory.mktemp("rig") / "swings.csv", *swings()))


@pytest.fixture(scope="module")
def back(report: IdentificationReport, tmp_path_factory: pytest.TempPathFactory) -> ReadBack:
    folder = tmp_path_factory.mktemp("recording")
    return ReadBack(viewer.record(report, folder / "a.rrd"))


def test_record_model_and_residual(back: ReadBack, report: IdentificationReport) -> None:
    time, theta = report.run.time, report.run.theta
    record, model = scalars(back, "/run_1/angle/record"), scalars(back, "/run_1/angle/model")
    assert np.allclose(back.seconds("/run_1/angle/record"), time, atol=1e-5)
    assert np.allclose(record, theta)
    read = decays.decay(release=2.0).angle(time) + OFFSET
    assert np.allclose(model, read, atol=1e-3), "what the sensor would have read without noise"
    residual = scalars(back, "/run_1/residual/residual")
    assert np.allclose(residual, 1e3 * (theta - model), atol=1e-9)
    assert report.joint is not None
    sigma = report.joint.readings[0].sigma
    assert np.allclose(scalars(back, "/run_1/residual/above"), 2e3 * sigma)
    assert np.allclose(scalars(back, "/run_1/residual/below"), -2e3 * sigma)
    assert np.mean(np.abs(residual) < 2e3 * sigma) == pytest.approx(0.954, abs=0.03)


def test_both_pendulums_swing(back: ReadBack, report: IdentificationReport) -> None:
    record = hanging(back, "/run_1/pendulum/data/record/bob", 0.0)
    model = hanging(back, "/run_1/pendulum/data/model/bob", runs.APART)
    assert np.allclose(record, report.run.theta, atol=1e-5)
    assert np.allclose(model, scalars(back, "/run_1/angle/model"), atol=1e-5)
    beside = hanging(back, "/run_1/pendulum/data/model/record/bob", runs.APART)
    assert np.allclose(beside, record, atol=1e-5), "the record hangs beside the model"
    assert back.columns["/run_1/pendulum/axes/names"]["Points2D:labels"] == [["record", "model"]]


def test_the_estimates_are_in_the_text(back: ReadBack, report: IdentificationReport) -> None:
    page = back.one("/summary", "TextDocument:text")
    assert page.split("\n\n") == [line.strip() for line in as_text(report)]
    table = back.one("/part_5/table", "TextDocument:text")
    for name, method in report.methods.items():
        if method.applicable and name in drawn(report.methods):
            assert f"| {look(name).label} |" in table


def test_runs_have_separate_views(tmp_path: Path) -> None:
    lines = []
    for number in (1, 2):
        write(tmp_path / f"run_{number}.csv", *swings(number, seconds=4.0 + number))
        lines += ["[[run]]", f'file = "run_{number}.csv"']
    (tmp_path / "experiment.toml").write_text("\n".join(lines) + "\n")
    report = identified(tmp_path, "trajectory")
    back = ReadBack(viewer.record(report, tmp_path / "a.rrd"))
    assert report.joint is not None
    for number, run in enumerate(report.joint.runs, 1):
        assert np.allclose(scalars(back, f"/run_{number}/angle/record"), run.theta)
        assert f"/run_{number}/residual" in back.views


def test_long_records_are_thinned(
    report: IdentificationReport, monkeypatch: pytest.MonkeyPatch
) -> None:
    swing = 2 * np.pi / report.model.w0
    for instants in (650, 10):
        monkeypatch.setattr(runs, "INSTANTS", instants)
        (one,) = runs.of_identification(report)
        every = round((one.time[1] - one.time[0]) / 0.02)
        assert every > 1
        assert np.array_equal(one.time, report.run.time[::every])
        assert np.array_equal(one.record, report.run.theta[::every])
        assert np.max(np.diff(one.time)) <= swing / runs.PER_SWING


def test_nothing_is_drawn_across_a_gap(tmp_path: Path) -> None:
    time, theta = swings()
    kept = (time < 8.0) | (time > 10.1)
    report = identified(write(tmp_path / "gap.csv", time[kept], theta[kept]), "trajectory")
    (one,) = runs.of_identification(report)
    cut = np.isnan(one.record)
    assert np.count_nonzero(cut) == 1
    assert 8.0 < one.time[cut][0] < 10.1
    back = ReadBack(viewer.record(report, tmp_path / "a.rrd"))
    assert np.isfinite(hanging(back, "/run_1/pendulum/data/record/bob", 0.0)).all()


def test_without_a_fit_the_best_model_is_simulated(tmp_path: Path) -> None:
    report = identified(write(tmp_path / "a.csv", *swings(seconds=70.0)), "combined_repaired")
    assert report.joint is None
    back = ReadBack(viewer.record(report, tmp_path / "a.rrd"))
    best, first = report.best, report.peaks.turned
    made = decays.decay(
        best["w0"], best["c_over_m"], best["Tr"], first.amplitude[0] - best["offset"]
    )
    time, model = (read(back, "/run_1/angle/model") for read in (ReadBack.seconds, scalars))
    assert np.abs(model - made.angle(time - first.time[0]) - best["offset"]).max() < 1e-5
    assert "/run_1/residual" not in back.views


def test_where_no_method_can_be_applied_the_record_is_shown(tmp_path: Path) -> None:
    file = write(
        tmp_path / "p.csv", *(np.array(x) for x in ([0, 0.5, 1.0], [2, -1.9, 1.8])), "peak_rad"
    )
    report = identified(file)
    back = ReadBack(viewer.record(report, tmp_path / "a.rrd"))
    assert "/run_1/angle/model" not in back.columns
    assert "/run_1/residual" not in back.views
    texts = [str(rows.get("TextDocument:text")) for rows in back.columns.values()]
    assert any("No method can be applied" in text for text in texts)
