"""Records with time stamps: results do not depend on the origin of the clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from decays import decay, record
from pendmap.comparison import compare
from pendmap.identification import find_peaks, identify
from pendmap.identification.methods.registry import identify_record
from pendmap.records import Experiment, Run

STAMP = 1.7e9


def test_time_stamps_change_nothing() -> None:
    time, angle = record(decay(), seconds=60)
    plain, stamped = identify_record(time, angle), identify_record(time + STAMP, angle)
    for name, found in plain.items():
        other = stamped[name]
        assert other.applicable == found.applicable
        for key, estimate in found.estimates.items():
            assert estimate.stderr is not None
            assert abs(other[key] - estimate.value) < 0.02 * estimate.stderr, (name, key)
        assert [w[:20] for w in other.warnings] == [w[:20] for w in found.warnings]
    assert all(e.ci95 is not None for e in stamped["trajectory"].estimates.values())
    assert "1700000000 to 1700000060 s" in stamped["trajectory"].used


def test_reports_keep_the_time_of_the_record() -> None:
    time, angle = record(decay(), seconds=30)
    runs = [
        Run("a", "a.csv", "free", t, angle, np.ones(t.size, bool)) for t in (time, time + STAMP)
    ]
    plain, stamped = (
        identify(Experiment(Path("there"), (run,)), methods=["trajectory", "de_paula"])
        for run in runs
    )
    assert np.allclose(stamped.peaks.time - STAMP, plain.peaks.time, atol=1e-5)
    assert np.array_equal(stamped.peaks.time, find_peaks(time + STAMP, angle).time)
    assert stamped.best["c_over_m"] == pytest.approx(plain.best["c_over_m"], rel=1e-4)
    (one,) = compare(plain.model, stamped.experiment).runs
    (other,) = compare(plain.model, plain.experiment).runs
    assert one.rms == pytest.approx(other.rms, rel=1e-3)
    assert one.errors is not None
    assert other.errors is not None
    assert one.errors.period_rms == pytest.approx(other.errors.period_rms, rel=1e-2)
