"""Tables, residuals, predictions and files of identifications, and records in all their forms."""

from __future__ import annotations

import dataclasses
import json
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import pendmap
from decays import decay, record
from fits import written
from pendmap import InputError, Rig, Run, virtual_rig
from pendmap.identification import Identification, IdentificationReport
from pendmap.identification.report import as_json

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run as Command

TRUE = {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.08}
BEGIN = 3.0  # Time of the first sample of a run, s


def made(name: str = "a", release: float = 2.0, seed: int = 1) -> Run:
    """Return a record of an independent integration with noise."""
    time, theta = record(decay(release=release, until=40.0), seconds=30, seed=seed)
    return Run(name, f"{name}.csv", "free", time + BEGIN, theta, np.ones(time.size, bool))


@pytest.fixture(scope="module")
def report() -> IdentificationReport:
    return pendmap.identify([made("a"), made("b", 1.0, 2)])


def test_a_row_has_value_error_interval_and_unit(report: IdentificationReport) -> None:
    table = report.to_dataframe()
    assert list(table.columns) == ["value", "stderr", "low", "high", "unit"]
    assert table.index.name == "parameter"
    for name, true in TRUE.items():
        row = table.loc[name]
        assert abs(row.value - true) < 4 * row.stderr
        assert row.low < row.value < row.high
        assert row.value == report.best[name]
    assert table.unit.to_dict()["Tr"] == "rad/s²"
    peaks = report.methods["log_decrement"].to_dataframe()
    assert set(peaks.index) <= {"w0", "c_over_m", "zeta", "Tr", "theta_r", "offset"}


def test_correlations_are_those_of_the_covariance(report: IdentificationReport) -> None:
    assert report.best.covariance is not None
    names, matrix = report.best.covariance
    table = report.correlation
    assert list(table.index) == list(table.columns) == list(names)
    assert np.diag(table) == pytest.approx(1.0)
    errors = report.to_dataframe().stderr[list(names)].to_numpy()
    assert table.to_numpy() * np.outer(errors, errors) == pytest.approx(matrix, rel=1e-9)
    bare = Identification("peaks", report.best.estimates)
    with pytest.raises(InputError, match="correlation must be of a method with a covariance"):
        _ = bare.correlation


def test_the_residual_is_the_reading_less_the_model_and_its_zero(
    report: IdentificationReport,
) -> None:
    assert list(report.residual) == ["a", "b"]
    for run in report.runs:
        residual = report.residual[run.name]
        assert residual.attrs["units"] == "rad"
        assert np.array_equal(residual.time, run.time)
        model = report.predict(run.time, run.name) + report.best["offset"]
        assert residual.to_numpy() == pytest.approx(run.theta - model, abs=1e-7)


def test_a_prediction_is_the_motion_of_the_fitted_model(report: IdentificationReport) -> None:
    """From the fitted state by scipy, up to the first turn, where friction changes its sense."""
    assert report.joint is not None
    (*_, theta, velocity), rig = report.joint.fit.windows[0], report.model

    def rhs(_: float, y: list[float]) -> list[float]:
        friction = rig.c_over_m * y[1] + rig.Tr * np.sign(y[1] or -1.0)
        return [y[1], -(rig.w0**2) * np.sin(y[0]) - friction]

    times = np.linspace(0.05, 0.5, 7)
    span, fine = (0.0, 0.5), {"rtol": 1e-11, "atol": 1e-11}
    exact = solve_ivp(rhs, span, [theta, velocity], t_eval=times, method="DOP853", **fine)
    assert report.predict(times + BEGIN) == pytest.approx(exact.y[0], abs=1e-7)
    assert report.predict(BEGIN + 0.5).shape == ()
    order = report.predict([BEGIN + 2, BEGIN, BEGIN + 40])
    assert order[1] == pytest.approx(theta, abs=1e-12)
    assert order[0] == pytest.approx(float(report.predict(BEGIN + 2)), abs=1e-9)
    with pytest.raises(InputError, match="run must be one of a, b, got 'c'"):
        report.predict(4.0, "c")
    with pytest.raises(InputError, match=r"t must be finite times from 3 s on, got 2\.0"):
        report.predict(2.0)


