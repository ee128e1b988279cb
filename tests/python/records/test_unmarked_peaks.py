"""Undeclared columns of turning points, and motions that have none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from pendmap import InputError
from recorded import found, motion, noisy, read, text

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def turns(start: float, noise: float) -> tuple[Floats, Floats]:
    """Return times and angles of the turning points of a decay, read with noise."""
    time, theta, speed = motion(start=start, duration=30.0, rate=1000.0)
    at = np.r_[0, np.flatnonzero(speed[1:-1] * speed[2:] < 0) + 1]
    rng = np.random.default_rng(1)
    return tuple(values[at] + noise * rng.standard_normal(at.size) for values in (time, theta))


@pytest.mark.parametrize("start", [2.5, 1.2, 0.5])
@pytest.mark.parametrize("every", [1, 2])
def test_turning_points_are_recognised(tmp_path: Path, start: float, every: int) -> None:
    time, theta = (values[::every] for values in turns(start, 2e-3))
    run = read(tmp_path, text((time, theta)))
    assert set(found(run)) == {"peaks-undeclared"}
    assert 'peaks = "theta_rad"' in found(run)["peaks-undeclared"].text
    assert run.peaks_only
    assert not run.trusted.any()
    with pytest.raises(InputError, match="turning points only"):
        pendmap.read_experiment(tmp_path / run.file).refuse_still([run])


@pytest.mark.parametrize("rate", [3.0, 6.0, 10.0, 100.0])
def test_slow_samples_are_no_turning_points(tmp_path: Path, rate: float) -> None:
    time, theta, _ = motion(start=2.0, duration=20.0, rate=rate)
    run = read(tmp_path, text((time, noisy(theta))))
    assert "peaks-undeclared" not in found(run)


def test_a_creep_is_no_swing(tmp_path: Path) -> None:
    time = np.arange(200) / 10
    run = read(tmp_path, text((time, 1.2 * np.exp(-time / 5))))
    assert "peaks-undeclared" not in found(run)
