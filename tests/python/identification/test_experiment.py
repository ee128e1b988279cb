"""Identification from an experiment: which runs are read, and how."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import pytest

import pendmap
from decays import decay, record
from driven_decays import motion
from pendmap import InputError
from pendmap.diagnosis import diagnose
from pendmap.identification import find_peaks, identify
from pendmap.identification.methods.registry import identify_record
from pendmap.identification.report import left_out
from pendmap.records import Experiment, Run

WIDE = decay()
SMALL = decay(release=0.2, c_over_m=0.0496, tr=0.03, until=40.0)
BOTH = {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.08}


def test_an_experiment_gives_its_longest_free_run() -> None:
    def run(seconds: float, kind: Literal["free", "forced"] = "free", **given: bool) -> Run:
        time, angle = record(WIDE, seconds=seconds)
        return Run("a", "a.csv", kind, time, angle, np.ones(time.size, bool), **given)  # type: ignore[arg-type]

    def experiment(*runs: Run) -> Experiment:
        return Experiment(Path("there"), runs)

    runs = run(10), run(84), run(85, hold_out=True), run(85, "forced")
    report = identify(experiment(*runs), methods=["combined_repaired"])
    assert report.run is runs[1]
    assert report.model == report.best.rig
    time, angle = record(WIDE, seconds=84)
    same = identify_record(time, angle, methods=["combined_repaired"])
    assert report.best.estimates == same["combined_repaired"].estimates
    with pytest.raises(InputError, match="no run is free"):
        identify(experiment(*runs[2:]))
    with pytest.raises(
        InputError, match=r"method must be one of trajectory, combined, .*, got 'best'"
    ):
        identify_record(time, angle, methods=["best"])


def test_free_runs_are_fitted_together() -> None:
    def run(seed: int, release: float) -> Run:
        time, angle = record(decay(release=release, until=40.0), seconds=30, seed=seed)
        return Run(f"{seed}", f"{seed}.csv", "free", time, angle, np.ones(time.size, bool))

    runs = run(1, 2.5), run(2, 1.0)
    both = identify(Experiment(Path("there"), runs), methods=["trajectory"])
    alone = identify(Experiment(Path("there"), runs[:1]), methods=["trajectory"])
    assert both.joint is not None
    assert len(both.joint.fit.curves) == 2
    assert "2 free runs" in both.best.used
    for name, true in BOTH.items():
        one, two = alone.best.estimates[name], both.best.estimates[name]
        assert one.stderr is not None
        assert two.stderr is not None
        assert two.stderr < one.stderr
        assert abs(two.value - true) < 4 * two.stderr


def test_peaks_alone_are_enough_for_methods_of_peaks() -> None:
    time, angle = record(SMALL, seconds=30, noise_deg=1e-3)
    peaks = find_peaks(time, angle).turned
    run = Run(
        "a",
        "a.csv",
        "free",
        peaks.time,
        peaks.amplitude,
        np.ones(len(peaks), bool),
        peaks_only=True,
    )
    report = identify(Experiment(Path("there"), (run,)))
    assert not report.methods["trajectory"].applicable
    assert report.joint is None
    found = report.methods["combined_repaired"]
    assert found["Tr"] == pytest.approx(0.03, rel=0.02)
    assert report.table.errors["combined_repaired"].peak_rms < 1


def test_a_decay_that_begins_with_rotations(tmp_path: Path) -> None:
    time = np.arange(0, 60, 0.01)
    theta = motion(time, (0.3, 30.0), w0=6.2, c_over_m=0.08, friction=0.1)
    noise = np.random.default_rng(5).normal(0, 2e-3, time.size)
    table = np.stack([time, theta + noise], axis=1)
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="t_s,theta_rad", comments="")
    report = identify(pendmap.read_experiment(tmp_path / "a.csv"), methods=["trajectory"])
    assert report.best.method == "trajectory", report.best.warnings
    for name, true in {"w0": 6.2, "c_over_m": 0.08, "Tr": 0.1}.items():
        found = report.best.estimates[name]
        assert found.stderr is not None
        assert abs(found.value - true) < 5 * found.stderr


def test_runs_that_are_not_read_are_reported() -> None:
    def run(kind: Literal["free", "forced"] = "free", *, hold_out: bool = False) -> Run:
        time = np.arange(10.0)
        good = np.ones(10, bool)
        return Run("a", "a.csv", kind, time, time, good, hold_out=hold_out)

    runs = run(), run("forced"), run("forced"), run(hold_out=True)
    there = Experiment(Path("there"), runs)
    said = left_out(there, runs[:1])
    assert said == "1 run read; 2 forced runs and 1 run held out are not used"
    assert left_out(there, [runs[0], runs[3]]) == "2 runs read; 2 forced runs are not used"
    assert not left_out(there, runs)
    # The run is both held out and forced: it is left out because it is forced.
    both = Experiment(Path("there"), (*runs, run("forced", hold_out=True)))
    assert left_out(both, [runs[0], runs[3]]) == "2 runs read; 3 forced runs are not used"
    two = Experiment(Path("there"), (*runs, run(hold_out=True)))
    said = left_out(two, [runs[0], runs[3]])
    assert said == "2 runs read; 2 forced runs and 1 run held out are not used"


def test_a_long_hold_before_the_release_does_no_harm(tmp_path: Path) -> None:
    # Followed backward through a hold of 15 s the fitted swing would grow to a rotation.
    time, angle = record(decay(release=2.0, until=40.0), seconds=30, seed=3)
    held = np.full(1500, angle[0])
    rows = np.column_stack([np.arange(1500 + time.size) * 0.01, np.concatenate([held, angle])])
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="t_s,theta_rad", comments="")
    experiment = pendmap.read_experiment(tmp_path / "a.csv")
    report = identify(experiment, methods=["trajectory"])
    assert report.best.converged
    for name, true in BOTH.items():
        found = report.best.estimates[name]
        assert found.stderr is not None
        assert abs(found.value - true) < 4 * found.stderr
    assert np.isnan(report.joint.fit.curves[0][0][1400])  # type: ignore[union-attr]


def test_gravity_of_the_rig_goes_into_every_model(tmp_path: Path) -> None:
    time, angle = record(decay(release=0.5, until=60.0), seconds=50)
    np.savetxt(tmp_path / "a.csv", np.column_stack([time, angle]), "%.6f", ",", header="t,theta")
    (tmp_path / "experiment.toml").write_text(
        "[rig]\ngravity = 1.62\n"
        '[columns]\ntime = { name = "t" }\nangle = { name = "theta", unit = "rad" }\n'
        '[[run]]\nfile = "a.csv"\nkind = "free"\n'
    )
    experiment = pendmap.read_experiment(tmp_path)
    for method in ("trajectory", "combined_repaired"):
        assert identify(experiment, methods=[method]).model.gravity == 1.62
    assert diagnose(experiment, max_effects=0).best.fitted.fit.model.gravity == 1.62
