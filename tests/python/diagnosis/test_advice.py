"""Advice on the next record, and detection limits of effects that were not found."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.special import chdtri

from hidden import once, recorded
from pendmap import InputError, virtual_rig
from pendmap.diagnosis import Discrepancy, Thresholds, diagnose
from pendmap.diagnosis.advice import required_gain
from pendmap.diagnosis.summary import as_json
from pendmap.virtual_rig import Request, RunPlan


def test_equally_good_names_are_listed_with_what_reveals_them() -> None:
    found = once("bias_torque", seed=6, size=0.3, free=2, forced=0)
    assert found.verdict == "ambiguous"
    text = found.advice.next_experiment
    assert text is not None
    assert text.startswith("To distinguish equally good names, record what reveals bias_torque (")
    (names,) = found.equivalent
    assert {"bias_torque", "asymmetric_coulomb"} <= set(names)
    for name in ("bias_torque", "asymmetric_coulomb"):
        assert f"{name} ({found.definition(name).revealed_by})" in text


def test_a_name_without_rivals_needs_a_narrower_interval() -> None:
    found = once("quadratic_drag")
    assert found.verdict == "named"
    (effect,) = found.effects
    low, high = effect.ci95["q"]
    half = 50 * (high - low) / effect.parameters["q"]
    assert as_json(found)["next_experiment"] == (
        f"quadratic_drag.q has the widest interval, +- {half:.2g} % (95 %): about four times as "
        "many such records halve it."
    )


def test_where_nothing_is_missing_limits_are_lowered() -> None:
    found = once("none", seed=5, free=1, forced=0)
    assert found.verdict == "none"
    fields = as_json(found)
    unseen = sum(size == math.inf for size in fields["detection_limits"].values())
    assert f"{unseen} effects cannot be detected in such records" in fields["next_experiment"]


def test_an_effect_that_a_free_decay_does_not_show_has_no_limit() -> None:
    found = once("none", seed=5, free=1, forced=0)
    limits = found.advice.limits
    assert limits["added_mass"].size == math.inf
    # A harmonic of one period a turn is gravity itself.
    assert [c.shape["n"] for c in limits["bearing_harmonic"].unseen] == [1.0]
    assert limits["encoder_offset"].size == pytest.approx(limits["rig_tilt"].size, rel=1e-3)


def test_limits_follow_from_the_thresholds_of_the_diagnosis() -> None:
    """An effect of one parameter must gain what noise gains with the given probability."""
    usual = once("none", seed=5, free=1, forced=0).advice.limits
    records, _ = recorded(seed=5, free=1, forced=0)
    strict = diagnose(records, thresholds=Thresholds(chance=1e-6)).advice.limits
    gains = [
        required_gain(float(chdtri(1, chance / len(usual))), 1)
        for chance in (Thresholds().chance, 1e-6)
    ]
    ratio = strict["encoder_gain"].size / usual["encoder_gain"].size
    assert ratio == pytest.approx(math.sqrt(gains[1] / gains[0]))
    assert ratio > 1.2


@pytest.mark.parametrize("count", [1, 2])
def test_a_limit_is_passed_in_95_of_100(count: int) -> None:
    """The probability is compared with sums of squares of normal draws about the expected gain."""
    rng = np.random.default_rng(1)
    mean = np.zeros(count)
    mean[0] = math.sqrt(required_gain(22.0, count))
    gains = np.sum((mean + rng.standard_normal((200_000, count))) ** 2, axis=1)
    assert np.mean(gains > 22.0) == pytest.approx(0.95, abs=0.002)


@pytest.mark.thorough
def test_an_effect_of_the_size_of_its_limit_is_found() -> None:
    """The limit follows from records without an effect; the same rig then has one of that size."""

    def hidden(*effects: str) -> Discrepancy:
        return once(*effects, seed=11, free=2, forced=0, noise=0.2)

    limit = hidden().advice.limits["encoder_gain"].size
    for size in (limit, -limit):
        assert hidden(f"encoder_gain,e={size:.6g}").verdict != "none"
    assert hidden(f"encoder_gain,e={limit / 4:.6g}").verdict == "none"


def test_the_rig_records_planned_runs() -> None:
    """Planned runs do not change those before them; contradictory requests are refused."""
    request = Request("hidden", seed=4, effects=("none",), free=1, forced=0)
    first = virtual_rig.make(request).runs[0]
    plan = RunPlan("free", 0.3, 1.0, 5.0, lab_time=900.0)
    asked = Request("hidden", seed=4, effects=("none",), plans=(first.plan, plan))
    again, new = virtual_rig.make(asked).runs
    assert np.array_equal(again.angle, first.angle)
    assert new.time[-1] == pytest.approx(5.0, abs=0.02)
    assert new.path.angle(np.zeros(1))[0] == pytest.approx(0.3)
    with pytest.raises(InputError, match="one of free and plans must be left out"):
        Request("hidden", free=1, plans=(plan,))
    with pytest.raises(InputError, match=r"plan 0 must .* take 1 to 3600 s .*duration=0\.0"):
        Request("hidden", plans=(dataclasses.replace(plan, duration=0.0),))
