"""What of an experiment is fitted and what is held back to try models on."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from driven_decays import motion
from pendmap.discrepancy.evidence import evidence_of
from pendmap.records import Experiment, Run

TIME = np.arange(1500) * 0.01
ANGLE = motion(TIME, (1.0, 0.0), w0=6.2, c_over_m=0.05, friction=0.03)
NOISE = np.random.default_rng(1).standard_normal(TIME.size)


def run(name: str, kind: Literal["free", "forced"], *, hold_out: bool = False) -> Run:
    drive = {"p": 0.1, "Omega": 12.0, "phi": 0.0} if kind == "forced" else None
    readings, trusted = ANGLE + 1e-3 * NOISE, np.ones(TIME.size, bool)
    return Run(name, f"{name}.csv", kind, TIME, readings, trusted, drive=drive, hold_out=hold_out)


@pytest.mark.parametrize(
    ("free", "forced", "held", "inside"),
    [
        (3, 3, ["free1", "forced1"], False),
        (2, 2, ["forced1"], False),
        (1, 1, ["free0"], True),
        (4, 0, ["free0", "free1", "free2", "free3"], True),
    ],
)
def test_what_is_held_back_where_nothing_is_marked(
    free: int, forced: int, held: list[str], *, inside: bool
) -> None:
    runs = [run(f"free{k}", "free") for k in range(free)]
    runs += [run(f"forced{k}", "forced") for k in range(forced)]
    evidence = evidence_of(Experiment(Path("there"), tuple(runs)))
    assert sorted(each.name for each in evidence.held) == sorted(held)
    assert evidence.inside is inside
    whole = set() if inside else set(held)
    assert {each.name for each in evidence.fitted} == {each.name for each in runs} - whole


def test_what_is_marked_is_held_back_and_nothing_else() -> None:
    runs = [run("a", "free"), run("b", "forced"), run("c", "forced", hold_out=True)]
    evidence = evidence_of(Experiment(Path("there"), tuple(runs)))
    assert [each.name for each in evidence.held] == ["c"]
    assert [each.name for each in evidence.fitted] == ["a", "b"]
