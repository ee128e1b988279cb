"""Identifications: runs, methods, tables, residuals, predictions; bad input, damaged records."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

import pendmap
from damages import ANGLES, TIMES, one_line, sound
from decays import decay, record
from driven_decays import motion
from fits import TRUTH, agrees, run_of, written
from pendmap import InputError, Pendulum, Rig
from pendmap.comparison import compare
from pendmap.formatting import estimate_text, interval
from pendmap.identification import (
    Estimate,
    Identification,
    Peaks,
    find_peaks,
    identified_model,
    identify,
)
from pendmap.identification.report import as_json, as_text, in_short, left_out
from pendmap.records import Experiment, Run

if TYPE_CHECKING:
    from pendmap.identification import IdentificationReport

BOTH = "trajectory", "combined_repaired"
STAMP = 1.7e9  # Origin of a clock that counts from 1970, s
TIME = np.arange(50) / 10
THERE = Experiment(Path("there"), ())
READ = {name: damage for name, damage in (TIMES | ANGLES).items() if damage.says is not None}


def experiment(*runs: Run) -> Experiment:
    return Experiment(Path("there"), runs)


def decaying(*, release: float = 3.0, seconds: float = 30, seed: int = 0, **given: Any) -> Run:  # noqa: ANN401
    run = run_of(*record(decay(release=release, until=40.0), seconds=seconds, seed=seed))
    return dataclasses.replace(run, **given)


def test_an_experiment_gives_its_longest_free_run() -> None:
    held, forced = decaying(seconds=35, hold_out=True), decaying(seconds=35, kind="forced")
    run = decaying(seconds=34)
    there = experiment(decaying(seconds=10), run, held, forced, decaying(kind="forced"))
    report = identify(there, methods=["energy_balance"])
    assert report.run is run
    assert report.model == report.best.rig
    with pytest.raises(InputError, match="no run is free"):
        identify(experiment(held, forced))
    text = "1 run read; not used: 1 shorter, 1 held out, 2 forced"
    assert left_out(there, [run]) == text
    # A run that is both held out and forced is left out because it is forced.
    both = experiment(run, held, forced, decaying(kind="forced", hold_out=True))
    assert left_out(both, [run, held]) == "2 runs read; not used: 2 forced"
    assert not left_out(both, both.runs)


def test_peaks_alone_are_enough_for_methods_of_peaks() -> None:
    small = decay(release=0.2, c_over_m=0.0496, tr=0.03, until=40.0)
    peaks = find_peaks(*record(small, seconds=30, noise_deg=1e-3)).turned
    run = dataclasses.replace(run_of(peaks.time, peaks.amplitude), peaks_only=True)
    report = identify(experiment(run))
    assert not report.methods["trajectory"].applicable
    assert not report.methods["energy_balance"].applicable
    assert report.joint is None
    assert report.methods["combined_repaired"]["Tr"] == pytest.approx(0.03, rel=0.02)
    assert report.table.errors["combined_repaired"].peak_rms < 1


@pytest.mark.parametrize("samples", [8.0, 100.0])
def test_a_decay_that_begins_with_rotations(samples: float) -> None:
    time = np.arange(0, 60, math.tau / 6.2 / samples)
    theta = motion(time, (0.3, 20.0), w0=6.2, c_over_m=0.08, friction=0.1)
    theta = theta + np.random.default_rng(5).normal(0, 2e-3, time.size)
    report = identify(time, theta)
    assert report.best.converged
    agrees(report.best, {"w0": 6.2, "c_over_m": 0.08, "Tr": 0.1}, 5)
    if samples > 20:
        assert report.peaks.kind[0] == "turn"
        assert report.table.errors["trajectory"].peak_rms < 1


# Of the first the search over all readings ends elsewhere; no step of the second is near a turn.
@pytest.mark.parametrize(
    ("samples", "speed", "viscous", "seconds"), [(8.0, -20.9, 0.08, 60), (9.0, 26.0, 0.01, 30)]
)
def test_wrapped_readings_far_apart(
    samples: float, speed: float, viscous: float, seconds: float
) -> None:
    time = np.arange(0, seconds, math.tau / 6.2 / samples)
    theta = motion(time, (0.3, speed), w0=6.2, c_over_m=viscous, friction=0.1)
    theta = (theta + np.random.default_rng(0).normal(0, 2e-3, time.size)) % math.tau
    best = identify(time, theta, methods=["trajectory"]).best
    assert best.converged
    agrees(best, {"w0": 6.2, "c_over_m": viscous, "Tr": 0.1}, 5)


def test_a_long_hold_before_the_release_does_no_harm() -> None:
    # Followed backward through a hold of 15 s the fitted swing would grow to a rotation.
    _, angle = record(decay(release=2.0, until=40.0), seconds=30, seed=3)
    theta = np.concatenate([np.full(1500, angle[0]), angle])
    report = identify(np.arange(theta.size) * 0.01, theta, methods=["trajectory"])
    assert report.best.converged
    agrees(report.best, TRUTH)
    assert report.joint is not None
    assert np.isnan(report.joint.fit.curves[0][0][1400])


def test_gravity_of_the_rig_goes_into_the_model() -> None:
    there = dataclasses.replace(experiment(decaying(release=0.5)), known={"gravity": 1.62})
    for method in BOTH:
        assert identify(there, methods=[method]).model.gravity == 1.62


BEGIN = 3.0  # Time of the first sample of a run, s


@pytest.fixture(scope="module")
def report() -> IdentificationReport:
    return identify([named("a", 2.0, 1), named("b", 1.0, 2)])


def named(name: str, release: float, seed: int) -> Run:
    run = decaying(release=release, seed=seed)
    return dataclasses.replace(run, name=name, file=f"{name}.csv", time=run.time + BEGIN)


def test_a_row_has_value_error_interval_and_unit(report: IdentificationReport) -> None:
    table = report.to_dataframe()
    assert list(table.columns) == ["value", "stderr", "low", "high", "unit"]
    agrees(report.best, TRUTH)
    for name in TRUTH:
        row = table.loc[name]
        assert row.low < row.value < row.high
        assert row.value == report.best[name]
    assert table.unit.to_dict()["Tr"] == "rad/s²"
    names, matrix = report.best.covariance or ((), np.empty(0))
    errors = table.stderr[list(names)].to_numpy()
    correlation = report.correlation.loc[[*names], [*names]].to_numpy()
    assert np.diag(correlation) == pytest.approx(1.0)
    assert correlation * np.outer(errors, errors) == pytest.approx(matrix, rel=1e-9)
    with pytest.raises(InputError, match="correlation must be of a method with a covariance"):
        _ = Identification("peaks", report.best.estimates).correlation


def test_free_runs_are_fitted_together(report: IdentificationReport) -> None:
    alone = identify(report.runs[0], methods=["trajectory"])
    assert "2 free runs" in report.best.used
    for name in TRUTH:
        one, two = (one.best.estimates[name].stderr for one in (alone, report))
        assert (two or math.inf) < (one or 0.0)


def test_the_residual_is_the_reading_less_the_model_and_its_zero(
    report: IdentificationReport,
) -> None:
    assert list(report.residual) == ["a", "b"]
    for run in report.runs:
        residual = report.residual[run.name]
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


def test_a_report_without_a_model_is_shown_and_kept(tmp_path: Path) -> None:
    empty = identify(*record(decay(), seconds=0.11), methods=["log_decrement"])
    assert empty.sound is None
    assert len(empty.to_dataframe()) == 0
    assert "not applicable" in empty._repr_html_()
    again = pendmap.load(pendmap.save(empty, tmp_path / "empty.nc"))
    assert str(again) == str(empty)
    with pytest.raises(InputError, match="the trajectory method must have fitted it"):
        _ = again.residual


def test_a_file_of_another_program_is_refused_on_one_line(
    report: IdentificationReport, tmp_path: Path
) -> None:
    dataset = report.to_dataset()
    for old, new, complaint in (
        ("pendmap.records.experiment:Run", "os:system", "'os:system' is no class of pendmap"),
        ("pendmap.records.experiment:Run", "pendmap.files.atomic:os", "cannot be read as"),
        ('"lab_time_s"', '"lab"', "Run lacks lab_time_s: another version of pendmap wrote it"),
        ("{", "", "cannot be read as a result of pendmap"),
    ):
        content = dataset.attrs["content"].replace(old, new)
        path = pendmap.save(dataset.assign_attrs(content=content), tmp_path / "bad.nc")
        with pytest.raises(InputError, match=complaint) as error:
            pendmap.load(path)
        assert "\n" not in str(error.value)


def test_records_are_taken_in_all_their_forms(tmp_path: Path, report: IdentificationReport) -> None:
    runs = report.runs
    files = [written(tmp_path / r.file, r.time, r.theta, form="%.17g") for r in runs]
    read = [pendmap.read_experiment(file) for file in files]
    frames = [pd.DataFrame({"t_s": r.time, "theta_rad": r.theta}) for r in runs]
    forms = [files, [str(file) for file in files], [read[0], read[1].runs[0]], tmp_path, frames]
    tables = [identify(form, methods=["trajectory"]).to_dataframe() for form in forms]
    assert all(table.equals(tables[0]) for table in tables[1:])
    arrays = runs[0].time, runs[0].theta
    single = [(runs[0],), (files[0],), arrays, ([files[0], files[0]],)]
    one, *others = (identify(*form, methods=["trajectory"]) for form in single)
    assert all(other.best["w0"] == one.best["w0"] for other in others)
    assert [run.name for run in others[-1].experiment.runs] == ["a", "a (2)"]
    known = [dataclasses.replace(read[k], known={"gravity": g}) for k, g in enumerate((9.7, 9.8))]
    with pytest.raises(InputError, match=r"gravity must be one for all records, got 9.7 and 9.8"):
        identify(known)
    assert [one.run.name for one in compare(report.model, files).runs] == ["a", "b"]


def test_a_comparison_has_a_table(report: IdentificationReport) -> None:
    result = compare(Rig(**TRUTH), report.runs)
    assert "The model describes 2 of 2 runs (residual up to 1.1 times the noise)." in str(result)
    table = result.to_dataframe()
    assert table.index.names == ["run", "quantity"]
    residual = table.xs("residual", level="quantity")
    assert list(residual.index) == ["a", "b"]
    assert residual.model.to_numpy() == pytest.approx(residual.record.to_numpy(), rel=0.1)
    periods = table.loc["a"].filter(like="period", axis="index")
    assert (periods.error_percent < 1).all()


def test_what_is_unphysical_is_held_at_0(report: IdentificationReport) -> None:
    run = report.runs[0]
    growing = dataclasses.replace(run, theta=run.theta * np.exp(0.2 * run.time / run.time[-1]))
    result = identify(growing)
    assert result.joint is not None
    assert result.joint.negative
    entry = as_json(result)["methods"]["trajectory"]
    for name, free in result.joint.negative.items():
        assert free.value < 0
        assert getattr(result.model, name) == entry[name] == 0.0
        assert entry["stderr"][name] is None
        low, high = entry["ci95"][name]
        assert low == 0 < high
        assert any(f" = 0 (below {high:.2g})" in line for line in in_short(result))
        text = f"{name} is {free.value:.3g}, which is unphysical: an effect is missing"
        assert any(line.startswith(text) and "held at 0" in line for line in result.warnings)
    # The others are fitted again: the model is the one whose residual is told.
    (one,) = compare(result.model, growing).runs
    assert one.rms == pytest.approx(result.joint.fit.rms, rel=1e-3)


def test_a_model_that_does_not_fit_is_said_first_and_once(report: IdentificationReport) -> None:
    bent = [dataclasses.replace(run, theta=run.theta + 0.02 * run.theta**3) for run in report.runs]
    result = identify(bent, methods=["trajectory"])
    (text,), lines = as_json(result)["doubts"], list(in_short(result))
    assert text.startswith("the model does not fit: residuals are ")
    assert lines[0] == f"Warning: {text}"
    for texts in (lines, as_text(result), result.warnings):
        assert sum("does not fit" in line for line in texts) == 1
    assert not any("does not fit" in line for line in as_json(report)["doubts"])


def test_which_method_gives_the_model() -> None:
    report = identify(decaying(release=0.5), methods=BOTH)
    assert report.best.converged
    assert not report.passed_over
    lost = dataclasses.replace(report.best, converged=False)
    for methods in (report.methods | {"trajectory": lost}, {"trajectory": lost}):
        other = dataclasses.replace(report, methods=methods)
        with pytest.raises(InputError, match="trajectory did not converge"):
            identified_model(other)
        assert as_json(other)["best"] is None
        assert not any(text.startswith("trajectory: 3001") for text in as_text(other))
    # A method that cannot be applied is replaced unless effects are given.
    short = dataclasses.replace(report.best, applicable=False, warnings=("too short",))
    other = dataclasses.replace(report, methods=report.methods | {"trajectory": short})
    line = "Warning: trajectory cannot be applied: the model is that of combined_repaired"
    assert line in as_text(other)
    model = identified_model(other)
    assert model.w0 == report.methods["combined_repaired"]["w0"]
    assert model.notes["provenance"]["method"] == "combined_repaired"
    with pytest.raises(InputError, match="magnet could not be fitted: too short"):
        identified_model(dataclasses.replace(other, asked=("magnet",)))


@pytest.mark.parametrize(
    ("estimate", "number", "ends"),
    [
        (Estimate(6.2, 1.2e-7), "6.20000000(12)", ""),
        (Estimate(6.2047, 0.0012, (6.20234, 6.20706)), "6.2047(12)", "[6.2023, 6.2071]"),
        (Estimate(6.2, None, (6.1, 6.3)), "6.2", "[6.100, 6.300]"),
        (Estimate(1234.0, 120.0, (1000.0, 1468.0)), "1234 +- 1.2e+02", "[1000, 1468]"),
        (Estimate(-0.0275698, 5.5e-7), "-0.02756980(55)", ""),
        (Estimate(0.5, math.inf), "0.5", ""),
    ],
)
def test_numbers_and_intervals_have_the_digits_of_the_error(
    estimate: Estimate, number: str, ends: str
) -> None:
    assert estimate_text(estimate) == number
    assert interval(estimate) == ends


def test_time_stamps_change_nothing() -> None:
    time, angle = record(decay(), seconds=40)
    plain, stamped = (identify(run_of(t, angle)) for t in (time, time + STAMP))
    for name, result in plain.methods.items():
        other = stamped.methods[name]
        for key, estimate in result.estimates.items():
            assert abs(other[key] - estimate.value) < 0.02 * (estimate.stderr or 0.0), (name, key)
        assert [w[:20] for w in other.warnings] == [w[:20] for w in result.warnings]
    assert "1700000000 to 1700000040 s" in stamped.methods["trajectory"].used
    assert np.allclose(stamped.peaks.time - STAMP, plain.peaks.time, atol=1e-5)
    (one,), (other,) = (compare(plain.model, r.experiment).runs for r in (stamped, plain))
    assert one.rms == pytest.approx(other.rms, rel=1e-3)


RUN = run_of(TIME, np.cos(6 * TIME))
REFUSED = {
    "records must be paths, arrays .*, got 3": lambda: identify(3),  # type: ignore[arg-type]
    r"records must be paths, .*, got \[\]": lambda: identify([]),
    r"must be of one shape \(N,\), got": lambda: identify(TIME, TIME[1:]),
    "methods must be a list of names, .*, got 't": lambda: identify(RUN, methods="trajectory"),
    "method must be one of trajectory, .*, got 'best'": lambda: identify(RUN, methods=["best"]),
    "effects must be left": lambda: identify(RUN, methods=["combined"], effects=["magnet"]),
    "rate_hz must be left out where no file or": lambda: identify(RUN, rate_hz=100.0),
    "model must be a Rig, like .*, got 'm'": lambda: compare("m", THERE),  # type: ignore[arg-type]
    "model must be a Rig, .*Pendulum": lambda: compare(Pendulum(), THERE),  # type: ignore[arg-type]
    "records must be .*, got 3": lambda: compare(Rig(w0=6.2), [THERE, 3]),  # type: ignore[list-item]
    "must be one run, like .*got 'a'": lambda: pendmap.noise_floor("a"),  # type: ignore[arg-type]
    "must be rows": lambda: find_peaks([0.0, 1.0], [0.0]),
    "must be finite": lambda: find_peaks([0.0, math.nan], [0.0, 1.0]),
    "must increase": lambda: find_peaks([0.0, 0.0], [0.0, 1.0]),
    "times and peaks must be as many": lambda: Peaks.of([0, 1], [0.3]),
}


@pytest.mark.parametrize("complaint", REFUSED)
def test_bad_input_is_refused(complaint: str) -> None:
    with pytest.raises(InputError, match=complaint) as error:
        REFUSED[complaint]()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", READ)
def test_a_damaged_file_gives_a_result_with_its_warning_or_an_error_of_one_line(
    name: str, tmp_path: Path
) -> None:
    damage = READ[name]
    path = tmp_path / f"record{damage.suffix}"
    made = damage.make(sound())
    path.write_bytes(made if isinstance(made, bytes) else made.encode())
    there = pendmap.read_experiment(path)
    try:
        report = identify(there, methods=BOTH)
        model = identified_model(report)
    except pendmap.InputError as error:
        one_line(str(error))
        return
    for result in report.methods.values():
        assert result.applicable or result.warnings
        assert all(math.isfinite(estimate.value) for estimate in result.estimates.values())
        assert not any("\n" in warning for warning in result.warnings)
    warned = any(result.warnings for result in report.methods.values()) or report.run.findings
    # A damage without a finding must not change the identified pendulum.
    assert warned or model.w0 == pytest.approx(6.2, rel=1e-3), name
