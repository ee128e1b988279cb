"""Recordings of identifications, read back: record, model, residual, both pendulums, tables."""

from __future__ import annotations

import dataclasses
import subprocess
from typing import TYPE_CHECKING

import numpy as np
import pytest

import decays
import pendmap
import recorded
from pendmap import InputError, viewer
from pendmap.identification import identify
from pendmap.viewer import comparison, identification, window
from recordings import ReadBack

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
    return ReadBack(viewer.record_identification(report, folder / "a.rrd"))


def scalars(back: ReadBack, entity: str) -> Floats:
    return back.rows(entity, "Scalars:scalars")


def hanging(back: ReadBack, bob: str) -> Floats:
    """Return the angle of a pendulum whose arm has length 1."""
    at = back.rows(bob, "Points2D:positions")
    assert np.allclose(np.hypot(*at.T), 1.0, atol=1e-5)
    return np.arctan2(at[:, 0], -at[:, 1])


def test_the_file_is_complete(report: IdentificationReport, tmp_path: Path) -> None:
    file = viewer.record_identification(report, tmp_path / "a.rrd")
    assert file == tmp_path / "a.rrd"
    assert list(tmp_path.iterdir()) == [file]
    command = [window._program(), "rrd", "verify", str(file)]  # noqa: SLF001 (the viewer itself)
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stderr


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


def test_peaks_are_marked(back: ReadBack, report: IdentificationReport) -> None:
    assert np.allclose(back.seconds("/run_1/angle/peaks"), report.peaks.time, atol=1e-5)
    assert np.allclose(scalars(back, "/run_1/angle/peaks"), report.peaks.amplitude)


def test_both_pendulums_swing(back: ReadBack, report: IdentificationReport) -> None:
    record = hanging(back, "/run_1/pendulum/data/record/bob")
    model = hanging(back, "/run_1/pendulum/data/model/bob")
    assert np.allclose(record, report.run.theta, atol=1e-5)
    assert np.allclose(model, scalars(back, "/run_1/angle/model"), atol=1e-5)
    arm = back.rows("/run_1/pendulum/data/model/arm", "LineStrips2D:strips")
    assert np.allclose(arm[:, 0], 0.0), "both hang on one pivot"
    names = back.columns["/run_1/pendulum/axes/legend/names"]["Points2D:labels"]
    assert names == [["record", "model"]]


def test_the_phase_plane(back: ReadBack, report: IdentificationReport) -> None:
    assert report.joint is not None
    (_, velocity) = report.joint.fit.curves[0]
    now = back.rows("/run_1/phase/data/model_now", "Points2D:positions")
    assert np.allclose(now[:, 1], velocity, atol=1e-5)
    beside = back.rows("/run_1/phase/data/record_now", "Points2D:positions")
    there = np.isin(report.run.time, back.seconds("/run_1/phase/data/record_now").round(6))
    assert np.count_nonzero(there) == len(beside) > 0.95 * len(now)
    noise = np.std(beside[:, 1] - velocity[there])
    assert noise < 0.08, "differences of readings 0.04 s apart, each with 0.00175 rad of noise"


def test_the_estimates_are_in_the_text(back: ReadBack, report: IdentificationReport) -> None:
    page = back.one("/summary", "TextDocument:text")
    best = report.methods["trajectory"]
    for name in ("w0", "c_over_m", "Tr", "offset"):
        row = next(line for line in page.splitlines() if line.startswith(f"| {name} |"))
        _, _, value, interval, *_ = (cell.strip() for cell in row.split("|"))
        low, high = (float(end) for end in interval.strip("[]").split(","))
        ci95 = best.estimates[name].ci95
        assert ci95 is not None
        tenth = 0.1 * (ci95[1] - ci95[0])
        assert float(value) == pytest.approx(best[name], abs=tenth)
        assert [low, high] == pytest.approx(ci95, abs=tenth)
    others = [(n, w) for n, each in report.methods.items() for w in each.warnings]
    assert others, "this record makes some methods warn"
    assert all(f"{name}: {text}" in page for name, text in others)


def test_the_views(back: ReadBack) -> None:
    leaves = ("angle", "residual", "pendulum", "phase")
    assert set(back.views) == {"/summary", *(f"/run_1/{leaf}" for leaf in leaves)}
    assert back.views["/run_1/residual"] == "Record less model (mrad)"


def test_runs_have_separate_views(tmp_path: Path) -> None:
    lines = []
    for number in (1, 2):
        write(tmp_path / f"run_{number}.csv", *swings(number, seconds=8.0 + number))
        lines += ["[[run]]", f'file = "run_{number}.csv"']
    (tmp_path / "experiment.toml").write_text("\n".join(lines) + "\n")
    report = identified(tmp_path, "trajectory")
    back = ReadBack(viewer.record_identification(report, tmp_path / "a.rrd"))
    assert report.joint is not None
    for number, run in enumerate(report.joint.runs, 1):
        assert np.allclose(scalars(back, f"/run_{number}/angle/record"), run.theta)
        assert len(scalars(back, f"/run_{number}/angle/peaks")) > 10
        assert f"/run_{number}/residual" in back.views


