"""The search: its fits, their caching, and the acceptance of effects."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from driven_decays import motion
from hidden import recorded
from pendmap import FitDiverged, InputError
from pendmap.comparison.data import DataSplit, split_records
from pendmap.diagnosis import Thresholds, diagnose
from pendmap.diagnosis.baseline import fit_baseline
from pendmap.diagnosis.candidates import CORE, Candidate
from pendmap.diagnosis.fitted_model import fit_with_candidates
from pendmap.diagnosis.hold_out import hold_out_losses
from pendmap.diagnosis.search import prune_effects, search
from pendmap.diagnosis.state import State
from pendmap.diagnosis.verdict import compare_alternatives
from pendmap.identification.fit import fit_runs
from pendmap.records import Experiment, Run

if TYPE_CHECKING:
    from pendmap.diagnosis.fitted_model import FittedModel
    from pendmap.identification.fit import TrajectoryFit


def decay(drag: float) -> DataSplit:
    """Return a free decay made by scipy, with noise of 2 mrad."""
    time = np.arange(1500) * 0.02
    theta = motion(time, (2.2, 0.0), w0=6.2, c_over_m=0.05, friction=0.05, drag=drag)
    theta = theta + np.random.default_rng(1).normal(0, 2e-3, time.shape)
    run = Run("a", "a.csv", "free", time, theta, np.ones(time.size, bool))
    return split_records(Experiment(Path("there"), (run,)))


@pytest.fixture(scope="module")
def dragged() -> tuple[State, FittedModel | None]:
    """Return the state of a decay with drag, and its physical core."""
    data = decay(drag=0.02)
    base, core = fit_baseline(data)
    return State(data, base, Thresholds(), 3, ()), core


@pytest.fixture(scope="module")
def best(dragged: tuple[State, FittedModel | None]) -> FittedModel:
    return search(*dragged)


def test_the_core_is_fitted_in_addition_to_the_given_model(
    dragged: tuple[State, FittedModel | None],
) -> None:
    state, core = dragged
    assert core is not None
    assert set(core.names) == set(CORE)
    assert state.base.chosen == ()
    q = core.fit.estimates["quadratic_drag.q"]
    assert abs(q.value - 0.02) < 4 * q.stderr
    assert core.chi2 < state.base.chi2 - 100
    _, none = fit_baseline(state.records, without=CORE)
    assert none is None


def test_a_search_keeps_the_true_effect_and_drops_the_others_of_the_core(
    dragged: tuple[State, FittedModel | None], best: FittedModel
) -> None:
    state, core = dragged
    assert best.names == ("quadratic_drag",)
    assert state.chance(state.base, best) < state.thresholds.chance
    assert core is not None
    assert state.chance(best, core) > state.thresholds.chance
    # Pruning of the core gives the same effects.
    assert prune_effects(state, core).names == ("quadratic_drag",)


def test_the_same_model_is_fitted_once(
    dragged: tuple[State, FittedModel | None], best: FittedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    state, _ = dragged
    (drag,) = best.chosen
    scores = state.scores(state.base)
    place = next(k for k in scores.best() if scores.scores[k].candidate.name == "cubic_damping")
    first = (
        state.refit(state.base, [place]),
        state.leave_out(best, drag),
        state.hold_out_losses(best),
    )
    assert first[0] is not None
    assert first[1] is not None
    for name in (
        "refit_with",
        "drop_effect",
        "evaluate_hold_out",
        "hold_out_losses",
        "score_candidates",
    ):
        monkeypatch.setattr(f"pendmap.diagnosis.state.{name}", pytest.fail)
    again = (
        state.refit(state.base, [place]),
        state.leave_out(best, drag),
        state.hold_out_losses(best),
    )
    assert all(one is other for one, other in zip(first, again, strict=True))
    assert state.scores(state.base) is scores


def test_a_fit_that_diverges_is_no_candidate(
    dragged: tuple[State, FittedModel | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    state, _ = dragged

    def lost(*_given: object, **_named: object) -> FittedModel:
        raise FitDiverged("lost")

    monkeypatch.setattr("pendmap.diagnosis.fitted_model.fit_model", lost)
    other = State(state.records, state.base, state.thresholds, 3, ())
    assert other.refit(state.base, [0]) is None
    assert search(other, None).chosen == ()


def test_an_error_of_a_fit_is_not_taken_for_divergence(
    dragged: tuple[State, FittedModel | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    state, _ = dragged

    def wrong(*_given: object, **_named: object) -> FittedModel:
        raise InputError("free must be among the parameters")

    monkeypatch.setattr("pendmap.diagnosis.refit.fit_with_candidates", wrong)
    with pytest.raises(InputError, match="free must be"):
        State(state.records, state.base, state.thresholds, 3, ()).refit(state.base, [0])


def test_no_effect_is_accepted_that_noise_explains() -> None:
    data = decay(drag=0.0)
    base, core = fit_baseline(data)
    state = State(data, base, Thresholds(), 3, ())
    assert search(state, core).chosen == ()
    # Thresholds that accept everything accept the best candidate.
    lax = Thresholds(chance=2.0, alike=0.0, closes=0.0, loss=math.inf)
    state = State(data, base, lax, 1, CORE)
    assert search(state, None).chosen != ()


def test_a_model_that_loses_on_held_out_records_is_refused(
    dragged: tuple[State, FittedModel | None], best: FittedModel
) -> None:
    state, _ = dragged
    assert state.keeps_hold_out(state.base, best)
    assert not state.keeps_hold_out(best, state.base)
    held = state.hold_out(best)
    assert held is not None
    # Stretches within the run, its first and its last third.
    assert len(hold_out_losses(state.data, best, held, state.level)) == 3


def test_alternatives_have_the_difference_of_gains(
    dragged: tuple[State, FittedModel | None], best: FittedModel
) -> None:
    state, _ = dragged
    (drag,) = best.chosen
    each = compare_alternatives(state, best, drag)
    rest = state.leave_out(best, drag)
    assert each.gain == pytest.approx((rest.chi2 - best.chi2) / best.level)
    assert 0.9 < each.closed <= 1.1
    behind = {r.candidate.name: r for r in each.alternatives}
    assert behind["power_law_drag"].contains
    cubic = behind["cubic_damping"]
    assert cubic.gain + cubic.behind == pytest.approx(each.gain)
    assert cubic.alike is (cubic.behind < state.thresholds.alike)


def test_a_model_without_an_effect_is_never_worse_than_one_with_fewer(
    dragged: tuple[State, FittedModel | None], best: FittedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    known, _ = dragged
    (drag,) = best.chosen
    gain = Candidate("encoder_gain")
    both = fit_with_candidates(known.data, best, [gain], {gain.free[0]: 0.0}, level=known.level)
    right = known.leave_out(both, gain)
    # The fit without the gain diverges; the drag is added to the given model instead.
    monkeypatch.setattr("pendmap.diagnosis.state.drop_effect", lambda *_: None)
    state = State(known.records, known.base, known.thresholds, 3, ())
    state.data = known.data
    rest = state.leave_out(both, gain)
    assert rest.names == ("quadratic_drag",)
    assert rest.chi2 == pytest.approx(right.chi2, rel=1e-3)
    # Where that fit diverges too, the given model is the best one without the gain.
    monkeypatch.setattr("pendmap.diagnosis.state.add_effects", lambda *_: None)
    state = State(known.records, known.base, known.thresholds, 3, ())
    assert state.leave_out(both, gain) is known.base
    assert state.leave_out(best, drag) is known.base


def test_a_fit_that_promises_far_less_than_its_target_is_given_up() -> None:
    data = split_records(recorded("quadratic_drag", noise=0.03, free=4, forced=0)[0])
    base, _ = fit_baseline(data)
    model = dataclasses.replace(base.fit.model, c_over_m=1.05 * base.fit.model.c_over_m)
    start = {"c_over_m": model.c_over_m}

    def fit(target: float) -> tuple[bool, bool, int, float]:
        found = fit_runs(
            data.fitted,
            model,
            base.free,
            start=start,
            windows=base.fit.windows,
            profiled=(),
            target=target,
        )
        return found.given_up, found.converged, found.steps, found.chi2

    whole = fit(math.inf)
    assert whole[:2] == (False, True)
    assert whole[3] == pytest.approx(base.chi2, rel=1e-6)
    given_up, converged, steps, chi2 = fit(0.5 * base.chi2)
    assert (given_up, converged) == (True, False)
    assert steps < whole[2]
    assert chi2 < 1.2 * base.chi2
    assert fit(1.01 * base.chi2) == whole


def test_a_diagnosis_whose_fit_does_not_converge_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    data = split_records(recorded("quadratic_drag", noise=0.03, free=4, forced=0)[0])

    def stopped(*given: Any, **named: Any) -> TrajectoryFit:  # noqa: ANN401 (of fit_runs)
        # Each search lowers the sum of squares by a half, and stops.
        fit, before = fit_runs(*given, **named), chi2[0]
        chi2[0] = before / 2
        return dataclasses.replace(fit, converged=False, chi2=before)

    chi2 = [1e9]
    monkeypatch.setattr("pendmap.diagnosis.fitted_model.fit_runs", stopped)
    with pytest.raises(InputError, match="must converge, got one whose sum"):
        diagnose(data.experiment, max_effects=0)


def test_a_fit_converges_where_the_pendulum_comes_to_rest() -> None:
    # A forced run comes to rest at the limit of friction: in its last windows the sum of squares
    # has its minimum at a kink.
    given = {"seed": 4, "free": 5, "forced": 4, "noise": 0.1, "counts": 4096, "rate": 124.0}
    data = split_records(recorded("quadratic_drag", **given)[0])
    _, core = fit_baseline(data)
    assert core is not None
    still = [
        float(np.ptp(run.theta[first:last]))
        for index, first, last, *_ in core.fit.windows
        if (run := data.fitted[index]).forced
    ]
    assert min(still) < 0.05
    assert core.fit.converged
    assert core.fit.steps < 40
