"""Division of an experiment into records to fit and records held out; means of dense readings."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from driven_decays import motion
from pendmap import InputError
from pendmap.comparison.data import DataSplit, average_blocks, split_records
from pendmap.identification.fit import fit_runs
from pendmap.identification.runs import FitRun
from pendmap.model import Rig
from pendmap.records import Experiment, Run

TIME = np.arange(1500) * 0.01
ANGLE = motion(TIME, (1.0, 0.0), w0=6.2, c_over_m=0.05, friction=0.03)
NOISE = np.random.default_rng(1).standard_normal(TIME.size)
DENSE = np.arange(20000) * 1e-3
DENSE_ANGLE = motion(DENSE, (1.5, 0.0), w0=8.0, c_over_m=0.05, friction=0.05)


def split(*names: str, held: str = "", samples: int = TIME.size, noise: float = 1e-3) -> DataSplit:
    """Divide runs of these names, whose first letter says whether they are driven."""
    runs = []
    for name in names:
        count = int(name.partition(" ")[2] or samples)
        drive = {"p": 0.1, "Omega": 12.0, "phi": 0.0} if name[0] == "d" else None
        angle, every = (ANGLE + noise * NOISE)[:count], np.ones(count, bool)
        kind = "forced" if drive else "free"
        runs.append(
            Run(name, "a.csv", kind, TIME[:count], angle, every, drive=drive, hold_out=name == held)
        )
    return split_records(Experiment(Path("there"), tuple(runs)))


@pytest.mark.parametrize(
    ("names", "marked", "held"),
    [
        ("f0 f1 f2 d0 d1 d2", "", "d1 f1"),
        ("f0 f1 d0 d1", "", "d1"),
        ("f0 d0 d1", "d0", "d0"),
        ("f0 d0", "", "f0"),
        ("f0 f1 f2 f3", "", "f0 f1 f2 f3"),
        ("d0", "", "d0 d0"),
    ],
)
def test_whole_runs_are_held_out_or_stretches(names: str, marked: str, held: str) -> None:
    data = split(*names.split(), held=marked)
    assert [run.name for run in data.held] == held.split()
    whole = len(names) > len("f0 d0") and "d" in names
    assert data.inside is (not whole and "f" in names)
    left = {name for name in names.split() if not whole or name not in held.split()}
    assert {run.name for run in data.fitted} == left


def test_the_noise_of_a_short_run_is_that_of_the_others() -> None:
    *known, few, some = split("f0", "f1", "f2", "f 19", "f 60").readings
    usual = np.median([reading.sigma for reading in known])
    assert usual == pytest.approx(1e-3, rel=0.1)
    assert few.sigma == some.sigma == usual
    assert 0 < few.doubt < 0.1
    (alone,) = split("f0", samples=250).readings
    assert alone.doubt > 0.02
    # Exact readings have the noise of the finest sensor.
    assert all(reading.sigma >= 1e-7 for reading in split("f0", "f1", noise=0.0).readings)


def test_runs_of_which_nothing_can_be_held_back_or_fitted_are_refused() -> None:
    with pytest.raises(InputError, match="at least one run must have 201 samples, so that"):
        split("f0", samples=150)
    undriven = dataclasses.replace(split("d0").runs[0], drive=None)
    with pytest.raises(InputError, match="a forced run must have drive or pivot, neither is given"):
        split_records(Experiment(Path("there"), (undriven,)))


def test_a_block_has_the_angle_at_its_own_time() -> None:
    run = average_blocks(FitRun(DENSE, DENSE_ANGLE, 1e-5))
    assert DENSE.size / 20 < run.time.size < DENSE.size / 10
    # Plain means would be off by T^2 th''/24, a hundred times as much.
    off = np.abs(run.theta - CubicSpline(DENSE, DENSE_ANGLE)(run.time))[3:-3]
    assert off.max() < 4e-6
    assert np.median(off) < 2e-6
    assert run.sigma == pytest.approx(1e-5 / np.sqrt(DENSE.size // run.time.size), rel=1e-9)
    sparse = FitRun(DENSE[::20], DENSE_ANGLE[::20], 1e-3)
    assert average_blocks(sparse) is sparse


def test_blocks_keep_the_errors_and_the_left_out_readings() -> None:
    rng = np.random.default_rng(4)
    sigma = np.where(DENSE < 10, 1e-3, 4e-3)
    trusted = rng.random(DENSE.size) > 0.05
    trusted[5000:5200] = False
    readings = DENSE_ANGLE + sigma * rng.standard_normal(DENSE.size)
    readings[~trusted] += 1.0
    run = average_blocks(FitRun(DENSE, readings, sigma, trusted=trusted))
    assert not run.counted.all()
    exact = np.interp(run.time, DENSE, DENSE_ANGLE)
    scatter = ((run.theta - exact) / run.sigma)[run.counted]
    for part in (scatter[: scatter.size // 2], scatter[scatter.size // 2 :]):
        assert np.std(part) == pytest.approx(1.0, abs=5 / np.sqrt(2 * part.size))
    weights = np.sum(run.sigmas[run.counted] ** -2)
    assert weights == pytest.approx(np.sum(sigma[trusted] ** -2), rel=2e-3)


def test_a_fit_to_blocks_equals_one_to_readings() -> None:
    readings = DENSE_ANGLE + 1e-3 * np.random.default_rng(5).standard_normal(DENSE.size)
    run, start = FitRun(DENSE, readings, 1e-3), Rig(w0=8.01, c_over_m=0.04, Tr=0.04)
    one, other = (fit_runs([r], start, profiled=()) for r in (run, average_blocks(run)))
    for name, estimate in one.estimates.items():
        assert other[name] == pytest.approx(estimate.value, abs=0.2 * estimate.stderr)
        assert other.estimates[name].stderr == pytest.approx(estimate.stderr, rel=0.02)


@pytest.mark.parametrize("turn", [1000, 4000])
def test_counts_of_dense_readings_are_averaged_with_their_errors(turn: int) -> None:
    count = 2 * np.pi / turn
    readings = count * np.round(DENSE_ANGLE / count)
    run = average_blocks(FitRun(DENSE, readings, count / np.sqrt(12), count=count))
    assert run.count is None
    assert run.time.size < DENSE.size / 10
    scatter = ((run.theta - CubicSpline(DENSE, DENSE_ANGLE)(run.time)) / run.sigma)[3:-3]
    assert 0.3 < np.std(scatter) < 1.05
    start = Rig(w0=8.01, c_over_m=0.04, Tr=0.04)
    fit = fit_runs([run], start, profiled=())
    for name, true in (("w0", 8.0), ("c_over_m", 0.05), ("Tr", 0.05)):
        assert abs(fit[name] - true) < 4 * (fit.estimates[name].stderr or 0)


def test_of_too_many_readings_every_second_is_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pendmap.comparison.data.MOST", 2000)
    data = split("f0", "f1")
    assert [run.time.size for run in data.fitted] == [750, 750]
    assert data.fitted[0].sigma == pytest.approx(1e-3, rel=0.1)
