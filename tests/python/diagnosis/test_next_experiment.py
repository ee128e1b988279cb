"""Proposed records distinguish effects as predicted, once they are recorded."""

from __future__ import annotations

import dataclasses
import json
import math
import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.special import chdtri

from hidden import once
from pendmap import InputError, virtual_rig
from pendmap.diagnosis import Discrepancy, Thresholds, diagnose
from pendmap.diagnosis.fitted_model import fit_model
from pendmap.diagnosis.next_experiment.information import Columns, Information, Prospects
from pendmap.diagnosis.next_experiment.limits import required_gain
from pendmap.diagnosis.next_experiment.power import chance_resolved, chance_wrong_name
from pendmap.diagnosis.next_experiment.proposals import list_proposals
from pendmap.diagnosis.summary import as_json
from pendmap.identification.readings import as_fit_run, reading_of
from pendmap.records import read_experiment
from pendmap.virtual_rig import Request, RunPlan

if TYPE_CHECKING:
    from pendmap.diagnosis.next_experiment.proposals import Proposal
    from pendmap.records import Experiment, Run


def recorded(request: Request) -> Experiment:
    """Write and read an experiment without its truth."""
    with tempfile.TemporaryDirectory() as folder:
        where = virtual_rig.places(Path(folder) / "records", replace=True)
        virtual_rig.write(virtual_rig.make(request), where)
        return read_experiment(where.experiment)


def done(request: Request, proposal: Proposal) -> tuple[Run, ...]:
    """Make the rig of a request record a proposal."""
    begun = [run.plan for run in virtual_rig.make(request).runs]
    plans = [
        RunPlan(
            "free",
            start.theta,
            start.velocity,
            proposal.length_s,
            lab_time=round(start.lab_time_s, 1),
        )
        for start in proposal.runs
    ]
    asked: dict[str, Any] = {"free": None, "forced": None, "plans": (*begun, *plans)}
    every = recorded(dataclasses.replace(request, **asked)).runs[len(begun) :]
    return tuple(dataclasses.replace(run, hold_out=False) for run in every)


def hidden(seed: int, *effects: str, **given: Any) -> tuple[Request, Experiment, Discrepancy]:  # noqa: ANN401 (parameters of the request)
    request = Request("hidden", seed=seed, effects=effects or ("none",), forced=0, **given)
    records = recorded(request)
    return request, records, diagnose(records)


@pytest.mark.thorough
def test_the_recommended_record_leaves_one_name() -> None:
    """Drifts indistinguishable within minutes are distinguished by the proposed record."""
    request, records, before = hidden(1000018, "viscous_drift", size=0.08, free=3)
    assert before.verdict == "ambiguous"
    (alike,) = before.equivalent
    assert {"viscous_drift", "coulomb_drift", "natural_frequency_drift"} <= set(alike)
    outlook, best = before.advice.outlook, before.advice.best
    assert outlook is not None
    assert best is not None
    assert best.value > outlook.wanted > outlook.now
    assert best.proposal.wait_s > 0
    assert best.proposal.what in before.advice.next_experiment
    runs = (*records.runs, *done(request, best.proposal))
    after = diagnose(dataclasses.replace(records, runs=runs))
    assert [effect.name for effect in after.effects] == ["viscous_drift"]
    assert after.verdict == "named"
    alternatives = after.assessment.identified[0].alternatives
    power = min(r.behind for r in alternatives if r.candidate.name in alike and not r.contains)
    # The tolerance includes the scatter of the gain and of the estimate that predicted it.
    doubt = 2 / math.sqrt(best.value) + 2 / math.sqrt(before.assessment.identified[0].gain)
    assert power == pytest.approx(best.value, rel=3 * doubt)


@pytest.mark.thorough
def test_an_interval_becomes_as_narrow_as_predicted() -> None:
    request, records, before = hidden(3, "quadratic_drag", free=3)
    assert before.verdict == "named"
    outlook, best = before.advice.outlook, before.advice.best
    assert outlook is not None
    assert best is not None
    assert outlook.about == ("quadratic_drag.q",)
    q = before.best.fitted.fit.estimates["quadratic_drag.q"]
    assert q.stderr is not None
    level = before.level
    assert outlook.now == pytest.approx(1.96 * q.stderr * math.sqrt(level) / q.value, rel=0.01)
    runs = (*records.runs, *done(request, best.proposal))
    after = diagnose(dataclasses.replace(records, runs=runs))
    r = after.best.fitted.fit.estimates["quadratic_drag.q"]
    assert r.stderr is not None
    reached = 1.96 * r.stderr * math.sqrt(after.level) / r.value
    assert reached == pytest.approx(best.value, rel=0.15)
    assert reached < 0.6 * outlook.now


