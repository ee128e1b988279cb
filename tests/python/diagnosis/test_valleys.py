"""Experiments with local minima: a mirrored position, a lost window, a curved valley.

Earlier versions named another effect, or had errors of many standard errors.
"""

from __future__ import annotations

from typing import Any

import pytest

from hidden import diagnosed
from pendmap.diagnosis import Thresholds
from pendmap.diagnosis.verdict import probabilities

CHANCE = Thresholds().rest

MIXED, FREE = {"free": 5, "forced": 4}, {"free": 5, "forced": 0}


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("effects", "given"),
    [
        # Load-dependent friction compensated for the wrong side.
        (
            ["rough_spot"],
            MIXED | {"seed": 1970971373, "size": 0.971, "noise": 0.208, "counts": 4096},
        ),
        # A power of 3.004 replaced the cube.
        (
            ["cubic_damping"],
            MIXED
            | {
                "seed": 923496461,
                "size": 0.6991996159060826,
                "noise": 0.11338333801751667,
                "counts": 2048,
                "rate": 500.0,
            },
        ),
        # A drift of size 0 was kept, as the fit without it diverged.
        (
            ["viscous_warm_up"],
            FREE
            | {
                "seed": 2109818056,
                "size": 0.35135879395833886,
                "noise": 0.16737536993889454,
                "counts": 2048,
                "rate": 500.0,
            },
        ),
        # The estimate was off by 17 standard errors along the valley of size and width.
        (
            ["stribeck_friction"],
            MIXED
            | {
                "seed": 1697828228,
                "size": 0.30958802710356986,
                "noise": 0.14649654326659584,
                "counts": 8192,
            },
        ),
    ],
    ids=["side", "power", "idle", "width"],
)
def test_a_hidden_effect_is_named_alone_with_its_parameters(
    effects: list[str], given: dict[str, Any]
) -> None:
    found, truth = diagnosed(*effects, **given)
    assert found.verdict == "named"
    assert sorted(effect.name for effect in found.effects) == sorted(effects)
    for effect in found.effects:
        for name, (low, high) in effect.ci95.items():
            # Within four standard errors.
            error = (high - low) / 3.92
            true = truth[effect.name][name]
            assert low - 2.1 * error < true < high + 2.1 * error, (effect.name, name)


@pytest.mark.thorough
def test_an_effect_is_named_although_a_fit_loses_the_end_of_a_run() -> None:
    # The drift was named a warm-up of 180 years: its fit had lost the end of a run.
    found, _ = diagnosed(
        "viscous_drift",
        "rough_spot",
        seed=1006634931,
        size=0.8111507497987244,
        noise=0.21590349695667901,
        counts=8192,
        **MIXED,
    )
    assert sorted(effect.name for effect in found.effects) == ["rough_spot", "viscous_drift"]


@pytest.mark.thorough
def test_held_out_runs_with_little_information_reject_no_effect() -> None:
    # The phases fitted to the held-out runs absorb the error of the frequency there.
    found, _ = diagnosed(
        "drive_frequency",
        seed=605362845,
        size=0.46370751706754837,
        noise=0.06575130601676935,
        counts=4096,
        **MIXED,
    )
    assert found.verdict == "ambiguous"
    (classed,) = found.equivalent
    assert {"drive_frequency", "timebase"} <= set(classed)


@pytest.mark.thorough
def test_a_name_that_does_not_predict_the_held_out_run_is_given_with_reserve() -> None:
    # One drift explains the fitted runs; the held-out run has chi^2/N = 1.9.
    found, _ = diagnosed(
        "viscous_drift",
        "viscous_warm_up",
        seed=673542390,
        size=1.176445072606374,
        noise=0.088696557283522,
        counts=2048,
        **FREE,
    )
    assert found.assessment.ratio <= found.assessment.ratio_allowed
    assert found.assessment.ratio_held > 1.3
    assert found.verdict in {"partial", "unknown"}
    assert found.assessment.form.chances["held_out"] < CHANCE
    assert all(effect.approximate for effect in found.effects)
    gains = [each.gain for each in found.assessment.identified]
    pairs = zip(found.assessment.probabilities, probabilities(1.0, gains), strict=True)
    assert all(sure < otherwise for sure, otherwise in pairs)


@pytest.mark.thorough
def test_an_effect_of_size_0_is_dropped_although_the_fit_without_it_slipped() -> None:
    # The drag was found first with a slipped window; a bearing harmonic of size 0 led out of that
    # minimum and was named.
    found, truth = diagnosed("quadratic_drag", seed=4, noise=0.1, counts=4096, rate=124.0, **MIXED)
    assert [effect.name for effect in found.effects] == ["quadratic_drag"]
    (effect,) = found.effects
    low, high = effect.ci95["q"]
    assert low < truth["quadratic_drag"]["q"] < high
