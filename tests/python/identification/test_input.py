"""Errors and warnings of the identification."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from decays import decay, record
from pendmap import InputError, Pendulum, Rig
from pendmap.comparison import compare
from pendmap.identification import identify
from pendmap.identification.methods.registry import identify_record
from pendmap.records import Experiment

THERE = Experiment(Path("there"), ())
TIME = np.arange(50) / 10


@pytest.mark.parametrize(
    ("call", "given", "complaint"),
    [
        (identify, (3,), "records must be paths, DataFrames .*, got 3"),
        (identify, ([],), r"records must be paths, .*, got \[\]"),
        (compare, ("model.toml", THERE), "model must be a Rig, like .*, got 'model.toml'"),
        (compare, (Pendulum(), THERE), "model must be a Rig"),
        (compare, (Rig(w0=6.2), [THERE, 3]), "records must be .*, got 3"),
        (identify_record, ([], []), "time must have samples"),
        (identify_record, (TIME[::-1], np.cos(TIME)), "time must increase"),
    ],
)
def test_bad_input_is_refused(call: Any, given: tuple[Any, ...], complaint: str) -> None:  # noqa: ANN401
    with pytest.raises(InputError, match=complaint) as error:
        call(*given)
    assert "\n" not in str(error.value)


def test_methods_must_be_a_list() -> None:
    with pytest.raises(InputError, match=r"methods must be a list of names, .*, got 'trajectory'"):
        identify_record(TIME, np.cos(TIME), methods="trajectory")


def test_few_samples_a_period_give_a_warning() -> None:
    names = ["energy_balance", "combined"]
    coarse = identify_record(*record(decay(), seconds=60, rate=16), methods=names)
    assert any("samples a period" in text for text in coarse["energy_balance"].warnings)
    fine = identify_record(*record(decay(), seconds=60), methods=names)
    assert not any("samples a period" in text for text in fine["energy_balance"].warnings)
    # Four samples a period are enough for peaks; two are not.
    few = identify_record(*record(decay(), seconds=90, rate=4), methods=names)["combined"]
    for name, truth in {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.08}.items():
        assert abs(few[name] - truth) < 3 * (few.estimates[name].stderr or 0.0)
    lost = identify_record(*record(decay(), seconds=90, rate=2), methods=names)["combined"]
    assert not lost.applicable
    assert "the record ends above it" not in lost.warnings[-1]
    short = identify_record(*record(decay(), seconds=6, rate=1000), methods=["combined"])[
        "combined"
    ]
    assert "the record ends above it" in short.warnings[-1]
