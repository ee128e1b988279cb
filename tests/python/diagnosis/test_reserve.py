"""Probabilities of names, and names that are given with reserve."""

from __future__ import annotations

import dataclasses
import importlib
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.signal import lfilter

import pendmap
from driven_decays import motion
from hidden import diagnosed, once
from pendmap.comparison.data import split_records
from pendmap.comparison.forecast import share_closed
from pendmap.diagnosis import Thresholds
from pendmap.diagnosis.baseline import fit_baseline
from pendmap.diagnosis.candidates import list_candidates
from pendmap.diagnosis.result import as_text
from pendmap.diagnosis.search import search
from pendmap.diagnosis.state import ScoredModel, State
from pendmap.diagnosis.summary import as_json
from pendmap.diagnosis.verdict import Alternative, Identifiability, decide_verdict, probabilities
from pendmap.records import Experiment, Run
from pendmap.residuals.by_run import RunByRun, parameters_by_run

if TYPE_CHECKING:
    from pendmap.diagnosis import NamedEffect
    from pendmap.diagnosis.fitted_model import FittedModel

CHANCE, SURE = Thresholds().rest, Thresholds().sure


def test_probability_falls_with_the_misfit_and_with_the_number_of_effects() -> None:
    by_chance = [probabilities(chance, [300.0])[0] for chance in (1.0, 0.1, 1e-2, 1e-3)]
    assert by_chance == sorted(by_chance, reverse=True)
    assert by_chance[0] > SURE > by_chance[-1]
    by_count = [min(probabilities(0.5, [500.0] * count)) for count in (1, 2, 3)]
    assert by_count == sorted(by_count, reverse=True)
    # A weak effect in addition to a strong one is less probable.
    strong, weak = probabilities(0.5, [2000.0, 20.0])
    assert strong > weak
    assert probabilities(0.5, [2000.0, 1500.0])[1] > weak
    assert min(probabilities(0.0, [1e300, 0.0])) > 0
    assert probabilities(0.5, []) == ()


def test_residuals_without_a_hidden_effect_are_explained_by_noise() -> None:
    found = once("none", seed=5, free=1, forced=0)
    assert found.verdict == "none"
    assert found.assessment.form.chance > CHANCE
    assert all(0 <= chance <= 1 for chance in found.assessment.form.chances.values())


def test_an_effect_outside_the_library_shows_in_the_residuals() -> None:
    found, _ = diagnosed("encoder_gain", size=3.0, free=3, forced=0, without=("encoder_gain",))
    assert found.verdict in {"unknown", "partial"}
    assert found.assessment.form.chance < CHANCE


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [3, 5])
def test_two_effects_in_the_place_of_one_are_named_with_reserve(seed: int) -> None:
    # Without the family of the drag two frictions fit its records to within the noise.
    own = [effect.name for effect in pendmap.effects() if effect.family == "damping"]
    found, _ = diagnosed("quadratic_drag", seed=seed, size=3.0, free=3, forced=0, without=own)
    assert found.effects == () or all(effect.approximate for effect in found.effects)
    assert min(found.assessment.probabilities) < SURE


@pytest.fixture(scope="module")
def waving() -> tuple[State, ScoredModel]:
    """Return decays with drag, by scipy, and a wave in the readings that no effect describes."""
    time = np.arange(1500) * 0.02
    runs = []
    for name, start in (("a", 2.2), ("b", 1.4)):
        theta = motion(time, (start, 0.0), w0=6.2, c_over_m=0.05, friction=0.05, drag=0.02)
        theta = theta + np.random.default_rng(1).normal(0, 2e-3, time.shape)
        theta += 6e-3 * np.sin(time * (1 + start))
        good = np.ones(time.size, bool)
        runs.append(Run(name, f"{name}.csv", "free", time, theta, good))
    data = split_records(Experiment(Path("there"), tuple(runs)))
    base, core = fit_baseline(data)
    state = State(data, base, Thresholds(), 3, ())
    return state, state.scored(search(state, core))


def runs_of(state: State, fitted: FittedModel) -> RunByRun:
    return parameters_by_run(state.data.fitted, fitted.fit, fitted.noise, fitted.level)


@pytest.mark.parametrize(
    ("change", "verdict"),
    [
        ({}, "partial"),
        ({"closes": 1.1}, "unknown"),
        # With residuals ignored the alternatives to the drag, which the wave hides, decide.
        ({"rest": 0.0}, "ambiguous"),
    ],
)
def test_thresholds_decide_between_partial_unknown_and_ambiguous(
    change: dict[str, float], verdict: str, waving: tuple[State, ScoredModel]
) -> None:
    state, best = waving
    assert best.fitted.names == ("quadratic_drag",)
    state.thresholds = Thresholds(**change)  # type: ignore[arg-type]
    judged = decide_verdict(state, best, runs_of(state, best.fitted), 1.0)
    assert judged.closed > 0.5
    assert judged.verdict == verdict
    assert judged.approximate is (verdict == "partial" or min(judged.probabilities) < SURE)


@pytest.mark.parametrize(
    ("stated", "correlation", "verdict"),
    [(1.0, 0.0, "none"), (0.7, 0.0, "unknown"), (0.3, 0.0, "unknown"), (1.0, 0.6, "none")],
)
def test_none_is_said_within_the_noise_only(
    stated: float, correlation: float, verdict: str
) -> None:
    # White residuals above the stated noise are not noise; coloured noise exceeds its local fits.
    time = np.arange(1000) * 0.02
    theta = motion(time, (2.2, 0.0), w0=6.2, c_over_m=0.05, friction=0.05)
    draw = np.random.default_rng(1).normal(0, 2e-3, time.size)
    noise = lfilter([math.sqrt(1 - correlation**2)], [1, -correlation], draw)
    run = Run("a", "a.csv", "free", time, theta + noise, np.ones(time.size, bool))
    data = split_records(Experiment(Path("there"), (run,)))
    fitted = tuple(dataclasses.replace(r, sigma=stated * r.sigmas) for r in data.fitted)
    data = dataclasses.replace(data, fitted=fitted)
    state = State(data, fit_baseline(data)[0], Thresholds(), 0, ())
    best = state.scored(search(state, None))
    judged = decide_verdict(state, best, runs_of(state, best.fitted), 1.0)
    assert judged.verdict == verdict
    assert (judged.ratio <= judged.ratio_allowed) is (verdict == "none")


