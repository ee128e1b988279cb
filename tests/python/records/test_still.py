"""The noise of a sensor at rest, from the frequencies of the counts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pendmap.records.noise import noise_of
from pendmap.records.resolution import still_noise

COUNT = math.tau / 1024
TIME = np.arange(6000) / 100.0


def shown(noise: float, place: float, seed: int) -> np.ndarray:
    """Return readings of an angle ``place`` counts from a count, with noise in counts."""
    moved = place + noise * np.random.default_rng(seed).standard_normal(TIME.size)
    return COUNT * np.round(moved)


@pytest.mark.parametrize("noise", [0.07, 0.14, 0.28, 0.5])
def test_the_noise_does_not_depend_on_the_position_between_counts(noise: float) -> None:
    expected = COUNT * math.hypot(noise, 1 / math.sqrt(12))
    ratios = []
    for seed, place in enumerate(np.linspace(-0.5, 0.5, 9)):
        floor = noise_of(TIME, shown(noise, float(place), seed), count=COUNT)
        ratios.append(floor.sigma / expected)
    assert np.median(ratios) == pytest.approx(1, abs=0.05)
    assert np.abs(np.array(ratios) - 1).max() < 0.15


def test_three_counts_give_the_noise_to_a_few_percent() -> None:
    found = still_noise(shown(0.3, 0.1, 1), COUNT)
    assert found is not None
    expected = COUNT * math.hypot(0.3, 1 / math.sqrt(12))
    assert found[1] < 0.03 * expected
    assert abs(found[0] - expected) < 3 * found[1]


def test_one_count_alone_and_a_motion_show_no_noise() -> None:
    assert still_noise(np.zeros(500), COUNT) is None
    assert still_noise(COUNT * np.round(np.linspace(0, 3, 500)), COUNT) is None
