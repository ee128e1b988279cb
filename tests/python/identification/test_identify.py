"""Which runs an identification reads, the method of its model, bad input, damaged records."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
import pytest

import pendmap
from damages import DAMAGES, one_line, sound
from decays import decay, record
from driven_decays import motion
from fits import methods_of, run_of, written
from pendmap import InputError, Pendulum, Rig
from pendmap.comparison import compare
from pendmap.diagnosis import diagnose
from pendmap.formatting import estimate_text, interval
from pendmap.identification import Estimate, find_peaks, identified_model, identify
from pendmap.identification.report import (
    as_json,
    as_text,
    in_short,
    left_out,
    methods_table,
    table1_table,
)
from pendmap.records import Experiment, Run

if TYPE_CHECKING:
    from decays import Floats
    from pendmap.identification import Identification, IdentificationReport

WIDE = decay()
TRUTH = {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.08}
BOTH = "trajectory", "combined_repaired"
STAMP = 1.7e9  # Origin of a clock that counts from 1970, s
TIME = np.arange(50) / 10
THERE = Experiment(Path("there"), ())
READ = [name for name, damage in DAMAGES.items() if damage.says is not None]


def experiment(*runs: Run) -> Experiment:
    return Experiment(Path("there"), runs)


def agrees(result: Identification, truth: dict[str, float], errors: float = 4) -> None:
    for name, true in truth.items():
        estimate = result.estimates[name]
        assert abs(estimate.value - true) < errors * (estimate.stderr or 0.0), name


def test_an_experiment_gives_its_longest_free_run() -> None:
    def run(seconds: float, kind: Literal["free", "forced"] = "free", **given: bool) -> Run:
        one = run_of(*record(WIDE, seconds=seconds))
        return dataclasses.replace(one, kind=kind, **given)  # type: ignore[arg-type]

    runs = run(10), run(84), run(85, hold_out=True), run(85, "forced")
    report = identify(experiment(*runs), methods=["combined_repaired"])
    assert report.run is runs[1]
    assert report.model == report.best.rig
    with pytest.raises(InputError, match="no run is free"):
        identify(experiment(*runs[2:]))


def test_free_runs_are_fitted_together() -> None:
    runs = [
        run_of(*record(decay(release=release, until=40.0), seconds=30, seed=seed))
        for seed, release in ((1, 2.5), (2, 1.0))
    ]
    both = identify(experiment(*runs), methods=["trajectory"])
    alone = identify(experiment(*runs[:1]), methods=["trajectory"])
    assert both.joint is not None
    assert len(both.joint.fit.curves) == 2
    assert "2 free runs" in both.best.used
    agrees(both.best, TRUTH)
    for name in TRUTH:
        one, two = (report.best.estimates[name].stderr for report in (alone, both))
        assert (two or math.inf) < (one or 0.0)


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


def test_a_decay_that_begins_with_rotations(tmp_path: Path) -> None:
    time = np.arange(0, 60, 0.01)
    theta = motion(time, (0.3, 30.0), w0=6.2, c_over_m=0.08, friction=0.1)
    theta = theta + np.random.default_rng(5).normal(0, 2e-3, time.size)
    report = identify(written(tmp_path / "a.csv", time, theta), methods=["trajectory"])
    agrees(report.best, {"w0": 6.2, "c_over_m": 0.08, "Tr": 0.1}, 5)


def test_a_long_hold_before_the_release_does_no_harm(tmp_path: Path) -> None:
    # Followed backward through a hold of 15 s the fitted swing would grow to a rotation.
    _, angle = record(decay(release=2.0, until=40.0), seconds=30, seed=3)
    theta = np.concatenate([np.full(1500, angle[0]), angle])
    report = identify(
        written(tmp_path / "a.csv", np.arange(theta.size) * 0.01, theta), methods=BOTH[:1]
    )
    assert report.best.converged
    agrees(report.best, TRUTH)
    assert np.isnan(report.joint.fit.curves[0][0][1400])  # type: ignore[union-attr]


def test_runs_that_are_not_read_are_reported() -> None:
    def run(kind: Literal["free", "forced"] = "free", *, hold_out: bool = False) -> Run:
        time = np.arange(10.0)
        return Run("a", "a.csv", kind, time, time, np.ones(10, bool), hold_out=hold_out)

    runs = run(), run("forced"), run("forced"), run(hold_out=True)
    there = experiment(*runs)
    text = left_out(there, runs[:1])
    assert text == "1 run read; 2 forced runs and 1 run held out are not used"
    assert left_out(there, [runs[0], runs[3]]) == "2 runs read; 2 forced runs are not used"
    assert not left_out(there, runs)
    # The run is both held out and forced: it is left out because it is forced.
    both = experiment(*runs, run("forced", hold_out=True))
    assert left_out(both, [runs[0], runs[3]]) == "2 runs read; 3 forced runs are not used"
    two = experiment(*runs, run(hold_out=True))
    text = left_out(two, [runs[0], runs[3]])
    assert text == "2 runs read; 2 forced runs and 1 run held out are not used"


def test_gravity_of_the_rig_goes_into_every_model(tmp_path: Path) -> None:
    written(tmp_path / "a.csv", *record(decay(release=0.5, until=60.0), seconds=50))
    (tmp_path / "experiment.toml").write_text(
        '[rig]\ngravity = 1.62\n[[run]]\nfile = "a.csv"\nkind = "free"\n'
    )
    there = pendmap.read_experiment(tmp_path)
    for method in BOTH:
        assert identify(there, methods=[method]).model.gravity == 1.62
    assert diagnose(there, max_effects=0).best.fitted.fit.model.gravity == 1.62


@pytest.fixture(scope="module")
def two_methods() -> IdentificationReport:
    run = run_of(*record(decay(release=0.5, until=40.0), seconds=30))
    return identify(experiment(run), methods=BOTH)


def test_a_search_that_did_not_converge_gives_no_model(two_methods: IdentificationReport) -> None:
    report = two_methods
    assert report.best.converged
    assert not report.passed_over
    lost = dataclasses.replace(report.best, converged=False)
    for methods in (report.methods | {"trajectory": lost}, {"trajectory": lost}):
        other = dataclasses.replace(report, methods=methods)
        with pytest.raises(InputError, match="trajectory did not converge"):
            identified_model(other)
        assert as_json(other)["best"] is None
        assert not any(text.startswith("trajectory: 3001") for text in as_text(other))


def test_a_method_that_cannot_be_applied_is_replaced_unless_effects_are_given(
    two_methods: IdentificationReport,
) -> None:
    report = two_methods
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
        (
            Estimate(6.2, 1.2e-7, (6.19999976, 6.20000024)),
            "6.20000000(12)",
            "[6.19999976, 6.20000024]",
        ),
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


def test_every_form_of_a_record_gives_the_same_and_a_limit_of_what_is_held_at_0() -> None:
    for seed in range(2):
        time, angle = record(decay(release=2.0, tr=0.0, until=30.0), seconds=30, seed=seed)
        frame = pd.DataFrame({"t_s": time, "theta_rad": angle})
        forms = [
            identify(*form, methods=["trajectory"])
            for form in ((time, angle), (frame,), (pendmap.read_experiment(frame).runs[0],))
        ]
        for report in forms[1:]:
            pd.testing.assert_frame_equal(report.to_dataframe(), forms[0].to_dataframe())
        entry = as_json(forms[0])["methods"]["trajectory"]
        low, high = entry["ci95"]["Tr"]
        assert low <= 0 < high < 0.01
        if entry["Tr"] == 0:
            assert entry["stderr"]["Tr"] is None
            assert entry["ci95"]["theta_r"] == pytest.approx([0.0, high / entry["w0"] ** 2])
            assert f"Tr = 0 (below {high:.2g}) rad/s^2" in next(iter(in_short(forms[0])))


def test_time_stamps_change_nothing() -> None:
    time, angle = record(decay(), seconds=40)
    plain, stamped = (identify(experiment(run_of(t, angle))) for t in (time, time + STAMP))
    for name, result in plain.methods.items():
        other = stamped.methods[name]
        assert other.applicable == result.applicable
        for key, estimate in result.estimates.items():
            assert abs(other[key] - estimate.value) < 0.02 * (estimate.stderr or 0.0), (name, key)
        assert [w[:20] for w in other.warnings] == [w[:20] for w in result.warnings]
    assert "1700000000 to 1700000040 s" in stamped.methods["trajectory"].used
    assert np.allclose(stamped.peaks.time - STAMP, plain.peaks.time, atol=1e-5)
    assert np.array_equal(stamped.peaks.time, find_peaks(time + STAMP, angle).time)
    (one,), (other,) = (compare(plain.model, r.experiment).runs for r in (stamped, plain))
    assert one.rms == pytest.approx(other.rms, rel=1e-3)
    assert one.errors is not None
    assert other.errors is not None
    assert one.errors.period_rms == pytest.approx(other.errors.period_rms, rel=1e-2)


@pytest.mark.parametrize(
    ("call", "given", "complaint"),
    [
        (identify, (3,), "records must be paths, DataFrames .*, got 3"),
        (identify, ([],), r"records must be paths, .*, got \[\]"),
        (identify, (TIME, TIME[1:]), r"must be of one shape \(N,\), got"),
        (compare, ("model.toml", THERE), "model must be a Rig, like .*, got 'model.toml'"),
        (compare, (Pendulum(), THERE), "model must be a Rig"),
        (compare, (Rig(w0=6.2), [THERE, 3]), "records must be .*, got 3"),
    ],
)
def test_bad_input_is_refused(call: Any, given: tuple[Any, ...], complaint: str) -> None:  # noqa: ANN401
    with pytest.raises(InputError, match=complaint) as error:
        call(*given)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ({"methods": "trajectory"}, r"methods must be a list of names, .*, got 'trajectory'"),
        ({"methods": ["best"]}, r"method must be one of trajectory, combined, .*, got 'best'"),
        ({"methods": ["combined"], "effects": ["magnet"]}, "effects must be left out without"),
    ],
)
def test_bad_choices_are_refused(given: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        identify(run_of(*record(decay(until=20.0), seconds=10)), **given)


def test_few_samples_a_period_give_a_warning() -> None:
    for rate, few in ((22, True), (100, False)):
        method = methods_of(*record(decay(), seconds=60, rate=rate), "energy_balance")
        assert any("samples a period" in w for w in method["energy_balance"].warnings) == few


def lose(time: Floats, angle: Floats, lost: np.ndarray) -> tuple[Floats, Floats]:
    """Remove samples."""
    return time[~lost], angle[~lost]


PENDULUMS = [
    decay(),
    decay(c_over_m=1.5, tr=0.5, release=2.5),
    decay(c_over_m=8.0, tr=0.1, release=1.0, until=10.0),
    decay(release=0.05, tr=0.01, until=30.0),
]
CHANGES = {
    "backwards": lambda t, x, _: (t, x[::-1].copy()),
    "clipped": lambda t, x, _: (t, np.clip(x, -1.3, 0.8)),
    "degrees taken for radians": lambda t, x, _: (t, np.degrees(x)),
    "radians taken for degrees": lambda t, x, _: (t, np.radians(x)),
    "two releases": lambda t, x, _: (t, np.roll(x, x.size // 2)),
    "jitter": lambda t, x, rng: (t + np.sort(rng.uniform(0, 3e-3, t.size)), x),
    "lost": lambda t, x, rng: lose(t, x, rng.random(t.size) < 0.4),
    "false": lambda t, x, rng: (t, np.where(rng.random(t.size) < 0.05, x + 1.7, x)),
    "some turns away": lambda t, x, _: (t, x - 2 * math.tau),
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", CHANGES)
def test_a_damaged_record_gives_a_result_or_an_error_of_one_line(name: str) -> None:
    rng = np.random.default_rng(len(name))
    for k, made in enumerate(PENDULUMS):
        seconds, rate = float(rng.choice([0.5, 2, 20, 60])), float(rng.choice([10, 30, 100]))
        counts = int(rng.choice([0, 64, 4096]))
        clean = record(made, seconds=seconds, rate=rate, counts=counts, noise_deg=0.3, seed=k)
        try:
            report = identify(experiment(run_of(*CHANGES[name](*clean, rng))))
        except InputError as error:
            one_line(str(error))
            continue
        for result in report.methods.values():
            assert result.applicable or result.warnings
            assert all(math.isfinite(e.value) for e in result.estimates.values())
        for errors in report.table.errors.values():
            assert errors.peak.size == errors.peak_error.size


@pytest.mark.parametrize("name", READ)
def test_a_damaged_file_gives_a_result_with_its_warning_or_an_error_of_one_line(
    name: str, tmp_path: Path
) -> None:
    damage = DAMAGES[name]
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
        for warning in result.warnings:
            one_line(warning)
    warned = any(result.warnings for result in report.methods.values()) or report.run.findings
    # A damage without a finding must not change the identified pendulum.
    assert warned or model.w0 == pytest.approx(6.2, rel=1e-3), name
    assert as_json(report)["methods"]
    for head, rows in (methods_table(report), table1_table(report)):
        assert all(len(row) == len(head) for row in rows)
