"""Division of an experiment into records to fit and records held out."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from driven_decays import motion
from pendmap import InputError
from pendmap.comparison.data import split_records
from pendmap.records import Experiment, Run

TIME = np.arange(1500) * 0.01
ANGLE = motion(TIME, (1.0, 0.0), w0=6.2, c_over_m=0.05, friction=0.03)
NOISE = np.random.default_rng(1).standard_normal(TIME.size)


def run(
    name: str,
    kind: Literal["free", "forced"],
    *,
    hold_out: bool = False,
    samples: int = TIME.size,
    noise: float = 1e-3,
) -> Run:
    drive = {"p": 0.1, "Omega": 12.0, "phi": 0.0} if kind == "forced" else None
    time, trusted = TIME[:samples], np.ones(samples, bool)
    readings = (ANGLE + noise * NOISE)[:samples]
    return Run(name, f"{name}.csv", kind, time, readings, trusted, drive=drive, hold_out=hold_out)


@pytest.mark.parametrize(
    ("free", "forced", "held", "inside"),
    [
        (3, 3, ["free1", "forced1"], False),
        (2, 2, ["forced1"], False),
        (1, 1, ["free0"], True),
        (4, 0, ["free0", "free1", "free2", "free3"], True),
    ],
)
def test_runs_and_stretches_are_held_out_if_none_is_marked(
    free: int, forced: int, held: list[str], *, inside: bool
) -> None:
    runs = [run(f"free{k}", "free") for k in range(free)]
    runs += [run(f"forced{k}", "forced") for k in range(forced)]
    data = split_records(Experiment(Path("there"), tuple(runs)))
    assert sorted(each.name for each in data.held) == sorted(held)
    assert data.inside is inside
    whole = set() if inside else set(held)
    assert {each.name for each in data.fitted} == {each.name for each in runs} - whole


def test_only_marked_runs_are_held_out() -> None:
    runs = [run("a", "free"), run("b", "forced"), run("c", "forced", hold_out=True)]
    data = split_records(Experiment(Path("there"), tuple(runs)))
    assert [each.name for each in data.held] == ["c"]
    assert [each.name for each in data.fitted] == ["a", "b"]


def test_a_run_too_short_for_a_noise_estimate_has_that_of_the_others() -> None:
    lengths = {"a": 1500, "b": 1500, "c": 1500, "few": 19, "some": 60}
    runs = tuple(run(name, "free", samples=count) for name, count in lengths.items())
    *known, few, some = split_records(Experiment(Path("there"), runs)).readings
    usual = np.median([reading.sigma for reading in known])
    assert usual == pytest.approx(1e-3, rel=0.1)
    assert few.sigma == some.sigma == usual
    assert 0 < few.doubt < 0.1
    # Its own estimate is poor, and has a large stated uncertainty.
    (alone,) = split_records(Experiment(Path("there"), (run("a", "free", samples=250),))).readings
    assert alone.doubt > 0.02


def test_the_noise_of_exact_readings_is_that_of_the_finest_sensor() -> None:
    runs = tuple(run(name, "free", noise=0.0) for name in "abc")
    readings = split_records(Experiment(Path("there"), runs)).readings
    assert all(reading.sigma >= 1e-7 for reading in readings)


def test_too_few_samples_to_hold_any_back_are_refused() -> None:
    with pytest.raises(InputError, match="at least one run must have 201 samples, so that"):
        split_records(Experiment(Path("there"), (run("a", "free", samples=150),)))
