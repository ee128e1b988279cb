"""With how much reserve a name is given."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from hidden import diagnosed
from pendmap.discrepancy.calibration import complete
from pendmap.discrepancy.noise import remainder_of
from pendmap.discrepancy.verdict import CHANCE, SURE
from pendmap.identification.runs import FitRun

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


@pytest.mark.parametrize("swell", [1.0, 1.15])
def test_slow_residuals_have_the_chance_that_noise_gives_them(swell: float) -> None:
    # Noise about swings whose initial states were fitted, in one run stronger than is stated.
    rng = np.random.default_rng(2)
    chances = []
    for _ in range(200):
        noise = rng.standard_normal((4, SAMPLES)) * np.array([swell, 1.0, 1.0, 1.0])[:, None]
        chances.append(_chance(noise - noise @ SWING.T @ SWING))
    assert np.mean(np.array(chances) < 0.1) < 0.18  # two standard errors above a tenth and more
    assert np.mean(np.array(chances) < 0.5) > 0.2
    assert min(chances) > CHANCE
    assert _chance(noise + 0.25 * np.sqrt(SAMPLES) * SWING[0]) < CHANCE


SAMPLES, INTERVAL, W0 = 800, 0.02, 6.0
_WAVES = np.exp(1j * W0 * INTERVAL * np.arange(SAMPLES))
SWING = np.linalg.qr(np.column_stack([_WAVES.real, _WAVES.imag]))[0].T


def _chance(residuals: np.ndarray) -> float:
    runs = [FitRun(INTERVAL * np.arange(SAMPLES), np.zeros(SAMPLES), 1.0) for _ in residuals]
    curve = np.vstack([np.zeros(SAMPLES), np.full(SAMPLES, W0)])
    fit = SimpleNamespace(
        white=residuals,
        curves=[curve] * len(runs),
        windows=[(k, 0, SAMPLES, 0.0, 0.0) for k in range(len(runs))],
        estimates={},
        model=pendmap.Rig(w0=W0),
    )
    return remainder_of(fit, runs, 0).chance  # type: ignore[arg-type]
