"""``diagnose`` on experiments whose hidden effects it cannot read."""

from __future__ import annotations

import pytest

from hidden import diagnosed, recorded
from pendmap import InputError
from pendmap.diagnosis import diagnose
from pendmap.identification.fit import fit_runs


def _names(found: object) -> set[str]:
    """Return the named effects and their equivalents."""
    effects = {effect.name for effect in found.effects}  # type: ignore[attr-defined]
    return effects | {name for names in found.equivalent for name in names}  # type: ignore[attr-defined]


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
    found, truth = diagnosed(effect)
    assert found.verdict == "named"
    assert [e.name for e in found.effects] == [effect]
    named = found.effects[0]
    low, high = named.ci95[parameter]
    wide = high - low
    assert low - wide < truth[effect][parameter] < high + wide
    assert named.probability > 0.9
    assert not named.approximate
    gap = found.gap
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
    # The scan has about a thousand frequencies or instants.
    found, truth = diagnosed(effect, seed=seed)
    assert found.verdict == "named"
    (named,) = found.effects
    assert named.name == effect
    for parameter, value in truth[effect].items():
        low, high = named.ci95[parameter]
        assert 1.5 * low - 0.5 * high < value < 1.5 * high - 0.5 * low
    low, high = named.ci95[time]
    assert high - low < 0.01 * truth[effect][time]


@pytest.mark.thorough
def test_the_drag_is_named_in_correlated_noise() -> None:
    found, truth = diagnosed(
        "quadratic_drag", free=3, forced=0, size=3.0, correlation=0.8, noise=0.1
    )
    assert "quadratic_drag" in _names(found)
    assert found.verdict in {"named", "ambiguous"}
    low, high = next(e.ci95["q"] for e in found.effects if e.name == "quadratic_drag")
    wide = high - low
    assert low - wide < truth["quadratic_drag"]["q"] < high + wide


@pytest.mark.thorough
def test_a_search_that_drops_accepted_effects_ends() -> None:
    # The search accepts friction alone; drag in its place gains too little.
    found, _ = diagnosed("quadratic_drag", free=1, forced=0, size=3.0, correlation=0.8, noise=0.1)
    assert len(found.attempts) < 50


def test_a_chirp_of_the_only_forced_run_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    lost: list[InputError] = []

    def watched(*given: object, **named: object) -> object:
        try:
            return fit_runs(*given, **named)  # type: ignore[arg-type]
        except InputError as error:
            lost.append(error)
            raise

    for module in ("fitted_model", "hold_out"):
        monkeypatch.setattr(f"pendmap.diagnosis.{module}.fit_runs", watched)
    found = diagnose(recorded("drive_chirp", size=4.0, free=4, forced=1)[0])
    assert "drive_chirp" in _names(found)
    # No fit was refused for an error in the records.
    assert [str(error) for error in lost if "range of numbers" not in str(error)] == []


@pytest.mark.thorough
def test_a_friction_that_sticks_is_named_or_equivalent() -> None:
    found, _ = diagnosed("stribeck_friction", noise=0.05, size=2.0)
    assert found.verdict in {"named", "ambiguous"}
    assert "stribeck_friction" in _names(found)


def test_both_effects_of_a_pair_are_named() -> None:
    found, truth = diagnosed("quadratic_drag", "bearing_harmonic", noise=0.1)
    assert set(truth) == {"quadratic_drag", "bearing_harmonic"}
    assert found.verdict == "named"
    assert {e.name for e in found.effects} == set(truth)


@pytest.mark.parametrize("seed", [3, pytest.param(4, marks=pytest.mark.thorough)])
def test_without_a_hidden_effect_none_is_claimed(seed: int) -> None:
    found, _ = diagnosed(seed=seed)
    assert found.verdict == "none"
    assert found.effects == ()
    assert found.gap.before == found.gap.after < 1.05 * found.gap.noise_floor


@pytest.mark.thorough
def test_a_run_that_begins_at_rest_is_followed_from_rest() -> None:
    # Friction holds the driven pendulum at first. A fit that starts from a moving state does not
    # converge to rest.
    found, _ = diagnosed(seed=97505873, noise=0.16727603822191536, counts=8192)
    assert found.verdict == "none"


@pytest.mark.thorough
def test_a_withheld_effect_gets_no_confident_name() -> None:
    found, _ = diagnosed("bearing_harmonic", size=3.0, without=("bearing_harmonic",))
    assert found.verdict in {"unknown", "partial"}
    assert found.verdict == "unknown" or all(effect.approximate for effect in found.effects)


@pytest.mark.thorough
def test_an_effect_outside_the_library_is_named_with_reserve_at_most() -> None:
    found, _ = diagnosed("base_sway", seed=1, without=("base_sway", "impulses"))
    assert found.verdict in {"unknown", "partial"}
    assert all(effect.approximate for effect in found.effects)
    assert found.assessment.form.chance < 1e-3
    # The best model has no effects other than those claimed.
    assert set(found.best.fitted.names) - {"encoder_offset"} <= {e.name for e in found.effects}


@pytest.mark.thorough
def test_an_effect_is_found_whose_full_first_step_diverges() -> None:
    # The runs amplify each step of the fit a thousandfold.
    found, _ = diagnosed(
        *("asymmetric_viscous", "drive_frequency"),
        seed=2136559900,
        size=0.12462361682953052,
        noise=0.12285742100008451,
    )
    assert found.verdict != "unknown"
    assert "asymmetric_viscous" in _names(found)
    assert found.best.hold_out.chi2 < found.base.hold_out.chi2


@pytest.mark.thorough
@pytest.mark.parametrize("most", [0, 1])
def test_at_most_the_allowed_number_of_effects_is_added(most: int) -> None:
    # One effect of the pair explains only a part: the search also tries pairs.
    pair = ("quadratic_drag", "bearing_harmonic")
    given = {"size": 4.0, "noise": 0.1, "free": 3, "forced": 0}
    found, _ = diagnosed(*pair, seed=1, max_effects=most, **given)
    counted = [name for name in found.nearest.fitted.names if name != "encoder_offset"]
    assert len(counted) <= most
    if not most:
        # The zero of the sensor is not an added effect.
        assert found.best.fitted.chosen == ()
        assert found.best is found.base
        assert found.attempts == ()
        assert found.effects == ()
        assert found.verdict == "unknown"