def test_what_is_loaded_has_the_same_numbers(report: IdentificationReport, tmp_path: Path) -> None:
    path = pendmap.save(report, tmp_path / "identify.nc")
    again = pendmap.load(path)
    assert str(pendmap.load(path)) == str(report)
    assert json.dumps(as_json(again)) == json.dumps(as_json(report))
    assert str(again) == str(report)
    assert again._repr_html_() == report._repr_html_()
    assert again.to_dataframe().equals(report.to_dataframe())
    assert again.correlation.equals(report.correlation)
    assert np.array_equal(again.predict(report.run.time), report.predict(report.run.time))
    assert again.run is again.runs[0]
    assert again.model == report.model
    one = pendmap.save(report.best, tmp_path / "one.nc")
    assert pendmap.load(one).to_dataframe().equals(report.to_dataframe())
    with pytest.raises(InputError, match=r"suffix|must be"):
        pendmap.save(report, tmp_path / "identify.csv")


def test_a_report_without_a_model_is_shown_and_kept(tmp_path: Path) -> None:
    run = made()
    few = dataclasses.replace(
        run, time=run.time[:12], theta=run.theta[:12], trusted=run.trusted[:12]
    )
    empty = pendmap.identify(few, methods=["log_decrement"])
    assert empty.sound is None
    assert len(empty.to_dataframe()) == 0
    assert "not applicable" in empty._repr_html_()
    again = pendmap.load(pendmap.save(empty, tmp_path / "empty.nc"))
    assert str(again) == str(empty)
    with pytest.raises(InputError, match="the trajectory method must have fitted it"):
        _ = again.residual


def test_a_damaged_file_is_refused_on_one_line(
    report: IdentificationReport, tmp_path: Path
) -> None:
    dataset = xr.open_dataset(pendmap.save(report, tmp_path / "identify.nc")).load()
    content = dataset.attrs["content"]
    for old, new, complaint in (
        ("pendmap.records.experiment:Run", "os:system", "'os:system' is no class of pendmap"),
        ("pendmap.records.experiment:Run", "pendmap.files.atomic:os", "cannot be read as"),
        ('"lab_time_s"', '"lab"', "Run lacks lab_time_s: another version of pendmap wrote it"),
        ("{", "", "cannot be read as a result of pendmap"),
    ):
        bad = dataset.assign_attrs(content=content.replace(old, new))
        with pytest.raises(InputError, match=complaint) as error:
            pendmap.load(pendmap.save(bad, tmp_path / "bad.nc"))
        assert "\n" not in str(error.value)


def test_the_models_file_keeps_the_covariance(report: IdentificationReport, tmp_path: Path) -> None:
    saved = pendmap.load_model(pendmap.save_model(report.model, tmp_path / "rig.toml"))
    assert saved == report.model
    table = saved.notes["covariance"]
    assert table["names"] == ["w0", "c_over_m", "Tr", "encoder_offset.d"]
    assert report.best.covariance is not None
    assert np.array_equal(table["matrix"], report.best.covariance[1])


def test_records_are_taken_in_all_their_forms(tmp_path: Path, report: IdentificationReport) -> None:
    runs = report.runs
    files = [written(tmp_path / r.file, r.time, r.theta, form="%.17g") for r in runs]
    read = [pendmap.read_experiment(file) for file in files]
    names = ["trajectory"]
    forms = [files, [str(file) for file in files], [read[0], read[1].runs[0]], tmp_path]
    tables = [pendmap.identify(form, methods=names).to_dataframe() for form in forms]
    assert all(table.equals(tables[0]) for table in tables[1:])
    one = [pendmap.identify(form, methods=names) for form in (read[0].runs[0], files[0])]
    twice = pendmap.identify([files[0], files[0]], methods=names)
    assert one[0].best["w0"] == one[1].best["w0"] == twice.best["w0"]
    assert [run.name for run in twice.experiment.runs] == ["a", "a (2)"]
    other = dataclasses.replace(read[1], known={"gravity": 9.8})
    with pytest.raises(InputError, match=r"gravity must be one for all records, got 9.7 and 9.8"):
        pendmap.identify([dataclasses.replace(read[0], known={"gravity": 9.7}), other])
    with pytest.raises(InputError, match="rate_hz must be left out where no file or DataFrame"):
        pendmap.identify(read, rate_hz=100.0)
    with pytest.raises(FileNotFoundError):
        pendmap.compare(Rig(w0=6.2), tmp_path / "nothing.csv")
    compared = pendmap.compare(report.model, files)
    assert [one.run.name for one in compared.runs] == ["a", "b"]


