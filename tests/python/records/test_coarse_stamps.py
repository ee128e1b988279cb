"""Records with coarse time stamps: the rate that the stamps allow, and its error."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import pendmap
from decays import decay

TICKS = (0.01, 1 / 60, 0.015625, 0.03, 0.1, 0.3, 1.0)


def stamped(seed: int, tick: float, lost: int = 0, cut: str = "floor") -> tuple[float, pendmap.Run]:
    """Return the sampling interval of a random decay, and its record with stamps in ticks."""
    rng = np.random.default_rng(seed)
    interval = 0.02 * rng.uniform(0.95, 1.05)
    time = interval * np.arange(rng.integers(1000, 2500))
    theta = decay().angle(time) + rng.normal(0, 2e-3, time.size)
    kept = np.ones(time.size, bool)
    kept[rng.choice(np.arange(50, time.size - 50), lost, replace=False)] = False
    stamps = tick * getattr(np, cut)((time[kept] + rng.uniform(0, 10)) / tick)
    frame = pd.DataFrame({"t_s": stamps, "theta_rad": theta[kept]})
    return interval, pendmap.read_experiment(frame).runs[0]


@pytest.mark.parametrize("cut", ["floor", "round", "ceil"])
def test_the_error_of_the_rate_is_a_standard_error(cut: str) -> None:
    off = []
    for seed in range(28):
        interval, run = stamped(seed, TICKS[seed % len(TICKS)], cut=cut)
        mean = float(run.time[-1] - run.time[0]) / (run.time.size - 1)
        assert np.ptp(np.diff(run.time)) < 1e-9
        off.append((mean / interval - 1) / run.clock_stderr)
    assert np.max(np.abs(off)) < 3.5
    assert 0.6 < np.sqrt(np.mean(np.square(off))) < 1.4


@pytest.mark.parametrize("rate", [30, 60, 120])
def test_written_digits_round_the_ticks(rate: int) -> None:
    # Of a clock of `rate` ticks a second nearly each has one reading; stamps are in ms.
    for seed in range(4):
        rng = np.random.default_rng(seed)
        interval = rng.uniform(1.001, 1.006) / rate
        time = interval * np.arange(int(30 / interval))
        theta = decay().angle(time) + rng.normal(0, 2e-3, time.size)
        stamps = np.round(np.floor((time + rng.uniform(0, 1)) * rate) / rate, 3)
        frame = pd.DataFrame({"t_s": stamps, "theta_rad": theta})
        run = pendmap.read_experiment(frame).runs[0]
        assert run.clock_stderr > 0
        mean = float(run.time[-1] - run.time[0]) / (run.time.size - 1)
        assert abs(mean / interval - 1) < 3.5 * run.clock_stderr


@pytest.mark.parametrize(("tick", "lost"), [(0.03, 5), (0.1, 5), (1.0, 1)])
def test_lost_readings_do_not_change_the_frequency(tick: float, lost: int) -> None:
    for seed in range(2):
        _, run = stamped(seed, tick, lost)
        found = pendmap.identify(run, methods=["trajectory"]).best
        assert abs(found["w0"] - 6.2) < 4 * (found.estimates["w0"].stderr or 0.0)


def test_stamps_that_scatter_or_are_exact_are_no_ticks() -> None:
    rng = np.random.default_rng(1)
    time = 0.02 * np.arange(1500)
    theta = decay().angle(time) + rng.normal(0, 2e-3, time.size)
    for late in (0.0, 2e-3):
        stamps = time + late * rng.uniform(-1, 1, time.size)
        frame = pd.DataFrame({"t_s": stamps, "theta_rad": theta})
        run = pendmap.read_experiment(frame).runs[0]
        assert run.clock_stderr == 0
        assert np.array_equal(run.time, stamps)


@pytest.mark.parametrize("tick", [0.1, 1.0])
def test_the_frequency_is_within_its_errors(tick: float) -> None:
    for seed in range(2):
        _, run = stamped(seed, tick)
        for name, found in pendmap.identify(run).methods.items():
            if name in {"trajectory", "energy_balance"}:
                error = found.estimates["w0"].stderr
                assert error is not None
                assert error > 0.9 * 6.2 * run.clock_stderr
                assert abs(found["w0"] - 6.2) < 4 * error
