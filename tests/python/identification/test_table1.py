"""Rows of table 1, without repetition."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from decays import decay, record
from pendmap import Rig
from pendmap.comparison import compare
from pendmap.identification import Estimate, Identification, table1
from pendmap.records import Experiment, Run

TRUE = Identification("true", {"w0": Estimate(6.2), "c_over_m": Estimate(0.05)})


def test_rows_do_not_repeat_and_leave_out_the_start() -> None:
    time, angle = record(decay(release=1.0, until=40.0), seconds=20)
    rows = table1(time, angle, {"true": TRUE}).rows
    assert [row.what for row in rows] == ["period", "period"]
    assert rows[0].measured != rows[1].measured
    rows = table1(time, angle, {"true": TRUE}, periods=(1.1, 1.1), peaks=(0.5, 0.5, 1.0, 2.0)).rows
    assert [(row.what, row.asked) for row in rows] == [("period", 1.1), ("peak", 0.5)]


def test_compare_prints_no_nan() -> None:
    time, angle = record(decay(release=1.0, until=40.0), seconds=20)
    run = Run("a", "a.csv", "free", time, angle, np.ones(time.size, bool))
    # The model rests after a swing.
    found = compare(Rig(w0=6.2, Tr=30.0), Experiment(Path("there"), (run,)))
    ((_, ((*_, periods, _),)),), lines = found.text_parts()
    assert periods == ""
    assert not any("nan" in line for line in lines)
