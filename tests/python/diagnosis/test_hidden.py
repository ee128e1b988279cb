"""``diagnose`` on experiments whose hidden effects it cannot read."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import pytest

import pendmap
from hidden import diagnosed, recorded
from pendmap.diagnosis import Thresholds
from pendmap.diagnosis.fitted_model import fit_model
from pendmap.diagnosis.verdict import probabilities

if TYPE_CHECKING:
    from pendmap.diagnosis import Discrepancy
    from pendmap.diagnosis.fitted_model import FittedModel

CHIRP = pendmap.Effect("drive_chirp", {"r": 1e-4})
RIG = pendmap.Rig(w0=6.2, c_over_m=0.05, Tr=0.08, p=0.1, Omega=10.0, effects=(CHIRP,))
MIXED, FREE = {"free": 5, "forced": 4}, {"free": 5, "forced": 0}
FAST = {"rate": 500.0}


def _names(result: Discrepancy) -> set[str]:
    effects = {effect.name for effect in result.effects}
    return effects | {name for names in result.equivalent for name in names}


@pytest.mark.parametrize(
    ("effect", "parameter"),
    [
        ("quadratic_drag", "q"),
        ("bearing_harmonic", "amplitude"),
        pytest.param("encoder_offset", "d", marks=pytest.mark.thorough),
        ("coulomb_drift", "r"),
    ],
)
def test_a_hidden_effect_is_named_with_its_size(effect: str, parameter: str) -> None:
    result, truth = diagnosed(effect)
    assert result.verdict == "named"
    assert [e.name for e in result.effects] == [effect]
    named = result.effects[0]
    low, high = named.ci95[parameter]
    wide = high - low
    assert low - wide < truth[effect][parameter] < high + wide
    assert named.probability > 0.9
    assert not named.approximate
    gap = result.gap
    assert gap.after < gap.before
    assert gap.held_out_after < gap.held_out_before
    assert gap.held_out_after < 1.05 * gap.noise_floor


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("effect", "seed", "time"), [("base_sway", 7, "ws"), ("impulses", 3, "t0")]
)
def test_an_instant_or_a_frequency_is_found_with_the_size(
    effect: str, seed: int, time: str
) -> None:
    result, truth = diagnosed(effect, seed=seed)
    assert result.verdict == "named"
    (named,) = result.effects
    assert named.name == effect
    for parameter, value in truth[effect].items():
        low, high = named.ci95[parameter]
        assert 1.5 * low - 0.5 * high < value < 1.5 * high - 0.5 * low
    low, high = named.ci95[time]
    assert high - low < 0.01 * truth[effect][time]


@pytest.mark.parametrize(
    ("effect", "given"),
    [
        ("drive_chirp", {"size": 4.0, "free": 4, "forced": 1}),
        # Friction that sticks.
        pytest.param("stribeck_friction", {"noise": 0.05, "size": 2.0}, marks=pytest.mark.thorough),
    ],
)
def test_a_hidden_effect_is_among_the_names(effect: str, given: dict[str, Any]) -> None:
    result, _ = diagnosed(effect, **given)
    assert result.verdict in {"named", "ambiguous"}
    assert effect in _names(result)


def test_both_effects_of_a_pair_are_named() -> None:
    result, truth = diagnosed("quadratic_drag", "bearing_harmonic", noise=0.1)
    assert result.verdict == "named"
    assert {e.name for e in result.effects} == set(truth) == {"quadratic_drag", "bearing_harmonic"}


@pytest.mark.parametrize(
    "given",
    [
        {"seed": 3},
        pytest.param({"seed": 4}, marks=pytest.mark.thorough),
        # Friction holds the driven pendulum at first: a run is followed from rest.
        pytest.param(
            {"seed": 97505873, "noise": 0.16727603822191536, "counts": 8192},
            marks=pytest.mark.thorough,
        ),
    ],
)
def test_without_a_hidden_effect_none_is_claimed(given: dict[str, Any]) -> None:
    result, _ = diagnosed(**given)
    assert result.verdict == "none"
    assert result.effects == ()
    assert result.gap.before == result.gap.after < 1.05 * result.gap.noise_floor


@pytest.mark.thorough
def test_an_effect_outside_the_library_is_named_with_reserve_at_most() -> None:
    result, _ = diagnosed("base_sway", seed=1, without=("base_sway", "impulses"))
    assert result.verdict in {"unknown", "partial"}
    assert all(effect.approximate for effect in result.effects)
    assert result.assessment.form.chance < 1e-3
    # The best model has no effects other than those claimed.
    assert set(result.best.fitted.names) - {"encoder_offset"} <= {e.name for e in result.effects}


@pytest.mark.thorough
def test_an_effect_is_found_whose_full_first_step_diverges() -> None:
    # The runs amplify each step of the fit a thousandfold.
    given = {"seed": 2136559900, "size": 0.12462361682953052, "noise": 0.12285742100008451}
    result, _ = diagnosed("asymmetric_viscous", "drive_frequency", **given)
    assert result.verdict != "unknown"
    assert "asymmetric_viscous" in _names(result)
    assert result.best.hold_out.chi2 < result.base.hold_out.chi2


@pytest.mark.thorough
def test_at_most_the_allowed_number_of_effects_is_added() -> None:
    # One effect of the pair explains only a part: the search also tries pairs.
    given = {"size": 4.0, "noise": 0.1, "free": 3, "forced": 0, "seed": 1}
    for most in (0, 1):
        result, _ = diagnosed("quadratic_drag", "bearing_harmonic", max_effects=most, **given)
        # The zero of the sensor is not an added effect.
        assert len(set(result.nearest.fitted.names) - {"encoder_offset"}) <= most
        assert (result.verdict == "unknown") or most


@pytest.mark.parametrize(
    ("free", "forced", "hidden", "held", "model"),
    [
        (2, 1, "drive_chirp", "", RIG),
        (1, 1, "drive_phase", "free", None),
        (1, 2, "lateral_drive", "forced", None),
        (0, 1, "drive_phase", "", None),
        (0, 3, "drive_phase", "", RIG),
        (1, 0, "quadratic_drag", "", RIG),
    ],
)
def test_any_mix_of_runs_is_diagnosed(
    free: int, forced: int, hidden: str, held: str, model: pendmap.Rig | None
) -> None:
    experiment, _ = recorded(hidden, seed=5, size=3.0, free=free, forced=forced, duration=8.0)
    runs = (dataclasses.replace(run, hold_out=run.kind == held) for run in experiment.runs)
    experiment = dataclasses.replace(experiment, runs=tuple(runs))
    result = pendmap.diagnose(experiment, max_effects=1, model=model)
    assert result.data.held
    # A drive that no fitted run has is no candidate; a fitted one is.
    known = {effect.name for effect in pendmap.effects() if effect.group == "drive"}
    ranked = known & {*result.ranking.index}
    assert bool(ranked) is any(run.drive for run in result.data.fitted)


# Local minima: earlier versions named another effect, or were off by many standard errors.


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("effect", "runs", "given"),
    [
        # Load-dependent friction compensated for the wrong side.
        ("rough_spot", MIXED, (1970971373, 0.971, 0.208, 4096)),
        # A power of 3.004 replaced the cube.
        ("cubic_damping", MIXED | FAST, (923496461, 0.6991996159060826, 0.11338333801751667, 2048)),
        # A drift of size 0 was kept, as the fit without it diverged.
        (
            "viscous_warm_up",
            FREE | FAST,
            (2109818056, 0.35135879395833886, 0.16737536993889454, 2048),
        ),
        # The estimate was off by 17 standard errors along the valley of size and width.
        ("stribeck_friction", MIXED, (1697828228, 0.30958802710356986, 0.14649654326659584, 8192)),
        # A slipped window led to a bearing harmonic of size 0, which was named.
        ("quadratic_drag", MIXED | {"rate": 124.0}, (4, 1.0, 0.1, 4096)),
    ],
    ids=["side", "power", "idle", "width", "slipped"],
)
def test_a_hidden_effect_is_named_alone_with_its_parameters(
    effect: str, runs: dict[str, Any], given: tuple[float, ...]
) -> None:
    choices = dict(zip(("seed", "size", "noise", "counts"), given, strict=True))
    result, truth = diagnosed(effect, **choices, **runs)
    assert result.verdict == "named"
    assert [named.name for named in result.effects] == [effect]
    for name, (low, high) in result.effects[0].ci95.items():
        # Within four standard errors.
        error = (high - low) / 3.92
        assert low - 2.1 * error < truth[effect][name] < high + 2.1 * error, name


@pytest.mark.thorough
def test_an_effect_is_named_although_a_fit_loses_the_end_of_a_run() -> None:
    # The drift was named a warm-up of 180 years: its fit had lost the end of a run.
    given = {"seed": 1006634931, "size": 0.8111507497987244, "noise": 0.21590349695667901}
    result, _ = diagnosed("viscous_drift", "rough_spot", counts=8192, **given, **MIXED)
    assert sorted(effect.name for effect in result.effects) == ["rough_spot", "viscous_drift"]


@pytest.mark.thorough
def test_held_out_runs_with_little_information_reject_no_effect() -> None:
    # The phases fitted to the held-out runs absorb the error of the frequency there.
    given = {"seed": 605362845, "size": 0.46370751706754837, "noise": 0.06575130601676935}
    result, _ = diagnosed("drive_frequency", counts=4096, **given, **MIXED)
    assert result.verdict == "ambiguous"
    (names,) = result.equivalent
    assert {"drive_frequency", "timebase"} <= set(names)


@pytest.mark.thorough
def test_a_name_that_does_not_predict_the_held_out_run_is_given_with_reserve() -> None:
    # One drift explains the fitted runs; the held-out run has chi^2/N = 1.9.
    given = {"seed": 673542390, "size": 1.176445072606374, "noise": 0.088696557283522}
    result, _ = diagnosed("viscous_drift", "viscous_warm_up", counts=2048, **given, **FREE)
    judged = result.assessment
    assert judged.ratio <= judged.ratio_allowed
    assert judged.ratio_held > 1.3
    assert result.verdict in {"partial", "unknown"}
    assert judged.form.chances["held_out"] < Thresholds().rest
    assert all(effect.approximate for effect in result.effects)
    gains = [effect.gain for effect in judged.identified]
    pairs = zip(judged.probabilities, probabilities(1.0, gains), strict=True)
    assert all(sure < otherwise for sure, otherwise in pairs)


# Intervals of shape parameters; places whose mirror image fits equally well.


def _held(result: Discrepancy, key: str, value: float) -> FittedModel:
    fitted = result.best.fitted
    name, parameter = key.split(".")
    model = fitted.fit.model
    (old,) = (e for e in model.effects if e.name == name)
    new = dataclasses.replace(old, parameters={**old.parameters, parameter: value})
    model = dataclasses.replace(model, effects=tuple(new if e is old else e for e in model.effects))
    start = {n: v for n, v in fitted.start.items() if n != key}
    free = [name for name in fitted.free if name != key]
    choices: dict[str, Any] = {"windows": fitted.fit.windows, "steps": 100}
    return fit_model(result.data, model, free, fitted.chosen, start=start, **choices)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("effect", "shape", "seed", "noise"),
    [("magnet", "width", 5, 0.2), ("viscous_warm_up", "tau", 5, 0.1), ("rough_spot", "w", 3, 0.2)],
)
def test_at_the_ends_of_an_interval_the_likelihood_has_fallen(
    effect: str, shape: str, seed: int, noise: float
) -> None:
    result, truth = diagnosed(effect, forced=0, size=0.3, seed=seed, noise=noise)
    (named,) = result.effects
    assert named.name == effect
    low, high = named.ci95[shape]
    assert low < named.parameters[shape] < high
    best = result.best.fitted
    for end in (low, high):
        risen = _held(result, f"{effect}.{shape}", end).chi2 - best.chi2
        assert risen / best.widening == pytest.approx(3.84, rel=0.1)
    wide = high - low
    assert low - wide < truth[effect][shape] < high + wide


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("given", "sides"), [({"forced": 0, "size": 0.3, "seed": 5}, 2), ({"size": 1.0}, 1)]
)
def test_a_place_that_may_be_on_either_side_is_given_twice(
    given: dict[str, Any], sides: int
) -> None:
    result, truth = diagnosed("rough_spot", **given)
    (named,) = result.effects
    places = [named.parameters["th0"], *named.elsewhere.values()]
    assert len(places) == sides
    assert sides == 1 or places[0] * places[1] < 0
    error = result.best.fitted.fit.estimates["rough_spot.th0"].stderr
    assert min(abs(place - truth["rough_spot"]["th0"]) for place in places) < 3 * error
