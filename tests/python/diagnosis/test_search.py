"""The search for effects, its verdict, the probabilities of names, and advice."""

from __future__ import annotations

import dataclasses
import functools
import importlib
import math
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.special import chdtri

import pendmap
from driven_decays import motion
from hidden import diagnosed, once, recorded
from pendmap import InputError
from pendmap.comparison.data import DataSplit, split_records
from pendmap.comparison.forecast import share_closed
from pendmap.diagnosis import Thresholds, diagnose
from pendmap.diagnosis.advice import required_gain
from pendmap.diagnosis.baseline import fit_baseline
from pendmap.diagnosis.candidates import CORE, Candidate, list_candidates
from pendmap.diagnosis.result import as_text
from pendmap.diagnosis.scores import Scores, score_candidates
from pendmap.diagnosis.search import prune_effects, search
from pendmap.diagnosis.state import ScoredModel, State
from pendmap.diagnosis.summary import as_json
from pendmap.diagnosis.verdict import Alternative, Identifiability, decide_verdict, probabilities
from pendmap.identification.fit import fit_runs
from pendmap.records import Experiment, Run
from pendmap.residuals.by_run import parameters_by_run

if TYPE_CHECKING:
    from pendmap.diagnosis import NamedEffect
    from pendmap.diagnosis.fitted_model import FittedModel
    from pendmap.diagnosis.verdict import Assessment
    from pendmap.identification.fit import TrajectoryFit

CHANCE, SURE = Thresholds().rest, Thresholds().sure
NOISE = np.random.default_rng(1).normal(0, 2e-3, 1500)


def decay(start: float, further: np.ndarray = NOISE, drag: float = 0.02) -> Run:
    """Return a free decay by scipy with a further reading."""
    time = np.arange(further.size) * 0.02
    theta = motion(time, (start, 0.0), w0=6.2, c_over_m=0.05, friction=0.05, drag=drag)
    return Run(f"{start}", "a.csv", "free", time, theta + further, np.ones(time.size, bool))


def state_of(*runs: Run) -> tuple[State, FittedModel | None]:
    """Return the state of a search in free decays, and their physical core."""
    data = split_records(Experiment(Path("there"), runs))
    base, core = fit_baseline(data)
    return State(data, base, Thresholds(), 3, ()), core


@pytest.fixture(scope="module")
def dragged() -> tuple[State, FittedModel, FittedModel]:
    """Return the state of a decay with drag, its physical core, and the best model."""
    state, core = state_of(decay(2.2))
    assert core is not None
    return state, core, search(state, core)


@pytest.fixture(scope="module")
def waving() -> tuple[State, ScoredModel]:
    """Return decays with drag, and a wave in the readings that no effect describes."""
    wave = {start: 6e-3 * np.sin(np.arange(1500) * 0.02 * (1 + start)) for start in (2.2, 1.4)}
    state, core = state_of(*(decay(start, NOISE + wave[start]) for start in wave))
    return state, state.scored(search(state, core))


def judged(state: State, best: ScoredModel) -> Assessment:
    fitted = best.fitted
    runs = parameters_by_run(state.data.fitted, fitted.fit, fitted.noise, fitted.level)
    return decide_verdict(state, best, runs, 1.0)


def test_a_search_keeps_the_true_effect_and_drops_the_others_of_the_core(
    dragged: tuple[State, FittedModel, FittedModel],
) -> None:
    state, core, best = dragged
    assert set(core.names) == set(CORE)
    q = core.fit.estimates["quadratic_drag.q"]
    assert abs(q.value - 0.02) < 4 * q.stderr
    assert best.names == prune_effects(state, core).names == ("quadratic_drag",)
    assert state.chance(state.base, best) < state.thresholds.chance < state.chance(best, core)
    # A model that loses on held-out records is refused.
    assert state.keeps_hold_out(state.base, best)
    assert not state.keeps_hold_out(best, state.base)


