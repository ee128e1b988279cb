"""``diagnose`` on measured records, where the environment names their folder."""

from __future__ import annotations

import functools
import os
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from pendmap.diagnosis import diagnose
from pendmap.diagnosis.physical import unphysical
from pendmap.diagnosis.summary import as_json, as_text
from pendmap.records import read_experiment

if TYPE_CHECKING:
    from pendmap.diagnosis import Discrepancy

RECORDS = os.environ.get("PENDMAP_RECORDS", "")

pytestmark = pytest.mark.skipif(not RECORDS, reason="PENDMAP_RECORDS names no folder of records")

BY_HAND = {"multiarm_single_free_large": 0.0028, "cartpend_free_long": 0.0030}
"""Root mean square, rad, that viscous, Coulomb and quadratic damping leave of the whole record."""


@functools.cache
def found(name: str) -> Discrepancy:
    return diagnose(read_experiment(Path(RECORDS) / f"{name}.csv"))


@pytest.mark.parametrize("name", BY_HAND)
def test_effects_are_named_and_close_the_gap_as_far_as_by_hand(name: str) -> None:
    diagnosis = found(name)
    # Far more is left than noise: never more than partial.
    assert diagnosis.verdict == "partial"
    assert diagnosis.effects
    assert all(effect.approximate for effect in diagnosis.effects)
    fit = diagnosis.best.trial.fit
    # One initial state for the whole record.
    assert len(fit.windows) == 1
    assert fit.rms <= BY_HAND[name]
    gap = diagnosis.gap
    assert gap.held_out_after < 0.3 * gap.held_out_before
    assert diagnosis.judgement.closed > 0.9


@pytest.mark.parametrize("name", BY_HAND)
def test_what_is_left_is_said(name: str) -> None:
    diagnosis = found(name)
    said = as_json(diagnosis)
    assert said["left"]["torque_by_chance"] < 1e-6
    assert diagnosis.where
    text = "\n".join(as_text(diagnosis))
    fit = diagnosis.best.trial.fit
    negative = {n for n in ("c_over_m", "Tr") if fit[n] < 0}
    assert negative <= set(said["unphysical"])
    for parameter in said["unphysical"]:
        assert fit[parameter] < 0
        assert any(parameter in line and "unphysical" in line for line in text.splitlines())


@pytest.mark.parametrize("name", BY_HAND)
def test_the_model_that_is_given_out_is_physical_and_nearly_as_good(name: str) -> None:
    diagnosis = found(name)
    fit = diagnosis.usable.trial.fit
    assert not unphysical(fit)
    assert fit.rms <= 1.1 * BY_HAND[name]
    assert fit.rms < 0.2 * diagnosis.base.trial.fit.rms


def test_damping_that_a_drift_takes_below_0_is_said() -> None:
    diagnosis = found("cartpend_free_long")
    assert "viscous_drift" in diagnosis.nearest.trial.names
    fit = diagnosis.best.trial.fit
    drift = next(e for e in fit.model.effects if e.name == "viscous_drift").parameters["r"]
    # c/m + r t = 0.
    expected = -fit["c_over_m"] / drift
    assert diagnosis.below_zero == {"c_over_m": pytest.approx(expected, rel=0.06)}
