"""Averaging of readings much denser than the motion, without loss of information."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from driven_decays import motion
from pendmap.comparison.data import average_blocks
from pendmap.identification.fit import fit_runs
from pendmap.identification.runs import FitRun
from pendmap.model import Rig

TIME = np.arange(20000) * 1e-3
ANGLE = motion(TIME, (1.5, 0.0), w0=8.0, c_over_m=0.05, friction=0.05)


def test_a_block_has_the_angle_at_its_own_time() -> None:
    found = average_blocks(FitRun(TIME, ANGLE, 1e-5))
    assert TIME.size / 20 < found.time.size < TIME.size / 10
    # Plain means would be off by T^2 th''/24, a hundred times as much.
    off = np.abs(found.theta - CubicSpline(TIME, ANGLE)(found.time))[3:-3]
    assert off.max() < 4e-6
    assert np.median(off) < 2e-6
    size = TIME.size // found.time.size
    assert found.sigma == pytest.approx(1e-5 / np.sqrt(size), rel=1e-9)


def test_blocks_keep_the_errors_and_the_left_out_readings() -> None:
    rng = np.random.default_rng(4)
    sigma = np.where(TIME < 10, 1e-3, 4e-3)
    trusted = rng.random(TIME.size) > 0.05
    trusted[5000:5200] = False
    readings = ANGLE + sigma * rng.standard_normal(TIME.size)
    readings[~trusted] += 1.0
    found = average_blocks(FitRun(TIME, readings, sigma, trusted=trusted))
    assert found.trusted is not None
    assert not found.trusted.all()
    exact = np.interp(found.time, TIME, ANGLE)
    scatter = ((found.theta - exact) / found.sigma)[found.trusted]
    for part in (scatter[: scatter.size // 2], scatter[scatter.size // 2 :]):
        assert np.std(part) == pytest.approx(1.0, abs=5 / np.sqrt(2 * part.size))
    assert np.sum(found.sigma[found.trusted] ** -2) == pytest.approx(
        np.sum(sigma[trusted] ** -2), rel=2e-3
    )


def test_a_fit_to_blocks_equals_one_to_readings() -> None:
    readings = ANGLE + 1e-3 * np.random.default_rng(5).standard_normal(TIME.size)
    run = FitRun(TIME, readings, 1e-3)
    start = Rig(w0=8.01, c_over_m=0.04, Tr=0.04)
    one = fit_runs([run], start, profiled=())
    other = fit_runs([average_blocks(run)], start, profiled=())
    for name, estimate in one.estimates.items():
        assert other[name] == pytest.approx(estimate.value, abs=0.2 * estimate.stderr)
        assert other.estimates[name].stderr == pytest.approx(estimate.stderr, rel=0.02)


@pytest.mark.parametrize("every", [20, 100])
def test_sparse_readings_are_not_averaged(every: int) -> None:
    run = FitRun(TIME[::every], ANGLE[::every], 1e-3)
    assert average_blocks(run) is run