def test_no_effect_is_accepted_that_noise_explains() -> None:
    state, core = state_of(decay(2.2, drag=0.0))
    assert search(state, core).chosen == ()
    # Thresholds that accept everything accept the best candidate.
    lax = Thresholds(chance=2.0, alike=0.0, closes=0.0, loss=math.inf)
    assert search(State(state.records, state.base, lax, 1, CORE), None).chosen != ()


def test_a_diagnosis_whose_fit_does_not_converge_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def stopped(*given: Any, **named: Any) -> TrajectoryFit:  # noqa: ANN401 (of fit_runs)
        # Each search lowers the sum of squares by a half, and stops.
        fit, before = fit_runs(*given, **named), chi2[0]
        chi2[0] = before / 2
        return dataclasses.replace(fit, converged=False, chi2=before)

    chi2 = [1e9]
    monkeypatch.setattr("pendmap.diagnosis.fitted_model.fit_runs", stopped)
    with pytest.raises(InputError, match="must converge, got one whose sum"):
        diagnose(decay(2.2), max_effects=0)


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


def test_an_effect_outside_the_library_shows_in_the_residuals() -> None:
    result, _ = diagnosed("encoder_gain", size=3.0, free=3, forced=0, without=("encoder_gain",))
    assert result.verdict in {"unknown", "partial"}
    assert result.assessment.form.chance < CHANCE


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
    result = judged(state, best)
    assert result.closed > 0.5
    assert result.verdict == verdict


def test_what_is_left_within_a_few_percent_of_the_noise_is_no_gap(
    waving: tuple[State, ScoredModel], monkeypatch: pytest.MonkeyPatch
) -> None:
    state, best = waving
    state.thresholds = Thresholds()
    assert judged(state, best).verdict == "partial"
    monkeypatch.setattr("pendmap.diagnosis.verdict.WHOLE", 0.5)
    assert judged(state, best).verdict == "partial"
    monkeypatch.setattr("pendmap.diagnosis.verdict.SLIGHT", 5.0)
    assert judged(state, best).verdict in {"named", "ambiguous"}


@pytest.mark.parametrize(("scale", "reserve"), [(1.0, False), (1.0009, True)])
def test_a_slight_gap_that_one_effect_would_close_gives_a_reserve(
    scale: float, *, reserve: bool
) -> None:
    clean, run = decay(2.2, 0 * NOISE), decay(2.2)
    result = diagnose(dataclasses.replace(run, theta=scale * clean.theta + NOISE), max_effects=1)
    assert result.verdict == "named"
    assert (result.assessment.form.chances["effects"] < CHANCE) is reserve
    assert [effect.approximate for effect in result.effects] == [reserve]


def test_a_model_is_evaluated_on_held_out_records_without_further_fits(
    dragged: tuple[State, FittedModel, FittedModel], monkeypatch: pytest.MonkeyPatch
) -> None:
    state, _, best = dragged
    again = State(state.data, state.base, Thresholds(), 3, ())
    monkeypatch.delattr("pendmap.diagnosis.state.hold_out_losses")
    assert again.scored(best).hold_out.degrees > 0


def test_half_of_the_gap_is_that_of_all_records_together() -> None:
    def judge(fitted: float, held: float) -> bool:
        def model(rms: float, other: float) -> Any:  # noqa: ANN401 (a stub)
            fit, out = (SimpleNamespace(samples=n, rms=x) for n, x in ((800, rms), (200, other)))
            return SimpleNamespace(fit=fit, out=SimpleNamespace(fit=out))

        held_back = (SimpleNamespace(sigmas=np.zeros(1), counted=np.ones(1, bool), count=None),)
        state: Any = SimpleNamespace(
            hold_out=lambda m: m.out,
            noise=0.0,
            records=SimpleNamespace(held=held_back),
            thresholds=Thresholds(),
        )
        less, full = model(1.0, 1.0), model(math.sqrt(1 - fitted), math.sqrt(1 - held))
        return State._halves_gap(state, less, full)  # noqa: SLF001 (the rule)

    assert judge(0.51, 0.51)
    assert judge(0.6, 0.4)
    assert not judge(0.6, 0.3)
    assert not judge(0.5, 0.4)


