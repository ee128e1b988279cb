"""Statistics of paths between wells, for paths with known itineraries."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pendmap.comparison.itinerary import NEVER, Ruler, wells

TICK, PERIOD, NEAR = 0.01, 0.73, 0.05
RULER = Ruler(TICK, 1.0, PERIOD, 0.001)
TIME = np.arange(0, 40, TICK)


def test_passages_of_a_staircase_of_wells_are_counted() -> None:
    """The path goes up two wells, back one, and twice round: 7 passages through 6 wells."""
    visited = [0, 1, 2, 1, 0, -1, -2, -3]
    path = np.repeat(math.tau * np.array(visited, float), TIME.size // len(visited))
    found = RULER.statistics(path)
    assert (found["escapes from a well"], found["wells visited"]) == (7, 6)
    assert found["angle covered"] == pytest.approx(5 * math.tau)
    assert wells(path).tolist()[:: TIME.size // len(visited)] == visited


def test_noise_at_the_top_is_no_escape_and_a_jump_over_wells_is_several_escapes() -> None:
    near_top = math.pi + np.random.default_rng(1).normal(0, 0.02, TIME.size)
    near_top[0] = 0.0
    assert RULER.statistics(near_top)["escapes from a well"] == 0
    over = RULER.statistics(np.where(TIME < 20, 0.3, 0.3 + 3 * math.tau))
    assert (over["escapes from a well"], over["wells visited"]) == (3, 2)


def test_velocities_are_those_of_the_motion() -> None:
    path = 1.3 * np.sin(5.0 * TIME)
    assert RULER.statistics(path)["greatest velocity"] == pytest.approx(6.5, rel=1e-3)
    speed = RULER.velocity(path)
    np.testing.assert_allclose(speed[20:-20], 6.5 * np.cos(5.0 * TIME)[20:-20], atol=0.01)


@pytest.mark.parametrize(("n", "w"), [(1, 0), (3, 0), (1, 1), (2, -1), (8, 3)])
def test_a_cycle_has_its_period_and_turns(n: int, w: int) -> None:
    rate = math.tau / (n * PERIOD)
    cycle = 0.8 * np.sin(rate * TIME) + 0.3 * np.cos((2 * n - 1) * rate * TIME)
    path = cycle + w * rate * TIME + np.random.default_rng(2).normal(0, 0.001, TIME.size)
    assert RULER.cycling(path) == (n, w, 0)


def test_the_time_to_settle_is_that_of_the_slowest_part() -> None:
    """A difference ``a exp(-k t)`` from the cycle changes by 0.05 a period at a known time."""
    rate, decay, apart = math.tau / PERIOD, 0.25, 1.5
    path = 0.5 * np.sin(rate * TIME) + apart * np.exp(-decay * TIME)
    expected = math.log(apart * (1 - math.exp(-decay * PERIOD)) / NEAR) / decay
    n, w, since = RULER.cycling(path)
    assert (n, w) == (1, 0)
    assert since == pytest.approx(expected, abs=2 * TICK)


def test_a_path_without_a_cycle_never_settles() -> None:
    walk = 0.1 * np.cumsum(np.random.default_rng(3).normal(0, 1, TIME.size))
    assert RULER.cycling(walk) == NEVER
    # Five periods are required, and fewer than two are present.
    assert RULER.cycling(np.where(TIME < 39, walk, 0.0)) == NEVER


def test_without_a_period_only_rest_counts_as_settled() -> None:
    ruler = Ruler(TICK, 1.0, None, 0.001)
    stays = np.exp(-0.5 * TIME) * np.cos(6 * TIME) + math.tau
    last = TIME[np.flatnonzero(np.abs(stays - stays[-1]) > NEAR)[-1]]
    assert ruler.cycling(stays) == (1, 0, pytest.approx(last + TICK))
    assert ruler.cycling(np.sin(6 * TIME)) == NEVER
