"""With how much reserve a name is given."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest

import pendmap
from hidden import diagnosed
from pendmap.diagnosis.alternatives import SPECIAL, Rival, Standing
from pendmap.diagnosis.calibration import complete
from pendmap.diagnosis.candidates import candidates
from pendmap.diagnosis.fitted_model import ALIKE
from pendmap.diagnosis.verdict import CHANCE, SURE, closes_most

if TYPE_CHECKING:
    from pathlib import Path


def test_probability_falls_with_what_is_left_and_with_how_many_effects_it_took() -> None:
    by_chance = [complete(chance, [500.0]) for chance in (1.0, 0.1, 1e-2, 1e-3)]
    assert by_chance == sorted(by_chance, reverse=True)
    assert by_chance[0] > SURE > by_chance[-1]
    by_count = [complete(0.5, [500.0] * count) for count in (1, 2, 3)]
    assert by_count == sorted(by_count, reverse=True)
    # One that mops up what a stronger one of the wrong form leaves.
    assert complete(0.5, [2000.0, 1500.0]) > complete(0.5, [2000.0, 20.0])
    assert complete(0.0, [1e300, 0.0]) > 0


def test_nothing_left_is_chance(tmp_path: Path) -> None:
    found, _ = diagnosed(tmp_path, free=3, forced=0)
    assert found.verdict == "none"
    assert found.judgement.form.chance > CHANCE
    assert all(0 <= chance <= 1 for chance in found.judgement.form.chances.values())


def test_a_form_that_the_library_lacks_shows_in_what_is_left(tmp_path: Path) -> None:
    found, _ = diagnosed(
        tmp_path, "encoder_gain", size=3.0, free=3, forced=0, without=("encoder_gain",)
    )
    assert found.verdict in {"unknown", "partial"}
    assert found.judgement.form.chance < CHANCE


@pytest.mark.parametrize("seed", [3, 5])
def test_what_two_others_do_together_is_given_with_reserve(seed: int, tmp_path: Path) -> None:
    # With its whole family taken out, two frictions do what a drag does, to within the noise.
    own = [effect.name for effect in pendmap.effects() if effect.family == "damping"]
    found, _ = diagnosed(
        tmp_path, "quadratic_drag", seed=seed, size=3.0, free=3, forced=0, without=own
    )
    assert found.effects == () or all(effect.approximate for effect in found.effects)
    assert all(effect.probability < SURE for effect in found.effects)


@pytest.mark.parametrize(
    ("gains", "closed", "spread", "clear"),
    [
        # One does it nearly alone.
        ([5000.0], 0.92, 0.2, True),
        ([5000.0], 0.85, 0.0, False),
        ([5000.0], 0.99, 0.4, False),
        ([5000.0, 400.0], 0.92, 0.2, True),
        # Several share it, well or not.
        ([5000.0, 1500.0], 0.97, 0.05, True),
        ([5000.0, 1500.0], 0.92, 0.05, False),
        ([5000.0, 1500.0], 0.97, 0.2, False),
        ([5000.0, 3000.0], 0.99, 0.0, False),
        # Without one of them there is no motion to speak of.
        ([math.inf], 0.99, 0.0, True),
        ([math.inf, 5000.0], 0.99, 0.0, False),
    ],
)
def test_what_is_partial(gains: list[float], closed: float, spread: float, clear: bool) -> None:  # noqa: FBT001 (a table)
    drag = next(c for c, *_ in candidates((), driven=False) if c.name == "quadratic_drag")
    standings = [Standing(drag, gain, ()) for gain in gains]
    assert closes_most(standings, closed, spread, rest=True) is clear
    # Where nothing is left beside it, one alone in doubt is not claimed, nor are several.
    little = 0 < sum(sorted(gains)[:-1]) < 0.1 * max(gains) < math.inf
    assert closes_most(standings, closed, spread, rest=False) is (clear and little)


def test_what_has_the_name_as_a_special_case_takes_its_share() -> None:
    named = {c.name: c for c, *_ in candidates((), driven=False)}

    def rival(name: str, behind: float, *, contains: bool) -> Rival:
        far = behind / 500.0
        return Rival(
            named[name],
            500.0 - behind,
            behind,
            far,
            1 - far,
            refitted=True,
            contains=contains,
            margin=ALIKE,
        )

    alone = Standing(named["quadratic_drag"], 500.0, ())
    assert alone.share == 1.0
    power = Standing(named["quadratic_drag"], 500.0, (rival("power_law_drag", 0.0, contains=True),))
    assert power.share == pytest.approx(1 / (1 + SPECIAL))
    assert power.equivalent == ["quadratic_drag"]
    cubic = Standing(named["quadratic_drag"], 500.0, (rival("cubic_damping", 0.0, contains=False),))
    assert cubic.share == 0.5
    assert cubic.equivalent == ["quadratic_drag", "cubic_damping"]
    far = Standing(named["quadratic_drag"], 500.0, (rival("power_law_drag", 30.0, contains=True),))
    assert far.share == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("seed", [34, 43])
def test_without_noise_nothing_is_made_of_what_the_arithmetic_leaves(
    seed: int, tmp_path: Path
) -> None:
    clean = {"seed": seed, "noise": 0.0, "counts": 0}
    nothing, _ = diagnosed(tmp_path, **clean)
    assert nothing.verdict == "none"
    assert nothing.gap.after < 1e-9
    drag, truth = diagnosed(tmp_path, "quadratic_drag", **clean)
    assert drag.verdict == "named"
    (effect,) = drag.effects
    assert effect.name == "quadratic_drag"
    assert effect.parameters["q"] == pytest.approx(truth["quadratic_drag"]["q"], rel=1e-5)