def test_long_records_are_thinned(
    report: IdentificationReport, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(comparison, "INSTANTS", 650)
    (one,) = comparison.comparisons(report)
    assert np.array_equal(one.time, report.run.time[::2])
    assert np.array_equal(one.record, report.run.theta[::2])
    monkeypatch.setattr(comparison, "INSTANTS", 10)
    (one,) = comparison.comparisons(report)
    swing = 2 * np.pi / report.model.w0
    assert np.max(np.diff(one.time)) <= swing / comparison.PER_SWING


def test_nothing_is_drawn_across_a_gap(tmp_path: Path) -> None:
    time, theta = swings()
    kept = (time < 8.0) | (time > 10.1)
    report = identified(write(tmp_path / "gap.csv", time[kept], theta[kept]), "trajectory")
    (one,) = comparison.comparisons(report)
    cut = np.isnan(one.record)
    assert np.count_nonzero(cut) == 1
    assert 8.0 < one.time[cut][0] < 10.1
    back = ReadBack(viewer.record_identification(report, tmp_path / "a.rrd"))
    assert np.isfinite(hanging(back, "/run_1/pendulum/data/record/bob")).all()


def test_unused_samples_are_marked(report: IdentificationReport, tmp_path: Path) -> None:
    out = np.zeros(report.run.time.size, bool)
    out[100:110] = True
    run = dataclasses.replace(report.run, trusted=~out)
    assert report.joint is not None
    joint = dataclasses.replace(report.joint, runs=(run,))
    some = dataclasses.replace(report, run=run, joint=joint)
    back = ReadBack(viewer.record_identification(some, tmp_path / "a.rrd"))
    assert np.allclose(scalars(back, "/run_1/angle/left_out"), report.run.theta[out])
    assert len(scalars(back, "/run_1/residual/residual")) == out.size - 10


def test_without_a_fit_the_best_model_is_simulated(tmp_path: Path) -> None:
    report = identified(write(tmp_path / "a.csv", *swings(seconds=70.0)), "combined_repaired")
    assert report.joint is None
    (one,) = comparison.comparisons(report)
    best, first = report.best, report.peaks.turned
    made = decays.decay(
        best["w0"], best["c_over_m"], best["Tr"], first.amplitude[0] - best["offset"]
    )
    read = made.angle(one.time - first.time[0]) + best["offset"]
    assert np.nanmax(np.abs(one.model - read)) < 1e-5
    known = np.isfinite(one.residual)
    assert np.allclose(one.residual[known], (one.record - one.model)[known])
    back = ReadBack(viewer.record_identification(report, tmp_path / "a.rrd"))
    assert {"/run_1/angle/model", "/run_1/residual/residual"} <= set(back.columns)


def test_a_record_of_peaks_alone(tmp_path: Path) -> None:
    made = decays.decay(release=2.0)
    file = write(tmp_path / "peaks.csv", made.peak_time[:-1], made.peak[:-1], "peak_rad")
    report = identified(file)
    back = ReadBack(viewer.record_identification(report, tmp_path / "a.rrd"))
    assert np.allclose(scalars(back, "/run_1/angle/record"), made.peak[:-1], atol=1e-8)
    time = back.seconds("/run_1/angle/model")
    assert np.max(np.diff(time)) < 2 * np.pi / 6.2 / comparison.PER_SWING
    assert np.allclose(scalars(back, "/run_1/angle/model"), made.angle(time), atol=0.2)
    assert len(scalars(back, "/run_1/residual/residual")) == len(made.peak) - 1


def test_a_record_that_begins_with_rotations(tmp_path: Path) -> None:
    time, theta, velocity = recorded.motion(1.2, 16.0, 40.0, 50.0)
    report = identified(write(tmp_path / "a.csv", time, theta), "energy_balance")
    (one,) = comparison.comparisons(report)
    near = np.interp(one.peaks.time, time, theta)
    assert np.allclose(one.peaks.amplitude, near, atol=0.03), "turns are counted as the record has"
    assert np.nanmax(np.abs(one.residual)) < 0.05
    low, high = identification._frame(one, 6.2).y  # noqa: SLF001 (a frame is drawn, not logged)
    assert low < velocity.min() < velocity.max() < high


def test_where_no_method_can_be_applied_the_record_is_shown(tmp_path: Path) -> None:
    file = write(
        tmp_path / "p.csv", *(np.array(x) for x in ([0, 0.5, 1.0], [2, -1.9, 1.8])), "peak_rad"
    )
    report = identified(file)
    back = ReadBack(viewer.record_identification(report, tmp_path / "a.rrd"))
    assert "/run_1/angle/model" not in back.columns
    assert "/run_1/residual" not in back.views
    assert "No method could be applied" in back.one("/summary", "TextDocument:text")


def test_recordings_of_one_report_are_equal(
    report: IdentificationReport, back: ReadBack, tmp_path: Path
) -> None:
    again = ReadBack(viewer.record_identification(report, tmp_path / "b.rrd"))
    other = dataclasses.replace(report, methods={"trajectory": report.best}, joint=None)
    third = ReadBack(viewer.record_identification(other, tmp_path / "c.rrd"))
    ids = [one.recordings[0].recording_id for one in (back, again, third)]
    assert ids[0] == ids[1] != ids[2]


def test_a_recording_is_complete_or_absent(
    report: IdentificationReport, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "a.rrd"
    file.write_bytes(b"old")
    with pytest.raises(InputError, match=r"suffix must be \.rrd, got '\.txt'"):
        viewer.record_identification(report, tmp_path / "a.txt")

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(identification, "_phase", interrupted)
    with pytest.raises(KeyboardInterrupt):
        viewer.record_identification(report, file)
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]
