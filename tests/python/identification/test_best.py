"""Choice of the method that gives the model, and printing of its intervals."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import pendmap
from decays import decay, record
from pendmap.errors import InputError
from pendmap.formatting import interval
from pendmap.identification import Estimate, identified_model, identify
from pendmap.identification.report import as_json, as_text, in_short
from pendmap.records import Experiment, Run


def test_a_search_that_did_not_converge_gives_no_model() -> None:
    time, angle = record(decay(release=0.5, until=40.0), seconds=30)
    run = Run("a", "a.csv", "free", time, angle, np.ones(time.size, bool))
    names = ["trajectory", "combined_repaired"]
    report = identify(Experiment(Path("there"), (run,)), methods=names)
    assert report.best.converged
    assert not report.passed_over
    lost = dataclasses.replace(report.best, converged=False)
    for methods in (report.methods | {"trajectory": lost}, {"trajectory": lost}):
        other = dataclasses.replace(report, methods=methods)
        with pytest.raises(InputError, match="trajectory did not converge"):
            identified_model(other)
        assert as_json(other)["best"] is None
        assert not any(text.startswith("trajectory: 3001") for text in as_text(other))


def test_a_method_that_cannot_be_applied_is_replaced_unless_effects_are_given() -> None:
    time, angle = record(decay(release=0.5, until=40.0), seconds=30)
    run = Run("a", "a.csv", "free", time, angle, np.ones(time.size, bool))
    names = ["trajectory", "combined_repaired"]
    report = identify(Experiment(Path("there"), (run,)), methods=names)
    short = dataclasses.replace(report.best, applicable=False, warnings=("too short",))
    other = dataclasses.replace(report, methods=report.methods | {"trajectory": short})
    line = "Warning: trajectory cannot be applied: the model is that of combined_repaired"
    assert line in list(as_text(other))
    model = identified_model(other)
    assert model.w0 == report.methods["combined_repaired"]["w0"]
    assert model.notes["provenance"]["method"] == "combined_repaired"
    with pytest.raises(InputError, match="magnet could not be fitted: too short"):
        identified_model(dataclasses.replace(other, asked=("magnet",)))


@pytest.mark.parametrize(
    ("estimate", "shown"),
    [
        (Estimate(6.2, 1.2e-7, (6.19999976, 6.20000024)), "[6.19999976, 6.20000024]"),
        (Estimate(6.2047, 0.0012, (6.20234, 6.20706)), "[6.2023, 6.2071]"),
        (Estimate(6.2, None, (6.1, 6.3)), "[6.100, 6.300]"),
        (Estimate(1234.0, 120.0, (1000.0, 1468.0)), "[1000, 1468]"),
        (Estimate(6.2, 0.1), ""),
    ],
)
def test_intervals_have_the_digits_of_the_error(estimate: Estimate, shown: str) -> None:
    assert interval(estimate) == shown


def test_every_form_of_a_record_gives_the_same_and_a_limit_of_what_is_held_at_0() -> None:
    assert identify is pendmap.identify
    for seed in range(3):
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
    with pytest.raises(pendmap.InputError, match=r"must be of one shape \(N,\), got"):
        identify(time, angle[1:])
    with pytest.raises(pendmap.InputError, match="effects must be left out without a fit"):
        identify(time, angle, methods=["energy_balance"], effects=["magnet"])