def test_a_comparison_is_a_table_a_file_and_a_figure(
    tmp_path: Path, pendmap_command: Command
) -> None:
    result = pendmap.compare(Rig(**TRUE), [made("a"), made("b", 1.0, 2)])
    assert "The model describes 2 of 2 runs (residual up to 1.1 times the noise)." in str(result)
    table = result.to_dataframe()
    assert table.index.names == ["run", "quantity"]
    residual = table.xs("residual", level="quantity")
    assert list(residual.index) == ["a", "b"]
    assert residual.model.to_numpy() == pytest.approx(residual.record.to_numpy(), rel=0.1)
    periods = table.loc["a"].filter(like="period", axis="index")
    assert (periods.error_percent < 1).all()
    again = pendmap.load(pendmap.save(result, tmp_path / "c.nc"))
    assert str(again) == str(result)
    pd.testing.assert_frame_equal(again.to_dataframe(), table)
    stored = xr.open_dataset(tmp_path / "c.nc")
    assert stored.attrs["kind"] == "comparison"
    assert list(stored["run"].values) == list(table.index.get_level_values("run"))
    for words in (("--layer", "residual", "--out", "c.png"), ("--out", "c.rrd")):
        run = pendmap_command("plot", "c.nc", *words)
        assert run.returncode == 0, run.stderr
        assert (tmp_path / words[-1]).stat().st_size > 10_000


def test_a_forced_comparison_has_the_statistics_of_its_ensemble(tmp_path: Path) -> None:
    request = virtual_rig.Request("forced", duration=15, forced=1)
    where = virtual_rig.places(tmp_path / "lab", replace=False)
    virtual_rig.write(virtual_rig.make(request), where)
    ensemble = pendmap.comparison.Ensemble(members=40)
    found = pendmap.compare(Rig(**TRUE), where.experiment, ensemble=ensemble)
    table = found.to_dataframe().loc["run_00"]
    for each in found.forced[0].statistics:
        row = table.loc[each.name]
        assert (row.record, row.model, row.low, row.high) == (
            each.measured,
            each.median,
            *each.ci95,
        )
    again = pendmap.load(pendmap.save(found, tmp_path / "c.nc"))
    pd.testing.assert_frame_equal(again.to_dataframe(), found.to_dataframe())


def test_what_is_unphysical_is_held_at_0(tmp_path: Path) -> None:
    run = made()
    growing = dataclasses.replace(run, theta=run.theta * np.exp(0.2 * run.time / run.time[-1]))
    found = pendmap.identify(growing)
    assert found.joint is not None
    negative = found.joint.negative
    assert negative
    for name, free in negative.items():
        assert free.value < 0
        assert getattr(found.model, name) == found.parameters[name].value == 0.0
        said = f"{name} is {free.value:.3g}, which is unphysical: an effect is missing"
        assert any(text.startswith(said) and "held at 0" in text for text in found.warnings)
    # The others are fitted again: the model is the one whose residual is told.
    (one,) = pendmap.compare(found.model, growing).runs
    assert one.rms == pytest.approx(found.joint.fit.rms, rel=1e-3)
    again = pendmap.load(pendmap.save(found, tmp_path / "a.nc"))
    assert again.joint is not None
    assert again.joint.negative == negative
    assert f"{len(found.warnings)} warning" in repr(found)
    assert "warning" not in repr(pendmap.identify(run))
