"""Fits that are given up, taken up again, or have slipped."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from pendmap.diagnosis.rests import Rests
from pendmap.diagnosis.slipped import from_short_windows, slipped

from pendmap import read_experiment, virtual_rig
from pendmap.diagnosis.baseline import baseline, taken_by
from pendmap.diagnosis.candidates import candidates
from pendmap.diagnosis.data import Evidence, evidence_of
from pendmap.diagnosis.refit import Refits
from pendmap.diagnosis.scores import Scores, scores_of
from pendmap.errors import InputError
from pendmap.identification.fitting import fit_runs

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.diagnosis.fitted_model import Trial


def recorded(folder: Path, *effects: str, **given: float) -> Evidence:
    asked = {"seed": 3, "free": 3, "forced": 0} | given
    request = virtual_rig.Request("hidden", effects=effects, **asked)  # type: ignore[arg-type]
    where = virtual_rig.places(folder / "lab", replace=True)
    virtual_rig.write(virtual_rig.make(request), where)
    return evidence_of(read_experiment(where.experiment))


@pytest.fixture(scope="module")
def dragged(tmp_path_factory: pytest.TempPathFactory) -> tuple[Evidence, Trial, Scores]:
    evidence = recorded(tmp_path_factory.mktemp("dragged"), "quadratic_drag", noise=0.03, free=4)
    base = baseline(evidence)
    pool = candidates(taken_by(base), driven=False, without=(), own=())
    return evidence, base, scores_of(evidence, base, pool)


def place_of(scores: Scores, name: str) -> int:
    return next(k for k in scores.best() if scores.scores[k].candidate.name == name)


def test_a_fit_that_promises_far_less_than_its_target_is_given_up(
    dragged: tuple[Evidence, Trial, Scores],
) -> None:
    evidence, base, _ = dragged
    model = dataclasses.replace(base.fit.model, c_over_m=1.05 * base.fit.model.c_over_m)
    start = {"c_over_m": model.c_over_m}

    def fit(target: float) -> tuple[bool, bool, int, float]:
        found = fit_runs(
            evidence.fitted,
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


def test_what_was_beaten_is_fitted_to_the_end_when_it_is_asked_for(
    dragged: tuple[Evidence, Trial, Scores],
) -> None:
    evidence, base, scores = dragged
    warming = [place_of(scores, "viscous_warm_up")]
    whole = Refits(evidence).fitted(base, scores, warming)
    refits = Refits(evidence)
    drag = refits.fitted(base, scores, [place_of(scores, "quadratic_drag")])
    assert whole is not None
    assert drag is not None
    assert whole.chi2 > drag.chi2 + 100
    quick = refits.fitted(base, scores, warming, drag.chi2)
    assert quick is not None
    assert quick.chi2 > 1.1 * whole.chi2
    added = [scores.scores[k].candidate for k in warming]
    assert refits.known(base, added) is None
    # Less is no reason to fit it again, more is.
    assert refits.fitted(base, scores, warming, 0.5 * drag.chi2) is quick
    again = refits.fitted(base, scores, warming)
    assert again is not None
    assert again.chi2 == pytest.approx(whole.chi2, rel=1e-9)
    assert refits.known(base, added) is again


def test_a_window_that_went_another_way_is_told_from_a_missing_effect(
    dragged: tuple[Evidence, Trial, Scores],
) -> None:
    evidence, base, _ = dragged
    # It lacks the drag, and that shows in all runs.
    assert base.chi2 > 1.5 * base.fit.degrees
    assert not slipped(base)
    drag = Refits(evidence).fitted(base, dragged[2], [place_of(dragged[2], "quadratic_drag")])
    assert drag is not None
    assert not slipped(drag)
    # One window a full swing late.
    run, first, last, theta, velocity = drag.fit.windows[0]
    windows = ((run, first, last, 0.8 * theta, velocity), *drag.fit.windows[1:])
    lost = fit_runs(
        evidence.fitted,
        drag.fit.model,
        drag.free,
        start=drag.start,
        windows=windows,
        profiled=(),
        hold=True,
        steps=0,
    )
    astray = dataclasses.replace(drag, fit=lost)
    assert slipped(astray)
    regained = from_short_windows(evidence, astray)
    assert regained.chi2 == pytest.approx(drag.chi2, rel=1e-6)


def test_where_nothing_is_found_without_an_effect_the_baseline_is(
    dragged: tuple[Evidence, Trial, Scores], monkeypatch: pytest.MonkeyPatch
) -> None:
    evidence, base, scores = dragged
    refits = Refits(evidence)
    places = [place_of(scores, name) for name in ("quadratic_drag", "viscous_warm_up")]
    both = refits.fitted(base, scores, places)
    assert both is not None

    def lost(*_given: object, **_named: object) -> Trial:
        raise InputError("lost")

    def astray(*_given: object, **_named: object) -> Trial:
        fit = dataclasses.replace(base.fit, chi2=2 * base.fit.chi2)
        return dataclasses.replace(base, chosen=both.chosen[1:], fit=fit)

    monkeypatch.setattr("pendmap.diagnosis.rests.with_candidates", lost)
    monkeypatch.setattr(Rests, "fit_without", astray)
    rests = Rests(evidence, base, refits)
    rest = rests.less(both, both.chosen[0])
    assert rest is base
    # It is asked for once.
    monkeypatch.setattr(Rests, "fit_without", lost)
    assert rests.less(both, both.chosen[0]) is base


def test_a_pendulum_that_rests_holds_up_no_fit(tmp_path: Path) -> None:
    # A forced run comes to rest where warming just holds it: in its last windows the sum of
    # squares is least at a kink, and no fit was ever at its end.
    evidence = recorded(
        tmp_path, "quadratic_drag", seed=4, free=5, forced=4, noise=0.1, counts=4096, rate=124.0
    )
    base = baseline(evidence)
    still = [
        float(np.ptp(run.theta[first:last]))
        for index, first, last, *_ in base.fit.windows
        if (run := evidence.fitted[index]).forced
    ]
    assert min(still) < 0.05
    assert base.fit.converged
    assert base.fit.steps < 40
