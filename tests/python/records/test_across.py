"""Rules across runs: one zero, several rigs, hands at the ends, times in the laboratory."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pendmap.records import Experiment, Run
from pendmap.records.across import (
    checked_together,
    one_zero,
    two_groups,
    with_lab_times,
    without_hands,
)

TIME = np.arange(0, 30, 0.02)
NOISE = np.random.default_rng(3).normal(0, 1e-3, (5, TIME.size))


def run(number: int, *, w0: float = 6.0, start: float = 0.4, zero: float = 0.0) -> Run:
    """Return a decay whose readings had ``zero`` subtracted and swing about their zero."""
    theta = start * np.exp(-0.04 * TIME) * np.cos(w0 * (1 - start**2 / 16) * TIME) + NOISE[number]
    every = np.ones(TIME.size, bool)
    name = f"run_{number}"
    return Run(name, f"{name}.csv", "free", TIME, theta, every, zero_rad=zero)


@pytest.mark.parametrize(
    ("rates", "differ"),
    [
        ((6.0, 6.0, 6.0), False),
        ((6.0, 6.2, 6.0, 6.2), True),  # two rods 3 % apart
        ((6.0, 6.03, 6.06, 6.09), False),  # a drift of 1.5 % has no gap
        ((6.0, 6.2, 6.4), True),  # three rods
    ],
)
def test_two_groups_of_periods_are_those_of_two_rigs(
    rates: tuple[float, ...], *, differ: bool
) -> None:
    runs = [run(k, w0=rate) for k, rate in enumerate(rates)]
    assert (two_groups(runs) is not None) is differ
    _, findings = checked_together(runs)
    assert ("rigs-differ" in {one.what for one in findings}) is differ


@pytest.mark.parametrize(
    ("middles", "shifts"),
    [
        # The reading shifted what is far off; all are shifted by the middle of their range.
        ((0.05, 0.12, 0.25), (0.15, 0.15, 0.15)),
        # Zeros that are far from each other are those of the runs.
        ((0.05, 0.5, 1.0), (0.05, 0.5, 1.0)),
        # Small zeros are left to the fit.
        ((0.0, 0.05, 0.12), (0.0, 0.0, 0.0)),
    ],
)
def test_runs_have_one_zero_or_each_its_own(
    middles: tuple[float, ...], shifts: tuple[float, ...]
) -> None:
    runs = []
    for k, middle in enumerate(middles):
        shifted = run(k, zero=middle if middle > 0.15 else 0.0)
        runs.append(dataclasses.replace(shifted, theta=shifted.theta + middle - shifted.zero_rad))
    made, findings = one_zero(runs)
    assert [one.zero_rad for one in made] == pytest.approx(shifts, abs=0.01)
    for before, after in zip(runs, made, strict=True):
        raw = before.theta + before.zero_rad
        np.testing.assert_allclose(after.theta + after.zero_rad, raw, atol=1e-12)
    assert len(findings) == any(shifts)


@pytest.mark.parametrize(
    ("instant", "first", "last"),
    [(100.6, 0.85, 30), (99.9, 0.16, 30), (129.5, 0, 29.2), (115.0, 0, 30)],
)
def test_an_instant_within_a_swing_of_an_end_is_that_of_a_hand(
    instant: float, first: float, last: float
) -> None:
    record = dataclasses.replace(run(0), lab_time_s=100.0)
    other = dataclasses.replace(run(1), lab_time_s=200.0)
    cut = without_hands(Experiment(Path("there"), (record, other)), [instant], 1.05)
    if instant == 115.0:
        assert cut is None
        return
    assert cut is not None
    used = TIME[cut.runs[0].trusted]
    assert (used[0], used[-1]) == pytest.approx((first, last), abs=0.05)
    assert [one.what for one in cut.runs[0].findings] == ["hand-at-end"]
    assert cut.runs[1] is other


def test_files_that_do_not_say_when_they_were_recorded_are_reported() -> None:
    runs = (run(0), run(1))
    together = with_lab_times(Experiment(Path("there"), runs))
    assert [one.what for one in together.findings] == ["lab-time-missing"]
    assert with_lab_times(together).findings == together.findings
    later = (runs[0], dataclasses.replace(runs[1], lab_time_s=60.0))
    assert with_lab_times(Experiment(Path("there"), later)).findings == ()
    assert with_lab_times(Experiment(Path("there"), runs[:1])).findings == ()
