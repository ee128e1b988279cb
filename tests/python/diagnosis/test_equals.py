"""Effects that records cannot distinguish, found from the sensitivities of the records."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import pytest

from hidden import recorded
from pendmap.comparison.data import split_records
from pendmap.diagnosis.baseline import fit_baseline
from pendmap.diagnosis.candidates import Candidate
from pendmap.diagnosis.scores import Scores, score_candidates

if TYPE_CHECKING:
    from pendmap.comparison.data import DataSplit
    from pendmap.diagnosis.fitted_model import FittedModel


@functools.cache
def baseline(forced: int) -> tuple[DataSplit, FittedModel]:
    """Return the records of an experiment without hidden effects, and its baseline."""
    data = split_records(recorded(seed=4, free=2, forced=forced)[0])
    return data, fit_baseline(data)[0]


def scored(names: list[str | Candidate], *, forced: int) -> Scores:
    """Score effects at the baseline."""
    pool = [[Candidate(n) if isinstance(n, str) else n] for n in names]
    return score_candidates(*baseline(forced), pool)


@pytest.mark.parametrize(
    ("one", "other", "forced"),
    [
        ("bias_torque", "asymmetric_coulomb", 0),
        ("bias_torque", "asymmetric_coulomb", 2),
        ("drive_frequency", "timebase", 2),
        ("drive_amplitude", "added_mass", 2),
        ("rig_tilt", "encoder_offset", 0),
        # A harmonic of one period a turn is equivalent to gravity and to a rotation of it.
        ("rig_tilt", Candidate("bearing_harmonic", {"n": 1.0}), 0),
    ],
)
def test_equivalent_effects_have_equal_scores(
    one: str, other: str | Candidate, forced: int
) -> None:
    scores = scored([one, other], forced=forced)
    assert scores.likeness(0, 1) == pytest.approx(1, abs=1e-4)
    gains = [score.gain for score in scores.scores]
    assert gains[0] == pytest.approx(gains[1], rel=1e-2, abs=1e-2)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("rig_tilt", "encoder_offset"),
        ("drive_frequency", "drive_phase"),
        ("sensor_lag", "encoder_offset"),
        ("asymmetric_coulomb", "asymmetric_viscous"),
    ],
)
def test_effects_that_differ_under_a_drive_are_distinguished(one: str, other: str) -> None:
    assert scored([one, other], forced=2).likeness(0, 1) < 0.99


@pytest.mark.parametrize("name", ["added_mass", "sensor_lag"])
def test_an_effect_that_a_free_decay_does_not_show_gains_nothing(name: str) -> None:
    score = scored([name, "encoder_offset"], forced=0).scores[0]
    assert score.gain == 0
    assert score.information == 0
