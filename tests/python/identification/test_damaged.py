"""Damaged records: every method returns a result or raises an error of one line."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from decays import decay, record
from pendmap import InputError
from pendmap.identification import find_peaks, table1
from pendmap.identification.methods.registry import identify_record
from pendmap.identification.methods.start import starting_values

if TYPE_CHECKING:
    from collections.abc import Callable

    from decays import Floats

    Damage = Callable[[Floats, Floats, np.random.Generator], tuple[Floats, Floats]]

PENDULUMS = [
    decay(),
    decay(c_over_m=1.5, tr=0.5, release=2.5),
    decay(c_over_m=0.3, tr=3.0, release=1.5),
    decay(c_over_m=8.0, tr=0.1, release=1.0, until=10.0),
    decay(release=0.05, tr=0.01, until=30.0),
]


def lose(time: Floats, angle: Floats, lost: np.ndarray) -> tuple[Floats, Floats]:
    """Remove samples."""
    return time[~lost], angle[~lost]


DAMAGES: dict[str, Damage] = {
    "none": lambda t, x, _: (t, x),
    "backwards": lambda t, x, _: (t, x[::-1].copy()),
    "clipped": lambda t, x, _: (t, np.clip(x, -1.3, 0.8)),
    "degrees taken for radians": lambda t, x, _: (t, np.degrees(x)),
    "radians taken for degrees": lambda t, x, _: (t, np.radians(x)),
    "turned round": lambda t, x, _: (t, -x),
    "two releases": lambda t, x, _: (t, np.roll(x, x.size // 2)),
    "jitter": lambda t, x, rng: (t + np.sort(rng.uniform(0, 3e-3, t.size)), x),
    "lost": lambda t, x, rng: lose(t, x, rng.random(t.size) < 0.4),
    "false": lambda t, x, rng: (t, np.where(rng.random(t.size) < 0.05, x + 1.7, x)),
    "some turns away": lambda t, x, _: (t, x - 2 * math.tau),
    "constant": lambda t, x, _: (t, np.full_like(x, 0.3)),
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", DAMAGES)
def test_a_damaged_record_gives_a_result_or_an_error_of_one_line(name: str) -> None:
    rng = np.random.default_rng(len(name))
    for k, made in enumerate(PENDULUMS):
        seconds, rate = float(rng.choice([0.5, 2, 20, 60])), float(rng.choice([10, 30, 100]))
        counts = int(rng.choice([0, 64, 4096]))
        clean = record(made, seconds=seconds, rate=rate, counts=counts, noise_deg=0.3, seed=k)
        time, angle = DAMAGES[name](*clean, rng)
        found = identify_record(time, angle)
        for each in found.values():
            assert each.applicable or each.warnings
            assert all(math.isfinite(e.value) for e in each.estimates.values())
        for errors in table1(time, angle, found).errors.values():
            assert errors.peak.size == errors.peak_error.size
        try:
            start = starting_values(time, angle)
        except InputError as error:
            assert "\n" not in str(error)  # noqa: PT017 (either outcome is valid)
        else:
            assert start["w0"] > 0


def test_no_peak_exceeds_the_readings() -> None:
    # Interpolated samples have no noise, and kinks at the readings.
    time, angle = record(PENDULUMS[0], seconds=84, counts=4096, noise_deg=0.1)
    dense = np.arange(time[0], time[-1], 2e-4)
    found = find_peaks(dense, np.interp(dense, time, angle))
    assert len(found) > 0
    assert np.abs(found.amplitude).max() < 1.01 * np.abs(angle).max()
