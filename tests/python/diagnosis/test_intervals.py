"""Intervals of shape parameters; parameters whose mirrored value fits equally well."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import pytest

from hidden import diagnosed
from pendmap.diagnosis.fitted_model import fit_model
from pendmap.diagnosis.refit import try_mirrored_places

if TYPE_CHECKING:
    from pendmap.diagnosis import Discrepancy
    from pendmap.diagnosis.fitted_model import FittedModel


def _from(found: Discrepancy, key: str, value: float, *, held: bool) -> FittedModel:
    """Return the model fitted from another value of a parameter, which may be held fixed."""
    fitted = found.best.fitted
    effect, parameter = key.split(".")
    model = fitted.fit.model
    effects = tuple(
        dataclasses.replace(e, parameters={**e.parameters, parameter: value})
        if e.name == effect
        else e
        for e in model.effects
    )
    return fit_model(
        found.data,
        dataclasses.replace(model, effects=effects),
        [name for name in fitted.free if name != key or not held],
        fitted.chosen,
        start={n: v for n, v in fitted.start.items() if n != key} | ({} if held else {key: value}),
        windows=fitted.fit.windows,
        steps=100,
    )


def _risen(found: Discrepancy, key: str, value: float) -> float:
    """Return the increase of the least sum of squares with a parameter fixed, over the noise."""
    fitted = found.best.fitted
    return (_from(found, key, value, held=True).chi2 - fitted.chi2) / fitted.widening


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("effect", "shape", "seed", "noise"),
    [
        ("magnet", "width", 5, 0.2),
        ("viscous_warm_up", "tau", 5, 0.1),
        ("rough_spot", "w", 3, 0.2),
    ],
)
def test_at_the_ends_of_an_interval_the_likelihood_has_fallen(
    effect: str, shape: str, seed: int, noise: float
) -> None:
    found, truth = diagnosed(effect, forced=0, size=0.3, seed=seed, noise=noise)
    (named,) = found.effects
    assert named.name == effect
    low, high = named.ci95[shape]
    assert low < named.parameters[shape] < high
    for end in (low, high):
        assert _risen(found, f"{effect}.{shape}", end) == pytest.approx(3.84, rel=0.1)
    wide = high - low
    assert low - wide < truth[effect][shape] < high + wide


@pytest.mark.thorough
def test_a_place_that_may_be_on_either_side_is_given_twice() -> None:
    found, truth = diagnosed("rough_spot", forced=0, size=0.3, seed=5)
    (named,) = found.effects
    assert named.name == "rough_spot"
    there, other = named.parameters["th0"], named.elsewhere["th0"]
    assert there * other < 0
    th0 = truth["rough_spot"]["th0"]
    error = found.best.fitted.fit.estimates["rough_spot.th0"].stderr
    assert min(abs(there - th0), abs(other - th0)) < 3 * error


@pytest.mark.thorough
def test_a_place_on_a_known_side_is_given_once() -> None:
    found, truth = diagnosed("rough_spot", size=1.0)
    (named,) = found.effects
    assert named.elsewhere == {}
    assert named.parameters["th0"] * truth["rough_spot"]["th0"] > 0
    # A fit that starts on the other side stays there unless mirrored places are tried.
    key, best = "rough_spot.th0", found.best.fitted
    astray = _from(found, key, -named.parameters["th0"], held=False)
    assert astray.chi2 > best.chi2 + 20
    assert astray.fit[key] * named.parameters["th0"] < 0
    back = try_mirrored_places(found.data, astray)
    assert back.chi2 == pytest.approx(best.chi2, abs=0.5)
    assert back.fit[key] == pytest.approx(named.parameters["th0"], rel=1e-2)
    assert try_mirrored_places(found.data, best) is best
