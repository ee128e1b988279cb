"""Records that begin while a hand holds the pendulum: no held reading is used for fitting."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from fits import trajectory_of
from recorded import W0, found, motion, noisy, read, text

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.records import Run

ANGLES = (0.3, 1.0, 1.3, 2.0, 2.8, 3.0)
HOLDS = (0.3, 0.7, 1.5, 5.0, 20.0)
LOST = 0.25
"""Free swing that may be lost, s."""


def held(folder: Path, angle: float, hold: float, degrees: float, seed: int) -> tuple[Run, int]:
    """Return the run of a pendulum held, then released at rest, and the index of the release."""
    free = motion(start=angle, duration=15.0)[1]
    count = round(100 * hold)
    noise, step = math.radians(degrees), (0.0, 2 * math.pi / 4096, 2 * math.pi / 1024)[seed % 3]
    theta = noisy(np.concatenate((np.full(count, angle), free)), noise, step, seed)
    return read(folder, text((np.arange(theta.size) / 100, theta))), count


@pytest.mark.parametrize("angle", ANGLES)
def test_the_end_of_a_hold_is_late_rather_than_early(tmp_path: Path, angle: float) -> None:
    for seed, (hold, degrees) in enumerate(itertools.product(HOLDS, (0.05, 0.2, 0.5))):
        run, release = held(tmp_path, angle, hold, degrees, seed)
        assert not run.trusted[:release].any(), (hold, degrees)
        first = int(np.argmax(run.trusted))
        assert run.time[first] - run.time[release] < LOST, (hold, degrees)
        assert f"used from {run.time[first]:.6g} s" in found(run)["held-start"].text


@pytest.mark.parametrize(("angle", "hold"), [(1.3, 1.5), (2.8, 0.4), (0.5, 12.0)])
def test_a_fit_after_a_hold_has_residuals_of_noise_alone(
    tmp_path: Path, angle: float, hold: float
) -> None:
    run, _ = held(tmp_path, angle, hold, 0.1, 4)
    fit = trajectory_of(run.time, run.theta, trusted=run.trusted)
    assert fit.misfit == pytest.approx(1.0, abs=0.15)
    assert not any("does not fit" in warning for warning in fit.warnings)
    w0 = fit.estimates["w0"]
    assert w0.stderr is not None
    assert abs(w0.value - W0) < 4 * w0.stderr