@pytest.mark.thorough
@pytest.mark.parametrize("what", ["from 0.5 rad", "from 2.8 rad", "flung through 0"])
def test_the_information_of_a_proposal_is_that_of_its_record(what: str) -> None:
    """The prediction from thinned samples agrees with the recorded run."""
    request, _, found = hidden(8, free=2, noise=0.2, counts=8192)
    known = {"max_velocity": 8 * found.base.fitted.fit.model.w0}
    experiment = dataclasses.replace(found.data.experiment, known=known)
    data = dataclasses.replace(found.data, experiment=experiment)
    menu = list_proposals(data, found.base.fitted.fit.model.w0)
    proposal = next(p for p in menu if len(p.runs) == 1 and what in p.what)
    ahead = Prospects(data, found.base, [], {}, [proposal])
    predicted = ahead.after(proposal).matrix - ahead.old.matrix
    (run,) = done(request, proposal)
    reading = reading_of(run.time, run.theta, trusted=run.trusted, count=run.count_rad)
    alone = dataclasses.replace(
        data, fitted=(as_fit_run(run, reading),), readings=(reading,), fitted_of=(0,)
    )
    fitted = found.base.fitted
    fit = fit_model(alone, fitted.fit.model, fitted.free, start=fitted.start).fit
    recorded_ = Columns.of(fit, alone.fitted, []).information(0, len(run.time), hold=True)
    errors = [np.sqrt(np.diag(np.linalg.inv(m))) for m in (predicted, recorded_.matrix)]
    # Within the approximation of the thinned samples.
    assert errors[0] == pytest.approx(errors[1], rel=0.3)


def test_no_proposal_distinguishes_equivalent_effects() -> None:
    found = once("bias_torque", seed=6, size=0.3, free=2, forced=0)
    outlook = found.advice.outlook
    assert outlook is not None
    assert {frozenset(pair) for pair in outlook.equals} == {
        frozenset(("bias_torque", "asymmetric_coulomb"))
    }
    assert "No free decay distinguishes" in found.advice.next_experiment
    assert "bias_torque" not in outlook.about or "asymmetric_coulomb" not in outlook.about


def test_every_verdict_has_a_table_and_json_without_gaps() -> None:
    found = once("none", seed=5, free=1, forced=0)
    assert found.verdict == "none"
    fields = as_json(found)
    table = fields["proposals"]
    assert table["aim"] == "limits"
    json.dumps(table, allow_nan=False)
    (chosen,) = [row for row in table["experiments"] if row["recommended"]]
    assert chosen["what"] in fields["next_experiment"]
    assert chosen["predicted"] <= table["wanted"] < table["now"]
    # The least recording time of all sufficient proposals.
    enough = [r["seconds"] for r in table["experiments"] if r["predicted"] <= table["wanted"]]
    assert chosen["seconds"] == min(enough)
    assert all(run["drive"] is None for row in table["experiments"] for run in row["runs"])


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
    request = Request("hidden", seed=5, effects=("none",), free=1, forced=0)
    strict = diagnose(recorded(request), thresholds=Thresholds(chance=1e-6)).advice.limits
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
    _, _, clean = hidden(11, free=2, noise=0.2)
    limit = clean.advice.limits["encoder_gain"].size
    found = 0
    for size in (limit, -limit):
        _, _, seen = hidden(11, f"encoder_gain,e={size:.6g}", free=2, noise=0.2)
        found += seen.verdict != "none"
    assert found == 2
    _, _, faint = hidden(11, f"encoder_gain,e={limit / 4:.6g}", free=2, noise=0.2)
    assert faint.verdict == "none"


def test_information_beside_other_columns_is_the_schur_complement() -> None:
    """The information is compared with least squares on the columns."""
    rng = np.random.default_rng(2)
    x = rng.standard_normal((300, 5)) * [1, 1e3, 1e-4, 7, 1]
    x[:, 4] = x[:, 0] + 2e-3 * x[:, 1]
    f = Information(x.T @ x)
    rest = x[:, 2] - x[:, [0, 1]] @ np.linalg.lstsq(x[:, [0, 1]], x[:, 2])[0]
    assert f.own([2], [0, 1])[0, 0] == pytest.approx(rest @ rest)
    assert f.own([4], [0, 1, 3])[0, 0] == 0
    assert f.followed([4], [0, 1], [3])[:, 0] == pytest.approx([1, 2e-3])


def test_probabilities_of_names_follow_from_the_expected_gain() -> None:
    """Twice the difference of log-likelihoods has the mean s G and the variance 4 s G."""
    rng = np.random.default_rng(3)
    draws = 16 + 2 * 4 * rng.standard_normal(400_000)
    assert chance_wrong_name(16) == pytest.approx(np.mean(draws < 0), rel=0.03)
    assert chance_resolved(16, 10) == pytest.approx(np.mean(draws > 10), rel=0.01)


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
    with pytest.raises(InputError, match=r"plan 0: duration must be .*, got 0 s"):
        Request("hidden", plans=(dataclasses.replace(plan, duration=0.0),))


def test_an_insufficient_proposal_says_how_many_runs_are_needed() -> None:
    """The gain of the drag is small: no single proposal reaches the wanted separation."""
    found = once("quadratic_drag", size=0.1)
    outlook, best = found.advice.outlook, found.advice.best
    assert outlook is not None
    assert best is not None
    assert best.value == max(p.value for p in outlook.prospects) < outlook.wanted
    said = re.search(r"25 wanted; about (\d+) such runs are needed", found.advice.next_experiment)
    assert said is not None
    ratio = (25 - outlook.now) / (best.value - outlook.now)
    assert int(said[1]) == math.ceil(ratio * len(best.proposal.runs))


@pytest.mark.parametrize("widest", [0.3, 1.0, 3.0])
def test_no_wider_swing_is_proposed_than_the_rig_has(widest: float) -> None:
    data = once("quadratic_drag").data
    known = {**data.experiment.known, "max_angle": widest}
    rig = dataclasses.replace(data.experiment, known=known)
    menu = list_proposals(dataclasses.replace(data, experiment=rig), 6.0)
    angles = {abs(start.theta) for proposal in menu for start in proposal.starts}
    assert max(angles) == min(widest, 2.8)
