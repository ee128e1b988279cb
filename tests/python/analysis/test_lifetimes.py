"""Lifetimes of transient chaos: statistics of drawn times, reference values, figures."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from drawn import made, named
from pendmap import Pendulum
from pendmap.analysis import survival
from pendmap.files import facts

if TYPE_CHECKING:
    import xarray as xr


BOUND = 4000


def test_the_mean_of_drawn_times_is_found_and_its_error_holds() -> None:
    off, exact = [], 1 / (1 - math.exp(-1 / 60))  # for whole periods
    for seed in range(40):
        draw = np.random.default_rng(seed)
        # An exponential tail after a settling that is none.
        times = draw.exponential(60.0, 20_000) + draw.gamma(4.0, 60 / 40, 20_000)
        tail = survival.begin(np.ceil(times).astype(int), 0, BOUND)
        assert tail is not None
        assert tail.is_exponential
        off.append((tail.mean - exact) / tail.stderr)
    assert abs(np.mean(off)) < 0.6
    assert 0.7 < np.std(off) < 1.4


def test_censored_times_do_not_bias_the_mean() -> None:
    draw = np.random.default_rng(3)
    times = np.ceil(draw.exponential(3000.0, 20_000)).astype(int)
    censored = int((times > 1000).sum())
    tail = survival.begin(times[times <= 1000], censored, 1000)
    assert tail is not None
    assert tail.censored == censored > 10_000
    assert abs(tail.mean - 3000.0) < 3 * tail.stderr
    assert tail.stderr == pytest.approx(tail.mean / math.sqrt(tail.captured))


@pytest.mark.parametrize("seed", range(3))
def test_other_distributions_are_rejected(seed: int) -> None:
    draw = np.random.default_rng(seed)
    for times in (draw.uniform(0, 300, 20_000), 50 * draw.weibull(2.0, 20_000)):
        whole = np.ceil(times).astype(int)
        assert not survival.tail(whole, 0, BOUND, 5).is_exponential
    # Exponential times are rejected with a probability of about one tenth at most.
    called = [
        survival.tail(np.ceil(draw.exponential(80.0, 2000)).astype(int), 0, BOUND, 0)
        for _ in range(60)
    ]
    assert sum(not tail.is_exponential for tail in called) < 16


@pytest.fixture(scope="module")
def long() -> xr.Dataset:
    return pendmap.lifetime(Pendulum(gamma=0.1, p=1.8, omega=2.0))


@pytest.mark.parametrize("p", [1.2, 1.8])
def test_against_the_reference(p: float, truths: dict[str, Any], long: xr.Dataset) -> None:
    a = facts(long if p == 1.8 else pendmap.lifetime(Pendulum(gamma=0.1, p=p, omega=2.0)))
    assert (a["persistent"], a["transient_chaos"]) == (0, 1)
    assert a["tail_chance"] > 0.05
    for known in truths["transient_lifetime_periods"][f"w2.0_p{p}"]["tail"]:
        gap = abs(a["mean_periods"] - known["mean"])
        assert gap < 3 * math.hypot(a["mean_periods_stderr"], known["stderr"]), known


def test_the_tail_is_that_of_the_starts(long: xr.Dataset) -> None:
    a = facts(long)
    times = long["capture_period"].values
    beyond = times[times > a["from_period"]] - a["from_period"]
    assert a["tail_captured"] == beyond.size
    assert a["mean_periods"] == pytest.approx(beyond.mean())
    assert long["captured"].values[:, -1].sum() == a["captured_starts"] == (times >= 0).sum()
    legend = " ".join(named(made(long)))
    assert "rotation 8:+8 captures" in legend
    assert f"tail from period {a['from_period']}: mean lifetime" in legend
    early = pendmap.lifetime(Pendulum(gamma=0.1, p=1.8, omega=2.0), from_period=5)
    assert early["from_period"].item() == 5
    assert "IS NOT EXPONENTIAL" in early.attrs["summary"]


def test_on_the_saddle_deviations_grow_faster_than_trajectories_leave(long: xr.Dataset) -> None:
    a = facts(long)
    assert a["escape_rate"] == pytest.approx(1 / a["mean_periods"], rel=0.01)
    assert 0.3 < a["exponent_per_period"] < 0.8
    assert a["entropy"] == pytest.approx(a["exponent_per_period"] - a["escape_rate"])
    assert 1 < a["saddle_dimension"] < 2


@pytest.mark.parametrize("p", [0.0, 0.3, 0.6])
def test_smooth_basins_have_no_transient_chaos(p: float) -> None:
    a = facts(pendmap.lifetime(Pendulum(gamma=0.1, p=p, omega=2.0)))
    assert (a["persistent"], a["transient_chaos"]) == (0, 0)
    assert math.isnan(a["mean_periods"])
    assert a["summary"].startswith("No transient chaos")


@pytest.mark.thorough
def test_chaos_that_persists() -> None:
    a = facts(pendmap.lifetime(pendmap.PRESETS["fig2b"], starts=2000))
    assert (a["persistent"], a["captured_starts"]) == (1, 0)
    assert a["chaos_exponent"] == pytest.approx(0.1454, abs=0.003)
    assert a["summary"].startswith("Persistent: tumbling chaos")
    # The only attractors are two chaotic ones, mirror images of one another.
    pair = pendmap.lifetime(Pendulum(p=1.808), starts=1000)
    assert (pair["persistent"].item(), pair.sizes["attractor"]) == (1, 2)
    assert "rotating chaos -" in pair.attrs["summary"]
    assert made(pair).axes
    # If there are other attractors, the starts that end on the chaotic one are left out.
    beside = facts(pendmap.lifetime(Pendulum(p=1.52, omega=1.1), starts=4000))
    assert beside["persistent"] == 0
    assert 0.02 < beside["chaotic_share"] < 0.06


def test_weak_friction_ends_persistent_chaos() -> None:
    found = pendmap.lifetime(Pendulum(p=2.0, theta_r=0.05), starts=2000)
    a = facts(found)
    assert (a["persistent"], a["transient_chaos"]) == (0, 1)
    assert {str(kind) for kind in found["kind"].values} <= {"rest", "inverted_rest"}
    assert a["mean_periods"] > 500