@pytest.mark.parametrize(
    ("stated", "correlation", "verdict"),
    [(1.0, 0.0, "none"), (0.7, 0.0, "unknown"), (1.0, 0.6, "none")],
)
def test_none_is_said_within_the_noise_only(
    stated: float, correlation: float, verdict: str
) -> None:
    # White residuals above the stated noise are not noise; coloured noise exceeds its local fits.
    noise = lfilter([math.sqrt(1 - correlation**2)], [1, -correlation], NOISE[:1000])
    data = split_records(Experiment(Path("there"), (decay(2.2, noise, drag=0.0),)))
    fitted = tuple(dataclasses.replace(r, sigma=stated * r.sigmas) for r in data.fitted)
    data = dataclasses.replace(data, fitted=fitted)
    state = State(data, fit_baseline(data)[0], Thresholds(), 0, ())
    result = judged(state, state.scored(search(state, None)))
    assert result.verdict == verdict
    assert (result.ratio <= result.ratio_allowed) is (verdict == "none")


def test_the_share_of_the_gap_is_one_number() -> None:
    result = once("quadratic_drag", seed=3, size=3.0, free=1, forced=0, max_effects=1)
    fields, gap = as_json(result), result.gap
    left, before = (x**2 - gap.noise_floor**2 for x in (gap.after, gap.before))
    closed = result.assessment.closed
    assert closed == pytest.approx(min(1.0, 1 - left / before), rel=1e-9)
    assert fields["gap"]["closed"] == fields["gap"]["closed_by_nearest"] == closed
    assert [effect["closes"] for effect in fields["effects"]] == [closed]
    assert f"Share of the squared gap closed: {100 * closed:.0f} %" in list(as_text(result))
    assert share_closed(2.0, 1.0, 1.0) == share_closed(0.9, 0.8, 1.0) == 1.0
    assert share_closed(0.9, 1.1, 1.0) == 0.0


def test_an_effect_whose_interval_contains_0_is_no_name(monkeypatch: pytest.MonkeyPatch) -> None:
    module = importlib.import_module("pendmap.diagnosis.diagnose")
    named, shown = module.name_effects, []

    def widened(*given: object) -> tuple[NamedEffect, ...]:
        shown.extend(named(*given))
        wide = [dict.fromkeys(effect.ci95, (-1.0, 1.0)) for effect in shown]
        return tuple(dataclasses.replace(e, ci95=w) for e, w in zip(shown, wide, strict=True))

    monkeypatch.setattr(module, "name_effects", widened)
    result = pendmap.diagnose(decay(2.2, NOISE[:600], drag=0.05), max_effects=1)
    assert shown
    assert result.effects == ()
    assert result.verdict == "unknown"


@pytest.mark.parametrize(
    ("rivals", "share", "equivalent"),
    [
        ({}, 1.0, ""),
        # An effect with the name as a special case takes no share.
        ({"power_law_drag": (0.0, True)}, 1.0, ""),
        ({"cubic_damping": (0.0, True)}, 0.5, "cubic_damping"),
        (
            {"cubic_damping": (0.0, True), "power_law_drag": (0.0, True)},
            0.5,
            "cubic_damping power_law_drag",
        ),
        ({"cubic_damping": (6.0, True)}, 1 / (1 + math.exp(-3)), "cubic_damping"),
        # An alternative that one run alone excludes is equivalent.
        ({"cubic_damping": (30.0, True)}, 1.0, "cubic_damping"),
    ],
)
def test_an_alternative_as_good_takes_a_share(
    rivals: dict[str, tuple[float, bool]], share: float, equivalent: str
) -> None:
    named = {c.name: c for c, *_ in list_candidates((), driven=False)}
    alternatives = tuple(
        Alternative(
            named[name],
            500.0 - behind,
            behind,
            behind / 500.0,
            refitted=True,
            contains=name == "power_law_drag",
            alike=alike,
        )
        for name, (behind, alike) in rivals.items()
    )
    drag = Identifiability(named["quadratic_drag"], 500.0, 1.0, alternatives)
    assert drag.share == pytest.approx(share, abs=1e-6)
    assert drag.equivalent == ["quadratic_drag", *equivalent.split()]


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


