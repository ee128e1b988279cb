"""Shares of the starts: rests that theory knows, bounds of none and of all, what starts miss."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
import scipy
from scipy.integrate import solve_ivp

import pendmap
from pendmap import Pendulum

if TYPE_CHECKING:
    from conftest import Run
    from pendmap.signal import Floats


def test_a_share_of_all_or_of_none_has_its_binomial_bound(pendmap_command: Run) -> None:
    words = ("basins", "--p", "14.21", "--omega", "10", "--grid", "30", "--json")
    told = json.loads(pendmap_command(*words).stdout)
    known = {a["kind"]: a for a in told["attractors"]}
    assert {kind: a["fraction"] for kind, a in known.items()} == {"rest": 1.0, "inverted_rest": 0.0}
    most = 1 - 0.05 ** (1 / 900)
    assert known["inverted_rest"]["ci95"] == pytest.approx([0.0, most])
    assert known["rest"]["ci95"] == pytest.approx([1 - most, 1.0])
    text = " ".join(told["summary"])
    assert "inverted rest: 0.00 % of the starts, at most 0.332 % of the plane (95 %)" in text
    assert "rest: 100.00 % of the starts, at least 99.67 % of the plane (95 %)" in text


def test_intervals_of_shares_are_binomial() -> None:
    found = pendmap.sweep(Pendulum(), {"p": [0.3, 0.6, 1.0]}, grid=9, check=False)
    hits = np.rint(81 * found.fraction.values)
    assert np.count_nonzero((hits > 0) & (hits < 81)) > 4
    for place in zip(*np.nonzero((hits > 0) & (hits < 81)), strict=True):
        exact = scipy.stats.binomtest(int(hits[place]), 81).proportion_ci()
        assert found.ci95.values[place] == pytest.approx([exact.low, exact.high])
    bounds = {0: [0.0, 1 - 0.05 ** (1 / 81)], 81: [0.05 ** (1 / 81), 1.0]}
    for place in zip(*np.nonzero((hits == 0) | (hits == 81)), strict=True):
        assert found.ci95.values[place] == pytest.approx(bounds[int(hits[place])])


def test_every_stable_rest_is_listed() -> None:
    source = np.random.default_rng(7)
    for _ in range(24):
        gamma, omega = source.choice([0.02, 0.1, 0.3]), source.uniform(0.5, 12.0)
        p = math.sqrt(2) * omega * source.uniform(0.9, 1.2)
        linear = [spectral_radius(gamma, p, omega, sense) for sense in (1, -1)]
        found = pendmap.basins(Pendulum(gamma, p, omega), 6, check=False, max_periods=200)
        rests = [kind in found.kind.values for kind in ("rest", "inverted_rest")]
        assert rests == [radius < 1 for radius in linear], (gamma, p, omega)


def spectral_radius(gamma: float, p: float, omega: float, sense: int) -> float:
    """Return the largest multiplier of rest, hanging or inverted, by scipy."""

    def rate(t: float, y: Floats) -> Floats:
        x, v = y.reshape(2, 2)
        return np.concatenate([v, -gamma * v - sense * (1 + p * np.cos(omega * t)) * x])

    end = solve_ivp(rate, (0, math.tau / omega), [1, 0, 0, 1], rtol=1e-10, atol=1e-12).y[:, -1]
    return float(np.abs(np.linalg.eigvals(end.reshape(2, 2))).max())


def test_held_rests_are_listed_with_friction() -> None:
    found = pendmap.basins(Pendulum(theta_r=0.01, p=0.3), 10, check=False)
    assert {"rest", "inverted_rest"} <= set(found.kind.values)


def test_starts_tell_what_they_may_miss() -> None:
    found = pendmap.bifurcation(Pendulum(), {"p": [0.8, 0.9]})
    assert float(found.missed) == pytest.approx(1 - 0.05 ** (1 / 9))
    assert "9 starts a value may miss attractors with 28.3 % of the box" in found.summary
    assert "all with 15.3 % (95 %)" in found.summary
