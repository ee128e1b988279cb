"""Outliers: all are found, also adjacent ones, next to gaps and at the ends."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from recorded import clean, found, motion, noisy, read, text

if TYPE_CHECKING:
    from pathlib import Path


def test_outliers_are_marked_and_nothing_else(tmp_path: Path) -> None:
    time, theta = clean()
    at = np.random.default_rng(3).choice(np.arange(20, 1980), 20, replace=False)
    theta[at] += np.random.default_rng(4).choice([-1, 1], 20) * 0.4
    run = read(tmp_path, text((time, theta)))
    assert set(np.flatnonzero(~run.trusted)) == set(at)
    np.testing.assert_allclose(run.theta, theta, atol=1e-6)


def test_outliers_of_the_virtual_rig_do_not_spoil_its_noise(tmp_path: Path) -> None:
    time, theta, _ = motion(duration=40.0)
    rng = np.random.default_rng(8)
    readings = noisy(theta, 0.002)
    false = rng.random(time.size) < 0.01
    readings[false] += rng.uniform(0.2, math.pi, int(false.sum()))
    run = read(tmp_path, text((time, readings)))
    assert np.mean(run.trusted[~false]) > 0.995
    assert np.mean(~run.trusted[false]) > 0.95
    assert pendmap.noise_floor(run).sigma == pytest.approx(0.00205, rel=0.06)


ADJACENT = [([500, 500 + k, 500 + 2 * k], [0.5, 2.1, -0.9], 0.001) for k in (2, 6, 11)]
ENDS = [([k], [size], 0.005) for k in (0, 3, 9, 1991, 1998, 2000) for size in (0.25, -2.0)]


@pytest.mark.parametrize(("at", "sizes", "noise"), [*ADJACENT, *ENDS])
def test_adjacent_outliers_and_those_at_the_ends_are_no_jumps(
    tmp_path: Path, at: list[int], sizes: list[float], noise: float
) -> None:
    time, theta, _ = motion()
    readings = noisy(theta, noise)
    readings[at] += sizes
    run = read(tmp_path, text((time, readings)))
    assert np.flatnonzero(~run.trusted).tolist() == at
    assert "missed-counts" not in found(run)


def test_an_outlier_next_to_a_gap_is_found(tmp_path: Path) -> None:
    time, theta, _ = motion()
    readings = noisy(theta, 0.005)
    readings[[499, 520]] += [0.4, -1.2]
    kept = np.r_[0:500, 520:2001]
    run = read(tmp_path, text((time[kept], readings[kept])))
    assert np.flatnonzero(~run.trusted).tolist() == [499, 500]


@pytest.mark.parametrize("rate", [60.0, 100.0])
def test_two_percent_of_outliers_with_gaps_are_found(tmp_path: Path, rate: float) -> None:
    time, theta, _ = motion(duration=40.0, rate=rate)
    rng = np.random.default_rng(5)
    readings = noisy(theta, 0.004)
    false = rng.random(time.size) < 0.02
    readings[false] += rng.choice([-1, 1], false.sum()) * rng.uniform(0.3, math.pi, false.sum())
    kept = np.ones(time.size, bool)
    for begin in rng.choice(time.size - 40, 8, replace=False):
        kept[begin : begin + rng.integers(1, 20)] = False
    run = read(tmp_path, text((time[kept], readings[kept])))
    assert not np.any(run.trusted & false[kept])
    assert np.mean(run.trusted[~false[kept]]) > 0.985


@pytest.mark.parametrize("start", [2.9, 0.1])
@pytest.mark.parametrize("rate", [25.0, 1000.0])
def test_a_record_without_outliers_has_no_finding(
    tmp_path: Path, start: float, rate: float
) -> None:
    time, theta, _ = motion(start=start, rate=rate)
    for seed in range(2):
        run = read(tmp_path, text((time, noisy(theta, 0.003, seed=seed))))
        assert "outliers" not in found(run)
        assert "missed-counts" not in found(run)