# Advice on the next record, detection limits, effects that records do not distinguish.


def test_equally_good_names_are_listed_with_what_reveals_them() -> None:
    result = once("bias_torque", seed=6, size=0.3, free=2, forced=0)
    assert result.verdict == "ambiguous"
    # Names that share their probability have the reserve of the number that is printed.
    assert all(e.approximate is (round(e.probability, 3) < SURE) for e in result.effects)
    text = result.advice.next_experiment
    assert text is not None
    assert text.startswith("To distinguish equally good names, record what reveals bias_torque (")
    (names,) = result.equivalent
    assert {"bias_torque", "asymmetric_coulomb"} <= set(names)
    for name in ("bias_torque", "asymmetric_coulomb"):
        assert f"{name} ({result.definition(name).revealed_by})" in text


def test_where_nothing_is_missing_limits_are_lowered() -> None:
    result = once("none", seed=5, free=1, forced=0)
    assert result.verdict == "none"
    limits = result.advice.limits
    unseen = sum(limit.size == math.inf for limit in limits.values())
    assert f"{unseen} effects cannot be detected in such" in str(result.advice.next_experiment)
    # A free decay does not show an added mass; its range of angle has no harmonic of one a turn.
    assert limits["added_mass"].size == math.inf
    assert limits["bearing_harmonic"].candidate.shape["n"] > 1
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


def test_a_limit_is_passed_in_95_of_100() -> None:
    """The probability is compared with sums of squares of normal draws about the expected gain."""
    rng = np.random.default_rng(1)
    mean = np.array([math.sqrt(required_gain(22.0, 2)), 0.0])
    gains = np.sum((mean + rng.standard_normal((200_000, 2))) ** 2, axis=1)
    assert np.mean(gains > 22.0) == pytest.approx(0.95, abs=0.002)


@pytest.mark.thorough
def test_an_effect_of_the_size_of_its_limit_is_found() -> None:
    """The limit follows from records without an effect; the same rig then has one of that size."""
    given = {"seed": 11, "free": 2, "forced": 0, "noise": 0.2}
    limit = once(**given).advice.limits["encoder_gain"].size
    for size, seen in ((limit, True), (-limit, True), (limit / 4, False)):
        verdict = once(f"encoder_gain,e={size:.6g}", **given).verdict
        assert (verdict != "none") is seen


@functools.cache
def baseline(forced: int) -> tuple[DataSplit, FittedModel]:
    """Return the records of an experiment without hidden effects, and its baseline."""
    data = split_records(recorded(seed=4, free=2, forced=forced)[0])
    return data, fit_baseline(data)[0]


def scored(names: list[str | Candidate], *, forced: int) -> Scores:
    pool = [[Candidate(n) if isinstance(n, str) else n] for n in names]
    return score_candidates(*baseline(forced), pool)


@pytest.mark.parametrize(
    ("one", "other", "forced"),
    [
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
        ("asymmetric_coulomb", "asymmetric_viscous"),
    ],
)
def test_effects_that_differ_under_a_drive_are_distinguished(one: str, other: str) -> None:
    assert scored([one, other], forced=2).likeness(0, 1) < 0.99


def test_an_effect_that_a_free_decay_does_not_show_gains_nothing() -> None:
    for score in scored(["added_mass", "sensor_lag"], forced=0).scores:
        assert score.gain == score.information == 0