def test_the_share_of_the_gap_is_one_number() -> None:
    found = once("quadratic_drag", seed=3, size=3.0, free=1, forced=0, max_effects=1)
    fields, gap = as_json(found), found.gap
    left, before = (x**2 - gap.noise_floor**2 for x in (gap.after, gap.before))
    share = min(1.0, 1 - left / before)
    assert 0 < share < 1 or gap.after <= gap.noise_floor
    closed = found.assessment.closed
    assert closed == pytest.approx(share, rel=1e-9)
    assert fields["gap"]["closed"] == fields["gap"]["closed_by_nearest"] == closed
    assert [effect["closes"] for effect in fields["effects"]] == [closed]
    assert f"Share of the squared gap closed: {100 * closed:.0f} %" in list(as_text(found))
    assert share_closed(2.0, 1.0, 1.0) == share_closed(0.9, 0.8, 1.0) == 1.0
    assert share_closed(0.9, 1.1, 1.0) == 0.0


def test_an_effect_whose_interval_contains_0_is_no_name(monkeypatch: pytest.MonkeyPatch) -> None:
    time = np.arange(600) * 0.02
    theta = motion(time, (2.2, 0.0), w0=6.2, c_over_m=0.05, friction=0.05, drag=0.05)
    theta = theta + np.random.default_rng(1).normal(0, 2e-3, time.size)
    run = Run("a", "a.csv", "free", time, theta, np.ones(time.size, bool))
    module = importlib.import_module("pendmap.diagnosis.diagnose")
    named = module.name_effects
    shown: list[str] = []

    def widened(*given: object) -> tuple[NamedEffect, ...]:
        effects = named(*given)
        shown.extend(effect.name for effect in effects)
        wide = {size: (-1.0, 1.0) for effect in effects for size in effect.ci95}
        return tuple(dataclasses.replace(effect, ci95=wide) for effect in effects)

    monkeypatch.setattr(module, "name_effects", widened)
    found = pendmap.diagnose(run, max_effects=1)
    assert shown
    assert found.effects == ()
    assert found.verdict == "unknown"


def test_the_effect_that_closes_most_comes_first(waving: tuple[State, ScoredModel]) -> None:
    state, best = waving
    scores = state.scores(best.fitted)
    place = next(k for k in scores.best() if scores.scores[k].candidate.name == "encoder_gain")
    both = state.refit(best.fitted, [place])
    assert both is not None
    for chosen in (both.chosen, both.chosen[::-1]):
        fitted = dataclasses.replace(both, chosen=chosen)
        judged = decide_verdict(state, state.scored(fitted), runs_of(state, fitted), 1.0)
        assert [s.candidate.name for s in judged.identified] == ["quadratic_drag", "encoder_gain"]
        assert judged.identified[0].gain > judged.identified[1].gain


def test_an_effect_that_contains_the_name_takes_no_share() -> None:
    named = {c.name: c for c, *_ in list_candidates((), driven=False)}

    def alternative(
        name: str, behind: float, *, contains: bool, alike: bool | None = None
    ) -> Alternative:
        far = behind / 500.0
        return Alternative(
            named[name],
            500.0 - behind,
            behind,
            far,
            refitted=True,
            contains=contains,
            alike=behind < Thresholds().alike if alike is None else alike,
        )

    def each(*alternatives: Alternative) -> Identifiability:
        return Identifiability(named["quadratic_drag"], 500.0, 1.0, alternatives)

    assert each().share == 1.0
    # An effect with the name as a special case takes no share.
    power = each(alternative("power_law_drag", 0.0, contains=True))
    assert power.share == 1.0
    assert power.equivalent == ["quadratic_drag"]
    cubic = each(alternative("cubic_damping", 0.0, contains=False))
    assert cubic.share == 0.5
    assert cubic.equivalent == ["quadratic_drag", "cubic_damping"]
    both = each(*cubic.alternatives, *power.alternatives)
    assert both.equivalent == ["quadratic_drag", "cubic_damping", "power_law_drag"]
    # exp(-6 / 2) to 1.
    behind = each(alternative("cubic_damping", 6.0, contains=False))
    assert behind.share == pytest.approx(1 / (1 + math.exp(-3)))
    # An alternative that one run alone excludes is equivalent.
    one = each(alternative("cubic_damping", 30.0, contains=False, alike=True))
    assert one.equivalent == ["quadratic_drag", "cubic_damping"]
    assert each(alternative("cubic_damping", 30.0, contains=False)).equivalent == ["quadratic_drag"]


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [34, 43])
def test_without_noise_rounding_errors_give_no_effect(seed: int) -> None:
    clean = {"seed": seed, "noise": 0.0, "counts": 0}
    nothing, _ = diagnosed(**clean)
    assert nothing.verdict == "none"
    assert nothing.gap.after < 1e-9
    drag, truth = diagnosed("quadratic_drag", **clean)
    assert drag.verdict == "named"
    (effect,) = drag.effects
    assert effect.name == "quadratic_drag"
    assert effect.parameters["q"] == pytest.approx(truth["quadratic_drag"]["q"], rel=1e-5)
